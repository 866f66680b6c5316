"""Ranges of a cell's derivatives, from the differences of its control points.

The derivatives of a Bezier surface are Bezier surfaces again, so each lies in the convex hull of
its own control points. Parameters run from 0 to 1 over the cell.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import kernel

Ranges = namedtuple(
    "Ranges", "along_u spread_u along_v spread_v middle_uu half_uu most_uu"
    " middle_uv half_uv most_uv middle_vv half_vv most_vv"
)  # fmt: skip
"""Of the derivatives by u and v: a vector, metres, and how far they are from it at most. Of each
second derivative, metres: middle and half length of the range of its product with a direction, and
no less than its length."""


@kernel
def _first(nets, at, room, p, n, step_i, step_j, factor):
    """Middle of the box around the derivatives along one parameter, and its half diagonal."""
    x_low = y_low = z_low = np.inf
    x_high = y_high = z_high = -np.inf
    for i in range(p + 1 - step_i):
        for j in range(n - step_j):
            k = at + i * n + j
            m = k + step_i * n + step_j
            x = nets[m] - nets[k]
            y = nets[m + room] - nets[k + room]
            z = nets[m + 2 * room] - nets[k + 2 * room]
            x_low, x_high = min(x_low, x), max(x_high, x)
            y_low, y_high = min(y_low, y), max(y_high, y)
            z_low, z_high = min(z_low, z), max(z_high, z)
    x, y, z = x_high - x_low, y_high - y_low, z_high - z_low
    middle = 0.5 * factor * (x_low + x_high), 0.5 * factor * (y_low + y_high)
    return (
        (middle[0], middle[1], 0.5 * factor * (z_low + z_high)),
        0.5 * factor * np.sqrt(x * x + y * y + z * z),
    )


@kernel
def _second(nets, at, room, p, n, step, other, count_i, count_j, factor, d):
    """Middle and half length of d times a second derivative, and its largest length.

    The differences are of the points k, k + step, k + other and k + step + other.
    """
    low, high, most = np.inf, -np.inf, 0.0
    for i in range(count_i):
        for j in range(count_j):
            k = at + i * n + j
            value = squared = 0.0
            for axis in range(3):
                m = k + axis * room
                x = (nets[m + step + other] - nets[m + step]) - (nets[m + other] - nets[m])
                value += d[axis] * x
                squared += x * x
            low, high, most = min(low, value), max(high, value), max(most, squared)
    if high < low:
        return 0.0, 0.0, 0.0
    return 0.5 * factor * (low + high), 0.5 * factor * (high - low), factor * np.sqrt(most)


@kernel
def ranges_of(piece, nets, at, d):
    """The ranges of a cell of a piece that is not rational; d is a direction in its frame."""
    p, q, room = np.int64(piece.degree_u), np.int64(piece.degree_v), np.int64(piece.room)
    n = q + 1
    none = (0.0, 0.0, 0.0)
    along_u, spread_u = _first(nets, at, room, p, n, 1, 0, float(p))
    along_v, spread_v = none, 0.0
    if q > 0:
        along_v, spread_v = _first(nets, at, room, p, n, 0, 1, float(q))
    uu = _second(nets, at, room, p, n, n, n, p - 1, n, p * (p - 1.0), d)
    uv = _second(nets, at, room, p, n, n, 1, p, q, float(p * q), d)
    vv = _second(nets, at, room, p, n, 1, 1, p + 1, q - 1, q * (q - 1.0), d)
    return Ranges(
        along_u, spread_u, along_v, spread_v,
        uu[0], uu[1], uu[2], uv[0], uv[1], uv[2], vv[0], vv[1], vv[2],
    )  # fmt: skip
