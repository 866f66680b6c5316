"""Starts the proximity monitor and, if asked to, RViz; the end of one ends the other."""

from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from proximity_monitor.scene import load_scene
from proximity_monitor.scene.opening import find_scene


def monitor(context):
    """The node; a scene given on the command line wins over the one in the parameter file."""
    scene = LaunchConfiguration("scene").perform(context)
    use_sim_time = ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)
    overrides = {"use_sim_time": use_sim_time}
    if scene:
        overrides["scene"] = scene
    return [
        Node(
            package="proximity_monitor",
            executable="node",
            name="proximity_monitor",
            output="screen",
            parameters=[LaunchConfiguration("params_file"), overrides],
            on_exit=Shutdown(reason="the monitor ended"),
        )
    ]


def viewer(context):
    """RViz; nothing says how the scene's frame lies in another, so it has to be the fixed one.

    Raises:
        RuntimeError: it is not installed. This is asked before anything is started, because an
            error ends launch and not what it started.
    """
    try:
        get_package_prefix("rviz2")
    except PackageNotFoundError as error:
        raise RuntimeError(
            "rviz:=true needs RViz, and the package rviz2 is not installed; install it"
            " (sudo apt install ros-$ROS_DISTRO-rviz2), or leave rviz:=true out"
        ) from error
    share = FindPackageShare("proximity_monitor")
    scene = LaunchConfiguration("scene").perform(context)
    frame = ["-f", load_scene(find_scene(scene)).frame] if scene else []
    sim_time = ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)
    return [
        Node(
            package="rviz2",
            executable="rviz2",
            arguments=["-d", PathJoinSubstitution([share, "rviz", "assembly.rviz"]), *frame],
            parameters=[{"use_sim_time": sim_time}],
            on_exit=Shutdown(reason="RViz ended"),
        )
    ]


def generate_launch_description():
    """Arguments: scene, params_file, use_sim_time, rviz."""
    config = PathJoinSubstitution([FindPackageShare("proximity_monitor"), "config"])
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "scene",
                default_value="",
                description="Bundled scene or scene file; empty: the one in params_file",
            ),
            DeclareLaunchArgument(
                "params_file",
                default_value=PathJoinSubstitution([config, "monitor.yaml"]),
                description="Parameters of the node",
            ),
            DeclareLaunchArgument(
                "use_sim_time",
                default_value="false",
                choices=["true", "false"],
                description="Take the time from /clock",
            ),
            DeclareLaunchArgument(
                "rviz",
                default_value="false",
                choices=["true", "false"],
                description="Start RViz with a view of parts and markers",
            ),
            OpaqueFunction(function=viewer, condition=IfCondition(LaunchConfiguration("rviz"))),
            OpaqueFunction(function=monitor),
        ]
    )
