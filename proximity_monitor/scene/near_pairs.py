"""The watched pairs that are followed one by one: all of infinite range, and the near ones.

A pair whose bodies' balls are farther apart than its range costs nothing: the broad phase never
meets it, and yet it is certified.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from proximity_monitor.engine.assembly.answers import Answers
from proximity_monitor.engine.assembly.broad_phase import BroadPhase
from proximity_monitor.scene.watch import WatchedPairs

LISTED_SILENT = 250
"""How many pairs of silent bodies are listed although they were far apart when last heard of. One
by one they are of no use: if a thousand bodies are silent, so are half a million pairs. With this
limit a crowd whose poses are still to come costs a tick no more than one that is there."""


class Change(NamedTuple):
    """The pairs of finite range that left, and those that came; both may use the same row."""

    left: np.ndarray
    """(k,) keys: the first body's index times the number of bodies, plus the second's."""
    left_rows: np.ndarray
    come: np.ndarray
    come_rows: np.ndarray


NO_CHANGE = Change(*(np.empty(0, np.int64) for _ in range(4)))


class NearPairs:
    """The pairs that have rows in a table of answers, in the scene's order."""

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
    """How many pairs of silent bodies have no row because there are too many; ignored ones do not
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
        self._ignored = np.empty(0, np.int64)
        self.unsure = 0
        self._finite = np.empty((2, 0), np.int64)  # keys and rows of near pairs
        a, b = watched.bodies(watched.infinite())
        self._infinite = np.stack((self._key(a, b), self._rows(a, b)))
        finite = watched.ranges[np.isfinite(watched.ranges)]
        self.beyond = float(finite.min(initial=np.inf))
        self.set_least(0.0)
        self._sort()

    def set_least(self, least: float) -> None:
        """Let every finite range count for at least this, metres: alerts depend on it."""
        reaches = self._watched.reaches(least)
        self._taking_part = np.flatnonzero(reaches >= 0.0)
        # A pair's range is at most that of either body, so half of each suffices. Doubling is
        # exact, and so is halving, except for subnormals, which the broad phase's floor covers.
        self._dilation = np.where(reaches >= 0.0, reaches, 0.0) / 2.0
        self._heard = None

    def ignore(self, positions: np.ndarray) -> None:
        """Leave the watched pairs at positions (k,) out of `unsure`: nobody asks about them."""
        self._ignored = self._of_finite_range(*self._watched.bodies(positions))
        self._heard = None

    def update(self, known: np.ndarray, silent: np.ndarray, moved: bool) -> Change:
        """Find the pairs that are near at the present poses.

        Args:
            known: (n,) the bodies whose pose is known.
            silent: (n,) the bodies whose pose may have changed unheard.
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
        keys = self._of_finite_range(pairs[:, 0], pairs[:, 1])
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
        """The keys of those pairs that are watched with a finite range."""
        kinds = self._watched.kind(a, b)
        wanted = (kinds >= 0) & np.isfinite(self._watched.ranges[kinds])
        return self._key(a[wanted], b[wanted])

    def _some_of(self, silent: np.ndarray) -> np.ndarray:
        """The keys of the pairs of silent bodies that are listed."""
        if not self._watched.ruled_finite:
            return self._key(*self._watched.finite_exceptions_of(silent))[:LISTED_SILENT]
        others, found, count = np.arange(len(silent)), [np.empty(0, np.int64)], 0
        for body in np.flatnonzero(silent):
            others = others[others != body]  # so that no pair is met twice
            found.append(self._of_finite_range(np.minimum(body, others), np.maximum(body, others)))
            count += len(found[-1])
            if count >= LISTED_SILENT:
                break
        return np.sort(np.concatenate(found))[:LISTED_SILENT]

    def _replace(self, keys: np.ndarray) -> Change:
        """Give rows to exactly these pairs of finite range."""
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
        """Join both kinds in the scene's order, which is that of the keys."""
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
