"""Pieces of a surface's elements: the functions that the search for a deepest point needs.

The type of the tree tells the kind of its elements; numba chooses the implementation when it
compiles (see `implements`). A piece is an element or a part of one. It lies in the convex hull of
its control points. This file has the stubs and the implementations for triangles.
"""

from __future__ import annotations

import numpy as np
from numba import uint64

from ..base.jit import implements, inlined, kernel
from ..base.memory import on_stack, table_on_stack
from ..base.rounding import DOUBLE_EPS
from ..base.trees import MeshTree
from ..base.vectors import add, along, dot, scaled, sub
from ..elements.primitives import corners, mixed
from ..tree.layout import (
    HALF_U,
    HALF_V,
    RADIUS,
    STRIDE,
    U_X,
    V_X,
    WIDTH,
    first_of,
    last_of,
    read_vector,
)
from .ball_cells import push, radius_limit
from .nearest import point_triangle
from .piece_rows import HULL, LINES, ROWS, bound_by
from .volumes import sphere_of

WHOLE, PART = -1, -2
"""Values of `PIECE.lane` for pieces that are no lane: a whole element, and a part of one."""

_DRIFT = 256.0 * DOUBLE_EPS
"""Share of a model's size by which halving may move a triangle's parts off the triangle. On each
axis an edge's middle errs by u of its coordinates more than the edge's ends. Two halvings halve
every edge, so after a hundred halvings a part is no larger than the rounding."""


def memory_of(surface, memory):
    """Return the extra memory (`parts` below) of the search with table `memory`. A stub."""


def forget(surface, parts, at):
    """Clear all pieces at the start of a search. A stub."""


def has_room(surface, parts, at):
    """Return whether there is room for the parts of a piece. A stub."""


def push_elements(surface, parts, state, leaf, near, bound):
    """Push the elements of a leaf onto the heap. A stub."""


def divide(surface, parts, state, piece, near, bound):
    """Push the parts of a piece onto the heap; return whether the piece can be divided. A stub.

    The piece is in the first free slot, so its parts overwrite it.
    """


def count_of(surface, parts, piece):
    """Return the number of control points; the piece's corners are among them. A stub."""


def control_of(surface, parts, piece, i):
    """Return a control point, metres. A stub."""


def margin_of(surface, parts, piece):
    """Return the error of control points beyond that of all surface points, metres. A stub."""


def span_of(surface, parts, piece):
    """Return two vectors that are about parallel to the piece. A stub."""


def corners_of(surface, parts, piece):
    """Return the number of corners of a piece. A stub."""


def spot_of(surface, parts, piece, corner):
    """Return a point of the piece: its middle (corner 0), or a corner (from 1 on).

    Returns the place and, if `spot_at` needs them, weights that locate it on its element. A stub.
    """


def is_within_trim(surface, element, weights):
    """Return whether the element's point with these weights surely is on the surface. A stub."""


def element_of(surface, parts, piece):
    """Return the element that the piece is part of. A stub."""


def weights_on(surface, element, point):
    """Return two weights that locate a POINT on its element, for `move_on`. A stub."""


def move_on(surface, element, u, v):
    """Return the point of an element at two weights, moved into the element, and these. A stub."""


def spot_at(surface, element, best):
    """Return a POINT's place on an element, metres, and its `Feature.parameters`. A stub."""


@kernel
def push_lane(surface, parts, state, lane, near, bound):
    """Push a lane's volume onto the heap."""
    at = state.at[0]
    cell = state.cells[state.order[at.size]]
    cell.lane, cell.near = lane, near
    push_piece(surface, parts, state, bound)


