"""The watched pairs: a rule and its exceptions, never a list of what follows from the rule.

A thousand bodies that are all watched against each other make half a million pairs, ten thousand
make fifty million. The file describes them in a few lines, and so does this module.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from proximity_monitor.scene.description import Question, Thresholds, WatchedPair
from proximity_monitor.scene.state import LazySequence

CONTACT = Thresholds(warn=0.0, stop=0.0, hysteresis=0.0)
UNWATCHED = -1
"""The kind of a pair that is not watched."""
_CHUNK = 4096
"""How many pairs are made in one go."""


@dataclass(frozen=True)
class PairSettings:
    """How a pair is watched; all lengths in metres (see `WatchedPair`)."""

    rel_err: float = 0.0
    abs_err: float = 0.0
    thresholds: Thresholds = CONTACT
    own_thresholds: bool = False
    question: Question = "distance"
    range: float = float("inf")


class WatchedPairs(LazySequence[WatchedPair]):
    """The watched pairs of a scene, in the order of their bodies, made when they are read.

    Bodies are known by their indices; the first of a pair is the lower one. A pair's *kind* says
    how it is watched: an index of `kinds`.
    """

    def __init__(
        self,
        names: Sequence[str],
        moving: Sequence[bool],
        kinds: Sequence[PairSettings],
        rule: int,
        exceptions: np.ndarray,
    ) -> None:
        """Make the sequence.

        Args:
            names: the bodies' names.
            moving: which bodies move; two that do not are never watched.
            kinds: all settings that occur.
            rule: the kind of every pair that is no exception; UNWATCHED for none.
            exceptions: (k, 3) whole numbers: two bodies, the lower index first, one of them moving,
                and their kind or UNWATCHED; each pair once.
        """
        self.names = tuple(names)
        self.moving = np.array(moving, dtype=bool)
        self.kinds = tuple(kinds)
        self.rule = rule
        self.ranges = np.array([limits.range for limits in kinds])
        a, b, kind = np.array(exceptions, dtype=np.int64).reshape(-1, 3).T
        order = np.argsort(self._keys(a, b))
        a, b, kind = a[order], b[order], kind[order]
        if rule == UNWATCHED:
            a, b, kind = a[kind >= 0], b[kind >= 0], kind[kind >= 0]
        self._a, self._b, self._kind = a, b, kind
        self._exceptions = self._keys(a, b)
        # How many pairs of the rule have each body first: with all later bodies if it moves, else
        # with the later moving ones.
        self._movers = np.flatnonzero(self.moving)
        self._movers_before = np.concatenate(([0], np.cumsum(self.moving)))
        index = np.arange(len(self.names))
        partners = np.where(
            self.moving,
            len(index) - 1 - index,
            len(self._movers) - self._movers_before[1:],
        )
        self._starts = np.concatenate(([0], np.cumsum(partners)))
        gone = kind == UNWATCHED
        self._gone = self._rank(a[gone], b[gone])
        self._length = len(a) if rule == UNWATCHED else int(self._starts[-1]) - len(self._gone)

    def __len__(self) -> int:
        """How many watched pairs there are."""
        return self._length

    def _made(self, places: range) -> Iterator[WatchedPair]:
        for start in range(0, len(places), _CHUNK):
            a, b = self.bodies(np.array(places[start : start + _CHUNK]))
            for i, j, kind in zip(a.tolist(), b.tolist(), self.kind(a, b).tolist(), strict=True):
                yield WatchedPair(self.names[i], self.names[j], **vars(self.kinds[kind]))

    def bodies(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the first and the second bodies, (k,) each, of the pairs at positions (k,)."""
        if self.rule == UNWATCHED:
            return self._a[positions], self._b[positions]
        ranks = positions + np.searchsorted(
            self._gone - np.arange(len(self._gone)), positions, side="right"
        )
        a = np.searchsorted(self._starts, ranks, side="right") - 1
        later = ranks - self._starts[a]
        mover = np.minimum(self._movers_before[a + 1] + later, len(self._movers) - 1)
        return a, np.where(self.moving[a], a + 1 + later, self._movers[mover])

    def positions(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Return the positions (k,) of the watched pairs of first and second bodies (k,) each."""
        if self.rule == UNWATCHED:
            return np.searchsorted(self._exceptions, self._keys(a, b))
        ranks = self._rank(a, b)
        return ranks - np.searchsorted(self._gone, ranks)

    def kind(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Return the kinds (k,) of pairs with a moving body; UNWATCHED for those not watched."""
        kinds = np.full(len(a), self.rule)
        if len(self._exceptions):
            keys = self._keys(a, b)
            at = np.minimum(np.searchsorted(self._exceptions, keys), len(self._exceptions) - 1)
            kinds = np.where(self._exceptions[at] == keys, self._kind[at], kinds)
        return kinds

    def infinite(self) -> np.ndarray:
        """Return the positions of the pairs of infinite range."""
        if self._ruled_infinite():
            positions = np.arange(self._length)
            finite = self._finite_exceptions()
            return np.delete(positions, self.positions(self._a[finite], self._b[finite]))
        infinite = (self._kind >= 0) & ~self._finite_exceptions()
        return self.positions(self._a[infinite], self._b[infinite])

    def reaches(self, least: float) -> np.ndarray:
        """Return (n,) metres: the largest finite range of each body's pairs, at least `least`.

        It is -inf for a body without such pairs.
        """
        ruled = self.ranges[self.rule] if self.ruled_finite else -np.inf
        reaches = np.full(len(self.names), ruled)
        finite = self._finite_exceptions()
        for bodies in (self._a[finite], self._b[finite]):
            np.maximum.at(reaches, bodies, self.ranges[self._kind[finite]])
        return np.where(reaches >= 0.0, np.maximum(reaches, least), reaches)

    def finite_of(self, chosen: np.ndarray) -> int:
        """Return how many pairs of finite range have one of the chosen bodies, a mask (n,)."""
        if not self.ruled_finite:
            return len(self.finite_exceptions_of(chosen)[0])
        movers, others = (int(((self.moving == each) & ~chosen).sum()) for each in (True, False))
        among_others = movers * (movers - 1) // 2 + movers * others
        other = (chosen[self._a] | chosen[self._b]) & ~self._finite_exceptions()
        return int(self._starts[-1]) - among_others - int(other.sum())

    def finite_exceptions_of(self, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return both bodies, (k,) each, of such pairs that are exceptions, in order."""
        which = (chosen[self._a] | chosen[self._b]) & self._finite_exceptions()
        return self._a[which], self._b[which]

    @property
    def ruled_finite(self) -> bool:
        """Whether the rule watches pairs, with a finite range."""
        return self.rule != UNWATCHED and bool(np.isfinite(self.ranges[self.rule]))

    def _ruled_infinite(self) -> bool:
        return self.rule != UNWATCHED and bool(np.isinf(self.ranges[self.rule]))

    def _finite_exceptions(self) -> np.ndarray:
        return (self._kind >= 0) & np.isfinite(self.ranges[self._kind])

    def _keys(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return a * len(self.names) + b

    def _rank(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """The positions of pairs among all that have a moving body."""
        among_movers = self._movers_before[b] - self._movers_before[a + 1]
        return self._starts[a] + np.where(self.moving[a], b - a - 1, among_movers)
