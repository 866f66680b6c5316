"""The checked query of an assembly."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import as_integers, as_tolerances
from ..kernels.assembly.questions import take_pairs


class Query(NamedTuple):
    """A checked query about some pairs of bodies."""

    poses: NDArray[np.float64]
    """(n, 4, 4) model to world of every body, metres."""
    pairs: NDArray[np.int32]
    """(k, 2) the bodies' indices."""
    wanted: NDArray[np.float64]
    """(k, 3) rel_err, abs_err in metres, and clearance in metres."""
    hints: NDArray[np.int32] | None
    """(k, 2) elements to start the search with, in tree order; negative: none."""
    signed: NDArray[np.bool_]
    """(k,) whether the answer is to be a signed distance. If the bodies may overlap, its lower
    bound is -inf."""

    def part(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> Query:
        """Return the query about some of the pairs."""
        hints = None if self.hints is None else self.hints[rows]
        return Query(self.poses, self.pairs[rows], self.wanted[rows], hints, self.signed[rows])


def checked_pairs(
    pairs: ArrayLike, solid: NDArray[np.bool_]
) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """Return pairs (k, 2) of bodies, and whether each (k,) has a body that is `solid` (n,).

    Raises:
        ValueError: `pairs` has another shape, or names a body that does not exist.
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
    """Return the n named tolerances as the columns of an array (count, n).

    Raises:
        TypeError: a value is no real number.
        ValueError: a value is neither a number nor (count,), or is negative or NaN.
    """
    wanted = np.empty((count, len(given)))
    for column, (name, value) in enumerate(given.items()):
        wanted[:, column] = as_tolerances(value, name, count)
    return wanted
