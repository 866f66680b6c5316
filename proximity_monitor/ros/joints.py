"""Joint input: turns joint positions from topics into poses of robots' links.

A message is checked as it arrives. It is taken as a whole, or refused and counted. It need not name
all joints: the others keep their last positions. A link's pose is as old as the oldest position
that it depends on, so a gripper that fell silent is stale although its arm still reports. If the
robot's root moves, the links depend on its pose as well. Joint names that no robot on the topic has
are counted and skipped.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from proximity_monitor.ros.inputs import FURTHEST, FUTURE_TOLERANCE_S
from proximity_monitor.scene import Robot, Scene
from proximity_monitor.scene.naming import counted

POSITIONS = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Several publishers may each report some of the joints, so more than the latest message counts.
Best effort accepts reliable publishers, too."""

_NAMED = 20
"""How many unknown joints of one message are logged by name."""

_MOST_TOLD = 10_000
"""How many joint names are remembered as logged; after that, no more unknown joints are logged."""

Store = Callable[[Sequence[str], np.ndarray, int, str, int], object]
"""Takes poses of bodies: names, (n, 4, 4) poses, stamp in ns, frame, the node's time in ns."""

RootPose = Callable[[str], tuple[np.ndarray, int] | None]
"""Returns the last pose of a robot's root by the robot's name, and its stamp in ns, or None."""


class JointReason:
    """The reasons by which messages are counted; UNKNOWN and LIMIT do not refuse the message."""

    LENGTH = "joint names and positions differ in number"
    TWICE = "joint named twice"
    NOT_FINITE = "joint position not finite"
    TOO_FAR = "joint position out of range"
    FUTURE = "joint stamp in the future"
    ORDER = "joint stamp out of order"
    UNKNOWN = "unknown joint"
    LIMIT = "joint beyond its limit"
    ALL = (LENGTH, TWICE, NOT_FINITE, TOO_FAR, FUTURE, ORDER, UNKNOWN, LIMIT)


class _Joints:
    """The last positions of one robot's joints."""

    def __init__(self, robot: Robot) -> None:
        kinematics = robot.kinematics
        self.robot = robot
        self.known = {joint.name for joint in kinematics.joints}
        self._free = {joint.name: joint for joint in kinematics.free}
        self._drivers = {body: kinematics.drivers(link) for body, link in robot.links.items()}
        self.forget()

    def forget(self) -> None:
        """Begin again with the scene file's positions."""
        self.positions = dict(self.robot.start)
        self.stamps: dict[str, int] = {}

    def missing(self) -> list[str]:
        """Return the joints without any position yet."""
        return [name for name in self._free if name not in self.positions]

    def late(self, names: Sequence[str], stamp_ns: int) -> bool:
        """Return whether one of the joints has a newer position already."""
        return any(self.stamps.get(name, stamp_ns) > stamp_ns for name in names)

    def take(self, positions: dict[str, float], stamp_ns: int) -> bool:
        """Keep the positions of the robot's free joints; return whether any exceeds its limit."""
        beyond = False
        for name in self._free.keys() & positions.keys():
            joint, value = self._free[name], positions[name]
            beyond |= not joint.lower <= value <= joint.upper
            self.positions[name], self.stamps[name] = value, stamp_ns
        return beyond

    def first(self, names: Iterable[str]) -> list[str]:
        """Return the bodies that depend on a named joint which had no position by message yet."""
        new = (self._free.keys() & set(names)) - self.stamps.keys()
        return [body for body, drivers in self._drivers.items() if drivers & new] if new else []

    def by_stamp(self, stamp_ns: int, root_ns: int | None) -> dict[int, list[str]]:
        """Return the bodies whose poses are known, by the oldest stamp that their poses depend on.

        The scene file's positions do not age: a pose that depends only on them has the message's
        stamp, `stamp_ns`.
        """
        found: dict[int, list[str]] = {}
        for body, drivers in self._drivers.items():
            if drivers <= self.positions.keys():
                stamps = [self.stamps[name] for name in drivers if name in self.stamps]
                if root_ns is not None:
                    stamps.append(root_ns)
                found.setdefault(min(stamps, default=stamp_ns), []).append(body)
        return found


