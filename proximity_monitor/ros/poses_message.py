"""The poses of a tick: ``~/poses``, a `geometry_msgs/PoseArray` with the tick's stamp.

It has one pose per moving body, in the scene's order; a body without a pose has all zeros, which is
no valid pose. Poses come from many sources (topics, arrays, joints, transforms, attachments). The
message has the poses that result, so a viewer shows the bodies where the tick of the same stamp saw
them. The message is written as bytes, because rclpy takes some 20 µs for each pose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from builtin_interfaces.msg import Time

from proximity_monitor import cdr
from proximity_monitor.ros.parts import to_numbers
from proximity_monitor.scene.state import PoseSample


class PosesMessage:
    """Remembers the poses of the moving bodies, as they are serialised."""

    def __init__(self, moving: Sequence[str], frame: str) -> None:
        """Begin without poses; `moving` has the names of the bodies, in order."""
        self._names = tuple(moving)
        self._shown: list[np.ndarray | None] = [None] * len(self._names)
        self._numbers = np.zeros((len(self._names), 7), "<f8")
        self._head = cdr.text(frame) + cdr.count(len(self._names))
        self._head += bytes(-(8 + len(self._head)) % 8)  # 8: the stamp; numbers are aligned to 8

    def serialised(self, samples: Mapping[str, PoseSample | None], stamp: Time) -> bytes:
        """Return the message with the samples' poses."""
        poses = [None if at is None else at.pose for at in map(samples.get, self._names)]
        # Each new good pose is a new array, so a body with the same array has not moved.
        moved = [i for i, pose in enumerate(poses) if self._shown[i] is not pose]
        known = [i for i in moved if poses[i] is not None]
        self._shown = poses
        self._numbers[moved] = 0.0
        self._numbers[known] = to_numbers(poses[i] for i in known)
        return cdr.stamped(stamp.sec, stamp.nanosec) + self._head + self._numbers.tobytes()
