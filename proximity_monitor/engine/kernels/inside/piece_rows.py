"""Bound the depths on a piece of a surface by several linear bounds of depths (rows).

A row is n and h, in the surface's frame: where a point x of the piece has a depth above 0, its
depth is at most h - n · x. The piece lies in the hull of some points, so a row is largest at one of
them. A depth is no larger than any weighted mean of rows, either. Along a ridge, where two faces of
the solid are equally near, the mean of their rows is level, while each row alone rises to one side.

The maximum of the mean of two rows over the points is a convex and piecewise linear function of the
weight. Its least value is found exactly, by the lines that are largest on either side. A mean is a
row too, and may be mixed with another row, as in `ball_rows`; this also says how a mean is rounded.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel, shared
from ..base.memory import on_stack
from .ball_state import KEPT

ROWS = KEPT + 2
"""Maximum number of rows of a piece: the inherited ones, and two new ones."""

LINES = ROWS + 1
"""The rows, and a mean of them."""

HULL = 256
"""Maximum number of points in whose hull a piece lies: control points of degree 15 both ways."""

_MIXES = 3
"""Maximum number of times that a mean is mixed with another row."""

_WORTH = 0.02
"""Share of the distance to the limit by which another mixture must lower the bound."""

_CUTS = 12
"""Maximum number of weights that are tried for a mean of two rows."""


@kernel
def _best_weight(x, y, points):
    """Return the weight of x in the mean of x and y with the least maximum, and that maximum.

    x and y hold the values of two rows at the points. The weight is between 0 and 1.
    """
    low, high = 0, 0  # the points where y, and x, are largest
    for k in range(1, points):
        if y[k] > y[low] or (y[k] == y[low] and x[k] > x[low]):
            low = k
        if x[k] > x[high] or (x[k] == x[high] and y[k] > y[high]):
            high = k
    if x[low] >= y[low]:
        return 0.0, y[low]
    if y[high] >= x[high]:
        return 1.0, x[high]
    weight, most = 0.0, y[low]
    for _ in range(_CUTS):
        # The lines of both points meet at a weight between 0 and 1.
        fall, rise = y[low] - x[low], x[high] - y[high]
        w = min(max((y[low] - y[high]) / (fall + rise), 0.0), 1.0)
        top, value = 0, -np.inf
        for k in range(points):
            each = w * x[k] + (1.0 - w) * y[k]
            if each > value:
                top, value = k, each
        if not (weight > 0.0 and value >= most):
            weight, most = w, value
        if top in (low, high) or x[top] == y[top]:
            break
        if x[top] < y[top]:
            low = top
        else:
            high = top
    return weight, most


@shared
def bound_by(rows, count, hull, points, limit, slack, values, used):
    """Return an upper bound of the smallest of `count` rows, at least one, in the hull of `points`.

    Writes the values of the rows at the points to `values` (LINES, HULL), and to `used` (ROWS,)
    whether the bound is due to a row, 1 or 0. Stops to improve the bound once it is at most
    `limit`.
    """
    best, first = np.inf, 0
    for i in range(count):
        a, b, c, h = rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3]
        most = -np.inf
        for k in range(points):
            value = h - (a * hull[k, 0] + b * hull[k, 1] + c * hull[k, 2])
            values[i, k] = value
            most = max(most, value)
        used[i] = 0
        if most < best:
            best, first = most, i
    used[first] = 1
    best += slack
    if best <= limit or count < 2:
        return best
    mixed = values[ROWS]
    for k in range(points):
        mixed[k] = values[first, k]
    for _ in range(_MIXES):
        share, better, other = 0.0, best - _WORTH * (best - limit), -1
        for i in range(count):
            weight, value = _best_weight(mixed, values[i], points)
            if value + slack < better:
                share, better, other = weight, value + slack, i
        if other < 0:
            break
        used[other] = 1
        for k in range(points):
            mixed[k] = share * mixed[k] + (1.0 - share) * values[other, k] + slack
        best = better + slack
        if best <= limit:
            break
    return best


@kernel
def leave_rows(at, rows, count, points, values, used):
    """Leave the useful rows of a piece to its parts; the other arguments are as in `bound_by`.

    A row is useless if another one is nowhere larger. Those that the bound is due to come first,
    then those with the least maxima.
    """
    order = on_stack(ROWS, np.int64(0))
    most = on_stack(ROWS, 0.0)
    n = 0
    for i in range(count):
        useless = False
        for j in range(count):
            if j == i or useless:
                continue
            above = False
            for k in range(points):
                if values[i, k] < values[j, k] or (values[i, k] == values[j, k] and i < j):
                    above = True
                    break
            useless = not above
        if useless:
            continue
        value = -np.inf
        if used[i] == 0:
            for k in range(points):
                value = max(value, values[i, k])
        place = n
        while place > 0 and most[place - 1] > value:
            most[place], order[place] = most[place - 1], order[place - 1]
            place -= 1
        most[place], order[place] = value, i
        n += 1
    at.count = min(n, KEPT)
    for i in range(at.count):
        for j in range(4):
            at.rows[i, j] = rows[order[i], j]
