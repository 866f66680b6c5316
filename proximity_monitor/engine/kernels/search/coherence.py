"""Pairs of volumes that were too far, and still are as long as the models have moved little since.

From one moment to the next a search mostly opens the same pairs of volumes, and finds nothing under
many of them. What it proved there, that nothing is nearer than some bound, is kept with how far the
models had moved by then. Later that bound holds less what they have moved since, and where it is
still beyond the limit, the pair is not opened. Each search remembers its nearest triangles
separately (Larsen et al. 1999, section 6.2).
"""

from __future__ import annotations

import numpy as np

from ..base.hashing import EMPTY_HASH, mixed, slot
from ..base.jit import inlined, kernel
from ..base.rounding import TRAVEL_SHARE
from ..base.trees import REVISION
from ..base.vectors import dot, scaled
from ..tree.layout import radius_of, row

_NONE = -1


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
        for i in range(state.keys.shape[0]):
            state.keys[i] = _NONE
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
    return state.keys.shape[0] > 0 and state.progress[0].step < 2.0 * state.progress[0].limit


@inlined
def still_far(state, a, b):
    """Whether it is known that nothing under the lanes a and b is nearer than the limit."""
    key = a << 32 | b
    i = slot(mixed(EMPTY_HASH, key), state.keys.shape[0])
    far = state.reaches[i] - state.progress[0].travelled >= state.progress[0].limit
    return far and state.keys[i] == key


@inlined
def remember_far(state, a, b, bound):
    """Keep the bound, metres, of all that is under the lanes a and b."""
    if bound > 0.0:
        key = a << 32 | b
        i = slot(mixed(EMPTY_HASH, key), state.keys.shape[0])
        state.keys[i] = key
        state.reaches[i] = (bound + state.progress[0].travelled) * (1.0 - TRAVEL_SHARE)
