"""Edges of trimmed patches: curves on pieces, elements of their own beside what is left of these.

A nearest point of a trimmed patch lies within it, or on an edge. An edge X(t) = S(u(t), v(t)) over
t of 0..1 is within max |X''| / 8 of its chord, and a part of length h within h² of that. So edges
are divided at the middle of t, and the control points of a part are its ends and the corners of a
box around its chord.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from ..base.jit import entry, inlined, kernel
from ..base.memory import on_stack, table_on_stack
from ..base.state import NONE
from ..base.vectors import along, cross, scaled, sub, unit
from .evaluate import jet_at, point_at
from .trim import from_unit, to_unit
from .trim_curve import restricted
from .trim_edge import trim_point

EDGE_POINTS = 10
"""Control points of an edge: the first and the last are its ends."""

_NARROW = 1e-3
"""The least width of the window of a piece in which derivatives are bounded."""

_TINY = 1e-5
"""Step in t over which derivatives of a trimming curve are compared for its second ones."""

Sizes = namedtuple("Sizes", "one other both_one both both_other")
"""No less than the lengths of derivatives: by one parameter, the other, twice, both, twice."""


@kernel
def place_on(tree, element, u, v):
    """The piece that a point of an element lies on, and its u and v there, 0 to 1."""
    piece = tree.pieces[element]
    if piece.edge == NONE:
        return element, u, v
    t = piece.low[0] + u * (piece.high[0] - piece.low[0])
    at_u, at_v, _, _ = trim_point(tree.trims, piece.patch, piece.edge, t)
    face = tree.pieces[piece.face]
    return np.int64(piece.face), _share(face, 0, at_u), _share(face, 1, at_v)


@inlined
def _share(face, axis, value):
    """Where a parameter of the patch lies on a piece of it, 0 to 1."""
    share = (value - face.low[axis]) / (face.high[axis] - face.low[axis])
    return min(max(share, 0.0), 1.0)


@kernel
def point_on(tree, element, u, v):
    """The point of an element, a piece or an edge, at u and v of 0..1, metres."""
    element, u, v = place_on(tree, element, u, v)
    return point_at(tree.pieces[element], tree.nets, u, v)


@kernel
def jet_on(tree, element, u, v):
    """As `jet_at`, of any element; an edge has derivatives by u alone."""
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
def put_edge(nets, at, room, first, last, bend):
    """Write the control points of an edge, or a part, that is within `bend` of its chord."""
    way = unit(sub(last, first))
    if way[0] == 0.0 and way[1] == 0.0 and way[2] == 0.0:
        way = (1.0, 0.0, 0.0)
    least = (1.0, 0.0, 0.0)
    if abs(way[0]) > abs(way[1]):
        least = (0.0, 1.0, 0.0)
    beside = unit(cross(way, least))
    above = cross(way, beside)
    bend *= 1.0 + 1e-12
    _put(nets, at, room, first)
    for k in range(8):
        corner = along(first, way, -bend) if k < 4 else along(last, way, bend)
        corner = along(corner, beside, bend if k & 1 else -bend)
        _put(nets, at + 1 + k, room, along(corner, above, bend if k & 2 else -bend))
    for k in range(EDGE_POINTS - 1, room):
        _put(nets, at + k, room, last)


@inlined
def _put(nets, at, room, point):
    nets[at], nets[at + room], nets[at + 2 * room] = point


@entry
def fit_edges(pieces, nets, table):
    """Write bends and control points of all edges among pieces; returns what rounding may do.

    That is how far, metres, an edge's point may be from that of the exact curve on the surface.

    Args:
        pieces: (m,) PIECE; an edge's patch, face, edge, low and high count.
        nets: their control nets; those of edges are written.
        table: Trims of the model.
    """
    lost = 0.0
    for i in range(len(pieces)):
        piece = pieces[i]
        if piece.edge != NONE:
            face = pieces[piece.face]
            piece.bend, blur = _bend(table, nets, piece, face, piece.low[0], piece.high[0])
            lost = max(lost, blur)
            ends = table_on_stack(2, 3, 0.0)
            for k in range(2):
                t = piece.low[0] if k == 0 else piece.high[0]
                u, v, _, _ = trim_point(table, piece.patch, piece.edge, t)
                point = point_at(face, nets, _share(face, 0, u), _share(face, 1, v))
                ends[k, 0], ends[k, 1], ends[k, 2] = point
            first = (ends[0, 0], ends[0, 1], ends[0, 2])
            last = (ends[1, 0], ends[1, 1], ends[1, 2])
            bend = min(piece.bend, _extent(face, nets))
            put_edge(nets, piece.net, np.int64(piece.room), first, last, bend)
            for k in range(piece.room):
                nets[piece.net + 3 * piece.room + k] = 1.0
    return lost


@kernel
def _extent(face, nets):
    """No less than the distance of any two points of a piece, metres."""
    square = 0.0
    for axis in range(3):
        low, high = np.inf, -np.inf
        for k in range(face.net, face.net + face.points):
            value = nets[k + axis * face.room] / nets[k + 3 * face.room]
            low, high = min(low, value), max(high, value)
        square += (high - low) * (high - low)
    return math.sqrt(square) * (1.0 + 1e-9)


@kernel
def bend_of(tree, piece, low, high):
    """How far the part of an edge from `low` to `high`, of 0..1, may be from its chord, metres."""
    stretch = piece.high[0] - piece.low[0]
    begin, end = piece.low[0] + low * stretch, piece.low[0] + high * stretch
    bend, _ = _bend(tree.trims, tree.nets, piece, tree.pieces[piece.face], begin, end)
    return bend


@kernel
def _bend(table, nets, piece, face, begin, end):
    """The same from t = `begin` to `end`; and how far it is from where the exact surface has it."""
    trim = table.trims[piece.patch]
    points = table_on_stack(16, 3, 0.0)
    segment = table.segments[piece.edge]
    restricted(table.nets, segment, begin, end, points)
    one, two, window = on_stack(2, 0.0), on_stack(2, 0.0), table_on_stack(2, 2, 0.0)
    beyond = 0.0
    for axis in range(2):
        first, second, least, most = _lengths(points, segment.degree, axis)
        # How u, of 0..1 over the piece, follows from its share of the patch (see `from_unit`).
        width = face.high[axis] - face.low[axis]
        slope, turn = trim.extent[axis] / width, 0.0
        if trim.arcs[axis] > 0:
            tangent = trim.tangent[axis]
            quarter = math.atan(tangent)
            turn = 4.0 * slope * trim.arcs[axis] * quarter * quarter * (1.0 + tangent * tangent)
            slope *= quarter * (1.0 + tangent * tangent) / tangent
        one[axis] = slope * first
        two[axis] = turn * first * first + slope * second
        a = (from_unit(trim, axis, least) - face.low[axis]) / width
        b = (from_unit(trim, axis, most) - face.low[axis]) / width
        # No line, for derivatives are by its width; nor beyond the piece, where weights may vanish.
        a = min(max(0.5 * (a + b - max(b - a, _NARROW)), 0.0), 1.0 - _NARROW)
        window[axis, 0], window[axis, 1] = a, min(max(b, a + _NARROW), 1.0)
        # Beyond its piece the curve is taken for that of the piece's own polynomials.
        low, high = to_unit(trim, axis, face.low[axis]), to_unit(trim, axis, face.high[axis])
        out = 2.0 * trim.slack + 8.0 * max(max(low - least, most - high), 0.0)
        beyond = max(beyond, out * slope / (window[axis, 1] - window[axis, 0]))
    part = on_stack(1024, 0.0)
    s = _sizes(face, part, cut_window(face, nets, window, part))
    for axis in range(2):
        across = window[axis, 1] - window[axis, 0]
        one[axis] /= across
        two[axis] /= across
    second = s.both_one * one[0] * one[0] + 2.0 * s.both * one[0] * one[1]
    second += s.both_other * one[1] * one[1] + s.one * two[0] + s.other * two[1]
    return 0.125 * second * (1.0 + 1e-9), beyond * (s.one + s.other)


@kernel
def _lengths(points, degree, axis):
    """Of a plane curve's x or y: bounds of its first two derivatives, its least and its most."""
    least, most = np.inf, -np.inf
    light = np.inf
    for i in range(degree + 1):
        value = points[i, axis] / points[i, 2]
        least, most = min(least, value), max(most, value)
        light = min(light, points[i, 2])
    middle, reach = 0.5 * (least + most), 0.5 * (most - least)
    n_1 = n_2 = w_1 = w_2 = 0.0
    for i in range(degree):
        a = (
            points[i + 1, axis]
            - middle * points[i + 1, 2]
            - (points[i, axis] - middle * points[i, 2])
        )
        w = points[i + 1, 2] - points[i, 2]
        n_1, w_1 = max(n_1, abs(a)), max(w_1, abs(w))
        if i + 1 < degree:
            b = points[i + 2, axis] - middle * points[i + 2, 2]
            b -= points[i + 1, axis] - middle * points[i + 1, 2]
            n_2 = max(n_2, abs(b - a))
            w_2 = max(w_2, abs(points[i + 2, 2] - points[i + 1, 2] - w))
    n = float(degree)
    first = n * (n_1 + w_1 * reach) / light
    second = (n * (n - 1.0) * (n_2 + w_2 * reach) + 2.0 * n * w_1 * first) / light
    return first, second, least, most


