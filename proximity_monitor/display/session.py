"""The session so far: its ticks, for looking back, and each pair's smallest clearance."""

from __future__ import annotations

from array import array
from bisect import bisect_left
from collections.abc import Collection

import numpy as np

from proximity_monitor.display.choice import PairName
from proximity_monitor.display.smallest import Smallest
from proximity_monitor.display.snapshot import Snapshot
from proximity_monitor.display.state import STALE, Frame, Pairs

PERIOD_S = 0.1
"""Seconds between two kept ticks, unless memory gets short."""

EARLY = 0.2
"""A tick this share of a period early is still kept, so that all of ten ticks a second are."""

LEAP_S, FIRST_LEAP_S = 86_400.0, 10.0
"""Seconds. A tick later than the previous one by more than this is of another clock, such as that
of a recording played again. FIRST_LEAP_S holds after a tick at 0, which came before any clock."""

BYTES = 64_000_000
"""Maximum bytes of the kept ticks; beyond this, every second one is dropped."""

CURVES = 8
"""How many curves are cached for the plots of several browsers."""

POINTS = 600
"""Approximate maximum number of points of a plot."""


class Session:
    """The session's frames and smallest clearances."""

    def __init__(self) -> None:
        """Begin without frames."""
        self._frames: list[Frame] = []
        self._extra: list[bool] = []  # for each frame, whether it was kept before it was due
        self._bytes = 0
        self._period_s, self._due_s = PERIOD_S, -np.inf
        # By pair and ignored pairs: the stamp, lower and upper bound of each kept frame.
        self._curves: dict[tuple[PairName | None, frozenset[PairName]], array] = {}
        self._smallest = Smallest()
        self.number = 0
        """How many sessions came before this one."""
        self.newest: Frame | None = None
        """The last added frame, kept or not."""

    def add(self, frame: Frame, *, keep: bool = False) -> None:
        """Remember a tick. A tick of another clock begins a new session.

        Args:
            frame: the tick.
            keep: whether to keep the tick even if it comes shortly after a kept one.
        """
        if self.ends_with(frame):
            self.clear()
        self.newest = frame
        self._smallest.note(frame)
        late_s = frame.stamp_s - self._due_s
        due = late_s >= -EARLY * self._period_s
        if due:
            # The next is due a period after this was due, or after this if it is a period late.
            begin_s = self._due_s if late_s < self._period_s else frame.stamp_s
            self._due_s = begin_s + self._period_s
        elif not keep:
            return
        self._frames.append(frame)
        self._extra.append(not due)
        for of, curve in list(self._curves.items()):
            curve.extend((frame.stamp_s, *_bounds(frame.pairs, *of)))
        self._bytes += _size(frame)
        while self._bytes > BYTES and len(self._frames) > 3:
            self._thin()

    def ends_with(self, frame: Frame) -> bool:
        """Return whether a tick is of another clock: earlier than the last one, or far later."""
        if not self._frames:
            return False
        before_s = self.newest.stamp_s
        return not 0.0 <= frame.stamp_s - before_s <= (LEAP_S if before_s else FIRST_LEAP_S)

    def clear(self) -> None:
        """Drop all frames and begin a new session."""
        self.number += 1
        self._frames, self._extra = [], []
        self._bytes, self._period_s, self._due_s = 0, PERIOD_S, -np.inf
        self._curves.clear()
        self.forget_worst()

    def forget_worst(self) -> None:
        """Forget the smallest clearances and begin them again."""
        self._smallest.clear()

    @property
    def thinned_s(self) -> float | None:
        """Seconds between kept ticks, if memory became short; None: it did not."""
        return self._period_s if self._period_s > PERIOD_S else None

    @property
    def frames(self) -> list[Frame]:
        """The kept frames, the oldest first."""
        return list(self._frames)

    @property
    def span_s(self) -> tuple[float, float]:
        """The stamps of the oldest and the newest kept frame."""
        if not self._frames:
            return (0.0, 0.0)
        return self._frames[0].stamp_s, self._frames[-1].stamp_s

    def at(self, stamp_s: float) -> Frame | None:
        """Return the first kept frame that is not older than a stamp; else the last one."""
        if not self._frames:
            return None
        i = bisect_left(self._frames, stamp_s, key=lambda frame: frame.stamp_s)
        return self._frames[min(i, len(self._frames) - 1)]

    def worst(
        self, pair: PairName | None = None, ignored: Collection[PairName] = ()
    ) -> tuple[PairName, Snapshot] | None:
        """Return the smallest clearance of a pair, or of all pairs that are not ignored."""
        if pair is not None:
            found = self._smallest.of(pair)
            return None if found is None else (pair, found)
        return self._smallest.least(ignored)

    def lowest(self, pair: PairName | None = None, ignored: Collection[PairName] = ()) -> float:
        """Return the smallest lower bound of a pair, or of all; see `Smallest.lowest`."""
        return self._smallest.lowest(pair, ignored)

    @property
    def pairs(self) -> list[PairName]:
        """The pairs that ticks have listed since the smallest clearances were last forgotten."""
        return self._smallest.pairs

    def knows(self, pair: PairName) -> bool:
        """Return whether a tick has listed a pair since these were last forgotten."""
        return pair in self._smallest

    def conflicts(self) -> list[tuple[PairName, int, float]]:
        """Return the pairs that were not clear; see `Smallest.conflicts`."""
        return self._smallest.conflicts()

    def series(
        self, pair: PairName | None = None, ignored: Collection[PairName] = ()
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return stamps, lower and upper bounds (n,), in metres, for a plot.

        They belong to the pair. Without a pair, they belong to the smallest clearance of all listed
        pairs that are not ignored, which is not known while one of these is stale. If several ticks
        fall on one point, the smallest bounds are taken. NaN is a gap, and has a point of its own.
        Only a pair that was not asked for lately takes a pass over the whole session.
        """
        wanted = (pair, frozenset(ignored))
        kept = self._curves.pop(wanted, None)
        if kept is None:
            kept = array("d")
            for frame in self._frames:
                kept.extend((frame.stamp_s, *_bounds(frame.pairs, *wanted)))
        self._curves[wanted] = kept  # now the newest, so it is dropped last
        while len(self._curves) > CURVES:
            del self._curves[next(iter(self._curves))]
        curve = np.array(kept).reshape(-1, 3)
        stamps, bounds = curve[:, 0], curve[:, 1:]
        step = -(-len(stamps) // POINTS)
        if step > 1:
            starts = np.arange(0, len(stamps), step)
            ends = np.append(starts[1:], len(stamps)) - 1
            unknown = np.logical_or.reduceat(np.isnan(bounds[:, 0]), starts)
            least = np.fmin.reduceat(bounds, starts, axis=0)
            gaps = np.flatnonzero(unknown & ~np.isnan(least[:, 0]))
            stamps = np.insert(stamps[starts], gaps + 1, stamps[ends[gaps]])
            bounds = np.insert(least, gaps + 1, np.nan, axis=0)
        return stamps, bounds[:, 0], bounds[:, 1]

    def _thin(self) -> None:
        """Drop every second tick of one kind: those kept before they were due, or the others.

        The kind with more ticks is thinned. So ticks kept for their own sake take at most about
        half of the memory. If the others are thinned, later ones are kept as rarely as those that
        stay. The first of them stays, because the times of the session count from it.
        """
        extra, stays = np.array(self._extra), np.ones(len(self._frames), bool)
        own, due = np.flatnonzero(extra), np.flatnonzero(~extra)
        rarer = len(due) > len(own)
        stays[due[-2:0:-2] if rarer else own[-2::-2]] = False
        rows = np.flatnonzero(stays)
        self._frames, self._extra = [self._frames[i] for i in rows], extra[rows].tolist()
        self._bytes = sum(map(_size, self._frames))
        self._curves.clear()
        if rarer:
            stamps_s = [self._frames[i].stamp_s for i in np.flatnonzero(~extra[rows])]
            self._period_s = max(2.0 * self._period_s, float(np.median(np.diff(stamps_s))))
            self._due_s = stamps_s[-1] + self._period_s


def _bounds(
    pairs: Pairs, pair: PairName | None, ignored: Collection[PairName]
) -> tuple[float, float]:
    if pair is not None:
        row = pairs.places.get(pair)
        known = row is not None and pairs.level[row] != STALE
        return (pairs.lower[row], pairs.upper[row]) if known else (np.nan, np.nan)
    keep = np.ones(len(pairs), bool)
    for name in ignored:
        if name in pairs.places:
            keep[pairs.places[name]] = False
    if not keep.any() or (pairs.level[keep] == STALE).any():
        return np.nan, np.nan
    return float(pairs.lower[keep].min()), float(pairs.upper[keep].min())


def _size(frame: Frame) -> int:
    """Return roughly the bytes of a frame: its arrays, the other data of its pairs, its objects."""
    pairs = frame.pairs
    return frame.poses.nbytes + pairs.points.nbytes + 70 * len(pairs) + 2_500
