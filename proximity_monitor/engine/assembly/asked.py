"""What an assembly is asked, checked."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import as_integers, as_tolerances
from ..kernels.assembly.questions import take_pairs


class Asked(NamedTuple):
    """What is asked about some pairs of bodies, checked."""

    poses: NDArray[np.float64]
    """(n, 4, 4) model to world of every body, metres."""
    pairs: NDArray[np.int32]
    """(k, 2) which bodies."""
    wanted: NDArray[np.float64]
    """(k, 3) rel_err, abs_err in metres, and clearance in metres."""
    hints: NDArray[np.int32] | None
    """(k, 2) elements to begin with, in tree order, where they are not negative."""
    signed: NDArray[np.bool_]
    """(k,) whether the answer is a signed distance, or has -inf as lower bound if the bodies may
    overlap."""

    def part(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> Asked:
        """What is asked about some of the pairs."""
        hints = None if self.hints is None else self.hints[rows]
        return Asked(self.poses, self.pairs[rows], self.wanted[rows], hints, self.signed[rows])


def checked_pairs(
    pairs: ArrayLike, solid: NDArray[np.bool_]
) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """Pairs (k, 2) of bodies, and which of them (k,) are of a body that is `solid` (n,).

    Raises:
        ValueError: another shape, or a pair that names no body.
    """
    given = as_integers(pairs, "pairs", 2, np.int64)
    chosen, of_solids = np.empty(given.shape, np.int32), np.empty(len(given), np.bool_)
    bad = take_pairs(given, solid, chosen, of_solids)
    if bad < len(given):
        raise ValueError(
            f"pairs[{bad}] = {given[bad].tolist()}: there are {len(solid)} bodies, numbered from 0"
        )
    return chosen, of_solids


def checked_tolerances(given: dict[str, ArrayLike], count: int) -> NDArray[np.float64]:
    """Numbers that are not negative, by their names, as the columns of an array (count, n).

    Raises:
        TypeError: no real number.
        ValueError: neither a number nor (count,), or one that is negative or NaN.
    """
    wanted = np.empty((count, len(given)))
    for column, (name, value) in enumerate(given.items()):
        wanted[:, column] = as_tolerances(value, name, count)
    return wanted
