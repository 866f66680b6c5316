"""The smallest clearance and the worst state of each pair in the session.

They are kept in columns, because one tick may change thousands of pairs. Pairs with their smallest
clearance at the same tick share its poses. If all poses take too much memory, the poses of pairs
with the largest of these clearances are dropped.
"""

from __future__ import annotations

import threading
from collections.abc import Collection

import numpy as np

from proximity_monitor.display.choice import PairName
from proximity_monitor.display.order import CLEAR_KIND, STALE_KIND, kinds
from proximity_monitor.display.snapshot import Snapshot
from proximity_monitor.display.state import STALE, Frame, PairNames

BYTES = 64_000_000
"""Maximum bytes of the poses."""

_MOMENT = np.dtype(
    [
        ("lower", float),
        ("upper", float),
        ("lowest", float),  # smallest lower bound of all ticks
        ("stamp_s", float),
        ("poses", object),
        ("points", float, (2, 3)),
        ("status", np.int8),
        ("level", np.int8),
        ("worst", np.int8),  # worst state, as a place in `order.KINDS`
    ]
)
_READ = ("lower", "upper", "points", "status", "level")


class Smallest:
    """The smallest clearance of each pair, given as a `Snapshot`. Any thread may call."""

    def __init__(self) -> None:
        """Begin without pairs."""
        self._lock = threading.Lock()
        self._places: dict[PairName, int] = {}
        self._moments = np.empty(0, _MOMENT)
        self._last: tuple[PairNames, np.ndarray] = ((), np.empty(0, int))
        self._bytes = 0  # upper bound of the kept poses' size: the last count plus all added since
        self._bodies = 0

    def clear(self) -> None:
        """Forget all pairs and begin again."""
        with self._lock:
            self._places = {}
            self._moments = np.empty(0, _MOMENT)
            self._last = ((), np.empty(0, int))
            self._bytes = 0

    def note(self, frame: Frame) -> None:
        """Take a tick; stale pairs in it do not count."""
        pairs = frame.pairs
        with self._lock:
            at = self._rows(pairs.names)
            of = kinds(pairs)
            of[of == STALE_KIND] = CLEAR_KIND
            self._moments["worst"][at] = np.minimum(self._moments["worst"][at], of)
            fresh = pairs.level != STALE
            lowest = np.fmin(self._moments["lowest"][at], pairs.lower)  # NaN is never lower
            self._moments["lowest"][at[fresh]] = lowest[fresh]
            nearer = pairs.upper < self._moments["upper"][at]  # NaN is never nearer
            nearer &= fresh
            at = at[nearer]
            for name in _READ:
                self._moments[name][at] = getattr(pairs, name)[nearer]
            self._moments["stamp_s"][at] = frame.stamp_s
            poses = np.empty((), object)
            poses[()] = frame.poses
            self._moments["poses"][at] = poses
            self._bodies = len(frame.poses)
            self._bytes += frame.poses.nbytes if len(at) else 0
            if self._bytes > BYTES:
                self._forget_poses()

    @property
    def pairs(self) -> list[PairName]:
        """The pairs that ticks have listed."""
        with self._lock:
            return list(self._places)

    def __contains__(self, pair: PairName) -> bool:
        """Return whether a tick has listed a pair."""
        return pair in self._places

    def of(self, pair: PairName) -> Snapshot | None:
        """Return a pair at its smallest clearance; None: no clearance was ever known."""
        with self._lock:
            row = self._places.get(pair)
            return None if row is None else self._snapshot(row)

    def least(self, ignored: Collection[PairName]) -> tuple[PairName, Snapshot] | None:
        """Return the pair with the smallest clearance among those not ignored, and its snapshot."""
        with self._lock:
            uppers = self._moments["upper"].copy()
            uppers[[self._places[name] for name in ignored if name in self._places]] = np.inf
            if not np.isfinite(uppers).any():
                return None
            row = int(np.argmin(uppers))
            pair = next(name for name, at in self._places.items() if at == row)
            return pair, self._snapshot(row)

    def lowest(self, pair: PairName | None, ignored: Collection[PairName]) -> float:
        """Return the smallest lower bound of a pair, or of all pairs not ignored, in metres.

        At no tick was the clearance smaller. It is NaN if no bound was ever known.
        """
        with self._lock:
            lowest = self._moments["lowest"].copy()
            lowest[[self._places[name] for name in ignored if name in self._places]] = np.inf
            if pair is not None:
                lowest = lowest[[self._places[pair]] if pair in self._places else []]
            least = float(lowest.min(initial=np.inf))
            return least if least < np.inf else float("nan")

    def conflicts(self) -> list[tuple[PairName, int, float]]:
        """Return the pairs that were not clear, each with its worst state and least upper bound.

        States are places in `order.KINDS`. Bounds are in metres, infinite if never known.
        """
        with self._lock:
            worst, upper, names = self._moments["worst"], self._moments["upper"], list(self._places)
            rows = np.flatnonzero(worst < STALE_KIND)
            found = zip(rows.tolist(), worst[rows].tolist(), upper[rows].tolist(), strict=True)
            return [(names[row], kind, least) for row, kind, least in found]

    def _rows(self, names: PairNames) -> np.ndarray:
        """Return the rows (k,) of pairs; new pairs get new rows."""
        if self._last[0] is not names:  # most ticks share the same names
            places = self._places
            at = np.fromiter((places.setdefault(n, len(places)) for n in names), int, len(names))
            more = np.zeros(len(places) - len(self._moments), _MOMENT)
            more["upper"] = more["lowest"] = np.inf
            more["worst"], more["poses"] = CLEAR_KIND, None
            self._moments = np.concatenate((self._moments, more))
            self._last = (names, at)
        return self._last[1]

    def _forget_poses(self) -> None:
        """Drop poses until half of `BYTES` is in use; keep those of the smallest clearances."""
        poses, kept, size = self._moments["poses"], set(), 0
        for row in np.argsort(self._moments["upper"]).tolist():
            each = poses[row]
            if each is None or id(each) in kept:
                continue
            if size + each.nbytes > BYTES // 2:
                poses[row] = None
            else:
                kept.add(id(each))
                size += each.nbytes
        self._bytes = size

    def _snapshot(self, row: int) -> Snapshot | None:
        found = self._moments[row]
        if np.isinf(found["upper"]):
            return None
        return Snapshot(
            float(found["lower"]),
            float(found["upper"]),
            float(found["stamp_s"]),
            np.zeros((self._bodies, 7)) if found["poses"] is None else found["poses"],
            found["points"].copy(),
            int(found["status"]),
            int(found["level"]),
        )
