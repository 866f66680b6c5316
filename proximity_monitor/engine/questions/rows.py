"""From rows that the search kernel wrote (see kernels/state.py) to answers."""

from __future__ import annotations

from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index
from ..models.model import Model
from .manifold import Candidates
from .result import Distance, Distances
from .witness import witness_points

Kinds = tuple[type[Model], type[Model]]

_new = object.__new__


def distance_of(
    row: NDArray[np.float64], start: float, candidates: Candidates | None, kinds: Kinds
) -> Distance:
    """The answer of a row (ANSWER,), which is kept, to what was asked at `start`.

    `kinds` are those of the two models.
    """
    # Its own __init__, which sets field by field past what freezes it, takes three times as long.
    answer = _new(Distance)
    fields = answer.__dict__
    fields["row"], fields["candidates"], fields["kinds"] = row, candidates, kinds
    fields["elapsed_s"] = perf_counter() - start
    return answer


def distances_of(rows: NDArray[np.float64]) -> Distances:
    """The answers of rows (k, ANSWER), which are kept; NaN stands where nothing was searched."""
    searched = ~np.isnan(rows[:, index.STATUS])
    whole = rows[
        :, [index.FEATURE_A + 3, index.FEATURE_B + 3, *range(index.TREE_A, index.RADIUS_A)]
    ]
    whole[~searched] = (-1, -1, -1, -1, 0, 0, index.OUT_OF_TIME)
    numbers = whole.astype(np.int32)
    return Distances(
        rows[:, index.LOWER],
        rows[:, index.UPPER],
        *witness_points(rows),
        numbers[:, 0:2],
        rows[:, [*range(8, 11), *range(12, 15)]].reshape(-1, 2, 3),
        numbers[:, 2:4],
        numbers[:, 6],
        whole[:, 4].astype(np.int64),
        whole[:, 5].astype(np.int64),
        searched,
    )
