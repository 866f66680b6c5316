"""The largest that the smallest of several linear bounds can be in a cuboid.

A row is n and h, and says that one of the depths at y is at most h - n · y. A ball at y is no
larger than every row says, hence no larger than any weighted mean of some of them; and the maximum
of such a mean over a cuboid is its value at the centre plus |n| times the half lengths. Of two rows
the best weight makes one of the three components of the mean's n vanish, or is 0 or 1: the mean's
maximum is convex and piecewise linear in the weight, with its corners there. A mean is a row, too,
and may be mixed with a third and a fourth: so many it takes to say how large a ball is that touches
four faces.

Rounding a mean errs by 3 u of each number, which is less than 10 u S of what it says (S as for the
slack, of 32 u S and more): a mean is raised by one slack.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel, shared

_MIXES = 6
"""How often a mean is mixed with another row, at the most."""

_WORTH = 0.02
"""Share of what is missing that another mixture has to bring."""


@kernel
def _value(u, v, x, y, half, w):
    """The maximum of the mean with weights w and 1 - w of rows x and y, u and v at the centre."""
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
    """The weight of row x in the mean with y whose maximum is least, and that, if below `best`."""
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
    """The largest that the smallest of `count` rows can be.

    Writes the row that says so into `mean` (4,), and into `used` (2,) from which two of the rows it
    began. Below `limit` none better is looked for.
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
