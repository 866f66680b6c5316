"""What is noted about each pair that there is something to know about, row by row."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from proximity_monitor import engine
from proximity_monitor.scene.description import Thresholds
from proximity_monitor.scene.near import Change, NearPairs
from proximity_monitor.scene.watch import WatchedPairs

REMEMBERED = 100_000
"""So many pairs that are beyond their range keep the session's minima; the first to go are
forgotten first."""


class Books:
    """Keeps the records of an agenda: what is asked about each row of the table of answers."""

    def __init__(self, watched: WatchedPairs, near: NearPairs, agenda: engine.Agenda) -> None:
        """Begin with what the scene says."""
        self._watched = watched
        self._near = near
        self._agenda = agenda
        self._ignored = np.empty(0, np.int64)
        self._thresholds: Sequence[Thresholds] | None = None  # None: the scene's own
        self._tolerance: tuple[float | None, float | None] = None, None
        self._minima: dict[int, tuple[float, float]] = {}
        self._open(near.rows)

    def set_thresholds(self, thresholds: Sequence[Thresholds]) -> None:
        """Take thresholds, one a watched pair."""
        if len(thresholds) != len(self._watched):
            raise ValueError(f"{len(thresholds)} thresholds for {len(self._watched)} pairs")
        self._thresholds = thresholds
        different = {id(each): each for each in thresholds}.values()
        self._near.set_least(max((t.warn + t.hysteresis for t in different), default=0.0))
        self._limit(slice(None))

    def set_tolerance(self, rel_err: float | None, abs_err: float | None) -> None:
        """Take tolerances for all pairs, abs_err in metres; None: each pair's own of the scene."""
        self._tolerance = rel_err, abs_err
        self._limit(slice(None))
        self._agenda.book["done"] = False

    def ignore(self, positions: np.ndarray) -> None:
        """Have nothing asked about the pairs at these positions (k,) among the watched ones."""
        self._ignored = positions
        self._limit(slice(None))

    def reset_minima(self) -> None:
        """Forget the smallest clearances of the session."""
        self._minima.clear()
        for name in ("min_upper", "min_lower"):
            self._agenda.book[name] = np.inf

    def update(self, change: Change) -> None:
        """Have records for the pairs that came, and keep what matters of those that left."""
        if len(change.left):
            self._close(change)
        if len(change.come):
            self._open(change.come_rows)
            book = self._agenda.book
            for key, row in zip(change.come.tolist(), change.come_rows.tolist(), strict=True):
                if key in self._minima:
                    upper, lower = self._minima.pop(key)
                    book["min_upper"][row], book["min_lower"][row] = upper, lower

    def _close(self, change: Change) -> None:
        """Keep the minima of pairs that left."""
        left = self._agenda.book[change.left_rows]
        upper, lower = left["min_upper"], left["min_lower"]
        known = np.isfinite(lower)
        pairs = zip(upper[known].tolist(), lower[known].tolist(), strict=True)
        self._minima.update(zip(change.left[known].tolist(), pairs, strict=True))
        while len(self._minima) > REMEMBERED:
            del self._minima[next(iter(self._minima))]

    def _open(self, rows: np.ndarray) -> None:
        """Begin new records."""
        self._agenda.begin(rows)
        self._limit(np.isin(self._near.rows, rows))

    def _limit(self, which: np.ndarray | slice) -> None:
        """Write what the records of some of the near pairs are limited by."""
        near, watched, book = self._near, self._watched, self._agenda.book
        rows, kinds = near.rows[which], near.kinds[which]
        limits = watched.kinds
        rel_err, abs_err = self._tolerance
        own = np.array([(each.rel_err, each.abs_err) for each in limits]).reshape(-1, 2)
        book["rel_err"][rows] = own[kinds, 0] if rel_err is None else rel_err
        book["abs_err"][rows] = own[kinds, 1] if abs_err is None else abs_err
        deciding = np.array([each.question != "distance" for each in limits])
        book["deciding"][rows] = deciding[kinds]
        book["ignored"][rows] = np.isin(near.positions[which], self._ignored)
        if self._thresholds is None:
            levels = np.array([_levels(each.thresholds) for each in limits])[kinds]
        else:
            given = (self._thresholds[i] for i in near.positions[which].tolist())
            levels = np.array([_levels(each) for each in given]).reshape(-1, engine.Agenda.LEVELS)
        book["levels"][rows] = levels
        book["range"][rows] = np.maximum(watched.ranges[kinds], levels.max(axis=1, initial=0.0))


def _levels(thresholds: Thresholds) -> tuple[float, ...]:
    """The clearances at which an alert may begin or end."""
    warn, stop, more = thresholds.warn, thresholds.stop, thresholds.hysteresis
    return stop, warn, stop + more, warn + more
