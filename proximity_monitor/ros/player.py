"""The player: publishes the poses of a scene's motion, as sensors or a simulator would."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from geometry_msgs.msg import PoseStamped
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from proximity_monitor import motion
from proximity_monitor.ros.parts import to_quaternion
from proximity_monitor.ros.spin import ros, spin
from proximity_monitor.scene import load_scene
from proximity_monitor.scene.opening import find_scene

LATEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)


class ProximityPlayer(Node):
    """Publishes each driven body's PoseStamped on its topic, stamped with the node's clock.

    Parameters, all read at start: ``scene`` (file or bundled name), ``rate_hz`` (messages a second
    and body), ``speed`` (seconds of motion in a second of the node's clock), ``loop`` (false: the
    player ends after one period, where the motion has one), ``fixed_frame`` (empty: the scene
    file's).
    """

    def __init__(self, **node_options) -> None:
        """Load the scene and start to publish.

        Raises:
            ValueError, OSError: of the scene, its motion or a parameter; the message says which.
        """
        super().__init__("proximity_player", **node_options)
        try:
            values = self._declare()
        except ParameterException as error:
            raise ValueError(str(error)) from error
        scene = load_scene(find_scene(values["scene"]))
        self._motion = motion.from_scene(scene)
        self._frame = values["fixed_frame"] or scene.frame
        self._speed = values["speed"]
        self._ends_at = None if values["loop"] else self._motion.period_s
        self.finished = False
        self._outputs = {
            body.name: self.create_publisher(PoseStamped, body.topic, LATEST)
            for body in scene.bodies
            if body.name in self._motion.bodies
        }
        self._started_ns: int | None = None
        self._timer = self.create_timer(1.0 / values["rate_hz"], self._publish)
        self.get_logger().info(
            f"{self._motion.describe()}, published at {values['rate_hz']:g} Hz,"
            f" speed {self._speed:g}"
        )

    def _declare(self) -> dict:
        number = {
            "rate_hz": (100.0, 0.1, 1000.0, "Messages a second for each body."),
            "speed": (1.0, 0.0, 1000.0, "Seconds of motion in a second; 0 stands still."),
        }
        other = {
            "scene": ("engine", "Scene file, or the name of a bundled scene."),
            "fixed_frame": ("", "Frame of the poses; empty: the scene file's."),
            "loop": (True, "Go on after one period; false ends the player there."),
        }
        for name, (default, low, high, text) in number.items():
            limits = [FloatingPointRange(from_value=low, to_value=high)]
            descriptor = ParameterDescriptor(
                description=text, read_only=True, floating_point_range=limits
            )
            self.declare_parameter(name, default, descriptor)
        for name, (default, text) in other.items():
            descriptor = ParameterDescriptor(description=text, read_only=True)
            self.declare_parameter(name, default, descriptor)
        return {name: self.get_parameter(name).value for name in (*number, *other)}

    def _publish(self) -> None:
        now = self.get_clock().now()
        if self._started_ns is None or now.nanoseconds < self._started_ns:
            self._started_ns = now.nanoseconds
        t = (now.nanoseconds - self._started_ns) * 1e-9 * self._speed
        if self._ends_at is not None and t > self._ends_at:
            self._timer.cancel()
            self.finished = True
            return
        message = PoseStamped()
        message.header.frame_id = self._frame
        message.header.stamp = now.to_msg()
        place, turn = message.pose.position, message.pose.orientation
        for name, pose in self._motion.poses(t).items():
            place.x, place.y, place.z = pose[:3, 3].tolist()
            turn.x, turn.y, turn.z, turn.w = to_quaternion(pose[:3, :3])
            self._outputs[name].publish(message)


def main(args: Sequence[str] | None = None) -> int:
    """Run the player until SIGINT, SIGTERM or its motion's end; return 1 if it cannot start."""
    with ros(args) as stop:
        try:
            node = ProximityPlayer()
        except (OSError, ValueError) as error:
            print(f"proximity_player: {error}", file=sys.stderr)
            return 1
        try:
            spin([node], stop, lambda: node.finished)
        finally:
            node.destroy_node()
    return 0
