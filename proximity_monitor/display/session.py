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
"""Least seconds between two kept ticks."""

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
        self._bytes = 0
        self._period_s = PERIOD_S
        # By pair and ignored pairs: stamp, lower and upper bound of each kept frame.
        self._curves: dict[tuple[PairName | None, frozenset[PairName]], array] = {}
        self._smallest = Smallest()
        self.newest: Frame | None = None
        """The last added frame, kept or not."""

    def add(self, frame: Frame, *, keep: bool = False) -> None:
        """Remember a tick. A clock that went back begins a new session.

        Args:
            frame: the tick.
            keep: whether to keep it even if one shortly before was kept.
        """
        if self._frames and frame.stamp_s < self._frames[-1].stamp_s:
            self.clear()
        self.newest = frame
        self._smallest.note(frame)
        due_s = self._frames[-1].stamp_s + self._period_s if self._frames else -np.inf
        if frame.stamp_s < due_s and not keep:
            return
        self._frames.append(frame)
        for of, curve in list(self._curves.items()):
            curve.extend((frame.stamp_s, *_bounds(frame.pairs, *of)))
        self._bytes += _size(frame)
        while self._bytes > BYTES and len(self._frames) > 2:
            self._thin()

    def clear(self) -> None:
        """Begin anew."""
        self._frames = []
        self._bytes, self._period_s = 0, PERIOD_S
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

        They belong to a pair or, without one, to the smallest clearance of all pairs that are not
        ignored. If several ticks fall on one point, the nearest is shown; NaN is a gap. It goes
        through the whole session only for pairs that were not asked for lately.
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
            stamps = stamps[starts]
            bounds = np.fmin.reduceat(bounds, starts, axis=0)
        return stamps, bounds[:, 0], bounds[:, 1]

    def _thin(self) -> None:
        """Keep each second tick of the whole session, and from now on half as many."""
        self._frames = self._frames[-1::-2][::-1]
        self._bytes = sum(map(_size, self._frames))
        self._period_s *= 2.0
        self._curves.clear()


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
    keep &= ~np.isnan(pairs.lower) & (pairs.level != STALE)
    if not keep.any():
        return np.nan, np.nan
    return float(pairs.lower[keep].min()), float(pairs.upper[keep].min())


def _size(frame: Frame) -> int:
    """Roughly the bytes of its arrays, of the rest of a pair, and of the objects themselves."""
    pairs = frame.pairs
    return frame.poses.nbytes + pairs.points.nbytes + 70 * len(pairs) + 2_500
