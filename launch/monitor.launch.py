"""Starts the proximity monitor and, if asked to, RViz."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
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
        )
    ]


def viewer(context):
    """RViz; nothing says how the scene's frame lies in another, so it has to be the fixed one."""
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
            OpaqueFunction(function=monitor),
            OpaqueFunction(function=viewer, condition=IfCondition(LaunchConfiguration("rviz"))),
        ]
    )
