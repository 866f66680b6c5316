"""On which side of a closed surface a point lies and how far from it: in slices, and remembered.

Let f(x) be the distance of x to a closed surface, positive inside and negative outside. Between two
points of different sign lies the surface, so f changes by no more than x moves. What was found for
a point therefore bounds f for the same point of a body that has moved since, which serves the next
question. Points are named by an integer, their `key`.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np
from numba import float32, uint64

from ..tolerances import SINGLE_LIMIT, SINGLE_MARGIN
from .jit import kernel
from .lanes import lowest, not_above
from .nearest import point_bounds, point_triangle
from .primitives import corners
from .vectors import dot, sub
from .volumes import STRIDE, WIDTH
from .winding import UNKNOWN, winding_number

Probe = namedtuple("Probe", "best counts stack bounds keys memos")
"""What a test of points needs. best (1,) metres: the distance so far; counts by the indices below;
stack (int32) and bounds: the volumes that the descent has still to look at; keys (int64, MEMOS) and
memos (MEMOS, 5): for remembered points where they were, in the other model's frame, f there, and
how far that may be wrong, all in metres.
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
def remembered(probe, p, key, slack):
    """Bounds of f at the point p from what its test found elsewhere: (error, f, side).

    The error is infinite where nothing is remembered; side is 1 inside, -1 outside, 0 unknown. Both
    places are images that rounding moved by less than the slack of their time.
    """
    at = _place(key)
    if probe.keys[at] != key:
        return np.inf, 0.0, 0
    memos = probe.memos
    away = length(sub(p, (memos[at, 0], memos[at, 1], memos[at, 2])))
    value, error = memos[at, 3], memos[at, 4] + away + 2.0 * slack
    if abs(value) <= error:
        return error, value, 0
    return error, value, 1 if value > 0.0 else -1


@kernel
def _remember(probe, p, key, value, error):
    at = _place(key)
    probe.keys[at] = key
    memos = probe.memos
    memos[at, 0], memos[at, 1], memos[at, 2] = p
    memos[at, 3], memos[at, 4] = value, error


@kernel
def start(probe, other, p, model):
    """Begin the test of a point p of `model`, in the frame of the other model, metres."""
    a, b, c = corners(other.triangles, probe.counts[NEAR + 1 - model])
    probe.best[0] = np.sqrt(point_triangle(p, a, b, c)[0])
    probe.stack[0], probe.bounds[0] = 0, -1.0
    probe.counts[TOP] = 1


@kernel
def descend(probe, other, p, model, slack, spare, found, steps):
    """Go on with a test, at most `steps` steps; returns how many are left.

    Where the stack is empty then, the distance lies between probe.best less `spare` and
    probe.best, right to `slack`.
    """
    counts, stack, bounds = probe.counts, probe.stack, probe.bounds
    best, top = probe.best[0], counts[TOP]
    unit = other.scale[0]
    while top > 0 and steps > 0:
        top -= 1
        if bounds[top] >= best - max(slack, spare):
            continue
        steps -= 1
        child = stack[top]
        if child < 0:
            a, b, c = corners(other.triangles, ~child)
            distance = np.sqrt(point_triangle(p, a, b, c)[0])
            if distance < best:
                best, counts[NEAR + 1 - model] = distance, ~child
            continue
        x = p[0] / unit - other.centres[child, 0]
        y = p[1] / unit - other.centres[child, 1]
        z = p[2] / unit - other.centres[child, 2]
        size = abs(x) + abs(y) + abs(z) + other.centres[child, 3]
        if size + slack / unit < SINGLE_LIMIT:
            margin = float32(SINGLE_MARGIN * size + slack / unit)
            point_bounds(
                other.nodes, uint64(child * STRIDE), float32(x), float32(y), float32(z), margin,
                found,
            )  # fmt: skip
        else:
            # Too far away for float32, or too small: then every lane is as good as the next.
            for k in range(WIDTH):
                empty = other.nodes[uint64(child * STRIDE + 9 * WIDTH + k)] < 0.0
                found[k] = float32(1e30) if empty else float32(-1.0)
        first = top
        survivors = not_above(found, float32(min(best / unit * (1.0 + 1e-6), 1e29)))
        while survivors:
            k = lowest(survivors)
            survivors &= survivors - 1
            bound = found[k] * unit
            at = top
            while at > first and bounds[at - 1] < bound:
                bounds[at], stack[at] = bounds[at - 1], stack[at - 1]
                at -= 1
            bounds[at], stack[at] = bound, other.children[child * WIDTH + k]
            top += 1
    probe.best[0], counts[TOP] = best, top
    return steps


@kernel
def result(probe, other, p, key, slack, spare, side, found):
    """The finding of a test that is over: (error, f, side), as `remembered` returns it.

    `side` may be known beforehand. The side of p is that of the exact point too, of which p is the
    rounded image.
    """
    probe.counts[TESTS] += 1
    value, error = probe.best[0] - 0.5 * spare, 0.5 * spare + slack
    if value - error <= slack:
        return error, value, 0
    if side == 0:
        winding = winding_number(other, p, slack, probe.stack, found)
        if winding == UNKNOWN:
            return error, value, 0
        side = -1 if winding == 0 else 1
    value *= side
    _remember(probe, p, key, value, error + 2.0 * slack)
    return error, value, side
