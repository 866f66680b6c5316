"""Pairs of volumes that were too far, and still are as long as the models have moved little since.

From one moment to the next a search mostly opens the same pairs of volumes, and finds little that
is near under them. What it proved there, that nothing is nearer than some bound but for what is
under some lanes, is kept with how far the models had moved by then. Later that bound holds less
what they have moved since, and where it is still beyond the limit, the pair is not bounded anew: it
is done with, or those lanes are open at once. Each search remembers its nearest triangles
separately (Larsen et al. 1999, section 6.2).
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
"""The bits of `kept` that are lanes; and the one that tells that these are of tree a."""


@kernel
def _spectral(d):
    """No less than the spectral norm of a 3×3 matrix, given by rows, and 1.1 times it at most.

    It is the fourth root of that of (DᵀD)², which is no larger than its Frobenius norm.
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
    """How far any point of a model moves at most, metres, from one motion to another."""
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


@kernel
def travel(tree_a, tree_b, state, before, slack):
    """Take note of how far the models moved relative to each other since the motions `before`.

    It is as much seen from either model; the smaller one turns less far out, so its bound is better
    as a rule. `slack` is what the motions before erred by. Of a model that was refitted nothing is
    known.
    """
    progress, motions = state.progress[0], state.motions
    if progress.shape_a != tree_a.scale[REVISION] or progress.shape_b != tree_b.scale[REVISION]:
        progress.shape_a, progress.shape_b = tree_a.scale[REVISION], tree_b.scale[REVISION]
        for i in range(state.far.shape[0]):
            state.far[i].key = NO_KEY
    if radius_of(tree_a) < radius_of(tree_b):
        distance = _displacement(tree_a, before[1], motions[1])
    else:
        distance = _displacement(tree_b, before[0], motions[0])
    distance += slack + progress.bound_slack
    progress.step = distance
    # Rounded up, so that no sum of many becomes too small.
    progress.travelled = (progress.travelled + distance) * (1.0 + TRAVEL_SHARE)


@inlined
def is_coherent(state):
    """Whether the models have moved so little since the last search that its bounds may serve."""
    return remembers(state) and state.progress[0].step < 2.0 * state.progress[0].limit


@inlined
def near_under(state, a, b):
    """The lanes below the lanes a and b that may be nearer than the limit, as far as is known.

    None, zero, where all is too far; SOME where nothing is known, or no longer. Returns also a
    bound of them, metres.
    """
    key = a << 32 | b
    known = state.far[slot(mixed(EMPTY_HASH, key), state.far.shape[0])]
    travelled = state.progress[0].travelled
    far = known.reach - travelled >= state.progress[0].limit
    kept = known.kept if far and known.key == key else np.int64(SOME)
    return kept, known.least - travelled


@inlined
def open_again(tree_a, tree_b, state, a, b, bound, kept):
    """Open those lanes, which `near_under` tells; all of them are bounded by `bound`, metres."""
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
    """Keep what the opening of the lanes a and b has proven; `flip` where that was of a."""
    progress = state.progress[0]
    if progress.proven > 0.0 and progress.kept != SOME:
        key = a << 32 | b
        known = state.far[slot(mixed(EMPTY_HASH, key), state.far.shape[0])]
        known.key = key
        known.kept = progress.kept | np.int64(flip) << _FLIP if progress.kept else 0
        known.reach = (progress.proven + progress.travelled) * (1.0 - TRAVEL_SHARE)
        least = (progress.least + progress.travelled) * (1.0 - TRAVEL_SHARE)
        known.least = least if progress.least > 0.0 else -np.inf
