"""Upper bounds: the distance between points of two elements, found near given points."""

from __future__ import annotations

import numpy as np

from ..base.jit import shared
from ..elements.primitives import keep
from .newton import nearest_near
from .sides import is_within_trim

MINIMUM_STEPS = 40
"""A search for a local minimum takes as long as this many steps."""

_MEET = 0.0625
"""A distance below this share of its error is not reduced any further: the models meet."""


@shared
def measure_near(tree_a, tree_b, state, element_a, from_a, element_b, from_b, most):
    """Find the local minimum near given points of two elements; keep it if it is nearest so far.

    The search takes at most `most` iterations; with 0, it measures the given points. Returns the
    distance, metres; infinity if a point has been cut off.
    """
    progress = state.progress[0]
    progress.primitive_tests += 1
    while True:
        distance, at_a, at_b, way = nearest_near(
            tree_a, tree_b, element_a, element_b, from_a, from_b, state.motions[0], most,
            _MEET * progress.slack,
        )  # fmt: skip
        if is_within_trim(tree_a, element_a, at_a) and is_within_trim(tree_b, element_b, at_b):
            break
        if most == 0:
            return np.inf
        most = 0  # the points where the search began may be left
    if distance < progress.distance:
        keep(state, distance, element_a, element_b, at_a, at_b, way)
    return distance
