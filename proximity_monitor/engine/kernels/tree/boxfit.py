"""Fitting a box to triangles along given axes, and measuring it again with the rounded axes."""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel
from ..base.rounding import DOUBLE_EPS, SINGLE_EPS
from ..base.vectors import cross, dot, scaled

_FLOOR = 1.2e-38
"""The smallest normal float32, node units: covers a subnormal result that is flushed to zero."""


@kernel
def box(points, n, first, second, third):
    """Return centre, two unit axes and half lengths along them of the box around points[:n].

    The three given axes are perpendicular. The two along which the box is longest are returned.
    `box_extents` measures the thickness along the third.
    """
    o = (points[0, 0], points[0, 1], points[0, 2])
    low_x = low_y = low_z = np.inf
    high_x = high_y = high_z = -np.inf
    for i in range(n):
        d = (points[i, 0] - o[0], points[i, 1] - o[1], points[i, 2] - o[2])
        x, y, z = dot(d, first), dot(d, second), dot(d, third)
        low_x, high_x = min(low_x, x), max(high_x, x)
        low_y, high_y = min(low_y, y), max(high_y, y)
        low_z, high_z = min(low_z, z), max(high_z, z)
    x, y, z = 0.5 * (low_x + high_x), 0.5 * (low_y + high_y), 0.5 * (low_z + high_z)
    centre = (
        o[0] + x * first[0] + y * second[0] + z * third[0],
        o[1] + x * first[1] + y * second[1] + z * third[1],
        o[2] + x * first[2] + y * second[2] + z * third[2],
    )
    a, b, c = 0.5 * (high_x - low_x), 0.5 * (high_y - low_y), 0.5 * (high_z - low_z)
    if c > min(a, b):
        if a < b:
            return centre, second, third, b, c
        return centre, first, third, a, c
    return centre, first, second, a, b


@kernel
def box_extents(points, n, centre, u, v):
    """Return half lengths and half thickness of a box that holds points[:n], rounded up to float32.

    `u` and `v` are the axes after rounding, so they are not quite perpendicular. A point's
    coordinates along u, v and w = u × v are its products with the dual axes: v × w, w × u and w,
    each divided by w·w, which is near 1.
    """
    w = cross(u, v)
    inverse = 1.0 / dot(w, w)
    over_u, over_v, over_w = scaled(cross(v, w), inverse), scaled(cross(w, u), inverse), w
    a = b = thickness = 0.0
    size = abs(centre[0]) + abs(centre[1]) + abs(centre[2])
    extent = 0.0
    for i in range(n):
        d = (points[i, 0] - centre[0], points[i, 1] - centre[1], points[i, 2] - centre[2])
        a = max(a, abs(dot(d, over_u)))
        b = max(b, abs(dot(d, over_v)))
        thickness = max(thickness, abs(dot(d, over_w)) * inverse)
        extent = max(extent, abs(points[i, 0]) + abs(points[i, 1]) + abs(points[i, 2]))
    # In units of the roundoff u of float64, times the magnitude of point and centre: 1 for the
    # centre's own rounding, 1 for the difference, 3 for the product, and 12 for the dual axes
    # (1 in w, 6 in a product with it, 5 in the division by w·w).
    rounding = 32.0 * DOUBLE_EPS * (extent + size)
    # A float32 is within u32 of its number, so 2 u32 more is safely above. The rounded axes are at
    # most 1 + u32 long, so w is at most 1 + 3 u32 long. The thickness gets 6 u32 more, so that the
    # rectangle swept by a ball of this radius holds the points, too.
    return (
        np.float32((a + rounding) * (1.0 + 2.0 * SINGLE_EPS) + _FLOOR),
        np.float32((b + rounding) * (1.0 + 2.0 * SINGLE_EPS) + _FLOOR),
        np.float32((thickness + rounding) * (1.0 + 8.0 * SINGLE_EPS) + _FLOOR),
    )
