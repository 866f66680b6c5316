"""De Casteljau's midpoint rule: the control nets of both halves of a cell, from its own net.

The index in `nets` where its net begins names a cell. The net holds x, y and z first, which bounds
use. For a rational piece, x w, y w, z w and w follow; these are divided and then projected.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel

PROJECTED = 3
"""Rows of a net before its homogeneous rows."""


@kernel
def copy_net(piece, source, nets, cell):
    """Copy the control net of a whole piece to that of a cell."""
    room = piece.room
    rows, first = 3, 0
    if piece.rational:
        rows, first = 4, PROJECTED * room
    for k in range(rows * room):
        nets[cell + first + k] = source[piece.net + k]
    if piece.rational:
        project(piece, nets, cell)


@kernel
def project(piece, nets, cell):
    """Write x, y and z of a rational cell from its homogeneous coordinates."""
    room = piece.room
    first = PROJECTED * room
    for k in range(room):
        w = nets[cell + first + 3 * room + k]
        for axis in range(3):
            nets[cell + axis * room + k] = nets[cell + first + axis * room + k] / w


@kernel
def _rows(piece):
    """Return which row of a cell is the first to divide, and how many rows are divided."""
    return (PROJECTED, 4) if piece.rational else (0, 3)


@inlined
def _close(nets, at, points, room):
    """Repeat the last point of a row to its end."""
    for k in range(points, room):
        nets[at + k] = nets[at + points - 1]


@inlined
def _halve_row_u(nets, source, low, high, p, n):
    """Divide one row of coordinates of (p + 1) n control points at the middle of u."""
    for k in range((p + 1) * n):
        nets[high + k] = nets[source + k]
    for level in range(p):
        # The first points of each level are points of the low half; what is left is the high half.
        for j in range(n):
            nets[low + level * n + j] = nets[high + j]
        for i in range(p - level):
            to = high + i * n
            for j in range(n):
                nets[to + j] = 0.5 * (nets[to + j] + nets[to + n + j])
    for j in range(n):
        nets[low + p * n + j] = nets[high + j]


@inlined
def _halve_row_v(nets, source, low, high, p, n):
    """As `_halve_row_u`, at the middle of v; `low` may be the source."""
    for i in range(p + 1):
        at = i * n
        for j in range(n):
            nets[high + at + j] = nets[source + at + j]
        for level in range(n - 1):
            nets[low + at + level] = nets[high + at]
            for j in range(n - 1 - level):
                nets[high + at + j] = 0.5 * (nets[high + at + j] + nets[high + at + j + 1])
        nets[low + at + n - 1] = nets[high + at]


# If the compiler knows the degrees, it unrolls the loops below, which then take a fifth of the
# time. Degrees 3 and 3 suit most splines, 2 and 2 surfaces of revolution.


@kernel
def halves_u(piece, nets, cell, low, high):
    """Divide a cell's net at the middle of u into the nets of two other cells."""
    p, n, room = np.int64(piece.degree_u), np.int64(piece.degree_v) + 1, np.int64(piece.room)
    begin, count = _rows(piece)
    for row in range(begin, begin + count):
        at = row * room
        if p == 3 and n == 4:
            _halve_row_u(nets, cell + at, low + at, high + at, 3, 4)
        elif p == 2 and n == 3:
            _halve_row_u(nets, cell + at, low + at, high + at, 2, 3)
        else:
            _halve_row_u(nets, cell + at, low + at, high + at, p, n)
        _close(nets, low + at, (p + 1) * n, room)
        _close(nets, high + at, (p + 1) * n, room)


@kernel
def halves_v(piece, nets, cell, low, high):
    """As `halves_u`, at the middle of v; `low` may be the cell itself."""
    p, n, room = np.int64(piece.degree_u), np.int64(piece.degree_v) + 1, np.int64(piece.room)
    begin, count = _rows(piece)
    for row in range(begin, begin + count):
        at = row * room
        if p == 3 and n == 4:
            _halve_row_v(nets, cell + at, low + at, high + at, 3, 4)
        elif p == 2 and n == 3:
            _halve_row_v(nets, cell + at, low + at, high + at, 2, 3)
        else:
            _halve_row_v(nets, cell + at, low + at, high + at, p, n)
        _close(nets, low + at, (p + 1) * n, room)
        _close(nets, high + at, (p + 1) * n, room)
