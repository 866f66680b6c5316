"""On which side of a surface a point lies and how far from it: in slices, and remembered.

Let f(x) be the distance of x to a surface, positive inside and negative outside. Between two points
of different sign lies the surface, if it is closed, so f changes by no more than x moves. Where it
is not, only |f| does, and the sign holds as far as it is known to (see angles.py). What was found
for a point therefore bounds f for the same point of a body that has moved since, which serves the
next question. Points are named by an integer, their `key`.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np
from numba import uint64

from ..base.jit import kernel
from ..base.vectors import dot, sub
from .angles import side_of
from .nearest import begin_nearest, nearest
from .solids import WHOLE

Probe = namedtuple("Probe", "best counts stack bounds keys memos")
"""What a test of points needs. best (1,) metres: the distance so far; counts by the indices below;
stack (int32) and bounds: the volumes that the descent has still to look at; keys (int64, MEMOS) and
memos (MEMOS, 6): for remembered points where they were, in the other model's frame, f there, how
far that may be wrong, and how far around them all points are on the same side, all in metres.
"""

TOP, TESTS, NEAR, COUNTS = 0, 1, 2, 4
"""Counts: height of the stack, 0 where no test is under way; points tested; the triangle of either
model that was nearest last, in tree order."""

MEMOS = 1 << 12
"""Points that are remembered, a power of two; a search tests some hundred. Of two points that share
a place the later one stays."""

NOBODY = -(2**63)
"""No point's key."""


@kernel
def length(v):
    """Norm of a vector."""
    return np.sqrt(dot(v, v))


@kernel
def _place(key):
    return np.int64((uint64(key) * uint64(0x9E3779B97F4A7C15)) >> uint64(52))


@kernel
def remembered(probe, region, p, key, slack):
    """Bounds of f at the point p from what its test found elsewhere: (error, f, side, clear).

    The error is infinite where nothing is remembered; side is 1 inside, -1 outside, 0 unknown, and
    that of all points within `clear`; where it is unknown and the surface open, f is its magnitude.
    Both places are images that rounding moved by less than the slack of their time.
    """
    at = _place(key)
    if probe.keys[at] != key:
        return np.inf, 0.0, 0, 0.0
    memos = probe.memos
    away = length(sub(p, (memos[at, 0], memos[at, 1], memos[at, 2]))) + 2.0 * slack
    value, error, clear = memos[at, 3], memos[at, 4] + away, memos[at, 5] - away
    if clear > 0.0:
        return error, value, 1 if value > 0.0 else -1, clear
    return error, value if region.inside == WHOLE else abs(value), 0, 0.0


@kernel
def _remember(probe, p, key, value, error, clear):
    at = _place(key)
    probe.keys[at] = key
    memos = probe.memos
    memos[at, 0], memos[at, 1], memos[at, 2] = p
    memos[at, 3], memos[at, 4], memos[at, 5] = value, error, clear


@kernel
def start(probe, other, p, model):
    """Begin the test of a point p of `model`, in the frame of the other model, metres."""
    counts = probe.counts
    near = NEAR + 1 - model
    probe.best[0], counts[near], counts[TOP] = begin_nearest(
        other, p, counts[near], probe.stack, probe.bounds
    )


@kernel
def descend(probe, other, p, model, slack, spare, found, steps):
    """Go on with a test, at most `steps` steps; returns how many are left.

    Where the stack is empty then, the distance lies between probe.best less `spare` and
    probe.best, right to `slack`.
    """
    counts = probe.counts
    near = NEAR + 1 - model
    probe.best[0], counts[near], counts[TOP], steps = nearest(
        other, p, probe.best[0], counts[near], counts[TOP], slack, spare, probe.stack,
        probe.bounds, found, steps,
    )  # fmt: skip
    return steps


@kernel
def result(probe, other, region, p, key, slack, spare, side, found):
    """The finding of a test that is over: (error, f, side, clear), as `remembered` returns it.

    `side` may be known beforehand. The side of p is that of the exact point too, of which p is the
    rounded image.
    """
    probe.counts[TESTS] += 1
    value, error = probe.best[0] - 0.5 * spare, 0.5 * spare + slack
    clear = value - error
    if clear <= slack:
        return error, value, 0, 0.0
    if side == 0 or region.inside != WHOLE:
        side, clear = side_of(other, region, p, clear, slack, probe.stack, found)
        if side == 0:
            return error, value, 0, 0.0
    value *= side
    _remember(probe, p, key, value, error + 2.0 * slack, clear - 2.0 * slack)
    return error, value, side, clear
