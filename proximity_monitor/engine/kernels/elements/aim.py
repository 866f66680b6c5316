"""The direction between the nearest points found so far, along which other triangles are measured.

Triangles that share the nearest corner or edge are exactly as near as each other, and where the
models are far apart many are nearly so: no bound in single precision tells them from nearer ones.
But along the direction between the nearest points their gap *is* that distance. Six inner products
in float64 dismiss nearly all of them.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.rounding import DOUBLE_EPS, GAP_SHARE
from ..base.state import NORMAL_A, NORMAL_B, OFFSET, SLACK
from ..base.vectors import dot


@kernel
def no_aim(reals):
    """Forget the direction: `gap_along` is then of no use, and dismisses nothing."""
    for i in range(NORMAL_A, OFFSET + 1):
        reals[i] = 0.0


@kernel
def take_aim(reals, motion, g):
    """Measure along g, the way from the nearest point of a to that of b in a's frame.

    Half a dozen roundings may lengthen a unit vector by less than 4 u, so it is made that much
    shorter; a vanishing g gives none.
    """
    length = np.sqrt(dot(g, g))
    scale = (1.0 - 4.0 * DOUBLE_EPS) / length if length > 1e-140 else 0.0
    x, y, z = scale * g[0], scale * g[1], scale * g[2]
    reals[NORMAL_A], reals[NORMAL_A + 1], reals[NORMAL_A + 2] = x, y, z
    for i in range(3):
        reals[NORMAL_B + i] = motion[i] * x + motion[3 + i] * y + motion[6 + i] * z
    reals[OFFSET] = motion[9] * x + motion[10] * y + motion[11] * z


@inlined
def _along(reals, normal, triangles, t):
    """The products of a triangle's three corners with a direction."""
    x, y, z = reals[normal], reals[normal + 1], reals[normal + 2]
    return (
        x * triangles[t, 0] + y * triangles[t, 1] + z * triangles[t, 2],
        x * triangles[t, 3] + y * triangles[t, 4] + z * triangles[t, 5],
        x * triangles[t, 6] + y * triangles[t, 7] + z * triangles[t, 8],
    )


@inlined
def end_along(reals, triangles_a, ta):
    """Where a triangle of a ends along the aim."""
    a0, a1, a2 = _along(reals, NORMAL_A, triangles_a, ta)
    return max(max(a0, a1), a2)


@inlined
def begin_along(reals, triangles_b, tb):
    """Where a triangle of b begins along the aim, in b's frame."""
    b0, b1, b2 = _along(reals, NORMAL_B, triangles_b, tb)
    return min(min(b0, b1), b2)


@inlined
def gap_between(reals, end, begin):
    """Certified lower bound of the distance, metres, of what ends and what begins there."""
    return ((begin + reals[OFFSET]) - end) - GAP_SHARE * reals[SLACK]


@inlined
def gap_along(reals, triangles_a, ta, triangles_b, tb):
    """Certified lower bound of the distance of two triangles, metres: their gap along the aim."""
    end = end_along(reals, triangles_a, ta)
    return gap_between(reals, end, begin_along(reals, triangles_b, tb))
