"""The monitor's subscriptions: messages are checked, then kept, or refused and counted.

Poses come in four ways: one body per message on each body's topic; all in one
`geometry_msgs/PoseArray` on ``poses``, in the scene's order of moving bodies; by
`sensor_msgs/JointState` for robots, whose roots may have a topic of their own; or by /tf.

The shape of a deforming body comes as `sensor_msgs/PointCloud2`, in metres and in the model's
frame, whose frame_id is the body's name or empty: a mesh's vertices on ``bodies/<name>/vertices``,
other models' control points on ``bodies/<name>/control``.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Mapping
from functools import partial

import numpy as np
from geometry_msgs.msg import PoseArray, PoseStamped, TransformStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState, PointCloud2

from proximity_monitor import engine
from proximity_monitor.ros.bulk import StampedPose, read_pose, read_pose_array, stamped_pose
from proximity_monitor.ros.clouds import control_topic, read_points
from proximity_monitor.ros.inputs import FURTHEST, Inputs, Reason
from proximity_monitor.ros.joints import JointInputs
from proximity_monitor.ros.qos import LATEST, POSES, TRANSFORMS, Incompatible
from proximity_monitor.ros.scene_parameters import Settings
from proximity_monitor.scene import Scene

Deform = Callable[[str, np.ndarray], None]


class Sources:
    """All subscriptions of a configured monitor."""

    def __init__(
        self,
        node: Node,
        scene: Scene,
        models: Mapping[str, engine.Model],
        settings: Settings,
        inputs: Inputs,
        incompatible: Incompatible,
        *,
        deform: Deform,
        on_poses: Callable[[], None],
    ) -> None:
        """Subscribe.

        Args:
            node: creates the subscriptions.
            scene: gives the topics.
            models: by body; a deforming body's model says how many points are expected.
            settings: give the frame and the sources to use.
            inputs: keeps the poses.
            incompatible: counts publishers whose quality of service does not fit.
            deform: takes a deforming body's name and control points, (n, 3) metres.
            on_poses: called after each message that brought good poses.

        Raises:
            ValueError: /tf is asked for, and tf2_msgs is not installed; or one topic would carry
                messages of two types, or the poses of two bodies.
        """
        transforms = _transforms_type() if settings.tf else None
        _check_topics(node, scene, models, settings)
        self._node = node
        self._inputs = inputs
        self._frame = settings.frame
        self._deform = deform
        self._on_poses = on_poses
        self._incompatible = incompatible
        self._subscriptions = []
        self._roots = {robot.name: robot.root for robot in scene.robots if robot.root is not None}
        self._frames = {name: [name] for name in inputs.names}
        """The bodies and robots' roots that a frame on /tf moves, by name of the frame."""
        for name, root in self._roots.items():
            self._frames.setdefault(root.frame, []).append(name)
        self.topics: set[str] = set()
        """Full names of the bodies' own pose topics."""
        self._subscribe(PoseArray, "poses", self._on_array, POSES, raw=True)
        posed = [(name, root.topic) for name, root in self._roots.items()]
        if settings.body_topics:
            posed += [(body.name, body.topic) for body in scene.bodies if body.topic is not None]
        for name, topic in posed:
            take = partial(self._on_pose, name)
            made = self._subscribe(PoseStamped, topic, take, POSES, raw=True)
            self.topics.add(made.topic_name)
        for body in scene.bodies:
            if body.deforming:
                model = models[body.name]
                take = partial(self._on_points, body.name, len(model.control_points))
                topic = control_topic(body.name, model.control_name)
                self._subscribe(PointCloud2, topic, take, LATEST)
        if transforms is not None:
            self._subscribe(transforms, "/tf", self._on_transforms, TRANSFORMS)
        self.joints = None
        if scene.robots:
            self.joints = JointInputs(
                node, scene, self._store_many, frame=settings.frame, root=inputs.last,
                forget=inputs.forget_pose,
            )  # fmt: skip

    def destroy(self) -> None:
        """End all subscriptions."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        if self.joints is not None:
            self.joints.destroy()

    def _subscribe(self, kind, topic, callback, qos, raw=False):
        made = self._node.create_subscription(
            kind,
            topic,
            callback,
            qos,
            raw=raw,
            event_callbacks=self._incompatible.subscription(topic),
        )
        self._subscriptions.append(made)
        return made

    def _now_ns(self) -> int:
        return self._node.get_clock().now().nanoseconds

    def _on_pose(self, name: str, data: bytes) -> None:
        try:
            pose = read_pose(data)
        except ValueError:
            self._inputs.refuse(Reason.LAYOUT)
            return
        self._take(name, pose)

    def _take(self, name: str, pose: StampedPose) -> None:
        if self._inputs.store(name, pose, self._now_ns()) is None:
            if name in self._roots:
                self.joints.follow(name)
            else:
                self._on_poses()

    def _on_array(self, data: bytes) -> None:
        try:
            poses = read_pose_array(data)
        except ValueError:
            self._inputs.refuse(Reason.LAYOUT)
            return
        if self._inputs.store_array(
            poses.positions, poses.quaternions, poses.stamp_ns, poses.frame, self._now_ns()
        ):
            self._on_poses()

    def _store_many(self, *poses) -> None:
        if self._inputs.store_many(*poses):
            self._on_poses()

    def _on_points(self, name: str, count: int, message: PointCloud2) -> None:
        if reason := self._take_points(name, count, message):
            self._inputs.refuse(reason)

    def _take_points(self, name: str, count: int, message: PointCloud2) -> str | None:
        """Reshape a body; return why its message is refused, or None."""
        stamp_ns = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        if message.header.frame_id not in ("", name):
            return Reason.FRAME
        if reason := self._inputs.judge_shape(name, stamp_ns, self._now_ns()):
            return reason
        try:
            points = read_points(message)
        except ValueError:
            return Reason.LAYOUT
        if len(points) != count:
            return Reason.LENGTH
        if not np.isfinite(points).all():
            return Reason.NOT_FINITE
        if not (np.abs(points) <= FURTHEST).all():
            return Reason.TOO_FAR
        try:
            self._deform(name, points)
        except ValueError:  # such as a solid that would be open now
            return Reason.SHAPE
        self._inputs.keep_shape(name, stamp_ns)
        return None

    def _on_transforms(self, message) -> None:
        self.take_transforms(message.transforms)

    def take_transforms(self, transforms: Iterable[TransformStamped]) -> None:
        """Keep the transforms to frames of moving bodies and roots, and skip the others."""
        for transform in transforms:
            for name in self._frames.get(transform.child_frame_id, ()):
                p, q = transform.transform.translation, transform.transform.rotation
                self._take(name, stamped_pose(transform.header, p, q))


def _check_topics(
    node: Node, scene: Scene, models: Mapping[str, engine.Model], settings: Settings
) -> None:
    """Refuse two types of messages on one topic, which the middleware does not report.

    Also refuse a pose topic that two bodies share. The scene file is checked for that as well, but
    only a node knows which names mean the same topic.
    """
    wanted: list[tuple[str, type, str]] = [("poses", PoseArray, "the poses of all bodies")]
    poses: set[str] = set()  # the entries of `wanted` about bodies' poses
    for robot in scene.robots:
        wanted.append((robot.topic, JointState, f"the joints of {robot.name}"))
        if robot.root is not None:
            wanted.append((robot.root.topic, PoseStamped, f"the root of {robot.name}"))
    for body in scene.bodies:
        if body.topic is not None and settings.body_topics:
            wanted.append((body.topic, PoseStamped, f"the pose of {body.name}"))
            poses.add(wanted[-1][2])
        if body.cloud is not None:
            wanted.append((body.cloud.topic, PointCloud2, f"the cloud {body.name}"))
        elif body.deforming:
            topic = control_topic(body.name, models[body.name].control_name)
            wanted.append((topic, PointCloud2, f"the shape of {body.name}"))
    users: dict[str, list[tuple[type, str]]] = {}
    for topic, kind, whose in wanted:
        full = node.resolve_topic_name(topic)
        for other, its in users.setdefault(full, []):
            if other is not kind or {its, whose} <= poses:
                raise ValueError(
                    f"{scene.path.name}: topic {full} would carry both {its} ({other.__name__}) "
                    f"and {whose} ({kind.__name__}); give one of them another topic"
                )
        users[full].append((kind, whose))


def _transforms_type():
    try:
        return importlib.import_module("tf2_msgs.msg").TFMessage
    except ImportError as error:
        raise ValueError(
            "tf: needs the package tf2_msgs, which is not installed and has no wheel; on a machine"
            " with ROS 2, sudo apt install ros-$ROS_DISTRO-tf2-msgs; or set tf to false"
        ) from error
