"""Answers made of the rows that a search kernel wrote (see kernels/base/state.py)."""

from __future__ import annotations

from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ..models.model import Model
from .manifold import Candidates
from .result import Distance

Kinds = tuple[type[Model], type[Model]]

_new = object.__new__


def distance_of(
    row: NDArray[np.float64], start: float, candidates: Candidates | None, kinds: Kinds
) -> Distance:
    """Make the answer of a row (ANSWER,), which it keeps; the question was asked at `start`.

    `kinds` are those of the two models.
    """
    # Its own __init__ has to get around the freeze for each field, and takes three times as long.
    answer = _new(Distance)
    fields = answer.__dict__
    fields["row"], fields["candidates"], fields["kinds"] = row, candidates, kinds
    fields["elapsed_s"] = perf_counter() - start
    return answer
