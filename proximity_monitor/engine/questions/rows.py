"""Makes answers from the rows that a search kernel wrote (see kernels/base/state.py)."""

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
    """Make an answer from a row (ANSWER,), which it keeps; the question was asked at `start`.

    `kinds` are the kinds of the two models.
    """
    # The class's __init__ has to bypass the freeze for each field, and takes three times as long.
    answer = _new(Distance)
    fields = answer.__dict__
    fields["row"], fields["candidates"], fields["kinds"] = row, candidates, kinds
    fields["elapsed_s"] = perf_counter() - start
    return answer
