"""The point of a profile that is nearest to a given one, as near to it as is asked for.

Fat arcs dismiss what is farther. Of an arc that has no halves Newton's method finds the nearest
point, and a bound of the second order tells that no other one is nearer by more than is tolerated.

Let D(s) be the way from the point p to C(s), n a unit vector along it at a parameter t, and tau
what D extends beside n. Where |D| <= U,

    |D| >= n . D + tau² / 2 U,

because |D| - n . D = tau² / (|D| + n . D); and where |D| > U >= |D(t)| there is nothing to prove.
With x = s - t, n . D is n . (D(t) + C' x + C'' x² / 2) but for l3 |x|³ / 6, and tau is tau(t) + b x
but for l2 x² / 2, where l2 and l3 limit the second and the third derivative. So with |x| <= w

    |D| >= |D(t)| + g x + m x² / 2 - 2 |tau(t)| (|b| w + l2 w² / 2) / 2 U,
    g = n . C',  m = n . C'' + b² / U - (l3 / 3 + |b| l2 / U) w,

whose minimum over the arc's part is known. U is no less than l1 w, so that rounding, which is what
makes tau(t) differ from 0, is not magnified where the point is near.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.memory import on_stack, table_on_stack
from ..base.trees import NONE
from .certificate import LOST, SPARE
from .meridian import chord_of, from_arc, from_chord, from_segment, thickness
from .profile import jet_of, put_part

_STACK = 128
"""Arcs that may wait: twice as many as a tree is deep; and parts of one."""

_NEWTONS, _PARTS = 8, 96
"""Steps of Newton's method, and parts that an arc is divided into where nothing else tells."""

_CURVED, _SHORTER, _NOTHING = 1e-6, 0.25, 1e-17
"""Share of that of a straight curve from which on the distance curves upwards: it is small near the
centre of an arc. By what a step is shortened that leads no nearer; and which share of the square of
the distance is no gain."""


@inlined
def enough(distance, share, spare):
    """The distance from which on nothing is looked for, metres."""
    return distance - max(share * distance, spare)


@kernel
def _newton(curve, low, high, rho, z, t):
    """Come nearer from t on a part of a piece: t, and the distance there."""
    best, best_t, step = np.inf, t, 0.0
    for _ in range(_NEWTONS):
        (x, y), (x1, y1), (x2, y2) = jet_of(curve, t)
        x, y = x - rho, y - z
        far = x * x + y * y
        if far < best:
            best, best_t = far, t
            slope, bend = x * x1 + y * y1, x1 * x1 + y1 * y1
            whole = bend + x * x2 + y * y2
            # Where the distance does not curve upwards, as if the curve were straight.
            bend = whole if whole > _CURVED * bend else bend
            if not slope * slope > _NOTHING * far * bend:
                break
            step = -slope / bend
        else:
            step *= _SHORTER
        t = min(max(best_t + step, low), high)
        if t == best_t:
            break
    return best_t, np.sqrt(best)


@kernel
def _least_on(curve, arc, rho, z, t):
    """A lower bound of the distance of an arc's part, by its nearest point at t; see above."""
    (x, y), (x1, y1), (x2, y2) = jet_of(curve, t)
    x, y = x - rho, y - z
    distance = np.sqrt(x * x + y * y)
    if not distance > 0.0:
        return 0.0
    n0, n1 = x / distance, y / distance
    left, right = t - arc.low, arc.high - t
    w = max(left, right)
    l1, l2, l3 = arc.limits[0], arc.limits[1], arc.limits[2]
    if not l1 < np.inf:
        return 0.0
    most = max(distance, l1 * w)
    g, k, b = n0 * x1 + n1 * y1, n0 * x2 + n1 * y2, n0 * y1 - n1 * x1
    beside = abs(n0 * y - n1 * x)
    m = k + b * b / most - (l3 / 3.0 + abs(b) * l2 / most) * w
    m -= SPARE * (abs(k) + l2 + b * b / most)
    lost = beside * (abs(b) * w + 0.5 * l2 * w * w) / most + LOST * l1 * w
    # The least of g x + m x² / 2 for -left <= x <= right.
    change = min(min(0.0, right * (g + 0.5 * m * right)), left * (0.5 * m * left - g))
    if m > 0.0 and -left * m < -g < right * m:
        change = -0.5 * g * g / m
    return n0 * x + n1 * y + change - lost


