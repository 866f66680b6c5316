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
from ..base.state import (
    KEPT,
    BreadthFirst,
)
from ..base.vectors import dot, moved, sub
from ..elements.primitives import keep
from ..elements.triangles import corner_weights
from ..tree.layout import first_of, last_of
from .stubs import least_open, push, take


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
    _measure_vertices(tree_a, tree_b, state, progress.nearest_a, progress.nearest_b)


@kernel
def _measure_vertices(tree_a, tree_b, state, a, b):
    """Keep the nearest two of the vertices kept of two volumes, where nothing nearer is known.

    Their distance errs by less than that of triangles does, which SLACK covers.
    """
    known = state.progress[0].distance
    best, way = known * known, (0.0, 0.0, 0.0)
    first, second = 0, 0
    for j in range(KEPT):
        of_b, q = _vertex(tree_b, state.open.spread_b, b, j)
        q = moved(state.motions[0], q)
        for i in range(KEPT):
            of_a, p = _vertex(tree_a, state.open.spread_a, a, i)
            d = sub(q, p)
            squared = dot(d, d)
            if squared < best:
                best, way, first, second = squared, d, of_a, of_b
    distance = np.sqrt(best)
    if distance < known:
        wa, wb = corner_weights(first % 3), corner_weights(second % 3)
        keep(state, distance, first // 3, second // 3, wa, wb, way)


@kernel
def _vertex(tree, spread, lane, i):
    """The i-th vertex that is kept of a lane, as 3 triangle + corner, and where it is."""
    child = tree.children[lane]
    if child >= 0:
        corner = np.int64(spread[child, i])
    elif i < 2:
        corner = 3 * first_of(child) + i
    else:
        corner = 3 * last_of(child) + i - 1
    t, at = corner // 3, 3 * (corner % 3)
    return corner, (
        tree.triangles[t, at],
        tree.triangles[t, at + 1],
        tree.triangles[t, at + 2],
    )
