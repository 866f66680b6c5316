"""The largest that the smaller of several linear bounds can be in a cuboid.

A row is n and h, and says that one of the depths at y is at most h - n · y. A ball at y is no
larger than every row says, hence no larger than any weighted mean of two of them; and the maximum
of such a mean over a cuboid is its value at the centre plus |n| times the half lengths. The best
weight makes one of the three components of the mean's n vanish, or is 0 or 1: the mean's maximum is
convex and piecewise linear in the weight, with its corners there.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel, shared


@kernel
def _mean(u, v, x, y, half, w):
    """The maximum of the mean with weights w and 1 - w of rows x and y, u and v at the centre."""
    m = 1.0 - w
    return (
        w * u + m * v
        + half[0] * abs(w * x[0] + m * y[0])
        + half[1] * abs(w * x[1] + m * y[1])
        + half[2] * abs(w * x[2] + m * y[2])
    )  # fmt: skip


@shared
def bound_of(rows, count, centre, half, used):
    """The largest that the smallest of `count` rows can be; writes which two say so into `used`."""
    best = np.inf
    used[0] = used[1] = 0
    for i in range(count):
        x = rows[i]
        u = x[3] - (x[0] * centre[0] + x[1] * centre[1] + x[2] * centre[2])
        alone = u + abs(x[0]) * half[0] + abs(x[1]) * half[1] + abs(x[2]) * half[2]
        if alone < best:
            best = alone
            used[0] = used[1] = i
        for j in range(i):
            y = rows[j]
            v = y[3] - (y[0] * centre[0] + y[1] * centre[1] + y[2] * centre[2])
            if min(u, v) >= best:
                continue
            for k in range(3):
                d = y[k] - x[k]
                if not x[k] * y[k] < 0.0:
                    continue
                value = _mean(u, v, x, y, half, y[k] / d)
                if value < best:
                    best = value
                    used[0], used[1] = i, j
    return best
