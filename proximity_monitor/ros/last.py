"""What is kept of one input: its last good pose, and how old that is."""

from __future__ import annotations

import numpy as np

from proximity_monitor.motion.screw import Paths, through
from proximity_monitor.ros.parts import to_numbers


class Input:
    """An input that must keep arriving: the stamp of its last good message."""

    __slots__ = ("stamp_ns",)

    def __init__(self) -> None:
        """Begin without a message."""
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self.stamp_ns: int | None = None

    def out_of_order(self, stamp_ns: int) -> bool:
        """Return whether a stamp is earlier than the last."""
        return self.stamp_ns is not None and stamp_ns < self.stamp_ns

    def late(self, now_ns: int, timeout_s: float) -> bool:
        """Return whether the last message is older than this, or there is none."""
        return self.stamp_ns is None or (now_ns - self.stamp_ns) * 1e-9 > timeout_s


class Last(Input):
    """The last good pose of one body, and the one before it with another stamp."""

    __slots__ = ("before", "before_ns", "first", "pose", "rests")

    def forget(self) -> None:
        """Begin anew."""
        super().forget()
        self.rests = False
        self.pose: np.ndarray | None = None
        self.before_ns: int | None = None
        self.before: np.ndarray | None = None
        self.first: np.ndarray | None = None

    def wakes(self, pose: np.ndarray) -> bool:
        """Return whether it has rested, and a pose says that it does no more."""
        rested = self.rests
        self.rests = self.pose is not None and pose.tobytes() == self.pose.tobytes()
        return rested and not self.rests

    def keep(self, pose: np.ndarray, stamp_ns: int) -> None:
        """Take a pose (4, 4), which must not change any more."""
        if stamp_ns != self.stamp_ns:
            # A link's stamp is the oldest of all that its pose depends on, so other joints may move
            # while it stays the same. The first pose of a stamp belongs to that moment; a later one
            # would hide motion.
            self.before, self.before_ns = self.first, self.stamp_ns
            self.first = pose
        self.pose, self.stamp_ns = pose, stamp_ns

    @property
    def rested(self) -> bool:
        """Whether the last two poses of different stamps are the same."""
        return self.before is not None and np.array_equal(self.before, self.pose)

    def at(self, stamp_ns: int, timeout_s: float) -> np.ndarray | None:
        """Return the pose (4, 4) at a moment that is not later than the last; None: not known.

        Args:
            stamp_ns: the moment.
            timeout_s: nobody knows how it moved between two poses that are farther apart.
        """
        if stamp_ns == self.stamp_ns:
            return self.pose
        if self.before is None or stamp_ns < self.before_ns:
            return None
        if (self.stamp_ns - self.before_ns) * 1e-9 > timeout_s:
            return None
        keys = to_numbers((self.before, self.pose))
        path = through(np.array([0.0, self.stamp_ns - self.before_ns]), keys[:, :3], keys[:, 3:])
        return Paths([path]).at(stamp_ns - self.before_ns)[0]
