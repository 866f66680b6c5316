"""Points and derivatives of a profile's pieces, and their control points over a part."""

from __future__ import annotations

from ..base.jit import inlined, kernel
from ..base.memory import table_on_stack

WIDTH = 16
"""Control points that a piece has room for."""


@kernel
def jet_of(curve, t):
    """Return the point of a piece at t, and its first two derivatives: three (rho, z), metres.

    By de Casteljau's method, and the quotient rule (Piegl and Tiller, The NURBS Book, 1997,
    equation 4.8).
    """
    rows = table_on_stack(16, 3, 0.0)
    degree = curve.degree
    for i in range(degree + 1):
        for c in range(3):
            rows[i, c] = curve.control[3 * i + c]
    s = 1.0 - t
    first, second = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for level in range(degree, 0, -1):
        if level == 2:
            second = (
                rows[2, 0] - 2.0 * rows[1, 0] + rows[0, 0],
                rows[2, 1] - 2.0 * rows[1, 1] + rows[0, 1],
                rows[2, 2] - 2.0 * rows[1, 2] + rows[0, 2],
            )
        if level == 1:
            first = (
                rows[1, 0] - rows[0, 0],
                rows[1, 1] - rows[0, 1],
                rows[1, 2] - rows[0, 2],
            )
        for i in range(level):
            for c in range(3):
                rows[i, c] = s * rows[i, c] + t * rows[i + 1, c]
    once, twice = float(degree), float(degree * (degree - 1))
    w = rows[0, 2]
    w1, w2 = once * first[2] / w, twice * second[2] / w
    x, z = rows[0, 0] / w, rows[0, 1] / w
    x1, z1 = once * first[0] / w - w1 * x, once * first[1] / w - w1 * z
    x2 = twice * second[0] / w - 2.0 * w1 * x1 - w2 * x
    z2 = twice * second[1] / w - 2.0 * w1 * z1 - w2 * z
    return (x, z), (x1, z1), (x2, z2)


@kernel
def put_part(curve, low, high, rows):
    """Write the control points rho w, z w and w of the part from `low` to `high` to `rows`."""
    degree = curve.degree
    for i in range(degree + 1):
        for c in range(3):
            rows[i, c] = curve.control[3 * i + c]
    _cut(rows, degree, low, high)


@kernel
def size_of_part(curve, low, high, size):
    """Return the length of which rounding errors of a part are shares, metres, at least `size`.

    Rounding errs by shares of the terms that are added up, whatever their signs. So this is the
    largest coordinate that the control points of the part would have if all coordinates of the
    piece's control points were positive.
    """
    degree, most = curve.degree, 0.0
    for i in range(degree + 1):
        far = max(abs(curve.control[3 * i]), abs(curve.control[3 * i + 1]))
        most = max(most, far / curve.control[3 * i + 2])
    if most <= size:
        return size
    rows = table_on_stack(16, 3, 0.0)
    for i in range(degree + 1):
        for c in range(3):
            rows[i, c] = abs(curve.control[3 * i + c])
    _cut(rows, degree, low, high)
    most = size
    for i in range(degree + 1):
        most = max(most, max(rows[i, 0], rows[i, 1]) / rows[i, 2])
    return most


@inlined
def _cut(rows, degree, low, high):
    """Make the control points in `rows` those of the part from `low` to `high`."""
    if high < 1.0:
        # Keep what is below `high`: the first points of each level.
        for level in range(degree):
            for i in range(degree, level, -1):
                for c in range(3):
                    rows[i, c] = (1.0 - high) * rows[i - 1, c] + high * rows[i, c]
    if low > 0.0:
        # Keep what is above `low`, which is a share of the part that is there now.
        share, left = low / high, (high - low) / high  # 1 - share would lose digits near the end
        for level in range(degree):
            for i in range(degree - level):
                for c in range(3):
                    rows[i, c] = left * rows[i, c] + share * rows[i + 1, c]
