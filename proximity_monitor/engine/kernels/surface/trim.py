"""Which part of a patch its trimming loops leave: for a point, and for a rectangle of parameters.

Loops are closed sequences of segments. A segment is a piece of a rational Bezier curve, with its
chord and the width of a band around the chord that holds it. Segments lie in the unit square, onto
which the patch's rectangle is mapped, axis by axis (`to_unit`). Each map is monotonic, so
rectangles stay rectangles. What is inside an odd number of loops belongs to the model.

If a point lies outside a convex set, a curve in the set may be replaced by another in the set with
the same ends: how often they cross a ray from the point differs by an even number. So for a point
outside its band, a segment counts as its chord. For a point within the band, the segment is halved
until its hull no longer holds the point (as in Bezier clipping: Sederberg, Nishita 1990).

A segment along a side of the rectangle bounds nothing inside it. Such segments are moved outward
and their band is FRAME: rays count them, but cells do not touch them.
"""

from __future__ import annotations

import math

from ..base.jit import kernel, shared
from ..base.memory import table_on_stack
from .trim_curve import along, curve_box

OUTSIDE, INSIDE, CROSSING = 0, 1, 2
"""What is left of a point or a rectangle: surely nothing, surely all, or unknown."""

_DEEP, _PATIENCE = 64, 96
"""Most stretches of a segment that wait at a time, and most that are looked at."""


@kernel
def to_unit(trim, axis, value):
    """Map a parameter of the patch to the unit interval.

    In an arc of angle t, the rational quadratic with weights 1, cos(t/2), 1 runs through the angle
    2 atan(s tan(t/4)) from the arc's middle at s = -1 ... 1.
    """
    share = min(max((value - trim.low[axis]) / trim.extent[axis], 0.0), 1.0)
    arcs = trim.arcs[axis]
    if arcs == 0:
        return share
    arc = min(math.floor(share * arcs), arcs - 1.0)
    tangent = trim.tangent[axis]
    angle = math.atan((2.0 * (share * arcs - arc) - 1.0) * tangent) / math.atan(tangent)
    return (arc + 0.5 + 0.5 * angle) / arcs


@kernel
def from_unit(trim, axis, share):
    """Map a share of the unit interval to a parameter of the patch: the inverse of `to_unit`."""
    share = min(max(share, 0.0), 1.0)
    arcs = trim.arcs[axis]
    if arcs > 0:
        arc = min(math.floor(share * arcs), arcs - 1.0)
        tangent = trim.tangent[axis]
        angle = (2.0 * (share * arcs - arc) - 1.0) * math.atan(tangent)
        share = (arc + 0.5 + 0.5 * math.tan(angle) / tangent) / arcs
    return trim.low[axis] + share * trim.extent[axis]


@kernel
def classify_point(table, patch, u, v):
    """Return INSIDE or OUTSIDE; CROSSING if the point is too near a loop for rounding to tell."""
    trim = table.trims[patch]
    if trim.rows == 0:
        return INSIDE
    return side_of(table, trim, to_unit(trim, 0, u), to_unit(trim, 1, v))


@kernel
def classify_rectangle(table, patch, low_u, low_v, high_u, high_v):
    """Return INSIDE or OUTSIDE if all of a rectangle of the patch surely is; else CROSSING."""
    trim = table.trims[patch]
    if trim.rows == 0:
        return INSIDE
    left, right = to_unit(trim, 0, low_u) - trim.slack, to_unit(trim, 0, high_u) + trim.slack
    lower, upper = to_unit(trim, 1, low_v) - trim.slack, to_unit(trim, 1, high_v) + trim.slack
    for row in range(row_of(trim, lower), row_of(trim, upper) + 1):
        for entry in range(table.rows[row], table.rows[row + 1]):
            segment = table.segments[table.entries[entry]]
            if segment.band >= 0.0 and is_near(segment, left, lower, right, upper):
                if segment.degree == 1:
                    return CROSSING
                if _touches(table, segment, trim.slack, left, lower, right, upper):
                    return CROSSING
    return side_of(table, trim, 0.5 * (left + right), 0.5 * (lower + upper))


@kernel
def row_of(trim, share):
    """Return the row that a share of v lies in."""
    return trim.first_row + min(max(int(share * trim.rows), 0), trim.rows - 1)


