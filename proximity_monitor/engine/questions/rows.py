"""Makes answers from the rows that a search kernel wrote (see kernels/base/state.py)."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..models.model import Model
from .manifold import Candidates
from .result import Distance

Kinds = tuple[type[Model], type[Model]]


class _Made:
    """A `Distance` while its fields are being set.

    The class's own __init__ has to bypass the freeze for each field, which takes four times as
    long as setting them here and changing the class.
    """


def distance_of(
    row: NDArray[np.float64], start: float, candidates: Candidates | None, kinds: Kinds
) -> Distance:
    """Make an answer from a row (ANSWER,), which it keeps; the question was asked at `start`.

    `kinds` are the kinds of the two models.
    """
    answer: Any = _Made()
    answer.row, answer.candidates, answer.kinds = row, candidates, kinds
    answer.elapsed_s = perf_counter() - start
    answer.__class__ = Distance
    return answer
