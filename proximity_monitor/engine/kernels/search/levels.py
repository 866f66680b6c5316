"""The search level by level, of lower and upper bounds (Johnson and Cohen 1997, section 3.1.1).

All pairs of one level of the bounding volume test tree are bounded before any of the next. When a
level begins, the nearest of its pairs gives an upper bound: the nearest two of the few vertices
that are kept of either volume, spread out over it (spread.py).

The pairs are listed in the order in which they were found, `pairs` being a ring: those from BASE to
DEPTH, which count up without end, stand at their remainders by its length, a power of two.

A level may be large. While more than FULL pairs are listed, the last is taken, not the first: what
is beyond FULL is a stack, and the search depth first until that is gone. So it is complete, and its
memory bounded: an opening replaces one pair by at most sixteen, so the first to exceed FULL leaves
no more than FULL + 15; then each level further down, of either model, leaves 15 at most behind.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel
from ..base.state import BreadthFirst
from .stubs import least_open, push, sample, take


@implements(push, BreadthFirst)
@inlined
def _push(open_pairs, state, first, top, a, b, bound):
    progress = state.progress[0]
    if bound < progress.next_lower:
        progress.next_lower = bound
        progress.nearest_a, progress.nearest_b = a, b
    at = top & (len(open_pairs.bounds) - 1)
    open_pairs.pairs[at, 0], open_pairs.pairs[at, 1], open_pairs.bounds[at] = a, b, bound


@implements(take, BreadthFirst)
@inlined
def _take(open_pairs, tree_a, tree_b, state):
    at = _take_first(tree_a, tree_b, state)
    return at if open_pairs.bounds[at] < state.progress[0].limit else -1


@implements(least_open, BreadthFirst)
@inlined
def _least(open_pairs, state):
    # There may be a million of them.
    return state.progress[0].level_lower if state.progress[0].open > 0 else np.inf


@kernel
def _take_first(tree_a, tree_b, state):
    """Take the first pair off the list, or the last where it is full; returns where it stands."""
    progress = state.progress[0]
    if progress.open - progress.base > progress.full:
        progress.open -= 1
        number = progress.open
    else:
        if progress.base >= progress.level_end:
            _begin_level(tree_a, tree_b, state)
        number = progress.base
        progress.base += 1
    if progress.base == progress.open:
        progress.base, progress.open, progress.level_end = 0, 0, 0
    return number & (len(state.open.bounds) - 1)


@kernel
def _begin_level(tree_a, tree_b, state):
    """Begin the level that is listed.

    What is listed was added since the last level began, and nothing that follows from a pair has a
    smaller bound: so the least bound that was added is one of the whole rest of the search.
    """
    progress = state.progress[0]
    progress.level_lower, progress.next_lower = progress.next_lower, np.inf
    progress.level_end = progress.open
    sample(tree_a, tree_b, state, progress.nearest_a, progress.nearest_b)
