"""De Casteljau's midpoints: the control nets of both halves of a cell, from its own.

A cell is named by where its net begins in `nets`: x, y and z first, which bounds are made of, and
of a rational piece x w, y w, z w and w after them, which are divided and then projected.
"""

from __future__ import annotations

from ..base.jit import kernel

_PROJECTED = 3
"""Rows of a net before its homogeneous ones."""


@kernel
def copy_net(piece, source, nets, cell):
    """Write the control net of a whole piece as that of a cell."""
    room = piece.room
    rows, first = 3, 0
    if piece.rational:
        rows, first = 4, _PROJECTED * room
    for k in range(rows * room):
        nets[cell + first + k] = source[piece.net + k]
    if piece.rational:
        project(piece, nets, cell)


@kernel
def project(piece, nets, cell):
    """Write x, y and z of a rational cell from its homogeneous coordinates."""
    room = piece.room
    first = _PROJECTED * room
    for k in range(room):
        w = nets[cell + first + 3 * room + k]
        for axis in range(3):
            nets[cell + axis * room + k] = nets[cell + first + axis * room + k] / w


@kernel
def _rows(piece):
    """Where the rows of a cell that are divided begin, and how many they are."""
    return (_PROJECTED, 4) if piece.rational else (0, 3)


@kernel
def _close(nets, cell, at, points, room):
    """Repeat the last point of a row to its end."""
    for k in range(points, room):
        nets[cell + at + k] = nets[cell + at + points - 1]


@kernel
def halves_u(piece, nets, cell, low, high):
    """Divide a cell's net at the middle of u into those of two other cells."""
    p, n, room = piece.degree_u, piece.degree_v + 1, piece.room
    begin, count = _rows(piece)
    for row in range(begin, begin + count):
        at = row * room
        for k in range(piece.points):
            nets[high + at + k] = nets[cell + at + k]
        for level in range(p):
            # The first row of each level is a row of the low half; what is left is the high half.
            for j in range(n):
                nets[low + at + level * n + j] = nets[high + at + j]
            for i in range(p - level):
                to = at + i * n
                for j in range(n):
                    nets[high + to + j] = 0.5 * (nets[high + to + j] + nets[high + to + n + j])
        for j in range(n):
            nets[low + at + p * n + j] = nets[high + at + j]
        _close(nets, low, at, piece.points, room)
        _close(nets, high, at, piece.points, room)


@kernel
def halves_v(piece, nets, cell, low, high):
    """The same at the middle of v; `low` may be the cell itself."""
    p, q, room = piece.degree_u, piece.degree_v, piece.room
    n = q + 1
    begin, count = _rows(piece)
    for row in range(begin, begin + count):
        for i in range(p + 1):
            at = row * room + i * n
            for j in range(n):
                nets[high + at + j] = nets[cell + at + j]
            for level in range(q):
                nets[low + at + level] = nets[high + at]
                for j in range(q - level):
                    nets[high + at + j] = 0.5 * (nets[high + at + j] + nets[high + at + j + 1])
            nets[low + at + q] = nets[high + at]
        _close(nets, low, row * room, piece.points, room)
        _close(nets, high, row * room, piece.points, room)
