"""A proof that a cell which trimming loops cross holds a nearest point on an edge only.

A nearest point of a trimmed patch lies on an edge, which is an element of its own, or the distance
there does not fall along either parameter. If the distance falls all over a cell in a direction in
which the cell's piece goes on, only edges are left. Bounds alone would not prove this, because they
include what has been cut off: cells all along the loop would have to be as small as the allowed
error.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel
from ..base.trees import SurfaceTree
from ..base.vectors import dot, moved, norm, scaled, sub
from .cells import net_of
from .facing import vector
from .subdivide import PROJECTED
from .trim import CROSSING


def is_crossed(tree, cells, index):
    """Tell whether trimming loops cross a cell, or may cross it: a stub."""


def ball_of(tree, cells, nets, index):
    """Return the centre and the radius, metres, of a ball that holds a cell: a stub."""


def falls(tree, cells, nets, index, way, spread):
    """Tell whether every point of a cell can move so that it comes nearer to what it faces: a stub.

    The way from any point of the cell to what it faces is within `spread` of `way`, in the frame of
    the cell's model.
    """


@kernel
def leads_to_edges(tree_a, tree_b, state, a, b, slack):
    """Tell whether two cells, one of them crossed by loops, surely hold no nearest inner points."""
    waiting = state.waiting
    of_a = is_crossed(tree_a, waiting.cells_a, a)
    of_b = is_crossed(tree_b, waiting.cells_b, b)
    if not (of_a or of_b):
        return False
    one, radius = ball_of(tree_a, waiting.cells_a, waiting.nets_a, a)
    other, more = ball_of(tree_b, waiting.cells_b, waiting.nets_b, b)
    spread = (radius + more) * (1.0 + 1e-5) + 4.0 * slack  # 1e-5: a pose may stretch b, see form.py
    way = sub(moved(state.motions[0], other), one)
    if of_a and falls(tree_a, waiting.cells_a, waiting.nets_a, a, way, spread):
        return True
    if not of_b:
        return False
    back = sub(moved(state.motions[1], one), other)
    return falls(tree_b, waiting.cells_b, waiting.nets_b, b, back, spread)


@implements(is_crossed, SurfaceTree)
@inlined
def _is_crossed(tree, cells, index):
    return cells[index].side == CROSSING


@implements(ball_of, SurfaceTree)
@kernel
def _ball(tree, cells, nets, index):
    cell = cells[index]
    piece = tree.pieces[cell.element]
    at, room = net_of(cells, nets, index), np.int64(piece.room)
    centre, square = vector(cell.centre), 0.0
    for k in range(at, at + piece.points):
        d = sub((nets[k], nets[k + room], nets[k + 2 * room]), centre)
        square = max(square, dot(d, d))
    return centre, np.sqrt(square) * (1.0 + 1e-12) + cell.margin


@implements(falls, SurfaceTree)
@kernel
def _falls(tree, cells, nets, index, way, spread):
    cell = cells[index]
    piece = tree.pieces[cell.element]
    _, radius = _ball(tree, cells, nets, index)
    length = norm(way) + spread
    p, n = np.int64(piece.degree_u), np.int64(piece.degree_v) + 1
    at = net_of(cells, nets, index)
    low, high = _slopes(cell, piece, nets, at, n, p, n, way, spread, length, radius)
    if (low > 0.0 and cell.high[0] < 1.0) or (high < 0.0 and cell.low[0] > 0.0):
        return True
    low, high = _slopes(cell, piece, nets, at, 1, p + 1, n - 1, way, spread, length, radius)
    return (low > 0.0 and cell.high[1] < 1.0) or (high < 0.0 and cell.low[1] > 0.0)


@kernel
def _slopes(cell, piece, nets, at, step, count_i, count_j, way, spread, length, radius):
    """Return the range of the product of a derivative with the ways, times a positive factor.

    About the cell's centre c, w r' = N' - w' (r - c) with N = w (P - c). N' lies in the hull of the
    differences of control points, and w' between the least and the largest difference of weights.
    """
    room, n = np.int64(piece.room), np.int64(piece.degree_v) + 1
    low, high, turn = np.inf, -np.inf, 0.0
    centre = vector(cell.centre)
    for i in range(count_i):
        for j in range(count_j):
            k = at + i * n + j
            if piece.rational:
                h = k + PROJECTED * room
                of_w = nets[h + 3 * room + step] - nets[h + 3 * room]
                heavy = max(nets[h + 3 * room + step], nets[h + 3 * room])
                d = sub(_three(nets, h + step, room), _three(nets, h, room))
                d = sub(d, scaled(centre, of_w))
                turn = max(turn, abs(of_w))
            else:
                d, heavy = sub(_three(nets, k + step, room), _three(nets, k, room)), 1.0
            loss = norm(d) * (spread + 1e-12 * length) + 4.0 * heavy * cell.margin * length
            product = dot(d, way)
            low, high = min(low, product - loss), max(high, product + loss)
    loss = turn * radius * length * (1.0 + 1e-9)
    return low - loss, high + loss


@inlined
def _three(nets, k, room):
    return (nets[k], nets[k + room], nets[k + 2 * room])
