"""The broad phase: find which of many bodies are near each other, tick by tick."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
from numpy.typing import NDArray

from ..kernels.assembly.sweep import UNSORTED, WIDTH, sweep


class BroadPhase:
    """Finds all pairs of bodies whose balls meet, by sweep and prune.

    It remembers the bodies' order along an axis. This makes the next call fast and changes no
    result. The cost grows with the number of bodies and of pairs that overlap along that axis,
    never with that of all pairs (Thomas et al. 2000, section 5).
    """

    __slots__ = ("_lanes", "_low", "_order", "_pairs")

    def __init__(self) -> None:
        self._order = np.empty(0, np.int64)
        self._low = np.empty(0)
        self._lanes = np.empty((5, 0))
        self._pairs = np.empty((1024, 2), np.int64)

    def __copy__(self) -> BroadPhase:
        """Return a copy that remembers the same order, with its own memory."""
        return deepcopy(self)

    def near(
        self,
        centres: NDArray[np.float64],
        radii: NDArray[np.float64],
        moving: NDArray[np.bool_],
        taking_part: NDArray[np.int64],
    ) -> NDArray[np.int64]:
        """Return every pair of balls that meet or touch; rounding can only add pairs.

        Args:
            centres: (n, 3) metres, world.
            radii: (n,) metres, not negative; they include half of a pair's range.
            moving: (n,) whether each body moves; two bodies that do not move are no pair.
            taking_part: (m,) the bodies to compare, ascending; fastest if the same as last time.

        Returns:
            (k, 2) indices, the lower one first, sorted.
        """
        if len(taking_part) < 2:
            return np.empty((0, 2), np.int64)
        centres, radii = (np.require(each, np.float64, "CAWE") for each in (centres, radii))
        moving = np.require(moving, np.bool_, "CAWE")
        taking_part = np.require(taking_part, np.int64, "CAWE")
        with np.errstate(over="ignore"):
            axis = int(np.ptp(centres[taking_part], axis=0).argmax())
        if len(self._low) != len(radii) or not self._same(taking_part):
            self._order = taking_part.astype(np.int64)
            self._low, self._lanes = np.empty(len(radii)), np.zeros((5, len(taking_part) + WIDTH))
        while True:
            count = sweep(
                centres, radii, moving, axis, self._order, self._low, self._lanes, self._pairs
            )
            if count == UNSORTED:  # sort by the lower ends that it wrote, so this happens only once
                self._order = self._order[np.argsort(self._low[self._order])]
            elif count > len(self._pairs):
                self._pairs = np.empty((count + count // 2, 2), np.int64)
            else:
                found = self._pairs[:count]
                return found[np.argsort(found[:, 0] * len(radii) + found[:, 1])]

    def _same(self, taking_part: NDArray[np.int64]) -> bool:
        return len(self._order) == len(taking_part) and bool(
            (np.sort(self._order) == taking_part).all()
        )
