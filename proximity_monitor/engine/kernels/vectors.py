"""Three-vectors and rotations as tuples of floats: numba keeps them in registers."""

from __future__ import annotations

from .jit import kernel


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
def cross(a, b):
    """Vector product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel
def rotated(r, v):
    """Row-major 3×3 rotation, nine numbers of a flat array, times a vector."""
    return (
        r[0] * v[0] + r[1] * v[1] + r[2] * v[2],
        r[3] * v[0] + r[4] * v[1] + r[5] * v[2],
        r[6] * v[0] + r[7] * v[1] + r[8] * v[2],
    )


@kernel
def moved(r, v):
    """Rotation and then translation: r holds twelve numbers, the translation last."""
    return (
        r[0] * v[0] + r[1] * v[1] + r[2] * v[2] + r[9],
        r[3] * v[0] + r[4] * v[1] + r[5] * v[2] + r[10],
        r[6] * v[0] + r[7] * v[1] + r[8] * v[2] + r[11],
    )
