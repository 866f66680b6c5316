"""The front of a search: the pairs of rings that the whole pair was divided into, each pruned.

From one tick to the next most of them are still too far, along the same direction. So the next
search begins with them: it takes one gap along a known direction for each, and skips the larger
pairs that they are parts of. It relies only on the fact that they cover the whole pair: whether
each is too far is tested anew. A front only becomes finer, so after a while a search begins with
the whole pair again.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.state import remembers
from ..base.trees import NONE, REVISION
from ..elements.primitives import LEAP, has_leapt

FRONT = 128
"""Pairs of rings that a front may have, at most."""

_FEWEST = 4
"""A front with fewer pairs of rings is not worth using."""

_GROWN, _BESIDES = 1.5, 8
"""A front may grow to _GROWN times the pairs that it had at first, and _BESIDES more."""


@kernel
def begin_front(tree_a, tree_b, state):
    """Forget the front if no search may use it, or it is of other shapes, or its arcs are many.

    They are many if they take up half of their room.
    """
    progress, waiting = state.progress[0], state.waiting
    same = progress.shape_a == tree_a.scale[REVISION] and progress.shape_b == tree_b.scale[REVISION]
    room = 2 * max(progress.arcs_a, progress.arcs_b) < len(waiting.arcs_a)
    if not (remembers(state) and same and room):
        progress.front = 0
    if progress.front == 0:
        progress.arcs_a = progress.arcs_b = 0
    progress.recorded = NONE


@inlined
def has_front(tree_a, tree_b, state):
    """Return whether a search should begin with the front instead of the whole pair."""
    front = state.progress[0].front
    few = _FEWEST <= front <= state.progress[0].largest_front
    return few and not has_leapt(tree_a, tree_b, state, LEAP)


@kernel
def forget_front(tree_a, tree_b, state):
    """Begin with the whole pair; record its parts as a new front if the next search may use it."""
    progress = state.progress[0]
    progress.front = progress.arcs_a = progress.arcs_b = progress.largest_front = 0
    near = remembers(state) and not has_leapt(tree_a, tree_b, state, LEAP)
    progress.recorded = 0 if near else NONE


@inlined
def keep_ring(state, a, b, angle, half, sector, n, e):
    """Add a pair that is too far along a direction to the next front, if one is recorded."""
    if state.progress[0].recorded != NONE:
        _keep(state, a, b, angle, half, sector, n, e)


@kernel
def _keep(state, a, b, angle, half, sector, n, e):
    progress, front = state.progress[0], state.waiting.front
    if progress.recorded == FRONT:
        progress.recorded = NONE
        return
    ring = front[FRONT * (1 - progress.front_half) + progress.recorded]
    progress.recorded += 1
    ring.bound, ring.a, ring.b, ring.angle, ring.half = progress.limit, a, b, angle, half
    ring.sector[0], ring.sector[1], ring.sector[2], ring.sector[3] = sector
    ring.way[0], ring.way[1], ring.way[2], ring.way[3] = n[0], n[1], e[0], e[1]


@kernel
def end_front(state):
    """Make the recorded pairs the next front, together with the pairs that are still open."""
    progress, waiting = state.progress[0], state.waiting
    for i in range(progress.rings):
        ring = waiting.rings[waiting.heap[i]]
        sector = (ring.sector[0], ring.sector[1], ring.sector[2], ring.sector[3])
        n, e = (ring.way[0], ring.way[1]), (ring.way[2], ring.way[3])
        keep_ring(state, ring.a, ring.b, ring.angle, ring.half, sector, n, e)
    if progress.recorded == NONE:
        return
    if progress.largest_front == 0:
        progress.largest_front = np.int64(_GROWN * progress.recorded) + _BESIDES
    progress.front, progress.front_half = progress.recorded, 1 - progress.front_half
