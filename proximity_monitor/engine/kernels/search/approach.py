"""From one pair of near points to a nearer one: the nearest point of b to that of a, and back.

A search starts from the elements that were nearest last time. If the models have moved far since
then, what the descent finds first is not the nearest either. Until the descent finds the nearest
points, it opens volumes that the true distance would have pruned: twice as many as necessary, for
spheres at random poses. Alternating projections (Cheney and Goldstein 1959) descend to a local
minimum in a few rounds of two point queries, which are far cheaper than those openings. Each
distance that they find is measured between two elements, like any other. This file decides when a
search does this; `pairs` implements how.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.memory import on_stack
from ..base.state import remembers
from ..elements.primitives import LEAP, enough, has_leapt
from ..tree.layout import WIDTH
from .stubs import approach, guess, least_open, settle

APPROACH_STEPS = 64
"""Steps that a call of `come_nearer` counts as. It takes about as long as these, so that a slice of
steps is a slice of time."""

_QUERY = 32
"""Most steps of a point query; what it has found by then is good enough."""

_ROUNDS, _WORTH = 4, 0.9
"""Most rounds; and the share of the distance below which a round must come to be followed by
another."""

_FAR, _EXACT_FAR = 0.97, 0.75
"""More rounds pay once the search has found a distance below this share of the one that it began
with, or had after the last rounds; the second share is for exact searches of elements that are
measured as a whole. Along a path this is rare, and so are rounds."""

_ASKED = 0.97
"""Less than the exact distance is asked for if the limit is below this share of the distance."""

LONG = 512 * WIDTH
"""A search with a tolerance is long after so many bound tests."""

_RENEWAL, _STALE = 200 * WIDTH, 0.05
"""Bound tests of searches with a tolerance until the nearest points are renewed (see `_renew`); and
the least tolerance, as a share of the distance, for which this is done.

Such a search finds no points that are nearer by less than the tolerance. So the points with which
the next search begins are too far by more and more, and so is the limit, and it opens more volumes:
along a path half as many again for a tolerance of 10 %. Renewing the points counts for about 30
openings.
"""
_NEAR = 0.1
"""The remembered elements are as near as before if their distance exceeds the last distance by no
more than this share of it, or by the relative error of the search if that is larger."""

_POOR, _POOR_SHARE, _PATH = 2.0, 0.5, 0.02
"""The remembered elements are too far to begin with if their distance exceeds the last distance by
more than a share of it. In an exact search of elements that are measured as a whole the share is
_POOR: even three times the distance costs fewer openings than a guess takes time. With a relative
error it is _POOR_SHARE of that error, because whatever part of the error the first distance uses up
keeps more volumes open; but at least _PATH, by which distances change from step to step of a path.
In all other searches it is _NEAR.
"""

_EXACT_LEAP = 0.5
"""`LEAP` of exact searches of elements that are measured as a whole, for the same reason."""


@inlined
def _is_exact(progress):
    """Return whether the exact distance is asked for, of elements that are measured as a whole."""
    return progress.rel_err + progress.abs_err == 0.0


@inlined
def _renew(tree_a, tree_b, state):
    """Bring the points to begin with nearer, if this is due (see _RENEWAL)."""
    progress = state.progress[0]
    stale = progress.rel_err * progress.distance + progress.abs_err >= _STALE * progress.distance
    if remembers(state) and stale and progress.spent >= _RENEWAL:
        progress.spent = 0
        approach(tree_a, tree_b, state, _QUERY, on_stack(WIDTH, np.float32(0.0)))


@kernel
def begin_near(tree_a, tree_b, state, last):
    """Begin with other elements if the remembered ones are now much farther apart than before.

    After a leap of the models, others may be nearer, however near these are. Then the first limit
    is too large, too, and pairs of volumes near it are put off (see stack.py). `last` is the
    distance (m) with which the search before ended.
    """
    progress = state.progress[0]
    progress.approached = np.inf
    if progress.limit < enough(progress):
        return
    near = (1.0 + max(progress.rel_err, _NEAR)) * last
    stays = progress.distance <= near
    exact = _is_exact(progress)
    leapt = has_leapt(tree_a, tree_b, state, _EXACT_LEAP if exact else LEAP)
    if stays and not leapt:
        settle(state.waiting, tree_a, tree_b, state)
    poor = _POOR if exact else _NEAR
    if progress.rel_err > 0.0:
        poor = max(_POOR_SHARE * progress.rel_err, _PATH)
    remembered = progress.distance
    if leapt or remembered > (1.0 + poor) * last:
        guess(tree_a, tree_b, state)
    if stays:
        if progress.distance == remembered:  # else the guess is a new beginning
            _renew(tree_a, tree_b, state)
        progress.approached = progress.distance
    if leapt or progress.distance > near or not remembers(state):
        progress.put_off = 0


@inlined
def far_from_nearest(progress):
    """Return whether the descent has found so much nearer points that `approach` is worth the time.

    If less than the exact distance is asked for, rounds pay in long searches only; and never if the
    question is whether anything is within a clearance.
    """
    distance, limit = progress.distance, progress.limit
    far = _EXACT_FAR if _is_exact(progress) else _FAR
    if not distance < far * progress.approached:
        return False
    if limit < _ASKED * distance:
        return progress.bound_tests >= LONG and limit >= enough(progress)
    return True


@kernel
def come_nearer(tree_a, tree_b, state, found):
    """Improve the nearest points found so far, in rounds of `approach`, while rounds gain enough.

    `found` is scratch for sixteen float32.
    """
    progress = state.progress[0]
    least = least_open(state.open, state)
    for _ in range(_ROUNDS):
        before = progress.distance
        if before - progress.slack <= progress.stop or progress.limit <= least:
            break
        approach(tree_a, tree_b, state, _QUERY, found)
        if not progress.distance < _WORTH * before:
            break
    progress.approached = progress.distance
