"""From rows that the search kernel wrote (see kernels/state.py) to answers."""

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
    """The answer of a row (ANSWER,), which is kept, to what was asked at `start`.

    `kinds` are those of the two models.
    """
    # Its own __init__, which sets field by field past what freezes it, takes three times as long.
    answer = _new(Distance)
    fields = answer.__dict__
    fields["row"], fields["candidates"], fields["kinds"] = row, candidates, kinds
    fields["elapsed_s"] = perf_counter() - start
    return answer
