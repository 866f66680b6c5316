"""Keeps the last good pose of one input, and its age."""

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
        """Return whether a stamp is earlier than the last one."""
        return self.stamp_ns is not None and stamp_ns < self.stamp_ns

    def late(self, now_ns: int, timeout_s: float) -> bool:
        """Return whether the last message is older than `timeout_s`, or there is none."""
        return self.stamp_ns is None or (now_ns - self.stamp_ns) * 1e-9 > timeout_s


class Last(Input):
    """The last good pose of one body, and the pose before it with another stamp.

    `pose` is the last pose with the stamp `stamp_ns`, and `first` the first pose with it. The body
    has had the pose `first` since the stamp `since_ns`. `before` is the first pose with the stamp
    before, `before_ns`.
    """

    __slots__ = ("before", "before_ns", "first", "pose", "since_ns")

    def forget(self) -> None:
        """Begin anew."""
        super().forget()
        self.pose: np.ndarray | None = None
        self.before_ns: int | None = None
        self.before: np.ndarray | None = None
        self.first: np.ndarray | None = None
        self.since_ns: int | None = None

    def keep(self, pose: np.ndarray, stamp_ns: int) -> bool:
        """Take a pose (4, 4), which must not change any more.

        Returns:
            Whether the body wakes: it had one pose at two stamps or more, and has another pose now.
        """
        same = self.first is not None and self.first.tobytes() == pose.tobytes()
        wakes = self.pose is not None and self.since_ns < self.stamp_ns and not same
        if stamp_ns != self.stamp_ns:
            # A link's stamp is the oldest stamp that its pose depends on, so other joints may move
            # the link while its stamp stays the same. Only the first pose with a stamp belongs to
            # that moment; a later pose would hide motion.
            self.before, self.before_ns = self.first, self.stamp_ns
            self.first = pose
            if not same:
                self.since_ns = stamp_ns
        self.pose, self.stamp_ns = pose, stamp_ns
        return wakes

    def seconds(self, timeout_s: float) -> float | None:
        """Return the time between its last two stamps.

        None: there are no two stamps, or they are more than `timeout_s` apart, so that the motion
        between them is not known.
        """
        if self.before is None:
            return None
        seconds = (self.stamp_ns - self.before_ns) * 1e-9
        return seconds if seconds <= timeout_s else None

    def at(self, stamp_ns: int, timeout_s: float) -> np.ndarray | None:
        """Return the pose (4, 4) at a moment; None: not known.

        Args:
            stamp_ns: the moment, not later than the last stamp. There must be a pose.
            timeout_s: see `seconds`.
        """
        if stamp_ns >= self.since_ns:
            # The body had this pose at stamps on both sides of the moment, so it rested, however
            # far apart the stamps are. This says nothing about earlier moments.
            return self.first
        if self.before is None or stamp_ns < self.before_ns or self.seconds(timeout_s) is None:
            return None
        keys = to_numbers((self.before, self.first))
        path = through(np.array([0.0, self.stamp_ns - self.before_ns]), keys[:, :3], keys[:, 3:])
        return Paths([path]).at(stamp_ns - self.before_ns)[0]
