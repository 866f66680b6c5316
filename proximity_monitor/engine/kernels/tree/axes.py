"""Axes along which a volume is fitted: principal axes of points, or axes along a leaf's side."""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel
from ..base.memory import table_on_stack
from ..base.vectors import along, cross, dot, scaled, sub
from ..tree.layout import row

_SHORTEST = 1e-200
"""Least squared length, in node units, of a vector that is normalised. A square below 1e-308 has
lost digits, and dividing by its root does not give a unit vector, which the margins assume."""

_NEEDLE = 1e-24
"""Squared area of a leaf, divided by its longest side to the fourth power, below which the leaf's
normal is only rounding noise."""

_UPRIGHT = 1e-8
"""Squared length of a side's projection into its leaf's plane, as a share of the side's squared
length, below which the projection is only rounding noise."""

_LONGER = 0.01
"""Share by which a rectangle along the longest side may be larger and still be preferred: around a
single triangle, the rectangles along all sides have the same area."""


@kernel
def eigenvectors(xx, xy, xz, yy, yz, zz):
    """Return orthonormal eigenvectors of a symmetric matrix, largest eigenvalue first.

    They are three tuples, computed by cyclic Jacobi sweeps. Convergence is quadratic: eight sweeps
    are ample for 3×3. Axes that had not converged would still be orthonormal; only the fit would be
    looser.
    """
    a = table_on_stack(3, 3, 0.0)
    a[0, 0], a[0, 1], a[0, 2] = xx, xy, xz
    a[1, 0], a[1, 1], a[1, 2] = xy, yy, yz
    a[2, 0], a[2, 1], a[2, 2] = xz, yz, zz
    v = table_on_stack(3, 3, 0.0)
    v[0, 0], v[0, 1], v[0, 2] = 1.0, 0.0, 0.0
    v[1, 0], v[1, 1], v[1, 2] = 0.0, 1.0, 0.0
    v[2, 0], v[2, 1], v[2, 2] = 0.0, 0.0, 1.0
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
    """Apply one Jacobi rotation that makes a[p, q] zero (Golub and Van Loan, algorithm 8.4.1)."""
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
    """Return the principal axes of points[:n], longest first.

    They come from mean and covariance (Larsen et al. 1999, section 4.1).
    """
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
def axes_of_leaf(points, n):
    """Return axes of a leaf with outline points[:n], n >= 3.

    The first is along a side, the second in the leaf's plane, the third is its normal. The side is
    the one whose bounding rectangle is smallest. Around two triangles that form a rectangle, or
    nearly so, the bounding rectangle is no larger than the triangles.
    """
    longest, first = 0.0, (1.0, 0.0, 0.0)
    for i in range(n):
        e = _side(points, i, n)
        ee = dot(e, e)
        if ee > longest:
            longest, first = ee, e
    if longest <= _SHORTEST:
        return (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    first = scaled(first, 1.0 / np.sqrt(longest))
    # For four points, the normal is the product of the diagonals.
    p, q = sub(row(points, 2), row(points, 0)), sub(row(points, n - 1), row(points, 1))
    normal = cross(p, q)
    # Remove the component along the side twice: the second time removes what rounding left.
    normal = along(normal, first, -dot(normal, first))
    normal = along(normal, first, -dot(normal, first))
    length = dot(normal, normal)
    if length <= max(_NEEDLE * longest * longest, _SHORTEST):
        # The leaf's normal is rounding noise: any vector perpendicular to its longest side serves.
        normal = cross(first, _least_aligned(first))
        normal = scaled(normal, 1.0 / np.sqrt(dot(normal, normal)))
        return first, cross(normal, first), normal
    normal = scaled(normal, 1.0 / np.sqrt(length))
    smallest = np.inf
    for i in range(n):
        e = _side(points, i, n)
        f = along(e, normal, -dot(e, normal))
        ee, ff = dot(e, e), dot(f, f)
        if ff > max(_UPRIGHT * ee, _SHORTEST):
            f = scaled(f, 1.0 / np.sqrt(ff))
            area = _area(points, n, f, cross(normal, f)) * (1.0 - _LONGER * ee / longest)
            if area < smallest:
                smallest, first = area, f
    return first, cross(normal, first), normal


@kernel
def _side(points, i, n):
    """Return the side of an outline from point i to the next."""
    return sub(row(points, i + 1 if i + 1 < n else 0), row(points, i))


@kernel
def _area(points, n, u, v):
    """Return the area of the rectangle around points[:n] along two axes."""
    low_s, high_s, low_t, high_t = np.inf, -np.inf, np.inf, -np.inf
    for i in range(n):
        d = sub(row(points, i), row(points, 0))
        s, t = dot(d, u), dot(d, v)
        low_s, high_s, low_t, high_t = min(low_s, s), max(high_s, s), min(low_t, t), max(high_t, t)
    return (high_s - low_s) * (high_t - low_t)


@kernel
def _least_aligned(v):
    """Return the coordinate direction that is farthest from parallel to v."""
    x, y, z = abs(v[0]), abs(v[1]), abs(v[2])
    if x <= y and x <= z:
        return (1.0, 0.0, 0.0)
    if y <= z:
        return (0.0, 1.0, 0.0)
    return (0.0, 0.0, 1.0)
