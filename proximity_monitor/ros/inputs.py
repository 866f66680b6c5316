"""Poses from the outside: each is checked as it arrives, then kept, or refused and counted.

A message never does more than this. The last good pose of a body stays, and is reported as stale
once its stamp is older than the timeout, so a source that sends garbage ends like one that fell
silent.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable

import numpy as np
from geometry_msgs.msg import PoseStamped

from proximity_monitor.scene.poses import UNIT_LENGTH, pose_matrix
from proximity_monitor.scene.state import PoseSample

FUTURE_TOLERANCE_S = 0.1
"""How far ahead of the node's clock a stamp may be. Clocks of machines that are kept in step
differ by less; a stamp further ahead would hide for as long that its source fell silent."""

FURTHEST = 1e9
"""Metres from the origin. Beyond it float64 rounds by more than a ten-thousandth of a mm."""


class Reason:
    """Why a message is refused; the keys of the counts in the diagnostics."""

    NOT_FINITE = "not finite"
    NOT_UNIT = "quaternion not unit"
    TOO_FAR = "position out of range"
    FRAME = "other frame"
    STALE = "stale stamp"
    FUTURE = "stamp in the future"
    ORDER = "stamp out of order"
    UNKNOWN_BODY = "unknown body"
    ALL = (NOT_FINITE, NOT_UNIT, TOO_FAR, FRAME, STALE, FUTURE, ORDER, UNKNOWN_BODY)


class _Last:
    """The last good pose of one body."""

    __slots__ = ("pose", "stamp_ns")

    def __init__(self) -> None:
        self.stamp_ns: int | None = None
        self.pose: np.ndarray | None = None


class Inputs:
    """The last good pose of each moving body, and what was refused."""

    def __init__(self, bodies: Iterable[str], frame: str) -> None:
        """Begin with no pose of any of the `bodies`; `frame` is the only one that is accepted."""
        self._last = {name: _Last() for name in bodies}
        self._frame = frame
        self._counted: set[bytes] = set()
        self.strangers: list[str] = []
        """Names of unknown bodies that are published now, sorted."""
        self.timeout_s = 0.5
        self.rejected: Counter[str] = Counter({reason: 0 for reason in Reason.ALL})

    def store(self, name: str, message: PoseStamped, now_ns: int) -> str | None:
        """Keep a message's pose if it is good; return the reason if it is not.

        Args:
            name: a moving body of the scene.
            message: as it arrived.
            now_ns: nanoseconds of the node's clock.
        """
        last = self._last[name]
        stamp_ns = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        p, q = message.pose.position, message.pose.orientation
        reason = self._judge_header(message.header.frame_id, stamp_ns, now_ns, last)
        reason = reason or _judge_pose((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))
        if reason is not None:
            self.rejected[reason] += 1
            return reason
        last.stamp_ns = stamp_ns
        last.pose = pose_matrix((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))
        return None

    def _judge_header(self, frame: str, stamp_ns: int, now_ns: int, last: _Last) -> str | None:
        age_s = (now_ns - stamp_ns) * 1e-9
        if frame != self._frame:
            return Reason.FRAME
        if age_s < -FUTURE_TOLERANCE_S:
            return Reason.FUTURE
        if age_s > self.timeout_s:
            return Reason.STALE
        if last.stamp_ns is not None and stamp_ns < last.stamp_ns:
            return Reason.ORDER
        return None

    def forget(self) -> None:
        """Forget all poses: the clock went back, so no stamp can be compared with a former one."""
        for last in self._last.values():
            last.stamp_ns = last.pose = None

    def samples(self, now_ns: int) -> dict[str, PoseSample | None]:
        """Return each moving body's last good pose and whether it is stale."""
        return {
            name: None if last.pose is None else PoseSample(last.pose, self._stale(last, now_ns))
            for name, last in self._last.items()
        }

    def silent(self, now_ns: int) -> list[str]:
        """Return the bodies whose pose is stale or was never given."""
        return [name for name, last in self._last.items() if self._stale(last, now_ns)]

    def stamp_ns(self, name: str) -> int | None:
        """Return the stamp of a body's last good pose; None for a fixed body or without a pose."""
        return self._last[name].stamp_ns if name in self._last else None

    def note_strangers(self, publishers: Iterable[tuple[str, bytes]]) -> list[str]:
        """Take the present publishers of pose topics that no body of the scene listens to.

        The node does not subscribe to such topics, so what is counted is publishers, each once.

        Args:
            publishers: the body that the topic names, and the publisher's identity in the
                middleware.

        Returns:
            The names that were not published before.
        """
        before, names = set(self.strangers), set()
        for name, identity in publishers:
            names.add(name)
            self.rejected[Reason.UNKNOWN_BODY] += identity not in self._counted
            self._counted.add(identity)
        self.strangers = sorted(names)
        return sorted(names - before)

    def _stale(self, last: _Last, now_ns: int) -> bool:
        return last.stamp_ns is None or (now_ns - last.stamp_ns) * 1e-9 > self.timeout_s


def _judge_pose(
    position: tuple[float, float, float], quaternion: tuple[float, float, float, float]
) -> str | None:
    if not all(map(math.isfinite, (*position, *quaternion))):
        return Reason.NOT_FINITE
    if not all(abs(x) <= FURTHEST for x in position):
        return Reason.TOO_FAR
    if not abs(math.hypot(*quaternion) - 1.0) <= UNIT_LENGTH:
        return Reason.NOT_UNIT
    return None
