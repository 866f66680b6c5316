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

from ..base.jit import inlined, kernel
from ..base.memory import on_stack
from ..base.state import (
    APPROACHED,
    BOUND_SLACK,
    BOUND_TESTS,
    DISTANCE,
    PRIMITIVE_TESTS,
    SLACK,
    STOP,
    TRIANGLE_A,
    TRIANGLE_B,
    WEIGHTS_A,
    WEIGHTS_B,
)
from ..base.vectors import moved
from ..elements.primitives import corners, mixed, test_triangles
from ..inside.nearest import begin_nearest, nearest
from ..tree.layout import WIDTH

APPROACH_STEPS = 64
"""Steps that a search takes as long for as this does, about: so a slice of steps is one of time."""

_QUERY = 32
"""Steps of a point query: what it has found by then will do."""
_STACK = 512
"""A step replaces one entry of the stack by at most sixteen."""
_ROUNDS, _WORTH = 4, 0.98
"""Most rounds; and the share of the distance to which one has to shorten it to have a successor."""
_FAR = 0.97
"""Of the distance that the search began with, or had after the last rounds: what it has to have
found before more of them pay. Along a path it never has, and none are made."""


@kernel
def _near(tree, p, nearby, state, stack, bounds, found):
    """A triangle near p, a point in the tree's frame."""
    distance, nearby, top = begin_nearest(tree, p, nearby, stack, bounds)
    slack = state.reals[BOUND_SLACK]
    _, nearby, _, left = nearest(
        tree, p, distance, nearby, top, slack, 0.0, stack, bounds, found, _QUERY
    )
    state.counts[BOUND_TESTS] += WIDTH * (_QUERY - left)
    return nearby


@inlined
def far_from_nearest(reals):
    """Whether the descent has found so much nearer points that `approach` is worth its time."""
    return reals[DISTANCE] < _FAR * reals[APPROACHED]


@kernel
def approach(tree_a, tree_b, state, found):
    """Improve the nearest points found so far, while that goes fast."""
    reals, counts, motions = state.reals, state.counts, state.motions
    stack, bounds = on_stack(_STACK, np.int32(0)), on_stack(_STACK, 0.0)
    for _ in range(_ROUNDS):
        before = reals[DISTANCE]
        if before - reals[SLACK] <= reals[STOP]:
            break
        ta, tb = counts[TRIANGLE_A], counts[TRIANGLE_B]
        p = mixed(corners(tree_a.triangles, ta), reals[WEIGHTS_A : WEIGHTS_A + 3])
        other = _near(tree_b, moved(motions[1], p), tb, state, stack, bounds, found)
        if other != tb:
            counts[PRIMITIVE_TESTS] += 1
            test_triangles(tree_a, tree_b, state, ta, other, 0.0)
        ta, tb = counts[TRIANGLE_A], counts[TRIANGLE_B]
        q = mixed(corners(tree_b.triangles, tb), reals[WEIGHTS_B : WEIGHTS_B + 3])
        other = _near(tree_a, moved(motions[0], q), ta, state, stack, bounds, found)
        if other != ta:
            counts[PRIMITIVE_TESTS] += 1
            test_triangles(tree_a, tree_b, state, other, tb, 0.0)
        if not reals[DISTANCE] < _WORTH * before:
            break
    reals[APPROACHED] = reals[DISTANCE]