@kernel
def push_piece(surface, parts, state, bound):
    """Push the piece in the first free slot onto the heap. It inherits rows, which may bound it."""
    at = state.at[0]
    piece = state.cells[state.order[at.size]]
    piece.count = at.count
    for i in range(at.count):
        for j in range(4):
            piece.rows[i, j] = at.rows[i, j]
    limit = radius_limit(at)
    if at.count > 0 and bound > limit:
        hull, values = table_on_stack(HULL, 3, 0.0), table_on_stack(LINES, HULL, 0.0)
        used = on_stack(ROWS, np.int64(0))
        points, margin = hull_of(surface, parts, piece, hull)
        margin += at.slack
        by_rows = bound_by(
            piece.rows, piece.count, hull, points, limit - margin, at.slack, values, used
        )
        bound = min(bound, by_rows + margin)
    push(state, at.size, bound)


@kernel
def hull_of(surface, parts, piece, hull):
    """Write points, metres, in whose hull a piece lies up to a margin; return count and margin."""
    if piece.lane < 0:
        count = count_of(surface, parts, piece)
        for i in range(count):
            hull[i, 0], hull[i, 1], hull[i, 2] = control_of(surface, parts, piece, i)
        return count, margin_of(surface, parts, piece)
    lane, scale = piece.lane, surface.scale[0]
    centre, radius = sphere_of(surface, lane)
    base = uint64(lane // WIDTH * STRIDE + lane % WIDTH)
    u, v = read_vector(surface.nodes, base + U_X), read_vector(surface.nodes, base + V_X)
    a = scale * np.float64(surface.nodes[base + HALF_U])
    b = scale * np.float64(surface.nodes[base + HALF_V])
    for i in range(4):
        corner = along(along(centre, u, -a if i & 1 else a), v, -b if i & 2 else b)
        hull[i, 0], hull[i, 1], hull[i, 2] = corner
    # The same reserve for the float32 of the volume as in `sphere_of`.
    return np.int64(4), 1e-4 * radius + scale * np.float64(surface.nodes[base + RADIUS])


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
def _push_triangle(surface, parts, state, p, q, r, triangle, kind, near, bound):
    at = state.at[0]
    cell = state.cells[state.order[at.size]]
    cell.lane, cell.near, cell.part = kind, near, triangle
    for i in range(3):
        cell.corners[0, i], cell.corners[1, i], cell.corners[2, i] = p[i], q[i], r[i]
    push_piece(surface, parts, state, bound)


@implements(push_elements, MeshTree)
@kernel
def _push_triangles(surface, parts, state, leaf, near, bound):
    for t in range(first_of(leaf), last_of(leaf) + 1):
        p, q, r = corners(surface.triangles, t)
        _push_triangle(surface, parts, state, p, q, r, t, WHOLE, near, bound)


@implements(divide, MeshTree)
@kernel
def _halve(surface, parts, state, piece, near, bound):
    """Halve the triangle across its longest edge."""
    p, q, r, triangle = _corner(piece, 0), _corner(piece, 1), _corner(piece, 2), piece.part
    pq, qr, rp = sub(p, q), sub(q, r), sub(r, p)
    a, b, c = dot(pq, pq), dot(qr, qr), dot(rp, rp)
    if b >= a and b >= c:
        p, q, r = q, r, p
    elif c >= a and c >= b:
        p, q, r = r, p, q
    middle = scaled(add(p, q), 0.5)
    _push_triangle(surface, parts, state, p, middle, r, triangle, PART, near, bound)
    _push_triangle(surface, parts, state, middle, q, r, triangle, PART, near, bound)
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


@implements(is_within_trim, MeshTree)
@inlined
def _whole(surface, element, weights):
    return True


@implements(weights_on, MeshTree)
@kernel
def _weights(surface, element, point):
    a, b, c = corners(surface.triangles, element)
    _, v, w = point_triangle((point.place[0], point.place[1], point.place[2]), a, b, c)
    return v, w


@implements(move_on, MeshTree)
@kernel
def _move(surface, element, v, w):
    a, b, c = corners(surface.triangles, element)
    v, w = max(v, 0.0), max(w, 0.0)
    over = max(v + w, 1.0)
    v, w = v / over, w / over
    return mixed((a, b, c), (max(1.0 - v - w, 0.0), v, w)), v, w


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
