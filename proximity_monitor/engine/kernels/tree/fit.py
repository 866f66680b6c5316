"""Fitting a volume to triangles (Larsen et al. 1999, section 4.1).

A volume is a core (rectangle, line or point) swept by a ball, or a box (boxfit.py). The axes come
from the covariance of the vertices, those of a leaf from its sides (axes.py). A rectangle is shrunk
by the radius along both sides, and its corners are then grown back at 45 degrees. A line goes
through the centre of the smallest circle around the vertices, seen along the line, and is shortened
by its caps. A point is the centre of the smallest ball.

Containment does not depend on the fit. After rounding to float32, the radius is measured again from
the rounded core to every vertex. A volume is convex, so it then contains the triangles.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel
from ..base.rounding import DOUBLE_EPS, SINGLE_EPS
from ..base.vectors import add, dot
from .ball import enclosing_ball
from .boxfit import box

RSS = None
LSS, PSS, HYBRID, OBB, AABB = 1, 2, 3, 4, 5
"""The volumes of a hierarchy: rectangle, line or point swept spheres; HYBRID: one of these three,
chosen for each volume by the dimensions of its box; from OBB on: boxes along the principal axes of
their content or along the coordinate axes. RSS, the usual one, is None: numba then sees the choice
at compile time and leaves out the code of the others."""

_SQRT_HALF = 0.7071067811865476
_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@kernel
def core(points, n, axes, volume, local):
    """Return the core of a volume around points[:n]: centre, unit axes and half lengths along them.

    The core is fitted along three given axes, except for point swept spheres and boxes along the
    coordinate axes. `local` (n, 3) is scratch. Half lengths may be 0.
    """
    first, second, normal = axes
    if volume is None:
        return rectangle(points, n, first, second, normal, local)
    return _other_core(points, n, first, second, normal, volume, local)


@kernel
def _other_core(points, n, first, second, normal, volume, local):
    """Return the core of a volume other than RSS."""
    if volume == AABB:
        return box(points, n, _X, _Y, _Z)
    if volume == OBB:
        return box(points, n, first, second, normal)
    x, y, z = extent(points, n, first), extent(points, n, second), extent(points, n, normal)
    if volume == HYBRID:
        volume = choice(x, y, z)
    if volume == PSS:
        return point(points, n, local)
    if volume != LSS:
        return rectangle(points, n, first, second, normal, local)
    if z > max(x, y):
        return line(points, n, normal, first, second, local)
    if y > x:
        return line(points, n, second, normal, first, local)
    return line(points, n, first, second, normal, local)


@kernel
def extent(points, n, axis):
    """Return the length of points[:n] along an axis."""
    low, high = np.inf, -np.inf
    for i in range(n):
        x = dot((points[i, 0], points[i, 1], points[i, 2]), axis)
        low, high = min(low, x), max(high, x)
    return high - low


@kernel
def choice(x, y, z):
    """Choose a volume by the static rule of section 4.2: PSS, LSS, or HYBRID for a rectangle.

    A dimension counts as larger than another if it is more than twice as long. A line needs two
    dimensions that are small and similar: a flat strip, such as a long triangle, fits a rectangle
    better.
    """
    largest, smallest = max(x, y, z), min(x, y, z)
    middle = max(min(x, y), min(max(x, y), z))
    if largest <= 2.0 * smallest:
        return PSS
    if largest > 2.0 * middle and middle <= 2.0 * smallest:
        return LSS
    return HYBRID


@kernel
def point(points, n, local):
    """Return the core of a point swept sphere: centre of the smallest ball around points[:n]."""
    o = (points[0, 0], points[0, 1], points[0, 2])
    for i in range(n):
        for axis in range(3):
            local[i, axis] = points[i, axis] - o[axis]
    return add(o, enclosing_ball(local, n)), _X, _Y, 0.0, 0.0


@kernel
def line(points, n, first, second, normal, local):
    """Return the core of a line swept sphere along `first` around points[:n]."""
    o = (points[0, 0], points[0, 1], points[0, 2])
    for i in range(n):
        d = (points[i, 0] - o[0], points[i, 1] - o[1], points[i, 2] - o[2])
        local[i, 0], local[i, 1], local[i, 2] = 0.0, dot(d, second), dot(d, normal)
    _, y, z = enclosing_ball(local, n)
    squared = 0.0
    for i in range(n):
        local[i, 1] = (local[i, 1] - y) ** 2 + (local[i, 2] - z) ** 2
        squared = max(squared, local[i, 1])
    # A cap covers a point that lies at most w beyond the end of the line.
    low, high = np.inf, -np.inf
    for i in range(n):
        d = (points[i, 0] - o[0], points[i, 1] - o[1], points[i, 2] - o[2])
        x, w = dot(d, first), np.sqrt(squared - local[i, 1])
        low, high = min(low, x + w), max(high, x - w)
    if low > high:
        low = high = 0.5 * (low + high)
    x = 0.5 * (low + high)
    centre = (
        o[0] + x * first[0] + y * second[0] + z * normal[0],
        o[1] + x * first[1] + y * second[1] + z * normal[1],
        o[2] + x * first[2] + y * second[2] + z * normal[2],
    )
    return centre, first, second, 0.5 * (high - low), 0.0


@kernel
def rectangle(points, n, first, second, normal, local):
    """Return, as `core` does, the rectangle of a swept sphere around points[:n] (section 4.1).

    `local` (n, 3) is scratch: the points along the axes.
    """
    o = (points[0, 0], points[0, 1], points[0, 2])
    low_z, high_z = np.inf, -np.inf
    for i in range(n):
        d = (points[i, 0] - o[0], points[i, 1] - o[1], points[i, 2] - o[2])
        local[i, 0], local[i, 1], local[i, 2] = dot(d, first), dot(d, second), dot(d, normal)
        low_z = min(low_z, local[i, 2])
        high_z = max(high_z, local[i, 2])
    radius = 0.5 * (high_z - low_z)
    mid_z = 0.5 * (low_z + high_z)
    # The sides: a point at height z off the rectangle is still covered w beyond its edge.
    low_x, high_x, low_y, high_y = np.inf, -np.inf, np.inf, -np.inf
    for i in range(n):
        z = local[i, 2] - mid_z
        w = np.sqrt(max(radius * radius - z * z, 0.0))
        local[i, 2] = z
        low_x = min(low_x, local[i, 0] + w)
        high_x = max(high_x, local[i, 0] - w)
        low_y = min(low_y, local[i, 1] + w)
        high_y = max(high_y, local[i, 1] - w)
    if low_x > high_x:
        low_x = high_x = 0.5 * (low_x + high_x)
    if low_y > high_y:
        low_y = high_y = 0.5 * (low_y + high_y)
    # The corners, grown outward at 45 degrees where a point lies beyond both edges.
    for i in range(n):
        x, y = local[i, 0], local[i, 1]
        outside_x = max(low_x - x, x - high_x)
        outside_y = max(low_y - y, y - high_y)
        if outside_x > 0.0 and outside_y > 0.0:
            along = _SQRT_HALF * (outside_x + outside_y)
            across = 0.5 * (outside_x - outside_y) * (outside_x - outside_y)
            z = local[i, 2]
            grow = along - np.sqrt(max(radius * radius - across - z * z, 0.0))
            if grow > 0.0:
                grow *= _SQRT_HALF
                if x < low_x:
                    low_x -= grow
                else:
                    high_x += grow
                if y < low_y:
                    low_y -= grow
                else:
                    high_y += grow
    cx, cy = 0.5 * (low_x + high_x), 0.5 * (low_y + high_y)
    centre = (
        o[0] + cx * first[0] + cy * second[0] + mid_z * normal[0],
        o[1] + cx * first[1] + cy * second[1] + mid_z * normal[1],
        o[2] + cx * first[2] + cy * second[2] + mid_z * normal[2],
    )
    return centre, first, second, 0.5 * (high_x - low_x), 0.5 * (high_y - low_y)


@kernel
def enclosing_radius(points, n, centre, u, v, a, b):
    """Return the radius of the ball that, swept over a core, covers points[:n].

    The radius is rounded up to float32.
    Any |s| <= a and |t| <= b give an upper bound of a point's distance to the rectangle, so the
    projections need not be exact. `rounding` covers the rounding of this computation.
    """
    worst = 0.0
    size = 0.0
    for i in range(n):
        d = (points[i, 0] - centre[0], points[i, 1] - centre[1], points[i, 2] - centre[2])
        s = min(max(dot(d, u), -a), a)
        t = min(max(dot(d, v), -b), b)
        e = (
            d[0] - s * u[0] - t * v[0],
            d[1] - s * u[1] - t * v[1],
            d[2] - s * u[2] - t * v[2],
        )
        worst = max(worst, dot(e, e))
        size = max(size, abs(points[i, 0]) + abs(points[i, 1]) + abs(points[i, 2]))
    rounding = 16.0 * DOUBLE_EPS * (size + abs(centre[0]) + abs(centre[1]) + abs(centre[2]))
    radius = np.sqrt(worst) + rounding
    # A float32 is within u32 of its number, so 2 u32 more is safely above. The smallest normal
    # float32 covers a subnormal result that is flushed to zero.
    return np.float32(radius * (1.0 + 2.0 * SINGLE_EPS) + 1.2e-38)
