"""How far a cell reaches along a direction, from the control points of its parts.

The control points of a cell go beyond the cell by about as much as it bends; those of its four
parts by a quarter of that. Along one direction, this takes midpoints of numbers, not of points: far
less work than dividing the cell, and it often makes the division unnecessary.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel
from ..base.memory import on_stack
from ..base.rounding import NET_SPLIT
from ..base.trees import NONE, SurfaceTree
from .cells import net_of
from .sides import least_of
from .subdivide import PROJECTED

_MOST = 496
"""Most numbers of a cell divided in u alone, of degree 15 in both directions."""


def halved_least(tree, cells, nets, index, n):
    """As `least_of`, but from the points of a cell's parts, less all rounding errors: a stub."""


@inlined
def _halve(line, last, out, first, step):
    """Write the control points of both halves, of `last` + 1 numbers, to every step-th of `out`."""
    out[first], out[first + 2 * last * step] = line[0], line[last]
    for level in range(1, last + 1):
        for i in range(last + 1 - level):
            line[i] = 0.5 * (line[i] + line[i + 1])
        out[first + level * step] = line[0]
        out[first + (2 * last - level) * step] = line[last - level]


@inlined
def _in_u(nets, x, y, z, n, p, q, line, out):
    """Write the products of n with a net's points, halved in u: rows of q + 1."""
    for j in range(q + 1):
        for i in range(p + 1):
            k = i * (q + 1) + j
            line[i] = n[0] * nets[x + k] + n[1] * nets[y + k] + n[2] * nets[z + k]
        _halve(line, p, out, j, q + 1)


@inlined
def _least(nets, at, room, n, p, q):
    line, ends = on_stack(16, 0.0), on_stack(31, 0.0)
    rows = on_stack(_MOST, 0.0)
    _in_u(nets, at, at + room, at + 2 * room, n, p, q, line, rows)
    least = np.inf
    for i in range(2 * p + 1):
        for j in range(q + 1):
            line[j] = rows[i * (q + 1) + j]
        _halve(line, q, ends, 0, 1)
        for j in range(2 * q + 1):
            least = min(least, ends[j])
    return least


@inlined
def _least_quotient(nets, at, room, n, p, q):
    """As `_least`, of homogeneous coordinates: the products over their weights, all positive."""
    line, ends, below = on_stack(16, 0.0), on_stack(31, 0.0), on_stack(31, 0.0)
    rows, weights = on_stack(_MOST, 0.0), on_stack(_MOST, 0.0)
    _in_u(nets, at, at + room, at + 2 * room, n, p, q, line, rows)
    w = at + 3 * room
    _in_u(nets, w, w, w, (1.0, 0.0, 0.0), p, q, line, weights)
    least = np.inf
    for i in range(2 * p + 1):
        for j in range(q + 1):
            line[j] = rows[i * (q + 1) + j]
        _halve(line, q, ends, 0, 1)
        for j in range(q + 1):
            line[j] = weights[i * (q + 1) + j]
        _halve(line, q, below, 0, 1)
        for j in range(2 * q + 1):
            least = min(least, ends[j] / below[j])
    return least


@implements(halved_least, SurfaceTree)
@kernel
def _halved_least(tree, cells, nets, index, n):
    cell = cells[index]
    piece = tree.pieces[cell.element]
    if piece.edge != NONE:  # the net of an edge is a box
        return least_of(tree, cells, nets, index, n)
    at, room = net_of(cells, nets, index), np.int64(piece.room)
    p, q = np.int64(piece.degree_u), np.int64(piece.degree_v)
    if piece.rational:
        at += PROJECTED * room
        if p == 2 and q == 2:
            least = _least_quotient(nets, at, room, n, 2, 2)
        else:
            least = _least_quotient(nets, at, room, n, p, q)
    elif p == 3 and q == 3:
        least = _least(nets, at, room, n, 3, 3)
    else:
        least = _least(nets, at, room, n, p, q)
    # A product errs by 3 u P, and each of the p + q midpoints adds u P. If the cell is rational,
    # that holds for w P, and likewise for w: (4 + 2 (p + q)) u P in all, because all are means with
    # positive shares.
    return least - NET_SPLIT * (max(p, q) + 1.0) * tree.scale[2]
