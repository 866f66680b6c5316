"""Bounds of how far an edge may be from its chord, in each of three directions."""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from ..base.jit import kernel, shared
from ..base.memory import on_stack, table_on_stack
from ..base.rounding import DOUBLE_EPS
from .trim import from_unit, to_unit
from .trim_curve import restricted

_NARROW = 1e-3
"""Least width of the parameter window of a piece in which derivatives are bounded."""

Sizes = namedtuple("Sizes", "one other both_one both both_other")
"""Bounds of the derivatives of a coordinate: by one parameter, by the other, twice by one, by both,
and twice by the other."""


@shared
def find_bends(table, nets, piece, face, begin, end, frame, bends):
    """Write how far an edge from t = `begin` to `end` may be from its chord along three axes.

    Args:
        table: Trims.
        nets: control nets of the pieces.
        piece: PIECE, the edge.
        face: PIECE, the piece that the edge lies on.
        begin: t where the edge begins on its trimming curve.
        end: t where it ends.
        frame: (3, 3) the axes: orthogonal unit vectors, the rows.
        bends: (4,) metres, along each axis; last, how far it may be from the exact edge.
    """
    trim = table.trims[piece.patch]
    points = table_on_stack(16, 3, 0.0)
    segment = table.segments[piece.edge]
    restricted(table.nets, segment, begin, end, points)
    one, two, window = on_stack(2, 0.0), on_stack(2, 0.0), table_on_stack(2, 2, 0.0)
    beyond = 0.0
    for axis in range(2):
        first, second, least, most = _lengths(points, segment.degree, axis)
        # How u, 0..1 over the piece, depends on the share of the patch (see `from_unit`).
        width = face.high[axis] - face.low[axis]
        slope, turn = trim.extent[axis] / width, 0.0
        if trim.arcs[axis] > 0:
            tangent = trim.tangent[axis]
            quarter = math.atan(tangent)
            turn = 4.0 * slope * trim.arcs[axis] * quarter * quarter * (1.0 + tangent * tangent)
            slope *= quarter * (1.0 + tangent * tangent) / tangent
        a = (from_unit(trim, axis, least) - face.low[axis]) / width
        b = (from_unit(trim, axis, most) - face.low[axis]) / width
        # The window needs a width, because derivatives are scaled by it. It stays within the piece,
        # because weights may vanish beyond.
        a = min(max(0.5 * (a + b - max(b - a, _NARROW)), 0.0), 1.0 - _NARROW)
        b = min(max(b, a + _NARROW), 1.0)
        window[axis, 0], window[axis, 1] = a, b
        one[axis] = slope * first / (b - a)
        two[axis] = (turn * first * first + slope * second) / (b - a)
        # Where the curve leaves its piece, it is taken to stay on this piece's own polynomials.
        low, high = to_unit(trim, axis, face.low[axis]), to_unit(trim, axis, face.high[axis])
        out = 2.0 * trim.slack + 8.0 * max(max(low - least, most - high), 0.0)
        beyond = max(beyond, out * slope / (b - a))
    part = on_stack(1024, 0.0)
    count = cut_window(face, nets, window, part)
    size = _turn(part, count, frame)
    degrees = float(face.degree_u + face.degree_v)
    blur = 0.0
    for i in range(3):
        s = _sizes(face, part, count, i)
        second = s.both_one * one[0] * one[0] + 2.0 * s.both * one[0] * one[1]
        second += s.both_other * one[1] * one[1] + s.one * two[0] + s.other * two[1]
        bends[i] = 0.125 * second * (1.0 + 1e-9) + 64.0 * degrees * degrees * DOUBLE_EPS * size
        blur += s.one + s.other
    bends[3] = beyond * blur


@kernel
def _turn(part, count, frame):
    """Rotate control points to the axes of `frame`; return the largest coordinate, metres."""
    size = 0.0
    for k in range(count):
        x, y, z = part[k], part[count + k], part[2 * count + k]
        for i in range(3):
            value = frame[i, 0] * x + frame[i, 1] * y + frame[i, 2] * z
            part[i * count + k] = value
            size = max(size, abs(value) / part[3 * count + k])
    return size


@kernel
def _lengths(points, degree, axis):
    """Bound the first two derivatives of a plane curve's x or y; also return its least and most."""
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
def _sizes(face, part, count, row):
    """Bound the derivatives of one coordinate by the quotient rule about its middle value.

    r = N / w has r' = (N' - w' r) / w and r'' = (N'' - 2 w' r' - w'' r) / w. The derivatives of N
    and w lie in the hulls of the differences of their nets.
    """
    p, n = np.int64(face.degree_u), np.int64(face.degree_v) + 1
    q = n - 1
    at, weights = row * count, 3 * count
    light, low, high = np.inf, np.inf, -np.inf
    for k in range(count):
        w = part[weights + k]
        value = part[at + k] / w
        light, low, high = min(light, w), min(low, value), max(high, value)
    middle, reach = 0.5 * (low + high), 0.5 * (high - low)
    n_u, w_u = _most(part, at, weights, n, middle, n, 0, p, n, float(p))
    n_v, w_v = _most(part, at, weights, n, middle, 1, 0, p + 1, q, float(q))
    n_uu, w_uu = _most(part, at, weights, n, middle, n, n, p - 1, n, p * (p - 1.0))
    n_uv, w_uv = _most(part, at, weights, n, middle, n, 1, p, q, float(p * q))
    n_vv, w_vv = _most(part, at, weights, n, middle, 1, 1, p + 1, q - 1, q * (q - 1.0))
    s_u, s_v = (n_u + w_u * reach) / light, (n_v + w_v * reach) / light
    return Sizes(
        s_u,
        s_v,
        (n_uu + 2.0 * w_u * s_u + w_uu * reach) / light,
        (n_uv + w_u * s_v + w_v * s_u + w_uv * reach) / light,
        (n_vv + 2.0 * w_v * s_v + w_vv * reach) / light,
    )


@kernel
def _most(part, at, weights, n, middle, step, other, count_i, count_j, factor):
    """Return the largest differences of a homogeneous coordinate about a middle, and of weights.

    Both are times `factor`. If `other` is 0, they are first differences: of the points k and k +
    step. Else they are second differences, which use k + other and k + step + other as well.
    """
    most = weight = 0.0
    for i in range(count_i):
        for j in range(count_j):
            k = i * n + j
            of_w = part[weights + k + step] - part[weights + k]
            d = part[at + k + step] - part[at + k]
            if other > 0:
                of_w = part[weights + k + step + other] - part[weights + k + other] - of_w
                d = part[at + k + step + other] - part[at + k + other] - d
            most, weight = max(most, abs(d - middle * of_w)), max(weight, abs(of_w))
    return factor * most, factor * weight


@kernel
def cut_window(face, nets, window, part):
    """Write the control points of the part of a piece within a window (2, 2) of u and v.

    Returns how many numbers each coordinate has; there are four coordinates, homogeneous.
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
    """Cut one row of coordinates to what is before `high`, and that to what is after `low`."""
    for level in range(degree):
        for i in range(degree, level, -1):
            k = at + i * step
            points[k] = (1.0 - high) * points[k - step] + high * points[k]
    share = low / high
    for level in range(degree):
        for i in range(degree - level):
            k = at + i * step
            points[k] = (1.0 - share) * points[k] + share * points[k + step]