@shared
def side_of(table, trim, x, y):
    """Classify a point of the unit square by counting what a ray to the right crosses."""
    odd = 0
    row = row_of(trim, y)
    for entry in range(table.rows[row], table.rows[row + 1]):
        segment = table.segments[table.entries[entry]]
        ax, ay, bx, by = segment.a[0], segment.a[1], segment.b[0], segment.b[1]
        reach = segment.band
        if reach >= 0.0 and _apart(x, y, ax, ay, bx, by) <= reach * reach:
            if segment.degree == 1:
                return CROSSING
            crossings = _crossings(table, segment, trim.slack, x, y)
            if crossings == CROSSING:
                return CROSSING
            odd ^= crossings
        else:
            odd ^= _passes(x, y, ax, ay, bx, by)
    return INSIDE if odd == 1 else OUTSIDE


@kernel
def _apart(x, y, ax, ay, bx, by):
    """Return the squared distance of a point from a chord."""
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    share = 0.0
    if square > 0.0:
        share = min(max(((x - ax) * dx + (y - ay) * dy) / square, 0.0), 1.0)
    ex, ey = x - ax - share * dx, y - ay - share * dy
    return ex * ex + ey * ey


@kernel
def _passes(x, y, ax, ay, bx, by):
    """Return 1 if a ray to the right from a point meets a chord (lower end included), else 0."""
    if (ay <= y) == (by <= y):
        return 0
    turn = (bx - ax) * (y - ay) - (x - ax) * (by - ay)
    return 1 if (turn > 0.0) == (by > ay) and turn != 0.0 else 0


@kernel
def _crossings(table, segment, slack, x, y):
    """Count, modulo 2, how often a ray from a point meets a curve near it; CROSSING if unknown."""
    stack = table_on_stack(_DEEP, 6, 0.0)
    stack[0, 0], stack[0, 1] = segment.begin, segment.end
    stack[0, 2], stack[0, 3] = segment.a[0], segment.a[1]
    stack[0, 4], stack[0, 5] = segment.b[0], segment.b[1]
    count, odd = 1, 0
    for _ in range(_PATIENCE):
        count -= 1
        begin, end = stack[count, 0], stack[count, 1]
        ay, bx, by = stack[count, 3], stack[count, 4], stack[count, 5]
        left, lower, right, upper = curve_box(table.nets, segment, begin, end, slack)
        if lower <= y <= upper and x <= right:
            if x < left:
                odd ^= 1 if (ay <= y) != (by <= y) else 0
            else:
                middle = 0.5 * (begin + end)
                if not begin < middle < end or max(right - left, upper - lower) <= 4.0 * slack:
                    return CROSSING
                mx, my, _, _ = along(table.nets, segment, middle)
                # The first half replaces the whole, the second goes on top.
                stack[count, 1], stack[count, 4], stack[count, 5] = middle, mx, my
                count += 1
                stack[count, 0], stack[count, 1] = middle, end
                stack[count, 2], stack[count, 3] = mx, my
                stack[count, 4], stack[count, 5] = bx, by
                count += 1
        if count == 0:
            return odd
        if count > _DEEP - 2:
            return CROSSING
    return CROSSING


@kernel
def is_near(segment, left, lower, right, upper):
    """Tell whether a segment's band may touch a rectangle: three separating axes."""
    dx, dy = segment.b[0] - segment.a[0], segment.b[1] - segment.a[1]
    x, y = 0.5 * (left + right), 0.5 * (lower + upper)
    half_x, half_y = 0.5 * (right - left), 0.5 * (upper - lower)
    ex, ey = x - segment.a[0], y - segment.a[1]
    if abs(ex - 0.5 * dx) > half_x + 0.5 * abs(dx) + segment.band:
        return False
    if abs(ey - 0.5 * dy) > half_y + 0.5 * abs(dy) + segment.band:
        return False
    reach = abs(dy) * half_x + abs(dx) * half_y + segment.band * math.sqrt(dx * dx + dy * dy)
    return abs(dx * ey - dy * ex) <= reach


@kernel
def _touches(table, segment, slack, left, lower, right, upper):
    """Tell whether a curve may touch a rectangle."""
    stack = table_on_stack(_DEEP, 2, 0.0)
    stack[0, 0], stack[0, 1] = segment.begin, segment.end
    count = 1
    for _ in range(_PATIENCE):
        count -= 1
        begin, end = stack[count, 0], stack[count, 1]
        x0, y0, x1, y1 = curve_box(table.nets, segment, begin, end, slack)
        if x0 <= right and x1 >= left and y0 <= upper and y1 >= lower:
            if x0 >= left and x1 <= right and y0 >= lower and y1 <= upper:
                return True
            middle = 0.5 * (begin + end)
            mx, my, _, _ = along(table.nets, segment, middle)
            if left <= mx <= right and lower <= my <= upper:
                return True
            stack[count, 1] = middle
            stack[count + 1, 0], stack[count + 1, 1] = middle, end
            count += 2
        if count == 0:
            return False
        if count > _DEEP - 2:
            return True
    return True
