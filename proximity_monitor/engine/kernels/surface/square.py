"""Whether a part is beyond a distance of the origin, by its squared distance as a Bezier surface.

With the numerator M and the weight w of the part's net, no point is nearer than b if |M|² - b² w²
is not negative. That is a Bezier surface of twice the degree. Its control points are sums of
products of those of M and w (Farin, Curves and Surfaces for CAGD, section 6.10), and none of its
points is below the least of them. No other proof is exact near a pole, where a side is one point:
all of its control points that lie beside the pole are those of the pole.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel
from ..base.memory import on_stack
from .parts import EACH

_MOST = 3
"""Highest degree, in either direction, for which this proof is worth its time."""

_SUMS, _WIDE = 49, 7
"""Control points of twice that degree: in all, and in one direction."""


@kernel
def _times(degree, i):
    """Return the binomial coefficient for a degree of at most three."""
    if i == 0 or i == degree:
        return 1.0
    return float(degree)


@kernel
def is_beyond(piece, parts, at, below, margin):
    """Tell whether no point of a part is nearer to the origin than `below`, b metres.

    Let R be no less than the distance of the control points from the origin. Control points err
    by `margin`, so a product errs by 2 R margin w w'. Their weights err too, which the margin
    covers as well: by (R + b) margin w w'. Rounding, in a sum of sixteen, adds
    24 u (R + b)² w w'. The margin is more than 32 u R, and b is less than R, so all of this is
    less than 8 (R + b) margin w w'.
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
