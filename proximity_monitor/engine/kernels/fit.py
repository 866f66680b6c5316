"""Fitting a swept sphere volume to triangles (Larsen et al. 1999, section 4.1).

The axes come from the covariance of the vertices; the rectangle is shrunk by the radius along both
sides and its corners grown back at 45 degrees. None of that is trusted to contain anything: after
rounding to float32 the radius is measured again from the rounded rectangle to every vertex, and a
volume is convex, so the triangles are inside whatever the fit did.
"""

from __future__ import annotations

import numpy as np

from ..tolerances import DOUBLE_EPS, SINGLE_EPS
from .jit import kernel
from .vectors import cross, dot, scaled, sub

_SQRT_HALF = 0.7071067811865476


@kernel
def eigenvectors(xx, xy, xz, yy, yz, zz):
    """Orthonormal eigenvectors of a symmetric matrix, largest eigenvalue first, by cyclic Jacobi.

    Returns three tuples. Convergence is quadratic: eight sweeps are ample for 3×3; axes that have
    not settled would still be orthonormal, and only the fit would be looser.
    """
    a = np.empty((3, 3))
    a[0, 0], a[0, 1], a[0, 2] = xx, xy, xz
    a[1, 0], a[1, 1], a[1, 2] = xy, yy, yz
    a[2, 0], a[2, 1], a[2, 2] = xz, yz, zz
    v = np.eye(3)
    for _ in range(8):
        off = abs(a[0, 1]) + abs(a[0, 2]) + abs(a[1, 2])
        if off <= 1e-12 * (abs(a[0, 0]) + abs(a[1, 1]) + abs(a[2, 2])):
            break
        for p in range(2):
            for q in range(p + 1, 3):
                if a[p, q] != 0.0:
                    _rotate(a, v, p, q)
    i0, i1, i2 = 0, 1, 2
    if a[i0, i0] < a[i1, i1]:
        i0, i1 = i1, i0
    if a[i1, i1] < a[i2, i2]:
        i1, i2 = i2, i1
    if a[i0, i0] < a[i1, i1]:
        i0, i1 = i1, i0
    return (
        (v[0, i0], v[1, i0], v[2, i0]),
        (v[0, i1], v[1, i1], v[2, i1]),
        (v[0, i2], v[1, i2], v[2, i2]),
    )


@kernel
def _rotate(a, v, p, q):
    """One Jacobi rotation that makes a[p, q] zero (Golub and Van Loan, algorithm 8.4.1)."""
    theta = (a[q, q] - a[p, p]) / (2.0 * a[p, q])
    t = 1.0 / (abs(theta) + np.sqrt(theta * theta + 1.0))
    if theta < 0.0:
        t = -t
    c = 1.0 / np.sqrt(t * t + 1.0)
    s = t * c
    for k in range(3):
        akp, akq = a[k, p], a[k, q]
        a[k, p], a[k, q] = c * akp - s * akq, s * akp + c * akq
    for k in range(3):
        apk, aqk = a[p, k], a[q, k]
        a[p, k], a[q, k] = c * apk - s * aqk, s * apk + c * aqk
        vkp, vkq = v[k, p], v[k, q]
        v[k, p], v[k, q] = c * vkp - s * vkq, s * vkp + c * vkq


@kernel
def axes_of_points(points, n):
    """Principal axes of points[:n], longest first (section 4.1: mean and covariance)."""
    mx = my = mz = 0.0
    for i in range(n):
        mx += points[i, 0]
        my += points[i, 1]
        mz += points[i, 2]
    mx, my, mz = mx / n, my / n, mz / n
    xx = xy = xz = yy = yz = zz = 0.0
    for i in range(n):
        x, y, z = points[i, 0] - mx, points[i, 1] - my, points[i, 2] - mz
        xx += x * x
        xy += x * y
        xz += x * z
        yy += y * y
        yz += y * z
        zz += z * z
    return eigenvectors(xx, xy, xz, yy, yz, zz)


@kernel
def axes_of_triangle(points):
    """Axes of one triangle: its longest edge, then the perpendicular in its plane."""
    p = (points[0, 0], points[0, 1], points[0, 2])
    q = (points[1, 0], points[1, 1], points[1, 2])
    r = (points[2, 0], points[2, 1], points[2, 2])
    e0, e1, e2 = sub(q, p), sub(r, q), sub(p, r)
    l0, l1, l2 = dot(e0, e0), dot(e1, e1), dot(e2, e2)
    along, other, longest = e0, e1, l0
    if l1 > longest:
        along, other, longest = e1, e2, l1
    if l2 > longest:
        along, other, longest = e2, e0, l2
    if longest == 0.0 or not np.isfinite(1.0 / longest):
        return (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    first = scaled(along, 1.0 / np.sqrt(longest))
    normal = cross(first, other)
    length = dot(normal, normal)
    # A needle's perpendicular is rounding noise: any perpendicular of its long edge serves.
    if length <= (1e-12 * 1e-12) * longest:
        normal = cross(first, _least_aligned(first))
        length = dot(normal, normal)
    normal = scaled(normal, 1.0 / np.sqrt(length))
    return first, cross(normal, first), normal


@kernel
def _least_aligned(v):
    """The coordinate direction that is farthest from parallel to v."""
    x, y, z = abs(v[0]), abs(v[1]), abs(v[2])
    if x <= y and x <= z:
        return (1.0, 0.0, 0.0)
    if y <= z:
        return (0.0, 1.0, 0.0)
    return (0.0, 0.0, 1.0)


@kernel
def rectangle(points, n, first, second, normal, local):
    """Rectangle and radius that enclose points[:n] (section 4.1); returns centre, u, v.

    `local` (n, 3) is scratch: the points in the axes. The returned half edges may vanish.
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
    return centre, scaled(first, 0.5 * (high_x - low_x)), scaled(second, 0.5 * (high_y - low_y))


@kernel
def enclosing_radius(points, n, centre, u, v):
    """Radius, rounded up to float32, of the ball that swept over {c + s u + t v} covers points[:n].

    Any s and t in [-1, 1] give an upper bound of a point's distance to the rectangle, so the
    projections need no exactness; the last line pays for the rounding of this very computation.
    """
    uu, vv = dot(u, u), dot(v, v)
    iu = 1.0 / uu if uu > 0.0 else 0.0
    iv = 1.0 / vv if vv > 0.0 else 0.0
    worst = 0.0
    size = 0.0
    for i in range(n):
        d = (points[i, 0] - centre[0], points[i, 1] - centre[1], points[i, 2] - centre[2])
        s = min(max(dot(d, u) * iu, -1.0), 1.0)
        t = min(max(dot(d, v) * iv, -1.0), 1.0)
        e = (
            d[0] - s * u[0] - t * v[0],
            d[1] - s * u[1] - t * v[1],
            d[2] - s * u[2] - t * v[2],
        )
        worst = max(worst, dot(e, e))
        size = max(size, abs(points[i, 0]) + abs(points[i, 1]) + abs(points[i, 2]))
    rounding = 16.0 * DOUBLE_EPS * (size + abs(centre[0]) + abs(centre[1]) + abs(centre[2]))
    radius = np.sqrt(worst) + rounding
    # A float32 is within u32 of its number: twice that is safely above. The smallest normal
    # float32 covers what would be flushed.
    return np.float32(radius * (1.0 + 2.0 * SINGLE_EPS) + 1.2e-38)
