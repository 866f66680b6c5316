"""Bodies that are point clouds: each message on a body's topic replaces the whole body.

An arriving message is only kept. The next tick reads the latest message and builds its model, so a
flood of messages costs one model per tick. Points that are not finite, which sensors send if they
see nothing, are left out and counted. A cloud without points says that nothing is there: while it
is fresh, the body is absent and its pairs are clear. A cloud without any finite point is refused,
because it may come from a covered sensor.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2

from proximity_monitor import engine
from proximity_monitor.ros.clouds import read_points
from proximity_monitor.ros.inputs import FURTHEST, Inputs, Reason
from proximity_monitor.ros.qos import POSES, Incompatible
from proximity_monitor.scene import Body
from proximity_monitor.scene.state import PoseSample

Samples = dict[str, PoseSample | None]


class CloudBodies:
    """The clouds of a configured monitor.

    Attributes:
        dropped: how many points were left out because they are not finite, by body.
        built: how many clouds became models, by body.
    """

    def __init__(
        self,
        node: Node,
        bodies: Sequence[Body],
        frame: str,
        inputs: Inputs,
        incompatible: Incompatible,
        replace: Callable[[str, engine.Model], None],
    ) -> None:
        """Subscribe.

        Args:
            node: creates the subscriptions.
            bodies: all of the scene.
            frame: the fixed frame; clouds that name no body's frame must be in it.
            inputs: keeps the stamps of the clouds.
            incompatible: counts publishers whose quality of service does not fit.
            replace: takes a body's name and its new model.
        """
        self._node = node
        self._inputs = inputs
        self._frame = frame
        self._replace = replace
        self._clouds = {body.name: body for body in bodies if body.cloud is not None}
        self._fixed = {body.name: PoseSample(body.pose) for body in bodies if not body.moving}
        self._here = PoseSample(np.eye(4))
        self._latest: dict[str, bytes] = {}
        self._empty: set[str] = set()
        self.dropped: Counter[str] = Counter(dict.fromkeys(self._clouds, 0))
        self.built: Counter[str] = Counter(dict.fromkeys(self._clouds, 0))
        self._subscriptions = [
            node.create_subscription(
                PointCloud2,
                body.cloud.topic,
                partial(self._latest.__setitem__, name),
                POSES,
                raw=True,
                event_callbacks=incompatible.subscription(body.cloud.topic),
            )
            for name, body in self._clouds.items()
        ]

    def destroy(self) -> None:
        """End the subscriptions."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)

    def build(self, now_ns: int) -> None:
        """Build the bodies that have a new cloud."""
        latest = self._latest.copy()
        self._latest.clear()
        for name, data in latest.items():
            if reason := self._take(name, data, now_ns):
                self._inputs.refuse(reason)

    def place(self, samples: Samples, silent: Mapping[str, str]) -> None:
        """Add each cloud's pose, the pose of its frame, to `samples`, the other bodies' poses."""
        for name, body in self._clouds.items():
            sample = self._here
            if frame := body.cloud.frame:
                sample = self._fixed.get(frame) or samples[frame]
            unseen = self._inputs.shape_stamp_ns(name) is None or name in self._empty
            samples[name] = None if unseen and name in silent else sample

    def absent(self, silent: Mapping[str, str]) -> frozenset[str]:
        """Return the bodies that are certainly absent."""
        return frozenset(self._empty - silent.keys())

    def _take(self, name: str, data: bytes, now_ns: int) -> str | None:
        """Build a body from a message; return why the message is refused, or None."""
        try:
            message = deserialize_message(data, PointCloud2)
            points = read_points(message)
        except (RuntimeError, ValueError):  # rclpy's RMWError is a RuntimeError
            return Reason.LAYOUT
        body, header = self._clouds[name], message.header
        stamp_ns = header.stamp.sec * 1_000_000_000 + header.stamp.nanosec
        if header.frame_id != (body.cloud.frame or self._frame):
            return Reason.FRAME
        if reason := self._inputs.judge_shape(name, stamp_ns, now_ns):
            return reason
        finite = points[np.isfinite(points).all(axis=1)]
        self.dropped[name] += len(points) - len(finite)
        if len(points) and not len(finite):
            return Reason.NOT_FINITE
        if not (np.abs(finite) <= FURTHEST).all():
            return Reason.TOO_FAR
        self._empty.discard(name)
        if len(finite):
            model = engine.points(
                finite, radius=body.cloud.radius, name=name, deviation=body.deviation
            )
            self._replace(name, model)
            self.built[name] += 1
        else:
            self._empty.add(name)
        self._inputs.keep_shape(name, stamp_ns)
        return None