@kernel
def _sizes(face, nets, room):
    """Bounds of the lengths of a piece's derivatives, by the quotient rule about its middle.

    r = N / w has r' = (N' - w' r) / w and r'' = (N'' - 2 w' r' - w'' r) / w, where N and w have
    derivatives within the hulls of their nets' differences.
    """
    p, q, net = np.int64(face.degree_u), np.int64(face.degree_v), 0
    middle = on_stack(3, 0.0)
    light, reach = np.inf, 0.0
    last = (p + 1) * (q + 1) - 1
    for axis in range(3):
        a, b = net + axis * room, net + 3 * room
        middle[axis] = 0.5 * (nets[a] / nets[b] + nets[a + last] / nets[b + last])
    for k in range(last + 1):
        w = nets[net + 3 * room + k]
        light = min(light, w)
        square = 0.0
        for axis in range(3):
            d = nets[net + axis * room + k] / w - middle[axis]
            square += d * d
        reach = max(reach, math.sqrt(square))
    n = q + 1
    n_u, w_u = _most(nets, net, room, n, middle, n, 0, p, n, float(p))
    n_v, w_v = _most(nets, net, room, n, middle, 1, 0, p + 1, q, float(q))
    n_uu, w_uu = _most(nets, net, room, n, middle, n, n, p - 1, n, p * (p - 1.0))
    n_uv, w_uv = _most(nets, net, room, n, middle, n, 1, p, q, float(p * q))
    n_vv, w_vv = _most(nets, net, room, n, middle, 1, 1, p + 1, q - 1, q * (q - 1.0))
    s_u, s_v = (n_u + w_u * reach) / light, (n_v + w_v * reach) / light
    return Sizes(
        s_u,
        s_v,
        (n_uu + 2.0 * w_u * s_u + w_uu * reach) / light,
        (n_uv + w_u * s_v + w_v * s_u + w_uv * reach) / light,
        (n_vv + 2.0 * w_v * s_v + w_vv * reach) / light,
    )


