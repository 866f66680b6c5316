"""Upper bounds: the distance of points that two elements have near given ones."""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel
from ..elements.primitives import keep
from .newton import nearest_near
from .sides import is_left

MINIMUM_STEPS = 40
"""Steps of a search that a search for a local minimum takes as long as."""

_MEET = 0.0625
"""Share of what a distance may err by below which it is not made any less: the models meet."""


@kernel
def measure_near(tree_a, tree_b, state, element_a, from_a, element_b, from_b, most):
    """Find the local minimum near given points of two elements; keep it where it is the nearest.

    In so many iterations at most; with none, it is about these points. Returns its distance,
    metres; infinity where it has been cut off.
    """
    progress = state.progress[0]
    progress.primitive_tests += 1
    while True:
        distance, at_a, at_b, way = nearest_near(
            tree_a, tree_b, element_a, element_b, from_a, from_b, state.motions[0], most,
            _MEET * progress.slack,
        )  # fmt: skip
        if is_left(tree_a, element_a, at_a) and is_left(tree_b, element_b, at_b):
            break
        if most == 0:
            return np.inf
        most = 0  # there may be something left where the search began
    if distance < progress.distance:
        keep(state, distance, element_a, element_b, at_a, at_b, way)
    return distance
