"""Starts the monitor and the player that moves the scene's bodies; one ends with the other."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, Shutdown
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    """Arguments: scene, params_file, use_sim_time, rviz."""
    share = FindPackageShare("proximity_monitor")
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "scene",
                default_value="engine",
                description="Bundled scene or scene file, with a motion section",
            ),
            DeclareLaunchArgument(
                "params_file",
                default_value=PathJoinSubstitution([share, "config", "monitor.yaml"]),
                description="Parameters of the monitor",
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
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(
                    PathJoinSubstitution([share, "launch", "monitor.launch.py"])
                ),
                launch_arguments={
                    name: LaunchConfiguration(name)
                    for name in ("scene", "params_file", "use_sim_time", "rviz")
                }.items(),
            ),
            Node(
                package="proximity_monitor",
                executable="player",
                output="screen",
                on_exit=Shutdown(reason="the player ended"),
                parameters=[
                    {
                        "scene": ParameterValue(LaunchConfiguration("scene"), value_type=str),
                        "use_sim_time": ParameterValue(
                            LaunchConfiguration("use_sim_time"), value_type=bool
                        ),
                    }
                ],
            ),
        ]
    )
