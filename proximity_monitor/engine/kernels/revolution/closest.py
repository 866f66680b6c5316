"""The point of a profile that is nearest to a given one, to the tolerance that is asked for.

Fat arcs prune what is farther. On an arc without halves, Newton's method finds the nearest point,
and a bound of the second order proves that no other point is nearer by more than the tolerance.

Let D(s) be the vector from the point p to C(s), n a unit vector along it at a parameter t, and tau
the part of D perpendicular to n. If |D| <= U,

    |D| >= n . D + tau² / 2 U,

because |D| - n . D = tau² / (|D| + n . D); and if |D| > U >= |D(t)|, there is nothing to prove.
With x = s - t, n . D is n . (D(t) + C' x + C'' x² / 2) up to l3 |x|³ / 6, and tau is tau(t) + b x
up to l2 x² / 2, where b is the part of C' perpendicular to n, and l2 and l3 limit the second and
the third derivative. So with |x| <= w

    |D| >= |D(t)| + g x + m x² / 2 - 2 |tau(t)| (|b| w + l2 w² / 2) / 2 U,
    g = n . C',  m = n . C'' + b² / U - (l3 / 3 + |b| l2 / U) w,

whose minimum over the arc's part is known. tau(t) differs from 0 only by rounding. So that this is
not magnified if the point is near, U is no less than l1 w.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel, shared
from ..base.memory import on_stack, table_on_stack
from ..base.trees import NONE
from .certificate import LOST, SPARE
from .meridian import chord_of, from_arc, from_chord, from_segment, thickness
from .profile import jet_of, put_part

_ALL = 1 << 60
"""Looks of a search that is not cut."""

_STACK = 128
"""Room for arcs that wait, twice the depth of a tree, and for waiting parts of one arc."""

_NEWTONS, _PARTS = 8, 96
"""Steps of Newton's method, and parts that an arc is divided into if no other bound suffices."""

_CURVED, _SHORTER, _NOTHING = 1e-6, 0.25, 1e-17
"""Newton's step uses the second derivative of the squared distance if it is above _CURVED of that
for a straight curve: near the centre of an arc it is small. _SHORTER shortens a step that leads no
nearer. What is below _NOTHING of the squared distance is no gain."""


@inlined
def enough(distance, share, spare):
    """Return the distance, metres, from which on everything is pruned."""
    return distance - max(share * distance, spare)


@kernel
def nearer_on_piece(curve, low, high, rho, z, t):
    """Go from t to a nearer point on a part of a piece; return its t and its distance."""
    best, best_t, step = np.inf, t, 0.0
    for _ in range(_NEWTONS):
        (x, y), (x1, y1), (x2, y2) = jet_of(curve, t)
        x, y = x - rho, y - z
        far = x * x + y * y
        if far < best:
            best, best_t = far, t
            slope, bend = x * x1 + y * y1, x1 * x1 + y1 * y1
            whole = bend + x * x2 + y * y2
            # If the distance does not curve upwards, the step is that of a straight curve.
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
    """Return a lower bound of the distance of an arc's part, by its nearest point at t.

    The module's docstring says why.
    """
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
def share_at(rows, degree, s):
    """Return the share of a part's parameter range at about the share `s` of its length.

    If both end weights are equal, that is `s`. Else the part is reparametrised to make them equal,
    which does not change its shape.
    """
    if rows[degree, 2] == rows[0, 2]:
        return s
    ratio = (rows[degree, 2] / rows[0, 2]) ** (1.0 / degree)
    return s / (s + (1.0 - s) * ratio)


