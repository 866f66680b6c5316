"""Three-vectors as tuples of floats, which numba keeps in registers, and rotations of them."""

from __future__ import annotations

import numpy as np

from .jit import inlined, kernel

_NEEDLE = 1e-24
"""Squared sine of the angle of two edges below which their normal is only rounding noise."""

_NOWHERE = (0.0, 0.0, 0.0)


@kernel
def add(a, b):
    """Sum of two vectors."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@kernel
def sub(a, b):
    """Difference of two vectors."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@kernel
def scaled(a, s):
    """Vector times number."""
    return (a[0] * s, a[1] * s, a[2] * s)


@kernel
def along(a, b, s):
    """The point a + s b."""
    return (a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2])


@kernel
def dot(a, b):
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def norm(v):
    """Length of a vector; infinity if its square overflows."""
    return np.sqrt(dot(v, v))


@inlined
def clamped(x):
    """The number from 0 to 1 that is nearest to x."""
    return min(max(x, 0.0), 1.0)


@kernel
def cross(a, b):
    """Vector product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel
def rotated(r, v):
    """Product of a row-major 3×3 rotation (nine numbers of a flat array) and a vector."""
    return (
        r[0] * v[0] + r[1] * v[1] + r[2] * v[2],
        r[3] * v[0] + r[4] * v[1] + r[5] * v[2],
        r[6] * v[0] + r[7] * v[1] + r[8] * v[2],
    )


@kernel
def turned_back(r, v):
    """Product of the transpose of such a rotation and a vector: undoes `rotated`."""
    return (
        r[0] * v[0] + r[3] * v[1] + r[6] * v[2],
        r[1] * v[0] + r[4] * v[1] + r[7] * v[2],
        r[2] * v[0] + r[5] * v[1] + r[8] * v[2],
    )


@kernel
def moved(r, v):
    """A point after a motion r: twelve numbers, first the rotation, then the translation."""
    return (
        r[0] * v[0] + r[1] * v[1] + r[2] * v[2] + r[9],
        r[3] * v[0] + r[4] * v[1] + r[5] * v[2] + r[10],
        r[6] * v[0] + r[7] * v[1] + r[8] * v[2] + r[11],
    )


@kernel
def moved_back(r, v):
    """A point before a motion r that moves it to v: undoes `moved`."""
    return turned_back(r, (v[0] - r[9], v[1] - r[10], v[2] - r[11]))


@kernel
def unit(v):
    """A vector divided by its length; zero if its largest component is below 1e-300."""
    size = max(max(abs(v[0]), abs(v[1])), abs(v[2]))
    if size < 1e-300:
        return _NOWHERE
    v = scaled(v, 1.0 / size)
    return scaled(v, 1.0 / norm(v))


@kernel
def across(e, f):
    """The unit vector perpendicular to two vectors; zero if they are parallel or one is zero."""
    n = cross(unit(e), unit(f))
    return unit(n) if dot(n, n) > _NEEDLE else _NOWHERE


@kernel
def face_normal(t):
    """Unit normal of a triangle (three corners); zero if the triangle has no area."""
    return across(sub(t[1], t[0]), sub(t[2], t[0]))
