"""Coherence: pairs of volumes that were too far still are if the models have moved little since.

From one tick to the next, a search mostly opens the same pairs of volumes and finds little that is
near under them. Opening a pair proves that everything under it is at least as far as some bound,
except what is under a few lanes (the kept lanes). This bound is stored, together with how far the
models had moved in total by then. Later, the bound minus the motion since then still holds. If that
is still beyond the limit, the pair is not bounded again: it is done with, or its kept lanes are
opened at once. The nearest triangles are remembered separately (Larsen et al. 1999, section 6.2).
"""

from __future__ import annotations

import numpy as np

from ..base.hashing import EMPTY_HASH, mixed, slot
from ..base.jit import inlined, kernel
from ..base.lanes import lowest
from ..base.rounding import TRAVEL_SHARE
from ..base.state import NO_KEY, SOME, remembers
from ..base.trees import REVISION
from ..base.vectors import dot, scaled
from ..tree.layout import WIDTH, radius_of, row
from .stubs import push

_LANES = (1 << WIDTH) - 1
_FLIP = WIDTH
"""The bits of `kept` that are lanes; and the bit that is set if these are lanes of tree a."""


@kernel
def _spectral(d):
    """Return an upper bound of a 3×3 matrix's spectral norm, at most 1.1 times it.

    `d` holds the matrix D by rows. The norm is the fourth root of the norm of (DᵀD)², which is at
    most the Frobenius norm of (DᵀD)².
    """
    a, b, c = (d[0], d[3], d[6]), (d[1], d[4], d[7]), (d[2], d[5], d[8])
    xx, yy, zz = dot(a, a), dot(b, b), dot(c, c)
    xy, xz, yz = dot(a, b), dot(a, c), dot(b, c)
    p, q, r = (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)
    s, t, u = dot(p, p), dot(q, q), dot(r, r)
    v, w, x = dot(p, q), dot(p, r), dot(q, r)
    return np.sqrt(np.sqrt(np.sqrt(s * s + t * t + u * u + 2.0 * (v * v + w * w + x * x))))


@kernel
def _displacement(tree, before, after):
    """Return an upper bound (m) of how far a model's points move from one motion to another."""
    x, y, z = scaled(row(tree.centres, 0), tree.scale[0])
    d = (
        after[0] - before[0], after[1] - before[1], after[2] - before[2],
        after[3] - before[3], after[4] - before[4], after[5] - before[5],
        after[6] - before[6], after[7] - before[7], after[8] - before[8],
    )  # fmt: skip
    g = (
        d[0] * x + d[1] * y + d[2] * z + (after[9] - before[9]),
        d[3] * x + d[4] * y + d[5] * z + (after[10] - before[10]),
        d[6] * x + d[7] * y + d[8] * z + (after[11] - before[11]),
    )
    return np.sqrt(dot(g, g)) + _spectral(d) * radius_of(tree)


@inlined
def _slot_of(state, key):
    return slot(mixed(EMPTY_HASH, key), state.progress[0].far_slots)


@kernel
def _make_room(state):
    """Use twice as many slots if the search before opened more pairs than half of these.

    So short searches touch little memory. A pair stays in its slot or moves to that slot of the new
    half.
    """
    progress, far = state.progress[0], state.far
    slots = progress.far_slots
    if 2 * progress.bound_tests <= WIDTH * slots or 2 * slots > far.shape[0]:
        return
    progress.far_slots = 2 * slots
    for i in range(slots):
        known, new = far[i], far[i + slots]
        new.key = NO_KEY
        if known.key != NO_KEY and _slot_of(state, known.key) != i:
            new.key, new.reach = known.key, known.reach
            new.kept, new.least = known.kept, known.least
            known.key = NO_KEY


@kernel
def travel(tree_a, tree_b, state, before, slack):
    """Record how far the models moved relative to each other since the motions `before`.

    The displacement can be bounded in either model's frame. The bound from the smaller model's
    points is usually better, because they are nearer to the axis of rotation. `slack` is the error
    (m) of the motions before. If a model was refitted, forget all pairs.
    """
    progress, motions = state.progress[0], state.motions
    if progress.shape_a != tree_a.scale[REVISION] or progress.shape_b != tree_b.scale[REVISION]:
        progress.shape_a, progress.shape_b = tree_a.scale[REVISION], tree_b.scale[REVISION]
        for i in range(progress.far_slots):
            state.far[i].key = NO_KEY
    _make_room(state)
    if radius_of(tree_a) < radius_of(tree_b):
        distance = _displacement(tree_a, before[1], motions[1])
    else:
        distance = _displacement(tree_b, before[0], motions[0])
    distance += slack + progress.bound_slack
    progress.step = distance
    # Rounded up, so that the sum of many displacements is not too small.
    progress.travelled = (progress.travelled + distance) * (1.0 + TRAVEL_SHARE)


@inlined
def is_coherent(state):
    """Return whether the models moved so little since the last search that its bounds may serve."""
    return remembers(state) and state.progress[0].step < 2.0 * state.progress[0].limit


@inlined
def near_under(state, a, b):
    """Return which lanes under the pair of lanes a, b may be nearer than the limit.

    The lanes are bits as in `FAR.kept`: zero if everything is too far; SOME if nothing is known or
    what was known no longer holds. Returns also a lower bound of these lanes, metres.
    """
    key = a << 32 | b
    known = state.far[_slot_of(state, key)]
    travelled = state.progress[0].travelled
    far = known.reach - travelled >= state.progress[0].limit
    kept = known.kept if far and known.key == key else np.int64(SOME)
    return kept, known.least - travelled


@inlined
def open_again(tree_a, tree_b, state, a, b, bound, kept):
    """Open the lanes `kept` that `near_under` returned; `bound` (m) is a lower bound of each."""
    flip = kept >> _FLIP
    node = np.int64(tree_a.children[a] if flip else tree_b.children[b])
    lanes = kept & _LANES
    first = top = state.progress[0].open
    while lanes:
        child = node * WIDTH + lowest(lanes)
        lanes &= lanes - 1
        i, j = (child, b) if flip else (a, child)
        push(state.open, state, first, top, i, j, bound)
        top += 1
    state.progress[0].open = top


@inlined
def remember_far(state, a, b, flip):
    """Store what opening the pair of lanes a, b has proven; `flip` if the lane of a was opened."""
    progress = state.progress[0]
    if progress.proven > 0.0 and progress.kept != SOME:
        key = a << 32 | b
        known = state.far[_slot_of(state, key)]
        known.key = key
        known.kept = progress.kept | np.int64(flip) << _FLIP if progress.kept else 0
        known.reach = (progress.proven + progress.travelled) * (1.0 - TRAVEL_SHARE)
        least = (progress.least + progress.travelled) * (1.0 - TRAVEL_SHARE)
        known.least = least if progress.least > 0.0 else -np.inf
