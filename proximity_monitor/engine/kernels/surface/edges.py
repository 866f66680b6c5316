"""Edges of trimmed patches: curves on pieces. An edge is an element of its own beside the pieces.

A nearest point of a trimmed patch lies within the patch or on an edge. An edge X(t) = S(u(t), v(t))
over t in 0..1 is within max |X''| / 8 of its chord, and a part of length h within h² times that of
its own chord. So edges are divided at the middle of t. The control points of a part are its ends
and the corners of a box around its chord, which is as thick as the edge bends in each direction.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import entry, inlined, kernel
from ..base.memory import on_stack, table_on_stack
from ..base.trees import NONE
from ..base.vectors import across, add, along, cross, dot, scaled, sub, unit
from .edge_bend import find_bends
from .evaluate import jet_at, point_at
from .trim import from_unit
from .trim_curve import curve_box
from .trim_edge import trim_point

EDGE_POINTS = 10
"""Control points of an edge: the first and the last are its ends."""

_CURVED = 1e-3
"""An edge that bends by more than this share of its chord is bounded in each direction."""

_TINY = 1e-5
"""Step in t of the differences that give the second derivatives of a trimming curve."""


@kernel
def place_on(tree, element, u, v):
    """Return the piece that a point of an element lies on, and its u and v there, 0 to 1."""
    piece = tree.pieces[element]
    if piece.edge == NONE:
        return element, u, v
    t = piece.low[0] + u * (piece.high[0] - piece.low[0])
    at_u, at_v, _, _ = trim_point(tree.trims, piece.patch, piece.edge, t)
    face = tree.pieces[piece.face]
    return np.int64(piece.face), _share(face, 0, at_u), _share(face, 1, at_v)


@inlined
def _share(face, axis, value):
    """Convert a parameter of the patch to one of its piece, clamped to 0..1."""
    share = (value - face.low[axis]) / (face.high[axis] - face.low[axis])
    return min(max(share, 0.0), 1.0)


@kernel
def rectangle_of(tree, piece, low, high):
    """Bound an edge's part from `low` to `high`, 0..1, by a rectangle of the patch's parameters.

    Returns its low u, low v, high u and high v.
    """
    stretch = piece.high[0] - piece.low[0]
    begin, end = piece.low[0] + low * stretch, piece.low[0] + high * stretch
    trim, segment = tree.trims.trims[piece.patch], tree.trims.segments[piece.edge]
    left, lower, right, upper = curve_box(tree.trims.nets, segment, begin, end, trim.slack)
    return (
        from_unit(trim, 0, left), from_unit(trim, 1, lower),
        from_unit(trim, 0, right), from_unit(trim, 1, upper),
    )  # fmt: skip


@kernel
def point_on(tree, element, u, v):
    """Return the point of an element, a piece or an edge, at u and v in 0..1, metres."""
    element, u, v = place_on(tree, element, u, v)
    return point_at(tree.pieces[element], tree.nets, u, v)


@kernel
def jet_on(tree, element, u, v):
    """As `jet_at`, for any element; an edge has derivatives by u alone."""
    piece = tree.pieces[element]
    if piece.edge == NONE:
        return jet_at(piece, tree.nets, u, v)
    face = tree.pieces[piece.face]
    stretch = piece.high[0] - piece.low[0]
    t = piece.low[0] + u * stretch
    at_u, at_v, du, dv = trim_point(tree.trims, piece.patch, piece.edge, t)
    _, _, du_0, dv_0 = trim_point(tree.trims, piece.patch, piece.edge, t - _TINY)
    _, _, du_1, dv_1 = trim_point(tree.trims, piece.patch, piece.edge, t + _TINY)
    scale_u = stretch / (face.high[0] - face.low[0])
    scale_v = stretch / (face.high[1] - face.low[1])
    bend_u = (du_1 - du_0) / (2.0 * _TINY) * stretch * scale_u
    bend_v = (dv_1 - dv_0) / (2.0 * _TINY) * stretch * scale_v
    du, dv = du * scale_u, dv * scale_v
    point, s_u, s_v, s_uu, s_uv, s_vv = jet_at(
        face, tree.nets, _share(face, 0, at_u), _share(face, 1, at_v)
    )
    first = along(scaled(s_u, du), s_v, dv)
    second = along(scaled(s_uu, du * du), s_uv, 2.0 * du * dv)
    second = along(along(along(second, s_vv, dv * dv), s_u, bend_u), s_v, bend_v)
    none = (0.0, 0.0, 0.0)
    return point, first, none, second, none, none


@kernel
def normal_on(tree, element, u, v):
    """Return the unit normal at a point of an element; zero if it has none, as on an edge."""
    piece = tree.pieces[element]
    if piece.edge != NONE:
        return (0.0, 0.0, 0.0)
    _, du, dv, _, _, _ = jet_at(piece, tree.nets, u, v)
    return across(du, dv)


@kernel
def put_edge(tree, piece, low, high, bend, nets, at):
    """Write the control points of the part of an edge from `low` to `high`, in 0..1.

    Returns an eighth of the part's largest second derivative, metres, which bounds its distance
    from its chord. `bend` is a known bound of that; if it is not small, each direction is bounded
    anew.
    """
    face = tree.pieces[piece.face]
    return _put_edge(tree.trims, tree.nets, piece, face, low, high, bend, np.inf, nets, at)


@kernel
def _put_edge(table, sources, piece, face, low, high, bend, most, nets, at):
    """As `put_edge`; `most` bounds the distance of any two points of the edge."""
    first = _point(table, sources, piece, face, low)
    last = _point(table, sources, piece, face, high)
    frame, bends = table_on_stack(3, 3, 0.0), on_stack(4, 0.0)
    _put_frame(frame, first, last, _point(table, sources, piece, face, 0.5 * (low + high)))
    bends[0] = bends[1] = bends[2] = bend
    way = sub(last, first)
    if bend > _CURVED * np.sqrt(dot(way, way)):
        stretch = piece.high[0] - piece.low[0]
        begin, end = piece.low[0] + low * stretch, piece.low[0] + high * stretch
        find_bends(table, sources, piece, face, begin, end, frame, bends)
        square = 0.0
        for i in range(3):
            bends[i] = min(bends[i], bend)
            square += bends[i] * bends[i]
        bend = min(bend, np.sqrt(square) * (1.0 + 1e-12))  # any direction: parts have other axes
    room = np.int64(piece.room)
    _put(nets, at, room, first)
    for k in range(8):
        corner = first if k < 4 else last
        for i in range(3):
            sign = 1.0 if k & (4 >> i) else -1.0
            corner = along(corner, _row(frame, i), sign * min(bends[i], most) * (1.0 + 1e-12))
        _put(nets, at + 1 + k, room, corner)
    for k in range(EDGE_POINTS - 1, room):
        _put(nets, at + k, room, last)
    return bend


@kernel
def _point(table, nets, piece, face, share):
    """Return the point of an edge at a share, 0..1, of its part of the curve."""
    t = piece.low[0] + share * (piece.high[0] - piece.low[0])
    u, v, _, _ = trim_point(table, piece.patch, piece.edge, t)
    return point_at(face, nets, _share(face, 0, u), _share(face, 1, v))


@kernel
def _put_frame(frame, first, last, middle):
    """Write three axes: along the chord, towards where the curve bends, and across both."""
    way = unit(sub(last, first))
    if not dot(way, way) > 0.5:
        way = (1.0, 0.0, 0.0)
    beside = sub(middle, scaled(add(first, last), 0.5))
    beside = unit(along(beside, way, -dot(beside, way)))
    beside = unit(along(beside, way, -dot(beside, way)))
    if not dot(beside, beside) > 0.5:  # it is straight
        least = (0.0, 1.0, 0.0) if abs(way[0]) > abs(way[1]) else (1.0, 0.0, 0.0)
        beside = unit(cross(way, least))
    above = cross(way, beside)
    for i in range(3):
        frame[0, i], frame[1, i], frame[2, i] = way[i], beside[i], above[i]


@inlined
def _row(table, i):
    return (table[i, 0], table[i, 1], table[i, 2])


@inlined
def _put(nets, at, room, point):
    nets[at], nets[at + room], nets[at + 2 * room] = point


@entry
def fit_edges(pieces, nets, table):
    """Write the bends and control points of all edges among pieces; return the rounding error.

    The error is how far, metres, a point of an edge may be from the exact curve on the surface.

    Args:
        pieces: (m,) PIECE; an edge needs its patch, face, edge, low and high.
        nets: control nets of the pieces; those of the edges are written.
        table: Trims of the model.
    """
    lost = 0.0
    frame, bends = table_on_stack(3, 3, 0.0), on_stack(4, 0.0)
    for i in range(3):
        for j in range(3):
            frame[i, j] = 1.0 if i == j else 0.0
    for i in range(len(pieces)):
        piece = pieces[i]
        if piece.edge != NONE:
            face = pieces[piece.face]
            find_bends(table, nets, piece, face, piece.low[0], piece.high[0], frame, bends)
            lost = max(lost, bends[3])
            for k in range(piece.room):
                nets[piece.net + 3 * piece.room + k] = 1.0
            most = _extent(face, nets)
            piece.bend = _put_edge(
                table, nets, piece, face, 0.0, 1.0, np.inf, most, nets, piece.net
            )
    return lost


@kernel
def _extent(face, nets):
    """Bound the distance between any two points of a piece, metres."""
    square = 0.0
    for axis in range(3):
        low, high = np.inf, -np.inf
        for k in range(face.net, face.net + face.points):
            value = nets[k + axis * face.room] / nets[k + 3 * face.room]
            low, high = min(low, value), max(high, value)
        square += (high - low) * (high - low)
    return np.sqrt(square) * (1.0 + 1e-9)
