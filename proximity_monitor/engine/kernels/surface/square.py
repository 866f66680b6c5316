"""Whether a part is beyond a distance of the origin, by its squared distance as a Bezier surface.

With numerator M and weight w, the part's net, nothing is nearer than b where |M|² - b² w² is not
negative: a Bezier surface of twice the degree. Its control points are sums of products of those of
M and w (Farin, Curves and Surfaces for CAGD, section 6.10), and none of its points is below the
least of them. That is the only proof which is exact about a pole, where a side is one point: all of
its control points that lie beside the pole are those of the pole.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel
from ..base.memory import on_stack
from .parts import EACH

_MOST = 3
"""The highest degree that this is worth its time for, in either direction."""

_SUMS, _WIDE = 49, 7
"""Control points of twice that degree, in all and in a direction."""


@kernel
def _times(degree, i):
    """Binomial coefficient of a degree of three at the most."""
    if i == 0 or i == degree:
        return 1.0
    return float(degree)


@kernel
def is_beyond(piece, parts, at, below, margin):
    """Whether no point of a part is nearer to the origin than `below`, metres.

    Control points err by `margin`, so with R no less than their distance from the origin, a product
    by 2 R margin w w'; by what their weights err by, which is in the margin as well, by (R + b)
    margin w w'; and by rounding, in a sum of sixteen, by 24 u (R + b)² w w'. As margin is more than
    32 u R, and b less than R, all are less than 8 (R + b) margin w w'.
    """
    p, q = np.int64(piece.degree_u), np.int64(piece.degree_v)
    if p > _MOST or q > _MOST or not below > 0.0:
        return False
    square = 0.0
    for i in range(np.int64(piece.points)):
        k = at + EACH * i
        x, y, z, w = parts[k], parts[k + 1], parts[k + 2], parts[k + 3]
        square = max(square, (x * x + y * y + z * z) / (w * w))
    reach = np.sqrt(square)
    if not below < reach:
        return False
    limit = below * below + 8.0 * (reach + below) * margin
    sums = on_stack(_SUMS, 0.0)
    for i in range(_SUMS):
        sums[i] = 0.0
    for i in range(p + 1):
        for j in range(q + 1):
            k = at + EACH * (i * (q + 1) + j)
            x, y, z, w = parts[k], parts[k + 1], parts[k + 2], limit * parts[k + 3]
            one = _times(p, i) * _times(q, j)
            for other in range(p + 1):
                for last in range(q + 1):
                    m = at + EACH * (other * (q + 1) + last)
                    product = x * parts[m] + y * parts[m + 1] + z * parts[m + 2] - w * parts[m + 3]
                    times = one * _times(p, other) * _times(q, last)
                    sums[(i + other) * _WIDE + j + last] += times * product
    for i in range(2 * p + 1):
        for j in range(2 * q + 1):
            if not sums[i * _WIDE + j] >= 0.0:
                return False
    return True
