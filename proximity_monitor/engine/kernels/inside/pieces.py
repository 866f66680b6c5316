"""Pieces of a surface's elements: what the search for a deepest point asks of each kind of them.

A tree says by its type which kind they are of; numba chooses when it compiles (see `implements`).
A piece lies in the convex hull of its control points. Here are the stubs, and those of triangles.
"""

from __future__ import annotations

from ..base.jit import implements, inlined, kernel
from ..base.rounding import DOUBLE_EPS
from ..base.trees import MeshTree
from ..base.vectors import add, dot, scaled, sub
from ..elements.primitives import corners, mixed
from ..tree.layout import first_of, last_of
from .ball_cells import push
from .nearest import point_triangle

WHOLE, PART = -1, -2
"""Lanes of what is none: of a whole element, and of a part of one."""

_DRIFT = 256.0 * DOUBLE_EPS
"""Share of a model's size by which halving may move a triangle's parts off it. An edge's middle
errs by u of its coordinates, along each axis, more than its ends; and parts are no larger than
rounding after a hundred halvings, as two halve each edge."""


def memory_of(surface, memory):
    """What else a search needs whose memory is the table `memory`; the `parts` of what follows."""


def forget(surface, parts, at):
    """Begin a search with no pieces."""


def has_room(surface, parts, at):
    """Whether there is room for the parts of a piece."""


def push_elements(surface, parts, state, leaf, near, bound):
    """Put the elements of a leaf into the heap."""


def divide(surface, parts, state, piece, near, bound):
    """Put the parts of a piece into the heap; returns whether it can be divided.

    The piece is the first free one, so that it is overwritten.
    """


def count_of(surface, parts, piece):
    """The number of control points; the corners of the piece are among them."""


def control_of(surface, parts, piece, i):
    """A control point, metres."""


def margin_of(surface, parts, piece):
    """What control points may err by, metres, besides what every point of the surface may."""


def span_of(surface, parts, piece):
    """Two vectors that the piece is about parallel to."""


def corners_of(surface, parts, piece):
    """The number of corners of a whole element."""


def spot_of(surface, parts, piece, corner):
    """A point of the piece: its middle, or from 1 on a corner of a whole element.

    Its place, and the weights that tell where it is on its element, where `spot_at` needs them.
    """


def is_left(surface, parts, piece, weights):
    """Whether a point of it, by its weights, surely belongs to the surface."""


def element_of(surface, parts, piece):
    """The element that it is a piece of."""


def spot_at(surface, element, best):
    """The point of a POINT on an element: its place, metres, and what `Feature.parameters` is."""


@kernel
def push_lane(state, lane, near, bound):
    """Put a lane's volume into the heap."""
    at = state.at[0]
    cell = state.cells[state.order[at.size]]
    cell.lane, cell.near = lane, near
    push(state, at.size, bound)


@implements(memory_of, MeshTree)
@inlined
def _no_memory(surface, memory):
    return 0


@implements(forget, MeshTree)
@inlined
def _nothing(surface, parts, at):
    pass


@implements(has_room, MeshTree)
@inlined
def _always(surface, parts, at):
    return True


@kernel
def _corner(piece, i):
    return (piece.corners[i, 0], piece.corners[i, 1], piece.corners[i, 2])


@kernel
def _push_triangle(state, p, q, r, triangle, kind, near, bound):
    at = state.at[0]
    cell = state.cells[state.order[at.size]]
    cell.lane, cell.near, cell.part = kind, near, triangle
    for i in range(3):
        cell.corners[0, i], cell.corners[1, i], cell.corners[2, i] = p[i], q[i], r[i]
    push(state, at.size, bound)


@implements(push_elements, MeshTree)
@kernel
def _push_triangles(surface, parts, state, leaf, near, bound):
    for t in range(first_of(leaf), last_of(leaf) + 1):
        p, q, r = corners(surface.triangles, t)
        _push_triangle(state, p, q, r, t, WHOLE, near, bound)


@implements(divide, MeshTree)
@kernel
def _halve(surface, parts, state, piece, near, bound):
    """Across the longest edge."""
    p, q, r, triangle = _corner(piece, 0), _corner(piece, 1), _corner(piece, 2), piece.part
    pq, qr, rp = sub(p, q), sub(q, r), sub(r, p)
    a, b, c = dot(pq, pq), dot(qr, qr), dot(rp, rp)
    if b >= a and b >= c:
        p, q, r = q, r, p
    elif c >= a and c >= b:
        p, q, r = r, p, q
    middle = scaled(add(p, q), 0.5)
    _push_triangle(state, p, middle, r, triangle, PART, near, bound)
    _push_triangle(state, middle, q, r, triangle, PART, near, bound)
    return True


@implements(count_of, MeshTree)
@inlined
def _three(surface, parts, piece):
    return 3


@implements(control_of, MeshTree)
@inlined
def _control(surface, parts, piece, i):
    return _corner(piece, i)


@implements(margin_of, MeshTree)
@inlined
def _drift(surface, parts, piece):
    return _DRIFT * surface.scale[2]


@implements(span_of, MeshTree)
@kernel
def _edges(surface, parts, piece):
    centre, _ = _spot(surface, parts, piece, 0)
    return sub(_corner(piece, 0), centre), sub(_corner(piece, 1), centre)


implements(corners_of, MeshTree)(_three)


@implements(spot_of, MeshTree)
@kernel
def _spot(surface, parts, piece, corner):
    unknown = (0.0, 0.0, 0.0)
    if corner > 0:
        return _corner(piece, corner - 1), unknown
    together = add(add(_corner(piece, 0), _corner(piece, 1)), _corner(piece, 2))
    return scaled(together, 1.0 / 3.0), unknown


@implements(is_left, MeshTree)
@inlined
def _whole(surface, parts, piece, weights):
    return True


@implements(element_of, MeshTree)
@inlined
def _triangle(surface, parts, piece):
    return piece.part


@implements(spot_at, MeshTree)
@kernel
def _foot(surface, element, best):
    a, b, c = corners(surface.triangles, element)
    _, v, w = point_triangle((best.place[0], best.place[1], best.place[2]), a, b, c)
    weights = (max(1.0 - v - w, 0.0), v, w)
    return mixed((a, b, c), weights), weights
