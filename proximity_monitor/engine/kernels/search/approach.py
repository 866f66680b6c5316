"""From one pair of near points to a nearer one: the nearest point of b to that of a, and back.

A search starts from the triangles that were nearest last time. Where the models have moved far
since, what the descent finds first is not yet the nearest either, and until it is, volumes are
opened that the true distance would have pruned: twice as many as need be, between spheres at random
poses. Alternating projections (Cheney and Goldstein 1959) go down to a local minimum in a few
rounds of two point queries, which are far cheaper than that. Whatever they find is the distance of
two triangles, tested like any other.
"""

from __future__ import annotations

import numpy as np
from numba import uint64

from ..base.jit import inlined, kernel
from ..base.lanes import lowest, not_above, smallest
from ..base.memory import on_stack
from ..base.vectors import along, moved, scaled, sub
from ..elements.primitives import corners, enough, mixed, test_triangles
from ..inside.nearest import begin_nearest, nearest, point_bounds, point_triangle
from ..tree.layout import STRIDE, WIDTH, first_of, row
from .stubs import least_open

APPROACH_STEPS = 64
"""Steps that a search takes as long for as this does, about: so a slice of steps is one of time."""

_QUERY, _ROUGH, _SHARE = 32, 6, 16 * WIDTH
"""Steps of a point query: what it has found by then will do; and where less than the exact distance
is asked for: down to the first leaf, and more in a long search: one step for so many bound tests.
"""
_STACK = 512
"""A step replaces one entry of the stack by at most sixteen."""
_ROUNDS, _WORTH = 4, 0.9
"""Most rounds; and the share of the distance to which one has to shorten it to have a successor."""
_FAR = 0.97
"""Of the distance that the search began with, or had after the last rounds: what it has to have
found before more of them pay. Along a path it never has, and none are made."""

_PATIENCE, _LONG, _LONGER = 24 * WIDTH, 96 * WIDTH, 8
"""Bound tests that a search with a tolerance makes first; the same where it began with points that
were the nearest of the search before; and how many times as many it makes before it tries again."""
_WITHIN_REACH = 1.5
"""How many times as far as a clearance the nearest points may be and may soon be within it."""
_POOR = 0.1
"""Share of the last distance by which the remembered triangles are too far to begin with."""
_ALL = (1 << WIDTH) - 1
_TINY = np.float32(1e-30)


@kernel
def _near(tree, p, nearby, state, steps, stack, bounds, found):
    """A triangle near p, a point in the tree's frame."""
    distance, nearby, top = begin_nearest(tree, p, nearby, stack, bounds)
    slack = state.progress[0].bound_slack
    _, nearby, _, left = nearest(
        tree, p, distance, nearby, top, slack, 0.0, stack, bounds, found, steps
    )
    state.progress[0].bound_tests += WIDTH * (steps - left)
    return nearby


@inlined
def far_from_nearest(progress):
    """Whether the descent has found so much nearer points that `approach` is worth its time.

    Where less than the exact distance is asked for, a few openings often answer: they come first.
    But points a little nearer may save most of a long search, so it is tried again and again.
    Whether something is within a clearance, which the limit is then, is approached from near it.
    """
    distance, limit = progress.distance, progress.limit
    if limit >= _FAR * distance:
        return distance < _FAR * progress.approached
    return progress.bound_tests >= progress.patience and (
        distance < _WITHIN_REACH * limit or limit >= enough(progress)
    )


@kernel
def _walk(tree, p, found):
    """The first triangle of the leaf where the nearest volume to p, level by level, leads to."""
    child = tree.children[0]
    while child >= 0:
        x = np.float32(p[0] * tree.scale[1] - tree.centres[child, 0])
        y = np.float32(p[1] * tree.scale[1] - tree.centres[child, 1])
        z = np.float32(p[2] * tree.scale[1] - tree.centres[child, 2])
        point_bounds(tree.nodes, uint64(child * STRIDE), x, y, z, np.float32(0.0), found)
        least = smallest(found, 0, _ALL)
        nearest_lanes = not_above(found, 0, least + np.float32(1e-6) * (abs(least) + _TINY))
        # Where float32 does not serve, the first lane, which is always used, is as good as any.
        child = tree.children[child * WIDTH + (lowest(nearest_lanes) if least < 1e29 else 0)]
    return first_of(child)


@kernel
def _point_near(tree, t, p):
    """The point of a triangle that is nearest to p."""
    a, b, c = corners(tree.triangles, t)
    _, v, w = point_triangle(p, a, b, c)
    return along(along(a, sub(b, a), v), sub(c, a), w)


@kernel
def guess(tree_a, tree_b, state, last):
    """Begin elsewhere where the remembered triangles are much farther apart than when they were.

    `last` is the distance that the search before ended with. The nearest triangle of a to the
    middle of b, and that of b to it, as far as one walk down each hierarchy tells, are nearer then.
    Returns from where to approach.
    """
    progress, motions = state.progress[0], state.motions
    near = (1.0 + max(progress.rel_err, _POOR)) * last
    progress.patience = _PATIENCE
    if progress.limit < enough(progress):
        return np.inf
    if progress.distance <= near:
        progress.patience = _LONG
        return progress.distance
    found = on_stack(WIDTH, np.float32(0.0))
    middle = scaled(row(tree_b.centres, 0), tree_b.scale[0])
    middle = moved(motions[0], middle)
    ta = _walk(tree_a, middle, found)
    p = moved(motions[1], _point_near(tree_a, ta, middle))
    tb = _walk(tree_b, p, found)
    progress.primitive_tests += 1
    test_triangles(tree_a, tree_b, state, ta, tb, 0.0)
    return np.inf


@kernel
def approach(tree_a, tree_b, state, found):
    """Improve the nearest points found so far, while that goes fast."""
    progress, motions = state.progress[0], state.motions
    stack, bounds = on_stack(_STACK, np.int32(0)), on_stack(_STACK, 0.0)
    least = least_open(state.open, state)
    steps = _QUERY
    if progress.limit < _FAR * progress.distance:
        steps = min(max(_ROUGH, progress.bound_tests // _SHARE), _QUERY)
    for _ in range(_ROUNDS):
        before = progress.distance
        if before - progress.slack <= progress.stop or progress.limit <= least:
            break
        ta, tb = progress.element_a, progress.element_b
        p = mixed(corners(tree_a.triangles, ta), progress.weights_a)
        other = _near(tree_b, moved(motions[1], p), tb, state, steps, stack, bounds, found)
        if other != tb:
            progress.primitive_tests += 1
            test_triangles(tree_a, tree_b, state, ta, other, 0.0)
        ta, tb = progress.element_a, progress.element_b
        q = mixed(corners(tree_b.triangles, tb), progress.weights_b)
        other = _near(tree_a, moved(motions[0], q), ta, state, steps, stack, bounds, found)
        if other != ta:
            progress.primitive_tests += 1
            test_triangles(tree_a, tree_b, state, other, tb, 0.0)
        if not progress.distance < _WORTH * before:
            break
    progress.approached = progress.distance
    progress.patience = _LONGER * progress.bound_tests
