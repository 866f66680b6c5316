"""The front of a search: the pairs of rings that it parted all that turns into, each one too far.

From one moment to the next most of them still are, and along the same direction. So the next search
begins with them: one gap along a known direction each, without the pairs that they are parts of.
That they are all there is, is what counts: whether each is too far is found out anew. A front only
becomes finer, so after a while a search begins with the whole again.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.state import remembers
from ..base.trees import NONE, REVISION
from ..elements.primitives import has_leapt

FRONT = 128
"""Pairs of rings that a front may have."""

_FEWEST = 4
"""Pairs of rings of a front that is worth while."""

_GROWN, _BESIDES = 1.5, 8
"""How many times as many pairs a front may come to have as at first; and how many besides."""


@kernel
def begin_front(tree_a, tree_b, state):
    """Forget a front that is of other shapes, or has taken up much of the room for arcs."""
    progress, waiting = state.progress[0], state.waiting
    same = progress.shape_a == tree_a.scale[REVISION] and progress.shape_b == tree_b.scale[REVISION]
    room = 2 * max(progress.arcs_a, progress.arcs_b) < len(waiting.arcs_a)
    if not (remembers(state) and same and room):
        progress.front = 0
    if progress.front == 0:
        progress.arcs_a = progress.arcs_b = 0
    progress.parted = NONE


@inlined
def has_front(tree_a, tree_b, state):
    """Whether a search had better begin with the front than with the whole."""
    front = state.progress[0].front
    few = _FEWEST <= front <= state.progress[0].grown
    return few and not has_leapt(tree_a, tree_b, state)


@kernel
def forget_front(tree_a, tree_b, state):
    """Begin with the whole, and keep what that is parted into where the next search is near."""
    progress = state.progress[0]
    progress.front = progress.arcs_a = progress.arcs_b = progress.grown = 0
    near = remembers(state) and not has_leapt(tree_a, tree_b, state)
    progress.parted = 0 if near else NONE


@inlined
def keep_ring(state, a, b, angle, half, sector, n, e):
    """Keep a pair of rings that is too far along a direction, where there is to be a front."""
    if state.progress[0].parted != NONE:
        _keep(state, a, b, angle, half, sector, n, e)


@kernel
def _keep(state, a, b, angle, half, sector, n, e):
    progress, front = state.progress[0], state.waiting.front
    if progress.parted == FRONT:
        progress.parted = NONE
        return
    ring = front[FRONT * (1 - progress.front_half) + progress.parted]
    progress.parted += 1
    ring.bound, ring.a, ring.b, ring.angle, ring.half = progress.limit, a, b, angle, half
    ring.sector[0], ring.sector[1], ring.sector[2], ring.sector[3] = sector
    ring.way[0], ring.way[1], ring.way[2], ring.way[3] = n[0], n[1], e[0], e[1]


@kernel
def end_front(state):
    """Make what the search parted all into the next front, together with what is still open."""
    progress, waiting = state.progress[0], state.waiting
    for i in range(progress.rings):
        ring = waiting.rings[waiting.heap[i]]
        sector = (ring.sector[0], ring.sector[1], ring.sector[2], ring.sector[3])
        n, e = (ring.way[0], ring.way[1]), (ring.way[2], ring.way[3])
        keep_ring(state, ring.a, ring.b, ring.angle, ring.half, sector, n, e)
    if progress.parted == NONE:
        return
    if progress.grown == 0:
        progress.grown = np.int64(_GROWN * progress.parted) + _BESIDES
    progress.front, progress.front_half = progress.parted, 1 - progress.front_half
