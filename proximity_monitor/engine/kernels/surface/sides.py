"""What the division of cells needs of either side of a pair: cells of a surface, or triangles.

An index names a cell. A model whose elements are not divided has no cells; the index of an element
then stands for its cell.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel
from ..base.lanes import least_along
from ..base.trees import NONE, SurfaceTree
from ..base.vectors import add, cross, dot, norm, sub
from .cells import MOST_SPLITS, directions_of, divide_cell, length_in, net_of, root_cell
from .clip import clipped_least
from .edges import rectangle_of
from .facing import vector
from .trim import CROSSING, INSIDE, classify_point

_FLAT, _CROSSED = 1e-12, 1e-6
"""Share of a cell's extent that is added to its roughness; and that for a cell that loops cross."""


def whole(tree, element, cells, nets, roots, used):
    """Return the cell of a whole element (NONE: no room), and how many are in use: a stub."""


def ways_to_divide(tree, cells, nets, index, n):
    """Tell whether to divide a cell in u, and in v, and its roughness along n (own frame): a stub.

    The rougher of two cells is divided. The roughness is negative if the cell cannot be divided.
    """


def divide_side(tree, index, cells, nets, used, in_u, in_v):
    """Divide a cell if it is not divided yet; return how many cells are then in use: a stub."""


def is_long_in(tree, cells, index, most):
    """Tell if a cell is longer than `most` in u, and in v, in its patch's parameters: a stub."""


def roughness(tree, cells, index):
    """Return about how far, metres, a cell is from the parallelogram that stands for it: a stub."""


def least_of(tree, cells, nets, index, n):
    """Return the least product of n (own frame) with a cell's control points or corners: a stub."""


def margin_of(tree, cells, index):
    """Return the error of these control points, metres: a stub."""


def element_of(tree, cells, index):
    """Return the element that a cell is a part of: a stub."""


def normal_of(tree, cells, index):
    """Return a vector about normal to a cell, in its own frame, of any length: a stub."""


def facing(tree_a, tree_b, cells_a, cells_b, a, b, motion):
    """Find two near points of what stands for two cells: a stub.

    Returns the way between them in a's frame, metres, and the weights of about where they are on
    their elements.
    """


def begin_on(tree, element):
    """Return an element and the weights of one of its points, to begin a local search with: a stub.

    It is the given element. If loops cross its piece, it may be an edge of the patch instead.
    """


def is_within_trim(tree, element, weights):
    """Tell whether a point of an element surely belongs to the model, uncut by loops: a stub."""


def near(tree, p, element, weights, steps, slack, stack, bounds, found):
    """Find the element about nearest to a point p of the model's frame, and where on it: a stub.

    The search takes at most `steps` steps and begins with the point `weights` of `element`.
    """


implements(whole, SurfaceTree)(root_cell)
implements(divide_side, SurfaceTree)(divide_cell)


@inlined
def _control(tree, piece, i, j):
    """Return a control point of a whole piece, metres."""
    at, room = piece.net + i * (piece.degree_v + 1) + j, piece.room
    inverse = 1.0 / tree.nets[at + 3 * room]
    x, y, z = tree.nets[at], tree.nets[at + room], tree.nets[at + 2 * room]
    return (x * inverse, y * inverse, z * inverse)


@kernel
def _is_at_pole(tree, piece, cell, in_u, most):
    """Tell if a cell lies so close to a pole that its length in u (or v) hardly matters.

    All along the end of a patch that is a single point, that parameter stands for the same point.
    Near this end the cell may be longer than `most`, as long as it extends no farther in space than
    a cell of that length does, on average, on the rest of its piece.
    """
    p, q = np.int64(piece.degree_u), np.int64(piece.degree_v)
    across, count, axis = (q, p, 0) if in_u else (p, q, 1)
    pole = touches = False
    for end in range(0, across + 1, across):
        first = _control(tree, piece, 0, end) if in_u else _control(tree, piece, end, 0)
        square = 0.0
        for k in range(1, count + 1):
            other = _control(tree, piece, k, end) if in_u else _control(tree, piece, end, k)
            way = sub(other, first)
            square = max(square, dot(way, way))
        if square <= cell.margin * cell.margin:
            pole = True
            here = cell.low[1 - axis] if end == 0 else 1.0 - cell.high[1 - axis]
            touches = touches or here == 0.0
    if not pole:
        return False
    a, b = _control(tree, piece, 0, 0), _control(tree, piece, 0, q)
    c, d = _control(tree, piece, p, 0), _control(tree, piece, p, q)
    whole = add(sub(c, a), sub(d, b)) if in_u else add(sub(b, a), sub(d, c))
    extent = norm(vector(cell.along_u if in_u else cell.along_v))
    if touches:  # it will be shorter once it is short across
        extent *= min(most / length_in(piece, cell, 1 - axis), 1.0)
    return extent <= 0.25 * most / (piece.high[axis] - piece.low[axis]) * norm(whole)


