"""Trimming curves: boxes around them, points on them, and the point nearest to a given one."""

from __future__ import annotations

import math

from ..base.jit import kernel
from ..base.memory import table_on_stack

_ROUNDS = 12
"""Steps towards the nearest point of a curve: enough digits for a seed."""


@kernel
def _halves(points, degree, share, keep_left):
    """Cut a Bezier curve in place: keep what lies before a share of it, or what lies after."""
    for level in range(1, degree + 1):
        if keep_left:
            for i in range(degree, level - 1, -1):
                for k in range(3):
                    points[i, k] = (1.0 - share) * points[i - 1, k] + share * points[i, k]
        else:
            for i in range(degree + 1 - level):
                for k in range(3):
                    points[i, k] = (1.0 - share) * points[i, k] + share * points[i + 1, k]


@kernel
def _taken(nets, segment, points):
    """Copy the control points of a segment's curve."""
    for i in range(segment.degree + 1):
        for k in range(3):
            points[i, k] = nets[segment.net + 3 * i + k]


@kernel
def restricted(nets, segment, begin, end, points):
    """Write the control points (n, 3) of a stretch of a segment's curve: x w, y w and w."""
    _taken(nets, segment, points)
    if end < 1.0:
        _halves(points, segment.degree, end, True)
    if begin > 0.0:
        _halves(points, segment.degree, begin / end, False)


@kernel
def curve_box(nets, segment, begin, end, slack):
    """Return the box (left, lower, right, upper) of a stretch of a curve, by its control points."""
    points = table_on_stack(16, 3, 0.0)
    restricted(nets, segment, begin, end, points)
    left, lower, right, upper = math.inf, math.inf, -math.inf, -math.inf
    for i in range(segment.degree + 1):
        x, y = points[i, 0] / points[i, 2], points[i, 1] / points[i, 2]
        left, right = min(left, x), max(right, x)
        lower, upper = min(lower, y), max(upper, y)
    return left - slack, lower - slack, right + slack, upper + slack


@kernel
def along(nets, segment, t):
    """Return the point of a curve at t, and its derivative: x, y, dx, dy."""
    points = table_on_stack(16, 3, 0.0)
    _taken(nets, segment, points)
    degree = segment.degree
    for level in range(1, degree):
        for i in range(degree + 1 - level):
            for k in range(3):
                points[i, k] = (1.0 - t) * points[i, k] + t * points[i + 1, k]
    wx = (1.0 - t) * points[0, 0] + t * points[1, 0]
    wy = (1.0 - t) * points[0, 1] + t * points[1, 1]
    w = (1.0 - t) * points[0, 2] + t * points[1, 2]
    x, y = wx / w, wy / w
    turn = degree * (points[1, 2] - points[0, 2])
    dx = (degree * (points[1, 0] - points[0, 0]) - x * turn) / w
    dy = (degree * (points[1, 1] - points[0, 1]) - y * turn) / w
    return x, y, dx, dy


@kernel
def foot(nets, segment, x, y, scale_x, scale_y):
    """Find the point of a segment near to a given one; return its t, and the squared distance.

    Any t is on the segment. That it is the nearest is likely, not sure. At the nearest point, the
    product of the way to it with the derivative vanishes: find that root by regula falsi
    (Illinois).
    """
    low, high = segment.begin, segment.end
    low_slope, apart = _slope(nets, segment, low, x, y, scale_x, scale_y)
    best, best_t = apart, low
    high_slope, apart = _slope(nets, segment, high, x, y, scale_x, scale_y)
    if apart < best:
        best, best_t = apart, high
    kept = 0
    for _ in range(_ROUNDS):
        if not (low_slope < 0.0 < high_slope):
            break
        t = (low * high_slope - high * low_slope) / (high_slope - low_slope)
        if not low < t < high:
            break
        slope, apart = _slope(nets, segment, t, x, y, scale_x, scale_y)
        if apart < best:
            best, best_t = apart, t
        if slope < 0.0:
            low, low_slope = t, slope
            high_slope *= 0.5 if kept < 0 else 1.0
            kept = -1
        else:
            high, high_slope = t, slope
            low_slope *= 0.5 if kept > 0 else 1.0
            kept = 1
    return best_t, best


@kernel
def _slope(nets, segment, t, x, y, scale_x, scale_y):
    """Return half the derivative by t of a squared distance, and the squared distance."""
    px, py, dx, dy = along(nets, segment, t)
    ex, ey = scale_x * (px - x), scale_y * (py - y)
    return ex * scale_x * dx + ey * scale_y * dy, ex * ex + ey * ey
