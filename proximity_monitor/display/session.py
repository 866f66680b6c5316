"""The session so far: its ticks, to look back at them, and each pair's smallest clearance."""

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
"""A tick is kept each so many seconds at most."""

EARLY = 0.2
"""By so many periods a kept tick may come too early, so that of ten ticks a second all are kept."""

LEAP_S, FIRST_LEAP_S = 86_400.0, 10.0
"""A tick that is so much later than the one before is of another clock, such as that of a recording
that is played again. The other holds for a tick at 0, which came before any clock was heard."""

BYTES = 64_000_000
"""Bytes that the kept ticks may take; beyond it each second one goes."""

CURVES = 8
"""How many curves are kept for the plots of several browsers."""

POINTS = 600
"""How many points a plot has at most."""


class Session:
    """Remembers frames."""

    def __init__(self) -> None:
        """Begin without frames."""
        self._frames: list[Frame] = []
        self._extra: list[bool] = []  # of each: whether it was kept before it was due
        self._bytes = 0
        self._period_s, self._due_s = PERIOD_S, -np.inf
        # By pair and ignored pairs: stamp, lower and upper bound of each kept frame.
        self._curves: dict[tuple[PairName | None, frozenset[PairName]], array] = {}
        self._smallest = Smallest()
        self.number = 0
        """So many sessions were before this one."""
        self.newest: Frame | None = None
        """The last added frame, kept or not."""

    def add(self, frame: Frame, *, keep: bool = False) -> None:
        """Remember a tick. One of another clock begins a new session.

        Args:
            frame: the tick.
            keep: whether to keep it even if one shortly before was kept.
        """
        if self.ends_with(frame):
            self.clear()
        self.newest = frame
        self._smallest.note(frame)
        late_s = frame.stamp_s - self._due_s
        due = late_s >= -EARLY * self._period_s
        if due:
            # It is due again a period after it was, unless ticks are rarer than that.
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
        """Return whether a tick is of another clock: it is earlier than the last, or far later."""
        if not self._frames:
            return False
        before_s = self.newest.stamp_s
        return not 0.0 <= frame.stamp_s - before_s <= (LEAP_S if before_s else FIRST_LEAP_S)

    def clear(self) -> None:
        """Begin anew."""
        self.number += 1
        self._frames, self._extra = [], []
        self._bytes, self._period_s, self._due_s = 0, PERIOD_S, -np.inf
        self._curves.clear()
        self.forget_worst()

    def forget_worst(self) -> None:
        """Begin the smallest clearances anew."""
        self._smallest.clear()

    @property
    def thinned_s(self) -> float | None:
        """Seconds between the kept ticks once memory was short, and None before that."""
        return self._period_s if self._period_s > PERIOD_S else None

    @property
    def frames(self) -> list[Frame]:
        """The kept frames, the oldest first."""
        return list(self._frames)

    @property
    def span_s(self) -> tuple[float, float]:
        """The stamps of the oldest and newest."""
        if not self._frames:
            return (0.0, 0.0)
        return self._frames[0].stamp_s, self._frames[-1].stamp_s

    def at(self, stamp_s: float) -> Frame | None:
        """Return the first frame that is not older than a stamp, or the newest."""
        if not self._frames:
            return None
        i = bisect_left(self._frames, stamp_s, key=lambda frame: frame.stamp_s)
        return self._frames[min(i, len(self._frames) - 1)]

    def worst(
        self, pair: PairName | None = None, ignored: Collection[PairName] = ()
    ) -> tuple[PairName, Snapshot] | None:
        """Return the smallest clearance of a pair, or of all that are not ignored."""
        if pair is not None:
            found = self._smallest.of(pair)
            return None if found is None else (pair, found)
        return self._smallest.least(ignored)

    @property
    def pairs(self) -> list[PairName]:
        """The pairs that a tick listed, since the smallest clearances began."""
        return self._smallest.pairs

    def knows(self, pair: PairName) -> bool:
        """Return whether a tick listed a pair, since the smallest clearances began."""
        return pair in self._smallest

    def conflicts(self) -> list[tuple[PairName, int, float]]:
        """Return the pairs that were not clear; see `Smallest.conflicts`."""
        return self._smallest.conflicts()

    def series(
        self, pair: PairName | None = None, ignored: Collection[PairName] = ()
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return stamps, lower and upper bounds (n,), in metres, for a plot.

        They belong to a pair or, without one, to the smallest clearance of all listed pairs that
        are not ignored, which is not known while one of these is stale. If several ticks fall on
        one point, the nearest is shown; NaN is a gap, and has a point of its own. It goes through
        the whole session only for pairs that were not asked for lately.
        """
        wanted = (pair, frozenset(ignored))
        kept = self._curves.pop(wanted, None)
        if kept is None:
            kept = array("d")
            for frame in self._frames:
                kept.extend((frame.stamp_s, *_bounds(frame.pairs, *wanted)))
        self._curves[wanted] = kept  # the last to go
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
        """Let each second tick go: of those that came before they were due, or else of the others.

        So ticks that are kept for their own sake take about half of the memory at most, and the
        others are as rare from now on as those that stay. The first stays, because the times of
        the session count from it.
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
    """Roughly the bytes of its arrays, of the rest of a pair, and of the objects themselves."""
    pairs = frame.pairs
    return frame.poses.nbytes + pairs.points.nbytes + 70 * len(pairs) + 2_500
