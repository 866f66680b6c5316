"""The search direction: from a's nearest point found so far to b's. Gaps are measured along it.

Triangles that share the nearest corner or edge are exactly equally near. If the models are far
apart, many more are nearly so. A bound in single precision cannot tell them from nearer ones. But
along the search direction their gap *is* the distance found. Six inner products in float64 prune
nearly all of them.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import fused, inlined, kernel
from ..base.rounding import DOUBLE_EPS, GAP_SHARE
from ..base.vectors import dot


@kernel
def forget_direction(progress):
    """Forget the search direction: `gap_along` then returns no useful bound and prunes nothing."""
    for i in range(3):
        progress.normal_a[i] = progress.normal_b[i] = 0.0
    progress.offset = 0.0


@kernel
def take_direction(progress, motion, g):
    """Make g the search direction: the vector from a's nearest point to b's, in a's frame.

    Half a dozen roundings may lengthen the unit vector by less than 4 u, so it is shortened by that
    much. If g vanishes, the direction is zero and prunes nothing.
    """
    length = np.sqrt(dot(g, g))
    scale = (1.0 - 4.0 * DOUBLE_EPS) / length if length > 1e-140 else 0.0
    x, y, z = scale * g[0], scale * g[1], scale * g[2]
    progress.normal_a[0], progress.normal_a[1], progress.normal_a[2] = x, y, z
    for i in range(3):
        progress.normal_b[i] = motion[i] * x + motion[3 + i] * y + motion[6 + i] * z
    progress.offset = motion[9] * x + motion[10] * y + motion[11] * z


@fused
def _along(normal, triangles, t):
    """Return the inner products of a triangle's three corners with a direction."""
    x, y, z = normal[0], normal[1], normal[2]
    return (
        x * triangles[t, 0] + y * triangles[t, 1] + z * triangles[t, 2],
        x * triangles[t, 3] + y * triangles[t, 4] + z * triangles[t, 5],
        x * triangles[t, 6] + y * triangles[t, 7] + z * triangles[t, 8],
    )


@inlined
def end_along(progress, triangles_a, ta):
    """Return the largest coordinate of a triangle of a along the search direction."""
    a0, a1, a2 = _along(progress.normal_a, triangles_a, ta)
    return max(max(a0, a1), a2)


@inlined
def begin_of(normal, triangles, t):
    """Return a triangle's least coordinate along a direction given in the triangle's frame."""
    c0, c1, c2 = _along(normal, triangles, t)
    return min(min(c0, c1), c2)


@inlined
def begin_along(progress, triangles_b, tb):
    """Return the least coordinate of a triangle of b along the search direction, in b's frame."""
    return begin_of(progress.normal_b, triangles_b, tb)


@inlined
def gap_between(progress, end, begin):
    """Return a certified lower bound, metres, of two triangles' distance.

    `end` comes from `end_along`, `begin` from `begin_along`.
    """
    return ((begin + progress.offset) - end) - GAP_SHARE * progress.slack


@inlined
def gap_along(progress, triangles_a, ta, triangles_b, tb):
    """Return a certified lower bound of two triangles' distance, metres: their gap along it."""
    end = end_along(progress, triangles_a, ta)
    return gap_between(progress, end, begin_along(progress, triangles_b, tb))