@kernel
def _share_at(rows, degree, s):
    """The share of a part's parameter that is at about `s` of its way, whatever its end weights.

    With these alike it is `s`, and a parameter for which they are does not move the part.
    """
    if rows[degree, 2] == rows[0, 2]:
        return s
    ratio = (rows[degree, 2] / rows[0, 2]) ** (1.0 / degree)
    return s / (s + (1.0 - s) * ratio)


@kernel
def _divide(curve, arc, rho, z, t, distance, share, spare, margin):
    """The same by parts that are as thin as their control points tell: t, distance and bound."""
    rows = table_on_stack(16, 3, 0.0)
    lows, highs = on_stack(_STACK, 0.0), on_stack(_STACK, 0.0)
    lows[0], highs[0] = arc.low, arc.high
    top, looks, least = 1, 0, np.inf
    while top > 0:
        top -= 1
        low, high = lows[top], highs[top]
        x0, z0, x1, z1, far = chord_of(curve, low, high, rows)
        bound = from_segment(rho, z, x0, z0, x1, z1) - far - margin
        if bound >= enough(distance, share, spare):
            continue
        x0, z0, x1, z1 = x0 - rho, z0 - z, x1 - rho, z1 - z
        first, last = np.sqrt(x0 * x0 + z0 * z0), np.sqrt(x1 * x1 + z1 * z1)
        if min(first, last) + margin < distance:
            distance, t = (first, low) if first <= last else (last, high)
            distance += margin
        looks += 1
        middle = low + _share_at(rows, curve.degree, 0.5) * (high - low)
        if looks > _PARTS or not low < middle < high:
            least = min(least, bound)
            continue
        one = 0 if first <= last else 1  # the nearer half is looked at first
        lows[top + 1 - one], highs[top + 1 - one] = low, middle
        lows[top + one], highs[top + one] = middle, high
        top += 2
    return t, distance, least, looks


@kernel
def nearest_on(tree, rho, z, margin, share, spare):
    """The point of the profile nearest to one of the half-plane (rho, z), metres.

    Nothing is looked for that is nearer by less than a share of the distance, or than is spared.

    Returns:
        Bounds of the distance, the upper one that of the point found; which piece that is on, and
        where; and how many arcs were looked at.
    """
    arcs = tree.arcs
    stack, bounds = on_stack(_STACK, np.int32(0)), on_stack(_STACK, 0.0)
    stack[0], bounds[0] = 0, -np.inf
    rows = table_on_stack(16, 3, 0.0)
    top, looks = 1, 0
    distance, least, piece, at = np.inf, np.inf, np.int64(0), 0.0
    while top > 0:
        top -= 1
        if bounds[top] >= enough(distance, share, spare):
            continue
        arc = arcs[stack[top]]
        looks += 1
        child = np.int64(arc.child)
        if child != NONE and top + 2 <= _STACK:
            one, other = arcs[child], arcs[child + 1]
            first = from_chord(one, rho, z) - thickness(one) - margin
            second = from_chord(other, rho, z) - thickness(other) - margin
            near = 0 if first <= second else 1  # comes first
            stack[top + 1 - near], bounds[top + 1 - near] = child, first
            stack[top + near], bounds[top + near] = child + 1, second
            top += 2
            continue
        off, s = from_arc(arc, rho, z)
        bound = off - arc.error - margin
        if bound >= enough(distance, share, spare):
            continue
        k = np.int64(arc.curve)
        curve, along = tree.curves[k], 0.5 * (1.0 + s)
        if curve.control[2] != curve.control[3 * curve.degree + 2]:
            put_part(curve, arc.low, arc.high, rows)
            along = _share_at(rows, curve.degree, along)
        t = arc.low + along * (arc.high - arc.low)
        t, found = _newton(curve, arc.low, arc.high, rho, z, t)
        looks += 2
        if found + margin < distance:
            distance, piece, at = found + margin, k, t
        if bound < enough(distance, share, spare):
            bound = max(bound, _least_on(tree.curves[k], arc, rho, z, t) - margin)
        if bound < enough(distance, share, spare):
            t, found, divided, parts = _divide(
                tree.curves[k], arc, rho, z, at, distance, share, spare, margin
            )
            bound = max(bound, divided)
            looks += 2 * parts
            if found < distance:
                distance, piece, at = found, k, t
        least = min(least, bound)
    least = max(min(least, enough(distance, share, spare)), 0.0)
    return least, distance, piece, at, looks
