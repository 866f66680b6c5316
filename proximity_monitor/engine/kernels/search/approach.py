"""From one pair of near points to a nearer one: the nearest point of b to that of a, and back.

A search starts from the elements that were nearest last time. Where the models have moved far
since, what the descent finds first is not yet the nearest either, and until it is, volumes are
opened that the true distance would have pruned: twice as many as need be, between spheres at random
poses. Alternating projections (Cheney and Goldstein 1959) go down to a local minimum in a few
rounds of two point queries, which are far cheaper than that. Whatever they find is the distance of
two elements, measured like any other. When a search does so stands here, how in `pairs`.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.memory import on_stack
from ..base.state import remembers
from ..elements.primitives import enough, has_leapt
from ..tree.layout import WIDTH
from .stubs import approach, guess, least_open, settle

APPROACH_STEPS = 64
"""Steps that a search takes as long for as this does, about: so a slice of steps is one of time."""

_QUERY, _ROUGH, _SHARE = 32, 6, 16 * WIDTH
"""Steps of a point query: what it has found by then will do; and where less than the exact distance
is asked for: down to the first leaf, and more in a long search: one step for so many bound tests.
"""
_ROUNDS, _WORTH = 4, 0.9
"""Most rounds; and the share of the distance to which one has to shorten it to have a successor."""
_FAR = 0.97
"""Of the distance that the search began with, or had after the last rounds: what it has to have
found before more of them pay. Along a path it never has, and none are made."""

_PATIENCE, _LONG, _LONGER = 24 * WIDTH, 96 * WIDTH, 8
"""Bound tests that a search with a tolerance makes first; the same where it began with points that
were the nearest of the search before; and how many times as many it makes before it tries again."""
_RENEWAL, _STALE = 200 * WIDTH, 0.05
"""Bound tests of searches with a tolerance until the nearest points are renewed (see `renew`); and
which share of the distance is tolerated at least.

Such a search finds none that are nearer by less than is tolerated. What the next begins with is too
far then by more and more, and with it the limit, so that it opens more volumes: along a path half
as many again for 10 %. To bring the points nearer takes some 30 openings.
"""
_WITHIN_REACH = 1.5
"""How many times as far as a clearance the nearest points may be and may soon be within it."""
_POOR, _POOR_SHARE, _PATH = 0.1, 0.25, 0.02
"""Share of the last distance by which the remembered elements are too far to begin with. With a
relative error it is this share of the error, as each part of it that the first distance takes up
keeps more volumes open; but no less than distances change from step to step of a path.
"""


@kernel
def begin_near(tree_a, tree_b, state, last):
    """Begin elsewhere where the remembered elements are much farther apart than when they were.

    After a leap to elsewhere they tell nothing, however near they are.

    `last` is the distance, metres, that the search before ended with.
    """
    progress = state.progress[0]
    progress.approached, progress.patience = np.inf, _PATIENCE
    if progress.limit < enough(progress):
        return
    near = (1.0 + max(progress.rel_err, _POOR)) * last
    leapt = has_leapt(tree_a, tree_b, state)
    if progress.distance <= near and not leapt:
        settle(state.waiting, tree_a, tree_b, state)
    poor = _POOR if progress.rel_err == 0.0 else max(_POOR_SHARE * progress.rel_err, _PATH)
    if leapt or progress.distance > (1.0 + poor) * last:
        guess(tree_a, tree_b, state)
    if progress.distance <= near:
        progress.approached, progress.patience = progress.distance, _LONG


@inlined
def renew(tree_a, tree_b, state):
    """Bring the nearest points of the search before nearer, if that is due."""
    progress = state.progress[0]
    stale = progress.rel_err * progress.distance + progress.abs_err >= _STALE * progress.distance
    if remembers(state) and stale and progress.spent >= _RENEWAL:
        progress.spent = 0
        approach(tree_a, tree_b, state, _QUERY, on_stack(WIDTH, np.float32(0.0)))


@inlined
def far_from_nearest(progress):
    """Whether the descent has found so much nearer points that `approach` is worth the time.

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
def come_nearer(tree_a, tree_b, state, found):
    """Improve the nearest points found so far, while that goes fast."""
    progress = state.progress[0]
    least = least_open(state.open, state)
    steps = _QUERY
    if progress.limit < _FAR * progress.distance:
        steps = min(max(_ROUGH, progress.bound_tests // _SHARE), _QUERY)
    for _ in range(_ROUNDS):
        before = progress.distance
        if before - progress.slack <= progress.stop or progress.limit <= least:
            break
        approach(tree_a, tree_b, state, steps, found)
        if not progress.distance < _WORTH * before:
            break
    progress.approached = progress.distance
    progress.patience = _LONGER * progress.bound_tests
