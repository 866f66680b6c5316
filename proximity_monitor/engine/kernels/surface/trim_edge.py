"""Points of a patch on its trimming loops, for upper bounds at its edges."""

from __future__ import annotations

import math

from ..base.jit import kernel
from .trim import from_unit, to_unit
from .trim_curve import along, foot


@kernel
def nearest_on_trim(table, patch, u, v, scale_u, scale_v):
    """Return the segment, and the t on its curve, likely nearest to (u, v); -1: no loops.

    Sides of the patch's rectangle do not count as segments.

    Args:
        table: the model's Trims.
        patch: which patch.
        u: a parameter of the patch.
        v: the other parameter of the patch.
        scale_u: what a step of u is worth, such as the length of the surface's derivative there.
        scale_v: what a step of v is worth.
    """
    trim = table.trims[patch]
    best_segment, best_t, best = -1, 0.0, math.inf
    if trim.rows == 0:
        return best_segment, best_t
    x, y = to_unit(trim, 0, u), to_unit(trim, 1, v)
    scale_x, scale_y = scale_u * trim.extent[0], scale_v * trim.extent[1]
    most = max(scale_x, scale_y)
    for index in range(trim.first, trim.end):
        segment = table.segments[index]
        if segment.band < 0.0:
            continue
        # The curve is no nearer than the box of its chord, less the width of its band.
        left, right = min(segment.a[0], segment.b[0]), max(segment.a[0], segment.b[0])
        lower, upper = min(segment.a[1], segment.b[1]), max(segment.a[1], segment.b[1])
        ex = scale_x * max(left - x, x - right, 0.0)
        ey = scale_y * max(lower - y, y - upper, 0.0)
        if math.sqrt(ex * ex + ey * ey) - most * segment.band < best:
            t, square = foot(table.nets, segment, x, y, scale_x, scale_y)
            apart = math.sqrt(square)
            if apart < best:
                best_segment, best_t, best = index, t, apart
    return best_segment, best_t


@kernel
def trim_point(table, patch, segment, t):
    """Return the patch's parameters u, v at t of a segment's curve, and their derivatives by t.

    The surface's point there belongs to the model: except for rounding, it lies on the model's
    edge. t may be anything from 0 to 1: the curve goes on beyond its segment, where it is still
    part of the loop.
    """
    trim = table.trims[patch]
    x, y, dx, dy = along(table.nets, table.segments[segment], t)
    u, v = from_unit(trim, 0, x), from_unit(trim, 1, y)
    return u, v, dx * _stretch(trim, 0, x), dy * _stretch(trim, 1, y)


@kernel
def _stretch(trim, axis, share):
    """Return the derivative of `from_unit`."""
    arcs = trim.arcs[axis]
    if arcs == 0:
        return trim.extent[axis]
    arc = min(max(math.floor(share * arcs), 0.0), arcs - 1.0)
    tangent = trim.tangent[axis]
    quarter = math.atan(tangent)
    tilt = math.tan((2.0 * (share * arcs - arc) - 1.0) * quarter)
    return trim.extent[axis] * (1.0 + tilt * tilt) * quarter / tangent
