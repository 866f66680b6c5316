"""The player: publishes the motion of a scene, as sensors or a simulator would."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence

from geometry_msgs.msg import PoseArray, PoseStamped
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Header, String

from proximity_monitor import motion
from proximity_monitor.ros.clouds import control_topic
from proximity_monitor.ros.descriptions import Descriptions
from proximity_monitor.ros.motion_clock import MotionClock
from proximity_monitor.ros.parameters import AS_SCENE, declare_one
from proximity_monitor.ros.played import as_cloud, as_joint_state, set_pose
from proximity_monitor.ros.poses_message import PosesMessage
from proximity_monitor.ros.qos import LATCHED, LATEST
from proximity_monitor.ros.spin import asked_to_stop, interruptible, ros, spin
from proximity_monitor.scene import Scene, load_scene
from proximity_monitor.scene.opening import find_scene
from proximity_monitor.scene.robots import joints_of
from proximity_monitor.scene.state import PoseSample

LEAST = 10.0
"""Hertz; at a lower rate poses could be stale before the next poses come."""

_NOBODY = Parameter("released", Parameter.Type.STRING_ARRAY, [])


class ProximityPlayer(Node):
    """Publishes all that the effects of a scene move, stamped with the node's clock.

    The messages are: the PoseStamped of each driven body or robot's root on its topic or, with
    ``bulk``, one PoseArray on ``poses`` with all moving bodies in the scene's order; a JointState
    with the driven joints on the topic of their robot; the control points of each deforming body as
    PointCloud2, on ``bodies/NAME/vertices`` for a mesh, else on ``bodies/NAME/control``; and,
    latched on ``~/motion``, the moment of the motion (see `MotionClock.told`).

    Parameters that can change at any time: ``released`` (bodies that are left out, because a hand
    or another node moves them; has no effect in bulk), ``speed`` (seconds of motion in a second of
    the node's clock; 0 stands still), ``seek_s`` (the moment of the motion to go on from; at start,
    the seconds to skip).

    Parameters that are read at start: ``scene`` (file or bundled name), ``rate_hz`` (messages per
    second for each body; -1: the scene's rate, at least `LEAST`), ``loop`` (false: the player ends
    when all of the motion was played once), ``bulk``, ``fixed_frame`` (empty: the scene file's).
    """

    def __init__(self, moves: motion.Motion | None = None, **node_options) -> None:
        """Load the scene and start to publish.

        Args:
            moves: the motion of the scene, if it exists already.
            node_options: for `rclpy.node.Node`, such as parameter_overrides.

        Raises:
            ValueError, OSError: the scene, its motion or a parameter is bad; the message says why.
        """
        super().__init__("proximity_player", **node_options)
        try:
            values = self._declare()
        except ParameterException as error:
            raise ValueError(str(error)) from error
        descriptions = Descriptions(self)
        scene = load_scene(find_scene(values["scene"]), descriptions.wait)
        descriptions.forget()
        with interruptible():  # this may read a long recording, or simulate the skipped part
            self._motion = moves or motion.from_scene(scene, live=True, stopped=asked_to_stop)
            self._motion.seek(values["seek_s"])
        self._path, self._frame = scene.path, values["fixed_frame"] or scene.frame
        self._motion_clock = MotionClock(values["speed"], values["seek_s"])
        self._to_seek: float | None = None  # the timer seeks: a parameter callback must not wait
        self._ends_at = None if values["loop"] else self._motion.once_s
        self.finished = False
        self.fault = ""
        """Why the motion cannot go on; empty if it can."""
        self._warned = ""
        self._advertise(scene, values["bulk"], values["seek_s"])
        self.add_on_set_parameters_callback(_judged)
        self.add_post_set_parameters_callback(self._on_parameters)
        rate_hz = values["rate_hz"] if values["rate_hz"] != AS_SCENE else max(scene.rate_hz, LEAST)
        if not rate_hz >= 0.1:
            raise ValueError(
                f"rate_hz: must be at least 0.1, or -1 for the scene's; not {rate_hz:g}"
            )
        self._timer = self.create_timer(1.0 / rate_hz, self._on_timer)
        self.get_logger().info(
            f"{'; '.join(self._motion.describe().splitlines())}, published at {rate_hz:g} Hz"
            f"{' in bulk' if values['bulk'] else ''}, speed {values['speed']:g}"
            + (f", from {values['seek_s']:g} s" if values["seek_s"] else "")
        )

    def _declare(self) -> dict:
        number = {
            "rate_hz": (
                AS_SCENE,
                AS_SCENE,
                1000.0,
                f"Messages per second for each body; -1: as in the scene, but at least {LEAST:g}.",
            ),
            "speed": (1.0, 0.0, 1000.0, "Seconds of motion per second; 0 stands still."),
            "seek_s": (0.0, 0.0, 1e9, "Moment of the motion from which to go on, in seconds."),
        }
        other = {
            "scene": ("engine", "Scene file, or the name of a bundled scene."),
            "fixed_frame": ("", "Frame of the poses; empty: that of the scene file."),
            "loop": (True, "Repeat the motion; false: end when all of it was played once."),
            "bulk": (False, "Publish one PoseArray of all moving bodies, not a message for each."),
        }
        for name, (default, low, high, text) in number.items():
            limits = [FloatingPointRange(from_value=low, to_value=high)]
            descriptor = ParameterDescriptor(
                description=text, read_only=name == "rate_hz", floating_point_range=limits
            )
            declare_one(self, name, default, descriptor)
        for name, (default, text) in other.items():
            descriptor = ParameterDescriptor(description=text, read_only=True)
            self.declare_parameter(name, default, descriptor)
        descriptor = ParameterDescriptor(
            description="Bodies whose poses are not published, because another node moves them."
        )
        self.declare_parameter("released", Parameter.Type.STRING_ARRAY, descriptor)
        return {name: self.get_parameter(name).value for name in (*number, *other)}

    def _advertise(self, scene: Scene, bulk: bool, seek_s: float) -> None:
        """Make a publisher for each thing that the motion drives."""
        driven = set(self._motion.bodies)
        moving = [body.name for body in scene.bodies if body.moving]
        posed = {body.name: body.topic for body in scene.bodies if body.topic is not None}
        posed |= {robot.name: robot.root.topic for robot in scene.robots if robot.root is not None}
        self._bulk = None
        self._outputs = {}
        if bulk:
            if strangers := [name for name in moving if name not in driven]:
                raise ValueError(
                    f"bulk: needs a pose of every moving body, but the motion of {scene.path} does"
                    f" not drive {', '.join(strangers)}; set bulk to false"
                )
            self._order = tuple(moving)
            self._bulk_message = PosesMessage(moving, self._frame)
            self._bulk = self.create_publisher(PoseArray, "poses", LATEST)
        else:
            self._outputs = {
                name: self.create_publisher(PoseStamped, topic, LATEST)
                for name, topic in posed.items()
                if name in driven
            }
        joints = self._motion.joints(seek_s)
        named: dict[str, tuple[str, dict[str, str]]] = {}  # by full name of the topic
        owners = joints_of(scene.robots)
        for called in joints:
            robot, joint = owners[called][0]
            full = self.resolve_topic_name(robot.topic)
            named.setdefault(full, (robot.topic, {}))[1][called] = joint.name
        self._joints = [
            (self.create_publisher(JointState, topic, LATEST), its) for topic, its in named.values()
        ]
        self._controls = {
            name: self.create_publisher(PointCloud2, control_topic(name, called), LATEST)
            for name, called in self._motion.control_names.items()
        }
        self._to_tell = self.create_publisher(String, "~/motion", LATCHED)
        self._told_from_ns: int | None = None

    def _on_parameters(self, parameters: Sequence[Parameter]) -> None:
        now_ns = self.get_clock().now().nanoseconds
        for each in parameters:
            if each.name == "speed":
                self._motion_clock.go_on(now_ns, each.value)
                self._told_from_ns = None
            elif each.name == "seek_s":
                self._to_seek = each.value

    def _seek(self) -> None:
        """Go to another moment, which a simulation may take a while to reach."""
        to_seek, self._to_seek = self._to_seek, None
        self._motion.seek(to_seek)
        self._motion_clock.seek(self.get_clock().now().nanoseconds, to_seek)
        self._told_from_ns = None

    def _tell_moment(self, now_ns: int) -> None:
        """Publish the moment of the motion, unless it follows from the last message."""
        if self._told_from_ns is None or now_ns < self._told_from_ns:
            self._told_from_ns = now_ns or None  # None: publish again when there is a time
            moves = self._motion
            told = self._motion_clock.told(now_ns, moves.period_s, moves.repeats)
            self._to_tell.publish(String(data=told))

    def _on_timer(self) -> None:
        """Publish; finish if the motion ends or cannot go on."""
        try:
            self.finished = self._publish()
        except ValueError as error:
            self.finished, self.fault = True, f"{self._path}: motion: {error}"
        if self._motion.trouble != self._warned:
            self._warned = self._motion.trouble
            self.get_logger().warning(self._warned)
        if self.finished:
            self._timer.cancel()

    def _publish(self) -> bool:
        """Publish the present moment; return whether it is the last one."""
        if self._to_seek is not None:
            self._seek()
        now = self.get_clock().now()
        t = self._motion_clock.read(now.nanoseconds)
        self._tell_moment(now.nanoseconds)
        last = self._ends_at is not None and t >= self._ends_at
        if last:
            t = self._ends_at
        stamp = now.to_msg()
        self._publish_poses(t, Header(stamp=stamp, frame_id=self._frame))
        if self._joints:
            positions = self._motion.joints(t)
            for output, names in self._joints:
                its = {joint: positions[called] for called, joint in names.items()}
                output.publish(as_joint_state(its, stamp))
        if self._controls:
            for name, points in self._motion.control_points(t).items():
                cloud = as_cloud(points, Header(stamp=stamp, frame_id=name))
                self._controls[name].publish(cloud)
        return last

    def _publish_poses(self, t: float, header: Header) -> None:
        poses = self._motion.poses(t)
        if self._bulk is None:
            message = PoseStamped(header=header)
            released = self.get_parameter_or("released", _NOBODY).value
            for name, pose in poses.items():
                if name not in released:
                    set_pose(message.pose, pose)
                    self._outputs[name].publish(message)
        elif len(poses) == len(self._order):  # else a body has no pose yet, and no value says so
            samples = {name: PoseSample(pose) for name, pose in poses.items()}
            self._bulk.publish(self._bulk_message.serialised(samples, header.stamp))


def _judged(parameters: Sequence[Parameter]) -> SetParametersResult:
    """Refuse numbers that are not finite; a parameter's range lets NaN pass."""
    for each in parameters:
        if each.type_ == Parameter.Type.DOUBLE and not math.isfinite(each.value):
            return SetParametersResult(successful=False, reason=f"{each.name}: must be finite")
    return SetParametersResult(successful=True)


def main(args: Sequence[str] | None = None) -> int:
    """Run the player until SIGINT, SIGTERM or its motion's end; return 1 if it cannot play."""
    with ros(args, "proximity_player") as stop:
        try:
            node = ProximityPlayer()
        except (OSError, ValueError) as error:
            print(f"proximity_player: {error}", file=sys.stderr)
            return 1
        try:
            spin([node], stop, lambda: node.finished)
        finally:
            node.destroy_node()
        if node.fault:
            print(f"proximity_player: {node.fault}", file=sys.stderr)
            return 1
    return 0
