"""The open pairs, depth first: a stack, with the nearest pair of each opening on top."""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined
from ..base.state import DepthFirst
from .stubs import least_open, push, take


@implements(push, DepthFirst)
@inlined
def _push(open_pairs, state, first, top, a, b, bound):
    pairs, bounds = open_pairs.pairs, open_pairs.bounds
    at = top
    while at > first and bounds[at - 1] < bound:
        bounds[at] = bounds[at - 1]
        pairs[at, 0], pairs[at, 1] = pairs[at - 1, 0], pairs[at - 1, 1]
        at -= 1
    bounds[at] = bound
    pairs[at, 0], pairs[at, 1] = a, b


@implements(take, DepthFirst)
@inlined
def _take(open_pairs, tree_a, tree_b, state):
    progress = state.progress[0]
    progress.open -= 1
    at = progress.open
    return at if open_pairs.bounds[at] < progress.limit else -1


@implements(least_open, DepthFirst)
@inlined
def _least(open_pairs, state):
    least = np.inf
    for i in range(state.progress[0].open):
        least = min(least, open_pairs.bounds[i])
    return least