@kernel
def _most(nets, net, room, n, middle, step, other, count_i, count_j, factor):
    """The largest differences of homogeneous points about a middle, and of weights.

    First ones of the points k and k + step where `other` is 0; else second ones, in which k + other
    and k + step + other count as well.
    """
    most = weight = 0.0
    for i in range(count_i):
        for j in range(count_j):
            k = net + i * n + j
            of_w = nets[k + 3 * room + step] - nets[k + 3 * room]
            if other > 0:
                of_w = nets[k + 3 * room + step + other] - nets[k + 3 * room + other] - of_w
            square = 0.0
            for axis in range(3):
                m = k + axis * room
                d = nets[m + step] - nets[m]
                if other > 0:
                    d = nets[m + step + other] - nets[m + other] - d
                d -= middle[axis] * of_w
                square += d * d
            most, weight = max(most, math.sqrt(square)), max(weight, abs(of_w))
    return factor * most, factor * weight


@kernel
def cut_window(face, nets, window, part):
    """Write the control points of the part of a piece in a window (2, 2) of u and v.

    Returns the numbers of one coordinate; there are four, homogeneous.
    """
    p, n = np.int64(face.degree_u), np.int64(face.degree_v) + 1
    count = (p + 1) * n
    for row in range(4):
        for k in range(count):
            part[row * count + k] = nets[face.net + row * face.room + k]
        at = row * count
        for j in range(n):
            _cut_line(part, at + j, n, p, window[0, 0], window[0, 1])
        for i in range(p + 1):
            _cut_line(part, at + i * n, 1, n - 1, window[1, 0], window[1, 1])
    return count


@kernel
def _cut_line(points, at, step, degree, low, high):
    """Cut one row of coordinates: what lies before `high`, and of that what lies after `low`."""
    for level in range(degree):
        for i in range(degree, level, -1):
            k = at + i * step
            points[k] = (1.0 - high) * points[k - step] + high * points[k]
    share = low / high
    for level in range(degree):
        for i in range(degree - level):
            k = at + i * step
            points[k] = (1.0 - share) * points[k] + share * points[k + step]