@implements(is_long_in, SurfaceTree)
@kernel
def _is_long_in(tree, cells, index, most):
    cell = cells[index]
    piece = tree.pieces[cell.element]
    if piece.edge == NONE:
        in_u, in_v = length_in(piece, cell, 0) > most, length_in(piece, cell, 1) > most
        if in_u and piece.degree_v > 0:
            in_u = not _is_at_pole(tree, piece, cell, True, most)
        if in_v:
            in_v = not _is_at_pole(tree, piece, cell, False, most)
        return in_u, in_v
    low_u, low_v, high_u, high_v = rectangle_of(tree, piece, cell.low[0], cell.high[0])
    return high_u - low_u > most or high_v - low_v > most, False


@implements(roughness, SurfaceTree)
@inlined
def _roughness(tree, cells, index):
    cell = cells[index]
    return cell.bend_u + cell.bend_v + cell.twist


@inlined
def is_halved(low, high):
    """Tell whether float64 holds the middle of a parameter interval, so that its halves are exact.

    If weights differ by many orders, all of a piece lies within the last bit of a parameter. Its
    control points can still be halved, but a proof would be about a different stretch.
    """
    middle = 0.5 * (low + high)
    return middle > low and middle - low == high - middle


@implements(ways_to_divide, SurfaceTree)
@kernel
def _ways(tree, cells, nets, index, n):
    cell = cells[index]
    if cell.splits >= MOST_SPLITS:
        return False, False, -1.0
    crossed = cell.side == CROSSING
    # What loops leave of a cell bends differently from the cell: nothing is known along n.
    n = (0.0, 0.0, 0.0) if crossed else n
    in_u, in_v, bends = directions_of(tree, cells, nets, index, n)
    in_u = in_u and is_halved(cell.low[0], cell.high[0])
    in_v = in_v and is_halved(cell.low[1], cell.high[1])
    if not (in_u or in_v):
        return False, False, -1.0
    u, v = vector(cell.along_u), vector(cell.along_v)
    size = u[0] * u[0] + u[1] * u[1] + u[2] * u[2] + v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    # Flat cells are divided when nothing else is left to do, the larger one first.
    return in_u, in_v, bends + (_CROSSED if crossed else _FLAT) * size**0.5


@implements(least_of, SurfaceTree)
@inlined
def _least(tree, cells, nets, index, n):
    cell, at = cells[index], net_of(cells, nets, index)
    piece = tree.pieces[cell.element]
    least = least_along(nets, at, piece.room, n[0], n[1], n[2])
    if cell.side == CROSSING and (cell.clip[0] != 0.0 or cell.clip[1] != 0.0):
        least = max(least, clipped_least(piece, cell, nets, at, n))
    return least


@implements(margin_of, SurfaceTree)
@inlined
def _margin(tree, cells, index):
    return cells[index].margin


@implements(element_of, SurfaceTree)
@inlined
def _element(tree, cells, index):
    return cells[index].element


@implements(normal_of, SurfaceTree)
@kernel
def _normal(tree, cells, index):
    return cross(vector(cells[index].along_u), vector(cells[index].along_v))


@implements(begin_on, SurfaceTree)
@inlined
def _begin(tree, element):
    piece = tree.pieces[element]
    if piece.edge == NONE:
        element, piece = np.int64(piece.face), tree.pieces[piece.face]
    return np.int64(element), (0.5, 0.5 if piece.degree_v > 0 else 0.0, 0.0)


@implements(is_within_trim, SurfaceTree)
@kernel
def _is_within_trim(tree, element, weights):
    piece = tree.pieces[element]
    if piece.side == INSIDE:
        return True
    u = piece.low[0] + weights[0] * (piece.high[0] - piece.low[0])
    v = piece.low[1] + weights[1] * (piece.high[1] - piece.low[1])
    return classify_point(tree.trims, piece.patch, u, v) == INSIDE
