"""Axes to fit a volume along: principal axes of points, and a triangle's own."""

from __future__ import annotations

import numpy as np

from .jit import kernel
from .memory import table_on_stack
from .vectors import cross, dot, scaled, sub


@kernel
def eigenvectors(xx, xy, xz, yy, yz, zz):
    """Orthonormal eigenvectors of a symmetric matrix, largest eigenvalue first, by cyclic Jacobi.

    Returns three tuples. Convergence is quadratic: eight sweeps are ample for 3×3; axes that have
    not settled would still be orthonormal, and only the fit would be looser.
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
