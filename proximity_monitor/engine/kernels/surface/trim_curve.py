"""Trimming curves themselves: boxes around them, points on them, the point nearest to another."""

from __future__ import annotations

import math

from ..base.jit import kernel
from ..base.memory import table_on_stack

_ROUNDS = 12
"""Gauss-Newton steps towards the nearest point of a curve: a seed has digits enough by then."""


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
def curve_box(nets, segment, begin, end, slack):
    """The box (left, lower, right, upper) of a stretch of a curve, by its control points."""
    points = table_on_stack(16, 3, 0.0)
    _taken(nets, segment, points)
    if end < 1.0:
        _halves(points, segment.degree, end, True)
    if begin > 0.0:
        _halves(points, segment.degree, begin / end, False)
    left, lower, right, upper = math.inf, math.inf, -math.inf, -math.inf
    for i in range(segment.degree + 1):
        x, y = points[i, 0] / points[i, 2], points[i, 1] / points[i, 2]
        left, right = min(left, x), max(right, x)
        lower, upper = min(lower, y), max(upper, y)
    return left - slack, lower - slack, right + slack, upper + slack


@kernel
def along(nets, segment, t):
    """The point of a curve at t, and its derivative: x, y, dx, dy."""
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
    """Where on a segment the point near to another is: t, and the square of its distance.

    Any t is on the segment; that it is the nearest is likely, not sure.
    """
    dx, dy = scale_x * (segment.b[0] - segment.a[0]), scale_y * (segment.b[1] - segment.a[1])
    square = dx * dx + dy * dy
    share = 0.0
    if square > 0.0:
        share = scale_x * (x - segment.a[0]) * dx + scale_y * (y - segment.a[1]) * dy
        share = min(max(share / square, 0.0), 1.0)
    t = segment.begin + share * (segment.end - segment.begin)
    best, best_t = math.inf, t
    for _ in range(_ROUNDS):
        px, py, dx, dy = along(nets, segment, t)
        ex, ey = scale_x * (px - x), scale_y * (py - y)
        apart = ex * ex + ey * ey
        if apart < best:
            best, best_t = apart, t
        dx, dy = scale_x * dx, scale_y * dy
        square = dx * dx + dy * dy
        if not square > 0.0:
            break
        moved = min(max(t - (ex * dx + ey * dy) / square, segment.begin), segment.end)
        if moved == t:
            break
        t = moved
    return best_t, best
