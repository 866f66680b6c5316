"""All watched pairs of a scene, and the pairs that are near now.

A thousand bodies that are all watched against each other make half a million pairs, ten thousand
bodies fifty million. The file describes these pairs in a few lines. This module, too, stores a rule
and its exceptions, never a list of the pairs that follow from the rule.

Only the pairs of infinite range and the near pairs are followed one by one. If the bounding balls
of a pair are farther apart than its range, the pair costs nothing: the broad phase never visits
it, and its distance is certified all the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from proximity_monitor.engine.assembly.answers import Answers
from proximity_monitor.engine.assembly.broad_phase import BroadPhase
from proximity_monitor.scene.description import Question, Thresholds, WatchedPair
from proximity_monitor.scene.state import LazySequence

CONTACT = Thresholds(warn=0.0, stop=0.0, hysteresis=0.0)
UNWATCHED = -1
"""The kind of a pair that is not watched."""
_CHUNK = 4096
"""How many pairs are made at a time."""


LISTED_SILENT = 250
"""How many pairs of silent bodies are listed although they were far apart at their last known
poses. A list of all these pairs would be of no use: if a thousand bodies are silent, so are half a
million pairs. With this limit, many bodies without poses cost a tick no more than bodies with
poses. A tick that lists fewer pairs of silent bodies lists all of them."""


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
    """The watched pairs of a scene, in the order of their bodies; each is made when it is read.

    A body is given by its index; the first body of a pair has the lower one. A pair's *kind* is an
    index into `kinds`, which says how the pair is watched.
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
            moving: which bodies move or deform; a pair of two others is never watched.
            kinds: all settings that occur.
            rule: the kind of every pair that is no exception; UNWATCHED: only exceptions count.
            exceptions: (k, 3) integers: two bodies, the lower index first, one of them moving,
                and their kind or UNWATCHED. Each pair occurs once.
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
        # For each body, how many pairs of the rule it is the first body of. Its partners are all
        # later bodies if it moves, else the later moving bodies.
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
        """Return the number of watched pairs."""
        return self._length

    def _made(self, places: range) -> Iterator[WatchedPair]:
        for start in range(0, len(places), _CHUNK):
            a, b = self.bodies(np.array(places[start : start + _CHUNK]))
            for i, j, kind in zip(a.tolist(), b.tolist(), self.kind(a, b).tolist(), strict=True):
                yield WatchedPair(self.names[i], self.names[j], **vars(self.kinds[kind]))

    def bodies(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the first and the second bodies, (k,) each, of the pairs at `positions` (k,)."""
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
        """Return the positions (k,) of watched pairs, whose bodies are `a` and `b`, (k,) each."""
        if self.rule == UNWATCHED:
            return np.searchsorted(self._exceptions, self._keys(a, b))
        ranks = self._rank(a, b)
        return ranks - np.searchsorted(self._gone, ranks)

    def kind(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Return the kinds (k,) of pairs with a moving body; UNWATCHED if a pair is not watched."""
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
        """Return how many pairs of finite range have a body in the mask `chosen` (n,)."""
        if not self.ruled_finite:
            return len(self.finite_exceptions_of(chosen)[0])
        movers, others = (int(((self.moving == each) & ~chosen).sum()) for each in (True, False))
        among_others = movers * (movers - 1) // 2 + movers * others
        other = (chosen[self._a] | chosen[self._b]) & ~self._finite_exceptions()
        return int(self._starts[-1]) - among_others - int(other.sum())

    def finite_exceptions_of(self, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return both bodies, (k,) each, of the exceptions among these pairs, in order."""
        which = (chosen[self._a] | chosen[self._b]) & self._finite_exceptions()
        return self._a[which], self._b[which]

    @property
    def ruled_finite(self) -> bool:
        """Whether the rule watches pairs and their range is finite."""
        return self.rule != UNWATCHED and bool(np.isfinite(self.ranges[self.rule]))

    def _ruled_infinite(self) -> bool:
        return self.rule != UNWATCHED and bool(np.isinf(self.ranges[self.rule]))

    def _finite_exceptions(self) -> np.ndarray:
        return (self._kind >= 0) & np.isfinite(self.ranges[self._kind])

    def _keys(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return a * len(self.names) + b

    def _rank(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Return the positions of pairs among all pairs with a moving body."""
        among_movers = self._movers_before[b] - self._movers_before[a + 1]
        return self._starts[a] + np.where(self.moving[a], b - a - 1, among_movers)


class Change(NamedTuple):
    """The pairs of finite range that lost their rows, and the pairs that got rows.

    A row in `left_rows` may be used again in `come_rows`.
    """

    left: np.ndarray
    """(k,) keys: the first body's index times the number of bodies, plus the second's."""
    left_rows: np.ndarray
    come: np.ndarray
    come_rows: np.ndarray


NO_CHANGE = Change(*(np.empty(0, np.int64) for _ in range(4)))


class NearPairs:
    """The pairs that have rows in a table of answers, in the scene's order.

    These are all pairs of infinite range, and the pairs of finite range that are near, are kept, or
    are listed because a body is silent.
    """

    rows: np.ndarray
    """(k,) their rows in the table of answers."""
    a: np.ndarray
    """(k,) their first bodies."""
    b: np.ndarray
    positions: np.ndarray
    """(k,) their positions among the watched pairs."""
    kinds: np.ndarray
    """(k,) their kinds, see `WatchedPairs`."""
    unsure: int
    """How many pairs of silent bodies have no row because there are too many. Ignored pairs do not
    count."""
    beyond: float
    """Metres; all pairs without a row are farther apart than this."""

    def __init__(self, watched: WatchedPairs, answers: Answers, solid: np.ndarray) -> None:
        """Begin with the pairs of infinite range; `solid` (n,) says which bodies are solids."""
        self._watched = watched
        self._answers = answers
        self._solid = solid
        self._broad = BroadPhase()
        self._heard: tuple[bytes, bytes] | None = None
        self._silent_pairs, self._silent_keys = 0, np.empty(0, np.int64)
        self._ignored = self._kept = np.empty(0, np.int64)
        self.unsure = 0
        self._finite = np.empty((2, 0), np.int64)  # keys and rows of near pairs
        a, b = watched.bodies(watched.infinite())
        self._infinite = np.stack((self._key(a, b), self._rows(a, b)))
        finite = watched.ranges[np.isfinite(watched.ranges)]
        self.beyond = float(finite.min(initial=np.inf))
        self.set_least(0.0)
        self._sort()

    def set_least(self, least: float) -> None:
        """Treat every finite range as at least `least` metres, which alerts need."""
        reaches = self._watched.reaches(least)
        self._taking_part = np.flatnonzero(reaches >= 0.0)
        # A pair's range is at most the reach of either body, so dilating each ball by half its
        # body's reach suffices. Doubling is exact, and so is halving except for subnormals, which
        # the broad phase's floor covers.
        self._dilation = np.where(reaches >= 0.0, reaches, 0.0) / 2.0
        self._heard = None

    def ignore(self, positions: np.ndarray) -> None:
        """Do not count the watched pairs at `positions` (k,) in `unsure`."""
        self._ignored = self._of_finite_range(*self._watched.bodies(positions))
        self._heard = None

    def keep(self, positions: np.ndarray) -> None:
        """Give rows to the watched pairs at `positions` (k,), wherever their bodies are."""
        self._kept = self._of_finite_range(*self._watched.bodies(positions))
        self._heard = None

    def update(self, known: np.ndarray, silent: np.ndarray, moved: bool) -> Change:
        """Find the pairs that are near at the present poses.

        Args:
            known: (n,) which bodies have a known pose.
            silent: (n,) which bodies may have moved although no new pose arrived.
            moved: whether any body moved since the last call.
        """
        heard = known.tobytes(), silent.tobytes()
        if not len(self._taking_part) or (not moved and heard == self._heard):
            return NO_CHANGE
        pairs = self._broad.near(
            self._answers.centres,
            self._answers.radii() + self._dilation,
            self._watched.moving,
            self._taking_part[known[self._taking_part]],
        )
        keys = np.union1d(self._of_finite_range(pairs[:, 0], pairs[:, 1]), self._kept)
        if heard != self._heard:
            self._heard = heard
            self._silent_pairs = self._watched.finite_of(silent)
            self._silent_keys = self._some_of(silent)
        self.unsure = 0
        if self._silent_pairs:
            keys = np.union1d(keys, self._silent_keys)
            a, b = np.divmod(np.union1d(keys, self._ignored), len(silent))
            self.unsure = self._silent_pairs - int((silent[a] | silent[b]).sum())
        return self._replace(keys)

    def _of_finite_range(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Return the keys of the given pairs that are watched with a finite range."""
        kinds = self._watched.kind(a, b)
        wanted = (kinds >= 0) & np.isfinite(self._watched.ranges[kinds])
        return self._key(a[wanted], b[wanted])

    def _some_of(self, silent: np.ndarray) -> np.ndarray:
        """Return the keys of the listed pairs of silent bodies; ignored pairs take no place."""
        if not self._watched.ruled_finite:
            keys = self._key(*self._watched.finite_exceptions_of(silent))
            return np.setdiff1d(keys, self._ignored)[:LISTED_SILENT]
        others, found, count = np.arange(len(silent)), [np.empty(0, np.int64)], 0
        for body in np.flatnonzero(silent):
            others = others[others != body]  # so that no pair is found twice
            keys = self._of_finite_range(np.minimum(body, others), np.maximum(body, others))
            found.append(np.setdiff1d(keys, self._ignored))
            count += len(found[-1])
            if count >= LISTED_SILENT:
                break
        return np.sort(np.concatenate(found))[:LISTED_SILENT]

    def _replace(self, keys: np.ndarray) -> Change:
        """Give rows to exactly these pairs of finite range; return the change."""
        old, rows = self._finite
        if np.array_equal(keys, old):
            return NO_CHANGE
        stay = np.isin(old, keys, assume_unique=True)
        new = ~np.isin(keys, old, assume_unique=True)
        gone = Change(old[~stay], rows[~stay], keys[new], np.empty(0, np.int64))
        self._answers.drop(gone.left_rows)
        kept = np.empty(len(keys), np.int64)
        kept[~new] = rows[stay]  # both are sorted by key
        kept[new] = self._rows(*np.divmod(keys[new], len(self._solid)))
        self._finite = np.stack((keys, kept))
        self._sort()
        return gone._replace(come_rows=kept[new])

    def _sort(self) -> None:
        """Join the pairs of infinite and finite range in the scene's order, the order of keys."""
        keys, rows = np.concatenate((self._infinite, self._finite), axis=1)
        order = np.argsort(keys, kind="stable")
        self.rows = rows[order]
        self.a, self.b = np.divmod(keys[order], len(self._solid))
        self.positions = self._watched.positions(self.a, self.b)
        self.kinds = self._watched.kind(self.a, self.b)

    def _key(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return a * len(self._solid) + b

    def _rows(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return self._answers.add(np.stack((a, b), axis=1), self._solid[a] | self._solid[b])
