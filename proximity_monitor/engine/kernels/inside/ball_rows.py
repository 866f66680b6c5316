"""Bound the largest ball centred in a cuboid by several linear bounds of depths (rows).

A row is n and h: one of the depths at y is at most h - n · y. A ball at y is no larger than the
smallest row's value, hence no larger than any weighted mean of rows. The maximum of a mean over a
cuboid is its value at the centre plus the sum of |n_i| times the half lengths. For two rows, the
best weight is 0, 1, or one at which a component of the mean's n vanishes, because the maximum is
convex and piecewise linear in the weight with kinks at these weights. A mean is a row too, and may
be mixed with a third and a fourth row. A ball that touches four faces needs that many.

Rounding a mean errs by 3 u of each number, less than 10 u S of its value (S as for the slack, which
is at least 32 u S). So a mean is raised by one slack.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel, shared

_MIXES = 6
"""Maximum number of times that a mean is mixed with another row."""

_WORTH = 0.02
"""Share of the distance to the limit by which another mixture must lower the bound."""


@kernel
def _value(u, v, x, y, half, w):
    """Return the maximum of w x + (1 - w) y; rows x and y have the values u and v at the centre."""
    m = 1.0 - w
    return (
        w * u + m * v
        + half[0] * abs(w * x[0] + m * y[0])
        + half[1] * abs(w * x[1] + m * y[1])
        + half[2] * abs(w * x[2] + m * y[2])
    )  # fmt: skip


@kernel
def _at(row, centre):
    return row[3] - (row[0] * centre[0] + row[1] * centre[1] + row[2] * centre[2])


@kernel
def _best_weight(u, v, x, y, half, best):
    """Return the weight of row x whose mean with y has the least maximum, and that maximum.

    If no maximum is below `best`, returns -1 and `best`. Weights 0 and 1 are not tried.
    """
    weight = -1.0
    if min(u, v) >= best:
        return weight, best
    for k in range(3):
        if x[k] * y[k] < 0.0:
            w = y[k] / (y[k] - x[k])
            value = _value(u, v, x, y, half, w)
            if value < best:
                weight, best = w, value
    return weight, best


@shared
def bound_of(rows, count, centre, half, limit, slack, mean, used):
    """Return an upper bound of the smallest of `count` rows in the cuboid (centre, half).

    Writes the row that gives the bound to `mean` (4,), and the two rows that the mean began with to
    `used` (2,). Stops to improve the bound once it is at most `limit`.
    """
    best = np.inf
    used[0] = used[1] = 0
    share = 1.0
    for i in range(count):
        x = rows[i]
        u = _at(x, centre)
        alone = u + abs(x[0]) * half[0] + abs(x[1]) * half[1] + abs(x[2]) * half[2]
        if alone < best:
            best, share = alone, 1.0
            used[0] = used[1] = i
        for j in range(i):
            y = rows[j]
            weight, value = _best_weight(u, _at(y, centre), x, y, half, best)
            if weight >= 0.0:
                best, share = value, weight
                used[0], used[1] = i, j
    if count == 0:
        return best
    x, y = rows[used[0]], rows[used[1]]
    for k in range(4):
        mean[k] = x[k] if share == 1.0 else share * x[k] + (1.0 - share) * y[k]
    if share != 1.0:
        mean[3] += slack
        best += slack
    for _ in range(_MIXES):
        if best <= limit or count < 3:
            break
        u, better, other = _at(mean, centre), best - _WORTH * (best - limit), -1
        for i in range(count):
            weight, value = _best_weight(u, _at(rows[i], centre), mean, rows[i], half, better)
            if weight >= 0.0:
                share, better, other = weight, value, i
        if other < 0:
            break
        for k in range(4):
            mean[k] = share * mean[k] + (1.0 - share) * rows[other, k]
        mean[3] += slack
        best = better + slack
    return best + slack
