"""The search direction: that between the nearest points found so far, to measure others along it.

Triangles that share the nearest corner or edge are exactly as near as each other, and where the
models are far apart many are nearly so: no bound in single precision tells them from nearer ones.
But along the direction between the nearest points their gap *is* that distance. Six inner products
in float64 dismiss nearly all of them.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.rounding import DOUBLE_EPS, GAP_SHARE
from ..base.vectors import dot


@kernel
def forget_direction(progress):
    """Forget the direction: `gap_along` is then of no use, and dismisses nothing."""
    for i in range(3):
        progress.normal_a[i] = progress.normal_b[i] = 0.0
    progress.offset = 0.0


@kernel
def take_direction(progress, motion, g):
    """Measure along g from now on, the way from the nearest point of a to that of b in a's frame.

    Half a dozen roundings may lengthen a unit vector by less than 4 u, so it is made that much
    shorter; a vanishing g gives none.
    """
    length = np.sqrt(dot(g, g))
    scale = (1.0 - 4.0 * DOUBLE_EPS) / length if length > 1e-140 else 0.0
    x, y, z = scale * g[0], scale * g[1], scale * g[2]
    progress.normal_a[0], progress.normal_a[1], progress.normal_a[2] = x, y, z
    for i in range(3):
        progress.normal_b[i] = motion[i] * x + motion[3 + i] * y + motion[6 + i] * z
    progress.offset = motion[9] * x + motion[10] * y + motion[11] * z


@inlined
def _along(normal, triangles, t):
    """The products of a triangle's three corners with a direction."""
    x, y, z = normal[0], normal[1], normal[2]
    return (
        x * triangles[t, 0] + y * triangles[t, 1] + z * triangles[t, 2],
        x * triangles[t, 3] + y * triangles[t, 4] + z * triangles[t, 5],
        x * triangles[t, 6] + y * triangles[t, 7] + z * triangles[t, 8],
    )


@inlined
def end_along(progress, triangles_a, ta):
    """Where a triangle of a ends along the direction."""
    a0, a1, a2 = _along(progress.normal_a, triangles_a, ta)
    return max(max(a0, a1), a2)


@inlined
def begin_of(normal, triangles, t):
    """Where a triangle begins along a direction, in the frame of both."""
    c0, c1, c2 = _along(normal, triangles, t)
    return min(min(c0, c1), c2)


@inlined
def begin_along(progress, triangles_b, tb):
    """Where a triangle of b begins along the direction, in b's frame."""
    return begin_of(progress.normal_b, triangles_b, tb)


@inlined
def gap_between(progress, end, begin):
    """Certified lower bound of the distance, metres, of what ends and what begins there."""
    return ((begin + progress.offset) - end) - GAP_SHARE * progress.slack


@inlined
def gap_along(progress, triangles_a, ta, triangles_b, tb):
    """Certified lower bound of the distance of two triangles, metres: their gap along it."""
    end = end_along(progress, triangles_a, ta)
    return gap_between(progress, end, begin_along(progress, triangles_b, tb))
