"""Poses and shapes from outside: checked as they arrive, then kept, or refused and counted.

A body's state depends on its inputs: its pose, and the control points or the cloud that its shape
comes from, if any. Each input remembers the stamp of its last good message. That message stays in
force, and the body is silent once the stamp is older than the timeout. So a source that sends bad
messages is treated like a source that fell silent.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from proximity_monitor.ros.bulk import StampedPose
from proximity_monitor.ros.last import Input, Last
from proximity_monitor.scene.poses import UNIT_LENGTH, pose_matrices, pose_matrix
from proximity_monitor.scene.relative_motion import Course
from proximity_monitor.scene.schema import bounds
from proximity_monitor.scene.state import NO_POSE_YET, NO_RECENT_POSE, PoseSample

FUTURE_TOLERANCE_S = 0.1
"""How far ahead of the node's clock a stamp may be. Synchronised clocks differ by less. If a source
fell silent, a stamp that is further ahead would hide that for just as long."""

_, FURTHEST = bounds("coordinate")
"""Largest coordinate, metres. Beyond it, float64 rounds by more than a ten-thousandth of a mm."""

RIGID = 1e-6
"""How far each entry of R'R may be from the identity's: half of the limit of the engine."""


class Reason:
    """Why a message is refused; the keys of the counts in the diagnostics."""

    NOT_FINITE = "not finite"
    NOT_UNIT = "quaternion not unit"
    NOT_RIGID = "not rigid"
    TOO_FAR = "position out of range"
    FRAME = "other frame"
    STALE = "stale stamp"
    FUTURE = "stamp in the future"
    ORDER = "stamp out of order"
    LENGTH = "wrong length"
    LAYOUT = "unreadable layout"
    SHAPE = "no sound shape"
    ATTACHED = "body is attached"
    UNKNOWN_BODY = "unknown body"
    ALL = (
        NOT_FINITE, NOT_UNIT, NOT_RIGID, TOO_FAR, FRAME, STALE, FUTURE, ORDER, LENGTH, LAYOUT,
        SHAPE, ATTACHED, UNKNOWN_BODY,
    )  # fmt: skip


class Inputs:
    """The last good pose of each moving body, how fresh each shape is, and what was refused."""

    def __init__(
        self,
        bodies: Iterable[str],
        frame: str,
        roots: Iterable[str] = (),
    ) -> None:
        """Begin without any message.

        Args:
            bodies: the bodies whose poses arrive.
            frame: the only frame that poses may be in.
            roots: robots whose root link moves. The root's poses are kept like a body's; the poses
                of the links follow from them.
        """
        self.names = tuple(bodies)
        """The moving bodies, in the order of bulk messages."""
        self._last = {name: Last() for name in (*self.names, *roots)}
        self._shapes: dict[str, tuple[Input, str]] = {}
        self._frame = frame
        self._counted: frozenset[bytes] = frozenset()
        self._round: frozenset[str] = frozenset()
        self._awaited: set[str] = set()
        self._stamp_ns = -1  # of the last good message, and the bodies that it has told of so far
        self._stamped: set[str] = set()
        self._in_step = True  # whether all bodies of a round seem to have one stamp
        self._extended = False  # whether this round waits for the rest of a stamp
        self.woken = False
        """Whether a body that rested has moved since the round began. Only poses that arrive for
        one body alone count, not those of arrays or joints."""
        self.attached: frozenset[str] = frozenset()
        """Bodies whose own poses do not count now."""
        self.strangers: list[str] = []
        """Names of unknown bodies that are published now, sorted."""
        self.timeout_s = 0.5
        self.rejected: Counter[str] = Counter({reason: 0 for reason in Reason.ALL})

    def store(self, name: str, pose: StampedPose, now_ns: int) -> str | None:
        """Keep a pose if it is good, else return the reason.

        Args:
            name: a moving body of the scene, or a robot whose root moves.
            pose: the pose as it arrived.
            now_ns: nanoseconds of the node's clock.
        """
        last = self._last[name]
        reason = self._judge_header(pose.frame, pose.stamp_ns, now_ns)
        reason = reason or _judge_pose(pose.position, pose.quaternion)
        reason = reason or self._judge_body(name, pose.stamp_ns)
        if reason is not None:
            self.rejected[reason] += 1
            return reason
        matrix = pose_matrix(pose.position, pose.quaternion)
        self.woken |= last.keep(matrix, pose.stamp_ns)
        self._heard([name], pose.stamp_ns)
        return None

    def store_array(
        self,
        positions: np.ndarray,
        quaternions: np.ndarray,
        stamp_ns: int,
        frame: str,
        now_ns: int,
    ) -> int:
        """Keep the poses of all moving bodies at one moment; return how many were good.

        Args:
            positions: (n, 3) in the order of `names`; if n differs, nothing is kept.
            quaternions: (n, 4) x, y, z, w.
            stamp_ns: the stamp of all poses.
            frame: the frame of all poses.
            now_ns: nanoseconds of the node's clock.
        """
        if len(positions) != len(self.names):
            self.rejected[Reason.LENGTH] += 1
            return 0
        with np.errstate(over="ignore", invalid="ignore"):
            lengths = np.sqrt((quaternions * quaternions).sum(axis=1))
            finite = np.isfinite(positions).all(axis=1) & np.isfinite(quaternions).all(axis=1)
            near = (np.abs(positions) <= FURTHEST).all(axis=1)
            unit = np.abs(lengths - 1.0) <= UNIT_LENGTH
        good = self._count(
            ((Reason.NOT_FINITE, finite), (Reason.TOO_FAR, near), (Reason.NOT_UNIT, unit))
        )
        poses = np.empty((len(good), 4, 4))
        poses[good] = pose_matrices(positions[good], quaternions[good])
        return self._keep(self.names, poses, good, stamp_ns, frame, now_ns)

    def store_many(
        self, names: Sequence[str], poses: np.ndarray, stamp_ns: int, frame: str, now_ns: int
    ) -> int:
        """Keep the poses of some bodies at one moment; return how many were good.

        Args:
            names: k moving bodies of the scene.
            poses: (k, 4, 4) model to world in metres; kept as they are, so they must not change.
            stamp_ns: the stamp of all poses.
            frame: the frame of all poses.
            now_ns: nanoseconds of the node's clock.
        """
        rotations, positions = poses[:, :3, :3], poses[:, :3, 3]
        with np.errstate(over="ignore", invalid="ignore"):
            finite = np.isfinite(poses).all(axis=(1, 2))
            near = (np.abs(positions) <= FURTHEST).all(axis=1)
            grams = rotations.transpose(0, 2, 1) @ rotations
            rigid = (np.abs(grams - np.eye(3)) <= RIGID).all(axis=(1, 2))
            rigid &= (np.linalg.det(rotations) > 0.0) & (poses[:, 3] == (0, 0, 0, 1)).all(axis=1)
        good = self._count(
            ((Reason.NOT_FINITE, finite), (Reason.TOO_FAR, near), (Reason.NOT_RIGID, rigid))
        )
        return self._keep(names, poses, good, stamp_ns, frame, now_ns)

    def refuse(self, reason: str) -> None:
        """Count a message that is refused because of its content."""
        self.rejected[reason] += 1

    def expect_shapes(self, shapes: Mapping[str, str]) -> None:
        """Wait for shapes; `shapes` gives by body how its shape arrives, such as "vertices"."""
        self._shapes = {name: (Input(), what) for name, what in shapes.items()}

    def judge_shape(self, name: str, stamp_ns: int, now_ns: int) -> str | None:
        """Return why a shape's stamp is refused; None if it is not."""
        if reason := self._judge_age(stamp_ns, now_ns):
            return reason
        return Reason.ORDER if self._shapes[name][0].out_of_order(stamp_ns) else None

    def keep_shape(self, name: str, stamp_ns: int) -> None:
        """Note that a body has the shape of a message with this stamp."""
        self._shapes[name][0].stamp_ns = stamp_ns

    def forget(self) -> None:
        """Forget all stamps and poses: the clock went back, so new stamps cannot be compared."""
        for last in self._last.values():
            last.forget()
        for heard, _ in self._shapes.values():
            heard.forget()

    def forget_pose(self, name: str) -> None:
        """Forget a body's pose, so that the next pose counts whatever its stamp."""
        self._last[name].forget()

    def place(self, name: str, pose: np.ndarray, stamp_ns: int) -> None:
        """Give a body that is being detached the pose to which it was carried."""
        last = self._last[name]
        last.forget()
        last.keep(pose, stamp_ns)

    def samples(self, now_ns: int) -> dict[str, PoseSample | None]:
        """Return each moving body's last good pose and whether it is stale."""
        every = ((name, self._last[name]) for name in self.names)
        return {
            name: None
            if last.pose is None
            else PoseSample(last.pose, last.late(now_ns, self.timeout_s))
            for name, last in every
        }

    def last(self, name: str) -> tuple[np.ndarray, int] | None:
        """Return the last good pose (4, 4) of a body or root and its stamp in ns, or None."""
        last = self._last[name]
        return None if last.pose is None else (last.pose, last.stamp_ns)

    def silent(self, samples: Mapping[str, PoseSample | None], now_ns: int) -> dict[str, str]:
        """Return, for each silent body, the reason.

        Args:
            samples: the poses of the bodies, including carried bodies.
            now_ns: nanoseconds of the node's clock.
        """
        found = {
            name: NO_POSE_YET if at is None else NO_RECENT_POSE
            for name, at in samples.items()
            if at is None or at.stale
        }
        for name, (heard, what) in self._shapes.items():
            # The pose's reason goes first, unless the body (a cloud) receives no poses.
            first = name not in found or name not in self._last
            if first and heard.late(now_ns, self.timeout_s):
                found[name] = f"no {what} yet" if heard.stamp_ns is None else f"no recent {what}"
        return found

    def await_again(self, names: Iterable[str]) -> None:
        """Begin a new round, which is `complete` once each of these bodies has a new pose.

        Without any body, each body is awaited that gets poses of its own: at the start, they come
        one after another. If poses come in step, all new poses also have one stamp.
        """
        self._round = frozenset(names) or frozenset(self.names) - self.attached
        self.woken = False
        self.renew()

    def renew(self) -> None:
        """Wait once more for new poses of all bodies of the round."""
        self._awaited, self._extended = set(self._round), False

    @property
    def complete(self) -> bool:
        """Whether all bodies of the round have new poses."""
        return not self._awaited

    def stamp_ns(self, name: str) -> int | None:
        """Return the stamp of a body's last good pose; None for a fixed body or without a pose."""
        return self._last[name].stamp_ns if name in self._last else None

    def shape_stamp_ns(self, name: str) -> int | None:
        """Return the stamp of the message that a body's shape comes from, or None."""
        return self._shapes[name][0].stamp_ns if name in self._shapes else None

    def course(self, name: str) -> Course | None:
        """Return a moving body's last two poses; None if it has no two recent poses."""
        last = self._last[name]
        seconds = last.seconds(self.timeout_s)
        return None if seconds is None else Course(last.before, last.pose, seconds)

    def together(self, a: str, b: str) -> tuple[np.ndarray, np.ndarray, float]:
        """Return the last poses (4, 4) of two bodies at one moment, if they are known.

        The moment is the earlier one of the two last stamps. At this moment, the body with the
        later stamp either had the pose that it still has, or a pose on the screw motion between the
        poses of its last two stamps.

        Args:
            a: a body whose pose is known.
            b: another such body.

        Returns:
            Both poses, and the seconds between their stamps. These are 0, unless a pose at the
            moment is not known; then the last poses of both bodies are returned.
        """
        one, other = self._last[a], self._last[b]
        moment_ns = min(one.stamp_ns, other.stamp_ns)
        at = [each.at(moment_ns, self.timeout_s) for each in (one, other)]
        if at[0] is None or at[1] is None:
            return one.pose, other.pose, abs(one.stamp_ns - other.stamp_ns) * 1e-9
        return at[0], at[1], 0.0

    def note_strangers(self, publishers: Iterable[tuple[str, bytes]]) -> list[str]:
        """Take the present publishers of pose topics that belong to no body of the scene.

        The node does not subscribe to such topics. So it counts publishers instead of messages, and
        each publisher once, when it appears.

        Args:
            publishers: the body that the topic names, and the publisher's identity in the
                middleware.

        Returns:
            The names that were not published before.
        """
        before, present = set(self.strangers), tuple(publishers)
        names = {name for name, _ in present}
        known, self._counted = self._counted, frozenset(identity for _, identity in present)
        self.rejected[Reason.UNKNOWN_BODY] += len(self._counted - known)
        self.strangers = sorted(names)
        return sorted(names - before)

    def _keep(
        self,
        names: Sequence[str],
        poses: np.ndarray,
        good: np.ndarray,
        stamp_ns: int,
        frame: str,
        now_ns: int,
    ) -> int:
        """Keep the good poses of one moment, count refusals, and return how many were kept."""
        if reason := self._judge_header(frame, stamp_ns, now_ns):
            self.rejected[reason] += int(good.sum())
            return 0
        kept = []
        for i in np.flatnonzero(good).tolist():
            if reason := self._judge_body(names[i], stamp_ns):
                self.rejected[reason] += 1
            else:
                self._last[names[i]].keep(poses[i], stamp_ns)
                kept.append(names[i])
        self._heard(kept, stamp_ns)
        return len(kept)

    def _heard(self, names: Sequence[str], stamp_ns: int) -> None:
        """Note that bodies have new poses with this stamp.

        If bodies get their poses one after another, each moment with one stamp, a round could end
        between the first and the last pose of a moment, and so would every later round. So a round
        of such bodies ends when all have the same stamp; but it is extended only once, for sources
        may cease to be in step.
        """
        self._awaited.difference_update(names)
        if stamp_ns != self._stamp_ns:
            self._stamp_ns, self._stamped = stamp_ns, set()
        self._stamped.update(names)
        as_one = len(self._stamped) >= len(self._round) and self._round <= self._stamped
        if as_one:
            self._in_step = True
        elif not self._awaited and self._in_step:
            if self._extended:
                self._in_step = False
            else:
                self._awaited, self._extended = set(self._round - self._stamped), True

    def _count(self, tests: Iterable[tuple[str, np.ndarray]]) -> np.ndarray:
        """Count each failure by the first test that fails; return a mask of what passes all."""
        good = True
        for reason, passed in tests:
            self.rejected[reason] += int((good & ~passed).sum())
            good = good & passed
        return good

    def _judge_header(self, frame: str, stamp_ns: int, now_ns: int) -> str | None:
        return Reason.FRAME if frame != self._frame else self._judge_age(stamp_ns, now_ns)

    def _judge_age(self, stamp_ns: int, now_ns: int) -> str | None:
        age_s = (now_ns - stamp_ns) * 1e-9
        if age_s < -FUTURE_TOLERANCE_S:
            return Reason.FUTURE
        if age_s > self.timeout_s:
            return Reason.STALE
        return None

    def _judge_body(self, name: str, stamp_ns: int) -> str | None:
        if name in self.attached:
            return Reason.ATTACHED
        return Reason.ORDER if self._last[name].out_of_order(stamp_ns) else None


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
