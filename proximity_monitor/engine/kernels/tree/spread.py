"""A few vertices of each node that are far apart, for the search by levels."""

from __future__ import annotations

import numpy as np

from ..base.jit import allocating_entry, kernel
from ..base.state import KEPT
from .layout import EMPTY, LARGEST, WIDTH, first_of, last_of


@allocating_entry
def spread_corners(triangles, children):
    """Return four vertices under each node that are far apart (int32, k × 4).

    Each is given as 3 triangle + corner. They are chosen among those of the child nodes and all
    vertices of leaves. Each is the farthest from those chosen before it; the first is the farthest
    from an arbitrary vertex.
    """
    k = children.shape[0] // WIDTH
    spread = np.empty((k, KEPT), np.int32)
    corners = triangles.reshape((3 * triangles.shape[0], 3))
    candidates, nearest = np.empty(3 * LARGEST * WIDTH, np.int32), np.empty(3 * LARGEST * WIDTH)
    for node in range(k - 1, -1, -1):
        n = 0
        for lane in range(node * WIDTH, (node + 1) * WIDTH):
            child = children[lane]
            if child >= 0:
                for i in range(KEPT):
                    candidates[n] = spread[child, i]
                    n += 1
            elif child != EMPTY:
                for corner in range(3 * first_of(child), 3 * last_of(child) + 3):
                    candidates[n] = corner
                    n += 1
        nearest[:n] = np.inf
        chosen = _farthest(corners, candidates, n, 0, nearest)
        nearest[:n] = np.inf
        for i in range(KEPT):
            spread[node, i] = candidates[chosen]
            chosen = _farthest(corners, candidates, n, chosen, nearest)
    return spread


@kernel
def _farthest(corners, candidates, n, last, nearest):
    """Return which of n candidates is farthest from its nearest chosen one; `last` is the latest.

    `nearest` holds the squared distances from the nearest chosen before, and is updated.
    """
    best = 0
    at = candidates[last]
    for i in range(n):
        j = candidates[i]
        x, y, z = (
            corners[j, 0] - corners[at, 0],
            corners[j, 1] - corners[at, 1],
            corners[j, 2] - corners[at, 2],
        )
        nearest[i] = min(nearest[i], x * x + y * y + z * z)
        if nearest[i] > nearest[best]:
            best = i
    return best
