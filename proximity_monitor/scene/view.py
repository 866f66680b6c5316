"""The near pairs during one tick: what is certain, what is wanted, and in which order."""

from __future__ import annotations

import numpy as np

from proximity_monitor import engine
from proximity_monitor.scene.books import Books
from proximity_monitor.scene.near import NearPairs
from proximity_monitor.scene.placing import Placing
from proximity_monitor.scene.state import STATUSES, PairStatus

_OUT_OF_TIME = tuple(engine.Status).index(engine.Status.OUT_OF_TIME)
_CODE = {status: code for code, status in enumerate(STATUSES)}
_PAIR_STATUS = np.array(
    [
        _CODE[
            {
                engine.Status.EXACT: PairStatus.EXACT,
                engine.Status.WITHIN_TOLERANCE: PairStatus.WITHIN_TOLERANCE,
                engine.Status.OUT_OF_TIME: PairStatus.BOUNDED,
                engine.Status.INTERSECTING: PairStatus.INTERSECTING,
            }[status]
        ]
        for status in engine.Status
    ],
    dtype=np.int8,
)
"""The code of a pair's status by that of the engine's."""


class View:
    """Arrays with one entry a near pair; searches improve them in place.

    Attributes:
        lower: (k,) metres, certified at the present poses.
        upper: (k,) metres.
        points: (k, 2, 3) metres, world.
        known: (k,) both poses are known.
        stale: (k,) a pose is not known, or too old.
        answered: (k,) nothing can be added to what the last search found.
        asked: (k,) the level on the side of which the last search of this tick was to decide;
            infinity for none, NaN where there was no search.
        straddling: (LEVELS, k) whether it is not known on which side of a level the pair is.
        tolerated: (k,) the bounds satisfy the tolerance.
        wanting: (k,) the pair is worth a search.
    """

    def __init__(
        self,
        near: NearPairs,
        placing: Placing,
        books: Books,
        ignored: np.ndarray,
        distances: bool,
    ) -> None:
        """Bound all near pairs.

        Args:
            near: which they are.
            placing: where the bodies are, and what is known of their pairs.
            books: what is asked about them.
            ignored: positions of pairs among the scene's that are to be left out.
            distances: whether anybody wants numbers; else pairs are only decided.
        """
        self._near, self._answers, self._books = near, placing.answers, books
        self._book = {
            name: books.table[name][near.rows]
            for name in ("range", "rel_err", "abs_err", "signed", "hard")
        }
        self._levels = np.ascontiguousarray(books.table["levels"][near.rows].T)
        carried = self._answers.carried(near.rows)
        self.lower, self.upper, self.points = carried.lower, carried.upper, carried.points
        self.known = placing.known[near.a] & placing.known[near.b]
        self.stale = placing.silent[near.a] | placing.silent[near.b]
        self.answered = books.table["done"][near.rows] & carried.still
        self.deciding = books.table["deciding"][near.rows] | (not distances)
        self.asked = np.full(len(near.rows), np.nan)
        self._watched = ~np.isin(near.positions, ignored)
        self.straddling, self.tolerated, self.wanting = self._judged(slice(None))

    def _judged(self, at: np.ndarray | slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What the bounds of some pairs (m,) say: `straddling`, `tolerated` and `wanting`."""
        lower, upper, levels = self.lower[at], self.upper[at], self._levels[:, at]
        straddling = (lower <= levels) & (levels < upper)
        rel_err, abs_err = self._book["rel_err"][at], self._book["abs_err"][at]
        small, large = (pick(np.abs(lower), np.abs(upper)) for pick in (np.minimum, np.maximum))
        alike = (lower > 0.0) | (upper < 0.0)
        tolerated = alike & (rel_err > 0.0) & (large <= (1.0 + rel_err) * small)
        tolerated |= (abs_err > 0.0) & (upper - lower <= abs_err)
        wanted = np.where(self.deciding[at], straddling.any(axis=0), ~tolerated)
        wanted &= self.known[at] & ~self.answered[at] & self._watched[at]
        return straddling, tolerated, wanted & (lower <= self._book["range"][at])

    def listed(self) -> np.ndarray:
        """(k,) whether each may be within its range, as far as is known."""
        return self._watched & (self.stale | (self.lower <= self._book["range"]))

    def order(self) -> np.ndarray:
        """The pairs that want a search, the most urgent first."""
        at = np.flatnonzero(self.wanting)
        straddles = self.straddling[:, at].any(axis=0)
        looked = self._books.table["looked"][self._near.rows[at]]
        return at[np.lexsort((looked, self.lower[at], ~straddles, self.stale[at]))]

    def alone(self, at: np.ndarray) -> np.ndarray:
        """(m,) whether a pair needs a search of its own: it may be negative, or takes long."""
        return self._book["hard"][at] | self.signed(at)

    def level(self, at: np.ndarray) -> np.ndarray:
        """(m,) what a search may end at: metres; infinity for nothing but the tolerance.

        A pair that is to be decided is asked for the largest level that is open: most pairs are
        beyond all of them, and that one question tells. One whose number is wanted is asked for its
        range first, while it may be farther: that costs an eighth of a distance, and who is farther
        is done with. Where an earlier search for the same level ended, rounding alone keeps it
        open; then all there is to know is asked.
        """
        undecided = np.where(self.straddling[:, at], self._levels[:, at], -np.inf)
        reach = self._book["range"][at]
        number = np.where(self.upper[at] > reach, reach, np.inf)
        level = np.where(self.deciding[at], undecided.max(axis=0), number)
        return np.where(level == self.asked[at], np.inf, level)

    def signed(self, at: np.ndarray) -> np.ndarray:
        """(m,) whether the distance may be negative, and a search has to look inside.

        Two solids that are certainly apart are as far apart as their surfaces.
        """
        return self._book["signed"][at] & (self.lower[at] <= 0.0)

    def tolerance(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The tolerances (m,) of searches; those that decide have none, their level ends them."""
        wanted = ~self.deciding[at]
        return self._book["rel_err"][at] * wanted, self._book["abs_err"][at] * wanted

    def hints(self, at: np.ndarray) -> np.ndarray:
        """(m, 2) the triangles that were nearest."""
        return self._books.table["hint"][self._near.rows[at]]

    def take(
        self,
        at: np.ndarray,
        level: np.ndarray,
        bounds: np.ndarray,
        points: np.ndarray,
        status: np.ndarray,
        now_s: float,
    ) -> None:
        """Take what searches of the pairs `at` (m,) found.

        Args:
            at: which pairs, each once.
            level: (m,) what each was asked.
            bounds: (m, 2) metres.
            points: (m, 2, 3) metres, world.
            status: (m,) positions in engine.Status.
            now_s: when.
        """
        ended = status != _OUT_OF_TIME
        final = ended & (level == np.inf)
        lower, upper = bounds[:, 0], bounds[:, 1]
        better = final | (upper <= self.upper[at])
        self.lower[at] = np.where(final, lower, np.maximum(self.lower[at], lower))
        self.upper[at] = np.where(better, upper, self.upper[at])
        self.points[at] = np.where(better[:, None, None], points, self.points[at])
        self.asked[at] = np.where(ended, level, np.nan)
        codes = _PAIR_STATUS[status]
        done = final | (codes == _CODE[PairStatus.INTERSECTING]) & ended
        self.answered[at] = done
        decided = (self.lower[at] > level) | ((self.upper[at] <= level) & (level < np.inf))
        hard = ~ended & ~decided
        self._book["hard"][at] = hard
        rows, table = self._near.rows[at], self._books.table
        table["done"][rows], table["status"][rows], table["hard"][rows] = done, codes, hard
        table["looked"][rows] = now_s
        kept = np.stack((self.lower[at], self.upper[at]), axis=1)
        self._answers.keep(rows, kept, self.points[at])
        self.straddling[:, at], self.tolerated[at], self.wanting[at] = self._judged(at)

    def note_hints(self, at: np.ndarray, hints: np.ndarray) -> None:
        """Take the nearest triangles (m, 2) of pairs, for their next search."""
        self._books.table["hint"][self._near.rows[at]] = hints

    def status(self) -> np.ndarray:
        """(k,) codes of what the numbers are, positions in STATUSES."""
        bounded = np.where(
            self.tolerated, _CODE[PairStatus.WITHIN_TOLERANCE], _CODE[PairStatus.BOUNDED]
        )
        codes = np.where(self.answered, self._books.table["status"][self._near.rows], bounded)
        codes = np.where(self.upper < 0.0, _CODE[PairStatus.OVERLAPPING], codes)
        return np.where(self.known, codes, _CODE[PairStatus.UNKNOWN]).astype(np.int8)
