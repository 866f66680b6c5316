"""How often a solid of revolution's profile winds around a point of the half-plane.

If a part of the profile lies in a convex region without the point, it turns around the point by as
much as its chord does. So parts are divided until their capsules miss the point. A capsule
surrounds the chord by as much as the part is far from it. Then the angles of the chords are added
up. A profile from axis to axis is closed by a path beyond the axis, where no point lies. That path
turns by the difference of the directions to its ends, seen backwards. The sum is a whole number of
turns, up to rounding.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.jit import inlined, kernel
from ..base.memory import on_stack, table_on_stack
from ..base.trees import NONE
from ..inside.winding import UNKNOWN
from .meridian import chord_of, from_chord, from_segment, thickness

_STACK = 128
"""Room for arcs that wait, twice the depth of a tree, and for waiting parts of one arc."""

_PARTS = 64
"""Parts that an arc is divided into, at most. For a point too near to tell by these, the answer is
UNKNOWN."""

_WHOLE = 0.01
"""Share of a turn by which the sum may be off a whole number of turns; rounding does far less."""


@inlined
def _turn(x0, z0, x1, z1):
    """Return the angle from one vector to another, radians, -pi to pi."""
    return math.atan2(x0 * z1 - z0 * x1, x0 * x1 + z0 * z1)


@inlined
def _beyond(x, z):
    """Return the reversed direction of a vector to beyond the axis, from -pi / 2 to pi / 2."""
    return math.atan2(-z, max(-x, 0.0))


@kernel
def _turn_of_part(curve, low, high, rho, z, margin):
    """Return whether the angle by which an arc's part turns around a point is known, and it."""
    rows = table_on_stack(16, 3, 0.0)
    lows, highs = on_stack(_STACK, 0.0), on_stack(_STACK, 0.0)
    lows[0], highs[0] = low, high
    top, looks, angle = 1, 0, 0.0
    while top > 0:
        top -= 1
        low, high = lows[top], highs[top]
        x0, z0, x1, z1, far = chord_of(curve, low, high, rows)
        if from_segment(rho, z, x0, z0, x1, z1) > far + margin:
            angle += _turn(x0 - rho, z0 - z, x1 - rho, z1 - z)
            continue
        looks += 1
        middle = 0.5 * (low + high)
        if looks > _PARTS or not low < middle < high:
            return False, angle
        lows[top], highs[top] = low, middle
        lows[top + 1], highs[top + 1] = middle, high
        top += 2
    return True, angle


@inlined
def _ends(arcs, i):
    """Return where the part of the profile under an arc begins and ends."""
    first = last = i
    while arcs[first].curve == NONE:
        first = np.int64(arcs[first].child)
    while arcs[last].curve == NONE:
        last = np.int64(arcs[last].child) + 1
    one, other = arcs[first], arcs[last]
    return (
        one.middle[0] - one.half[0], one.middle[1] - one.half[1],
        other.middle[0] + other.half[0], other.middle[1] + other.half[1],
    )  # fmt: skip


@kernel
def turns_around(tree, rho, z, margin, joints):
    """Return how often the profile winds around (rho, z), metres, and all within `margin` of it.

    UNKNOWN if the profile may be that near, or is too near to tell. The profile's pieces are no
    farther than `joints` apart where they meet; `margin` includes that.
    """
    arcs, curves = tree.arcs, tree.curves
    stack = on_stack(_STACK, np.int32(0))
    stack[0] = 0
    top, angle = 1, 0.0
    while top > 0:
        top -= 1
        i = np.int64(stack[top])
        arc = arcs[i]
        if from_chord(arc, rho, z) > thickness(arc) + margin:
            x0, z0, x1, z1 = _ends(arcs, i)
            angle += _turn(x0 - rho, z0 - z, x1 - rho, z1 - z)
        elif arc.child != NONE and top + 2 <= _STACK:
            stack[top], stack[top + 1] = arc.child, arc.child + 1
            top += 2
        else:
            known, more = _turn_of_part(curves[arc.curve], arc.low, arc.high, rho, z, margin)
            if not known:
                return UNKNOWN
            angle += more
    x0, z0, x1, z1 = _ends(arcs, 0)
    x0, z0, x1, z1 = x0 - rho, z0 - z, x1 - rho, z1 - z
    if max(abs(x0 - x1), abs(z0 - z1)) > joints:
        angle += _beyond(x0, z0) - _beyond(x1, z1)
    else:
        angle += _turn(x1, z1, x0, z0)
    turns = angle / (2.0 * math.pi)
    whole = np.floor(turns + 0.5)
    if not abs(turns - whole) < _WHOLE:
        return UNKNOWN
    return np.int64(whole)
