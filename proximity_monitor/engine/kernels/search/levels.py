"""The search level by level, with lower and upper bounds (Johnson and Cohen 1997, section 3.1.1).

All pairs of one level of the bounding volume test tree are bounded before any pair of the next.
When a level begins, its nearest pair gives an upper bound: the distance of the nearest two among a
few vertices that are kept for each volume, spread out over it (spread.py).

The pairs are listed in the order in which they were found. `pairs` is a ring buffer: pair numbers
run from `progress.base` to `progress.open` and grow without limit; pair i is stored at i modulo the
buffer's length, a power of two.

A level may be large. While more than `progress.full` pairs are listed, the last pair is taken
instead of the first: the excess is a stack, and the search is depth first until it is gone. So the
search is complete and its memory is bounded. An opening replaces one pair by at most sixteen, so
the first one to exceed `full` leaves at most full + 15 pairs, and each further level of either
model adds at most 15.
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
    # There may be a million open pairs: do not look at each.
    return state.progress[0].level_lower if state.progress[0].open > 0 else np.inf


@kernel
def _take_first(tree_a, tree_b, state):
    """Take the first pair off the list, or the last one if the list is full; return its place."""
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

    All listed pairs were added since the last level began, and no pair below another has a smaller
    bound. So the least bound that was added is a lower bound of all the rest of the search.
    """
    progress = state.progress[0]
    progress.level_lower, progress.next_lower = progress.next_lower, np.inf
    progress.level_end = progress.open
    sample(tree_a, tree_b, state, progress.nearest_a, progress.nearest_b)
