"""Points and derivatives of a profile's pieces, and their control points over a part."""

from __future__ import annotations

from ..base.jit import inlined, kernel
from ..base.memory import table_on_stack

WIDTH = 16
"""Control points that a piece has room for."""


@inlined
def _control(curve, i):
    return (curve.control[3 * i], curve.control[3 * i + 1], curve.control[3 * i + 2])


@inlined
def _between(s, p, t, q):
    return (s * p[0] + t * q[0], s * p[1] + t * q[1], s * p[2] + t * q[2])


@kernel
def _last_three(curve, t):
    """Return the last three points of de Casteljau's method, for any degree from 2 on."""
    rows = table_on_stack(16, 3, 0.0)
    degree, s = curve.degree, 1.0 - t
    for i in range(degree + 1):
        for c in range(3):
            rows[i, c] = curve.control[3 * i + c]
    for level in range(degree, 2, -1):
        for i in range(level):
            for c in range(3):
                rows[i, c] = s * rows[i, c] + t * rows[i + 1, c]
    return (
        (rows[0, 0], rows[0, 1], rows[0, 2]), (rows[1, 0], rows[1, 1], rows[1, 2]),
        (rows[2, 0], rows[2, 1], rows[2, 2]),
    )  # fmt: skip


@kernel
def jet_of(curve, t):
    """Return the point of a piece at t, and its first two derivatives: three (rho, z), metres.

    By de Casteljau's method, and the quotient rule (Piegl and Tiller, The NURBS Book, 1997,
    equation 4.8). Up to degree 3 all numbers stay in registers, which takes half the time.
    """
    degree, s = curve.degree, 1.0 - t
    begin, end, second = _control(curve, 0), _control(curve, 1), (0.0, 0.0, 0.0)
    if degree > 1:
        middle, end = end, _control(curve, 2)
        if degree == 3:
            begin, middle, end = (
                _between(s, begin, t, middle), _between(s, middle, t, end),
                _between(s, end, t, _control(curve, 3)),
            )  # fmt: skip
        elif degree > 3:
            begin, middle, end = _last_three(curve, t)
        second = (
            end[0] - 2.0 * middle[0] + begin[0],
            end[1] - 2.0 * middle[1] + begin[1],
            end[2] - 2.0 * middle[2] + begin[2],
        )
        begin, end = _between(s, begin, t, middle), _between(s, middle, t, end)
    first = (end[0] - begin[0], end[1] - begin[1], end[2] - begin[2])
    x, z, w = _between(s, begin, t, end)
    once, twice = float(degree), float(degree * (degree - 1))
    w1, w2 = once * first[2] / w, twice * second[2] / w
    x, z = x / w, z / w
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