class JointInputs:
    """Subscriptions to the joint states of a scene's robots.

    Attributes:
        rejected: how many messages were refused or noted, by `JointReason`.
    """

    def __init__(
        self,
        node: Node,
        scene: Scene,
        store: Store,
        *,
        frame: str | None = None,
        root: RootPose = lambda name: None,
        forget: Callable[[str], None] = lambda body: None,
    ) -> None:
        """Subscribe to each topic once.

        Args:
            node: gives subscriptions, its clock and its log.
            scene: may have no robots.
            store: called with the poses of a message's robots; counts what it refuses.
            frame: fixed frame of the poses; None: the scene's.
            root: gives the poses of moving roots; `follow` must be called when there is a new pose.
            forget: called with a body whose next pose may have an earlier stamp than its last pose,
                which used the scene file's position of a joint.
        """
        self.rejected: Counter[str] = Counter({reason: 0 for reason in JointReason.ALL})
        self._node = node
        self._store = store
        self._frame = scene.frame if frame is None else frame
        self._root = root
        self._forget = forget
        self._told: set[str] = set()
        self._now_ns = 0
        self._by_topic: dict[str, list[_Joints]] = {}
        for robot in scene.robots:
            full = node.resolve_topic_name(robot.topic)  # "/a" and "a" may be one topic
            self._by_topic.setdefault(full, []).append(_Joints(robot))
        self._subscriptions = [
            node.create_subscription(
                JointState,
                robots[0].robot.topic,  # a full name could be remapped once more
                lambda message, of=robots: self._take(of, message),
                POSITIONS,
            )
            for robots in self._by_topic.values()
        ]

    def destroy(self) -> None:
        """End the subscriptions."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)

    def missing(self) -> list[str]:
        """Return the joints whose position is not in the scene file and has not arrived yet."""
        return [name for each in self._all() for name in each.missing()]

    def follow(self, name: str) -> None:
        """Move the links of a robot after a new pose of its root."""
        now_ns = self._now()
        for each in self._all():
            if each.robot.name == name:
                self._place(each, now_ns, now_ns)

    def forget(self) -> None:
        """Begin again with the scene file's positions: the clock went back."""
        for each in self._all():
            each.forget()

    def _all(self) -> Iterator[_Joints]:
        return itertools.chain.from_iterable(self._by_topic.values())

    def _now(self) -> int:
        now_ns = self._node.get_clock().now().nanoseconds
        if now_ns < self._now_ns:  # the clock went back, so earlier stamps cannot be compared
            self.forget()
        self._now_ns = now_ns
        return now_ns

    def _take(self, robots: list[_Joints], message: JointState) -> None:
        now_ns = self._now()
        stamp_ns = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        reason = _judge(message, robots, stamp_ns, now_ns)
        if reason is not None:
            self.rejected[reason] += 1
            return
        positions = dict(zip(message.name, message.position, strict=True))
        self._note_unknown(positions.keys() - set().union(*(each.known for each in robots)))
        for each in robots:
            for body in each.first(positions):
                self._forget(body)
            self.rejected[JointReason.LIMIT] += each.take(positions, stamp_ns)
            self._place(each, stamp_ns, now_ns)

    def _place(self, each: _Joints, stamp_ns: int, now_ns: int) -> None:
        """Store the poses of a robot's links, as far as they are known."""
        for name in each.missing():
            self._warn(name, "has no position yet, neither from the scene file nor from a message")
        base = root_ns = None
        if each.robot.root is not None:
            if (found := self._root(each.robot.name)) is None:
                return
            base, root_ns = found
        poses = each.robot.poses(each.positions, base)
        for stamp, bodies in each.by_stamp(stamp_ns, root_ns).items():
            chosen = np.array([poses[body] for body in bodies])
            self._store(bodies, chosen, stamp, self._frame, now_ns)

    def _note_unknown(self, names: set[str]) -> None:
        self.rejected[JointReason.UNKNOWN] += bool(names)
        new = sorted(names - self._told) if len(self._told) < _MOST_TOLD else ()
        for name in new[:_NAMED]:
            self._warn(name, "does not belong to a robot in the scene")
        if len(new) > _NAMED:
            more = counted(len(new) - _NAMED, "more joint does", "more joints do")
            self._node.get_logger().warning(f"and {more} not belong to a robot in the scene")
        self._told.update(new[:_MOST_TOLD])

    def _warn(self, name: str, why: str) -> None:
        """Log a warning about a joint, once, because messages come by the hundred."""
        if name not in self._told:
            self._told.add(name)
            self._node.get_logger().warning(f"joint '{name}' {why}")


def _judge(message: JointState, robots: list[_Joints], stamp_ns: int, now_ns: int) -> str | None:
    """Return why a message is refused, or None. `store` judges its age."""
    names, positions = message.name, message.position
    if len(names) != len(positions):
        return JointReason.LENGTH
    if len(set(names)) != len(names):
        return JointReason.TWICE
    if not all(map(math.isfinite, positions)):
        return JointReason.NOT_FINITE
    if not all(abs(position) <= FURTHEST for position in positions):
        return JointReason.TOO_FAR
    # If it were kept, its stamp would make every later message look out of order.
    if (stamp_ns - now_ns) * 1e-9 > FUTURE_TOLERANCE_S:
        return JointReason.FUTURE
    if any(each.late(names, stamp_ns) for each in robots):
        return JointReason.ORDER
    return None
