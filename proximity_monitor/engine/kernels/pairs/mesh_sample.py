"""Compares the few vertices kept of each volume (see tree/spread.py), for a search by levels."""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, kernel
from ..base.state import KEPT
from ..base.trees import MESHES
from ..base.vectors import dot, moved, sub
from ..elements.primitives import keep
from ..elements.triangles import corner_weights
from ..search import stubs
from ..tree.layout import first_of, last_of


@implements(stubs.sample, MESHES, MESHES)
@kernel
def _sample(tree_a, tree_b, state, a, b):
    """Find the nearest two of the vertices kept of two volumes; keep them if none known is nearer.

    Their distance errs by less than that of triangles, which the slack covers.
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
    """Return the i-th vertex kept of a lane, as 3 triangle + corner, and its position."""
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
