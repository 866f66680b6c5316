"""What is noted about each pair that there is something to know about, row by row."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from proximity_monitor.scene.description import Thresholds
from proximity_monitor.scene.near import Change, NearPairs
from proximity_monitor.scene.watch import WatchedPairs

REMEMBERED = 100_000
"""So many pairs that are beyond their range keep the session's minima; the first to go are
forgotten first."""

LEVELS = 4

_BOOK = {
    "range": (np.float64, np.inf),  # metres
    "levels": (np.float64, 0.0),  # (LEVELS,) metres: where an alert may begin or end
    "rel_err": (np.float64, 0.0),
    "abs_err": (np.float64, 0.0),
    "deciding": (np.bool_, False),  # only the side of the levels is asked for
    "signed": (np.bool_, False),
    "status": (np.int8, 0),  # of the last search; see STATUSES
    "done": (np.bool_, False),  # the last search answered all that can be asked
    "hard": (np.bool_, False),  # the last search ran out of time
    "looked": (np.float64, -np.inf),  # seconds
    "hint": (np.int32, -1),  # (2,) nearest triangles, as engine.Assembly knows them
    "min_upper": (np.float64, np.inf),
    "min_lower": (np.float64, np.inf),
}
"""By name the type, and what a record begins with."""

_WIDTHS = {"levels": (LEVELS,), "hint": (2,)}


class Books:
    """A table with a record for each row of the table of answers."""

    def __init__(self, watched: WatchedPairs, near: NearPairs, solid: np.ndarray) -> None:
        """Begin with what the scene says; `solid` (n,) bool is of the bodies."""
        self._watched = watched
        self._near = near
        self._solid = solid
        self._thresholds: Sequence[Thresholds] | None = None  # None: the scene's own
        self._tolerance: tuple[float | None, float | None] = None, None
        self._minima: dict[int, tuple[float, float]] = {}
        self.table = {
            name: np.full((0, *_WIDTHS.get(name, ())), first, kind)
            for name, (kind, first) in _BOOK.items()
        }
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
        self.table["done"][:] = False

    def reset_minima(self) -> None:
        """Forget the smallest clearances of the session."""
        self._minima.clear()
        for name in ("min_upper", "min_lower"):
            self.table[name][:] = np.inf

    def update(self, change: Change) -> None:
        """Have records for the pairs that came, and keep what matters of those that left."""
        if len(change.left):
            self._close(change)
        if len(change.come):
            self._open(change.come_rows)
            for key, row in zip(change.come.tolist(), change.come_rows.tolist(), strict=True):
                if key in self._minima:
                    minima = self._minima.pop(key)
                    self.table["min_upper"][row], self.table["min_lower"][row] = minima

    def _close(self, change: Change) -> None:
        """Keep the minima of pairs that left."""
        upper, lower = (self.table[name][change.left_rows] for name in ("min_upper", "min_lower"))
        known = np.isfinite(lower)
        pairs = zip(upper[known].tolist(), lower[known].tolist(), strict=True)
        self._minima.update(zip(change.left[known].tolist(), pairs, strict=True))
        while len(self._minima) > REMEMBERED:
            del self._minima[next(iter(self._minima))]

    def _open(self, rows: np.ndarray) -> None:
        """Begin new records."""
        least = int(rows.max(initial=-1)) + 1
        for name, (kind, first) in _BOOK.items():
            column = self.table[name]
            if least > len(column):
                more = np.full((least, *column.shape[1:]), first, kind)
                column = self.table[name] = np.concatenate((column, more))
            column[rows] = first
        self._limit(np.isin(self._near.rows, rows))

    def _limit(self, which: np.ndarray | slice) -> None:
        """Write what the records of some of the near pairs are limited by."""
        near, watched = self._near, self._watched
        rows, kinds = near.rows[which], near.kinds[which]
        limits = watched.kinds
        rel_err, abs_err = self._tolerance
        own = np.array([(each.rel_err, each.abs_err) for each in limits]).reshape(-1, 2)
        self.table["rel_err"][rows] = own[kinds, 0] if rel_err is None else rel_err
        self.table["abs_err"][rows] = own[kinds, 1] if abs_err is None else abs_err
        deciding = np.array([each.question != "distance" for each in limits])
        self.table["deciding"][rows] = deciding[kinds]
        self.table["signed"][rows] = self._solid[near.a[which]] & self._solid[near.b[which]]
        if self._thresholds is None:
            levels = np.array([_levels(each.thresholds) for each in limits])[kinds]
        else:
            given = (self._thresholds[i] for i in near.positions[which].tolist())
            levels = np.array([_levels(each) for each in given]).reshape(-1, LEVELS)
        self.table["levels"][rows] = levels
        self.table["range"][rows] = np.maximum(
            watched.ranges[kinds], levels.max(axis=1, initial=0.0)
        )


def _levels(thresholds: Thresholds) -> tuple[float, ...]:
    """The clearances at which an alert may begin or end."""
    warn, stop, more = thresholds.warn, thresholds.stop, thresholds.hysteresis
    return stop, warn, stop + more, warn + more