@kernel
def _divide(curve, arc, rho, z, t, distance, share, spare, margin):
    """Find the nearest point on an arc's part by halving it, with bounds by control points.

    Returns t, the distance, a lower bound of the parts that are not divided any more, and the
    looks.
    """
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
        middle = low + share_at(rows, curve.degree, 0.5) * (high - low)
        if looks > _PARTS or not low < middle < high:
            least = min(least, bound)
            continue
        one = 0 if first <= last else 1  # the nearer half is looked at first
        lows[top + 1 - one], highs[top + 1 - one] = low, middle
        lows[top + one], highs[top + one] = middle, high
        top += 2
    return t, distance, least, looks


@kernel
def nearest_on_arc(tree, arc, rho, z, margin, share, spare, distance, piece, at):
    """Find the nearest point on the part of an arc without halves, as `nearest_on` does for all.

    `distance`, `piece` and `at` are those of the nearest point known. Returns a lower bound of the
    distance of the part; these three, of the point found if it is nearer; and the looks.
    """
    off, s = from_arc(arc, rho, z)
    bound, looks = off - arc.error - margin, 0
    if bound >= enough(distance, share, spare):
        return bound, distance, piece, at, looks
    k = np.int64(arc.curve)
    curve, along = tree.curves[k], 0.5 * (1.0 + s)
    if curve.control[2] != curve.control[3 * curve.degree + 2]:
        rows = table_on_stack(16, 3, 0.0)
        put_part(curve, arc.low, arc.high, rows)
        along = share_at(rows, curve.degree, along)
    t = arc.low + along * (arc.high - arc.low)
    t, found = nearer_on_piece(curve, arc.low, arc.high, rho, z, t)
    looks = 2
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
    return bound, distance, piece, at, looks


@inlined
def halves_beside(arcs, child, rho, z, margin):
    """Return lower bounds of the distances of a point from both halves of an arc, metres."""
    one, other = arcs[child], arcs[child + 1]
    first = from_chord(one, rho, z) - thickness(one) - margin
    return first, from_chord(other, rho, z) - thickness(other) - margin


@inlined
def nearest_on(tree, rho, z, margin, share, spare):
    """Find the point of the profile nearest to the point (rho, z) of the half-plane, metres.

    Points nearer by less than `share` of the distance, or by less than `spare`, are not looked for.

    Returns:
        Bounds of the distance, the upper one that of the point found; its piece and its parameter
        there; and how many arcs were looked at.
    """
    return nearest_in(tree, rho, z, margin, share, spare, _ALL)


@inlined
def nearest_in(tree, rho, z, margin, share, spare, most):
    """Do the same in about `most` looks at arcs, or in as many as it takes to find any point."""
    return nearest_under(tree, 0, rho, z, margin, share, spare, most)


@shared
def nearest_under(tree, first, rho, z, margin, share, spare, most):
    """Do the same on the part of the profile that the arc `first` is around."""
    arcs = tree.arcs
    stack, bounds = on_stack(_STACK, np.int32(0)), on_stack(_STACK, 0.0)
    stack[0], bounds[0] = first, -np.inf
    top, looks = 1, 0
    distance, least, piece, at = np.inf, np.inf, np.int64(0), 0.0
    while top > 0 and (looks < most or distance == np.inf):
        top -= 1
        if bounds[top] >= enough(distance, share, spare):
            continue
        arc = arcs[stack[top]]
        looks += 1
        child = np.int64(arc.child)
        if child != NONE and top + 2 <= _STACK:
            one, other = halves_beside(arcs, child, rho, z, margin)
            near = 0 if one <= other else 1  # is looked at first
            stack[top + 1 - near], bounds[top + 1 - near] = child, one
            stack[top + near], bounds[top + near] = child + 1, other
            top += 2
            continue
        bound, distance, piece, at, more = nearest_on_arc(
            tree, arc, rho, z, margin, share, spare, distance, piece, at
        )
        looks += more
        if bound < enough(distance, share, spare):
            least = min(least, bound)
    for k in range(top):  # what was not looked at any more
        least = min(least, bounds[k])
    least = max(min(least, enough(distance, share, spare)), 0.0)
    return least, distance, piece, at, looks
