"""What the proof of `certificate.py` needs of surface cells: ranges of their derivatives."""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel, shared
from ..base.rounding import DOUBLE_EPS
from ..base.trees import NONE, SurfaceTree
from ..base.vectors import along, dot, norm, scaled, sub
from .cells import net_of
from .certificate import can_be_proven, find_in, put_point, put_ranges
from .evaluate import jet_at, point_at
from .facing import closest_in, parameters_in, vector
from .form import (
    ACROSS,
    APART,
    CORNER,
    ENDS,
    ERRORS,
    HALF,
    HALVES,
    MIDDLE,
    SECOND,
    SLOPE,
    SPREAD,
)
from .ranges import errors_of, ranges_of, slope_error
from .sides import roughness

_JOINED = 1e-9
"""No proof is tried across patches that are farther apart than this share of the model's size."""

_POLE = 1e-14
"""Most distance between the control points of a pole, as a share of the model's size."""

_FOOT_STEPS, _FLAT = 8, 1e-12
"""Most steps to the point of a cell that coincides with a point of another patch; and the least
determinant of the derivatives there, as a share of the product of both squared derivatives."""


@implements(can_be_proven, SurfaceTree)
@inlined
def _can_be_proven(tree, cells, index):
    return tree.pieces[cells[index].element].edge == NONE


@implements(find_in, SurfaceTree)
@kernel
def _find_in(tree, cells, index, element, weights):
    cell, u, v = cells[index], weights[0], weights[1]
    piece, one = tree.pieces[cell.element], tree.pieces[element]
    if cell.element != element and one.edge != NONE:
        return False, weights, (0.0, 0.0, 0.0)
    if one.patch == piece.patch:
        if cell.element != element:
            u = _carried(u, one.low[0], one.high[0], piece.low[0], piece.high[0])
            v = _carried(v, one.low[1], one.high[1], piece.low[1], piece.high[1])
        if cell.low[0] <= u <= cell.high[0] and cell.low[1] <= v <= cell.high[1]:
            return True, (u, v, 0.0), point_at(piece, tree.nets, u, v)
    if 0.0 < weights[0] < 1.0 and (0.0 < weights[1] < 1.0 or one.degree_v == 0):
        return False, weights, (0.0, 0.0, 0.0)
    # Patches are joined at their ends, and a patch joins itself at a pole and along a seam.
    p = point_at(one, tree.nets, weights[0], weights[1])
    return _find_beside(piece, tree.nets, cell, p, roughness(tree, cells, index), tree.scale[2])


@shared
def _find_beside(piece, nets, cell, p, rough, size):
    """Find where a cell meets p, a point at the end of another patch, if it does: see `find_in`.

    `rough` is about how far the cell is from its parallelogram, metres.
    """
    centre, e, f = vector(cell.centre), vector(cell.along_u), vector(cell.along_v)
    place = closest_in(centre, e, f, p)
    near = along(along(centre, e, place[0]), f, place[1])
    weights = parameters_in(cell, place)
    if not norm(sub(p, near)) <= rough + _JOINED * size:
        return False, weights, p
    x, y, q = _foot(piece, nets, cell, p, weights[0], weights[1], 4.0 * DOUBLE_EPS * size)
    return norm(sub(p, q)) <= _JOINED * size, (x, y, 0.0), q


@kernel
def _foot(piece, nets, cell, p, u, v, error):
    """Find the cell's point nearest to p by Gauss-Newton from u, v; return its u, v and itself.

    A parameter snaps to an end of the cell if that moves the point by no more than `error`.
    """
    e = f = (0.0, 0.0, 0.0)
    for _ in range(_FOOT_STEPS):
        q, e, f, _, _, _ = jet_at(piece, nets, u, v)
        way = sub(p, q)
        ee, ff, ef = dot(e, e), dot(f, f), dot(e, f)
        x, y = dot(e, way), dot(f, way)
        if (u <= cell.low[0] and x <= 0.0) or (u >= cell.high[0] and x >= 0.0) or ee == 0.0:
            ee, ef, x = 1.0, 0.0, 0.0
        if (v <= cell.low[1] and y <= 0.0) or (v >= cell.high[1] and y >= 0.0) or ff == 0.0:
            ff, ef, y = 1.0, 0.0, 0.0
        det = ee * ff - ef * ef
        if not det > _FLAT * ee * ff:
            break
        x, y = (x * ff - y * ef) / det, (y * ee - x * ef) / det
        before_u, before_v = u, v
        u = min(max(u + x, cell.low[0]), cell.high[0])
        v = min(max(v + y, cell.low[1]), cell.high[1])
        if norm(along(scaled(e, u - before_u), f, v - before_v)) <= error:
            break
    u = _at_end(u, cell.low[0], cell.high[0], norm(e), error)
    v = _at_end(v, cell.low[1], cell.high[1], norm(f), error)
    return u, v, point_at(piece, nets, u, v)


@inlined
def _at_end(t, low, high, speed, error):
    """Return the parameter t, or the end of its interval if that is within `error`."""
    if (t - low) * speed <= error:
        return low
    return high if (high - t) * speed <= error else t


@inlined
def _carried(t, low, high, other_low, other_high):
    """Convert a parameter of one piece to one of another; exact at an end that both share."""
    at = high if t == 1.0 else low + t * (high - low)
    if at == other_high:
        return 1.0
    return (at - other_low) / (other_high - other_low) if other_high > other_low else 0.0


@implements(put_ranges, SurfaceTree)
@kernel
def _put_ranges(tree, cells, nets, index, d, side):
    cell = cells[index]
    piece = tree.pieces[cell.element]
    ranges = ranges_of(piece, nets, net_of(cells, nets, index), d, vector(cell.centre))
    p, q = float(piece.degree_u), float(piece.degree_v)
    once, twice = errors_of(piece, cell.margin)
    for i in range(3):
        side[ACROSS + i], side[ACROSS + 3 + i] = ranges.across_u[i], ranges.across_v[i]
    side[SPREAD], side[SPREAD + 1] = ranges.spread_u + once * p, ranges.spread_v + once * q
    side[MIDDLE], side[MIDDLE + 1] = ranges.middle_u, ranges.middle_v
    side[HALF], side[HALF + 1] = ranges.half_u + once * p, ranges.half_v + once * q
    side[SECOND] = ranges.middle_uu
    side[SECOND + 1] = ranges.middle_uv
    side[SECOND + 2] = ranges.middle_vv
    side[HALVES] = ranges.half_uu + twice * p * p
    side[HALVES + 1] = ranges.half_uv + twice * p * q
    side[HALVES + 2] = ranges.half_vv + twice * q * q
    share = slope_error(piece, tree.nets)
    side[ERRORS] = share * p * (cell.high[0] - cell.low[0])
    side[ERRORS + 1] = share * q * (cell.high[1] - cell.low[1])


@kernel
def _apart_at(piece, nets, axis, end, size):
    """Bound how far apart a piece's points are at an end of u (axis 0) or v (axis 1): see `form`.

    Returns metres; infinity if the end is no pole. The points are means of its control points.
    """
    n = piece.degree_v + 1
    first = (piece.degree_u * n if axis == 0 else piece.degree_v) if end == 1.0 else 0
    count, step = (n, 1) if axis == 0 else (piece.degree_u + 1, n)
    p, apart = _control(piece, nets, first), 0.0
    for k in range(1, count):
        apart = max(apart, norm(sub(_control(piece, nets, first + k * step), p)))
    return 2.0 * apart + 16.0 * DOUBLE_EPS * size if apart <= _POLE * size else np.inf


@inlined
def _control(piece, nets, k):
    at, room = piece.net + k, piece.room
    w = nets[at + 3 * room] if piece.rational else 1.0
    return nets[at] / w, nets[at + room] / w, nets[at + 2 * room] / w


@implements(put_point, SurfaceTree)
@kernel
def _put_point(tree, cells, index, weights, side):
    cell = cells[index]
    piece = tree.pieces[cell.element]
    _, du, dv, _, _, _ = jet_at(piece, tree.nets, weights[0], weights[1])
    side[CORNER] = 0.0
    for k in range(2):
        side[APART + k] = np.inf
        if weights[k] == 0.0 or weights[k] == 1.0:
            side[APART + k] = _apart_at(piece, tree.nets, k, weights[k], tree.scale[2])
        first, width = du if k == 0 else dv, cell.high[k] - cell.low[k]
        for i in range(3):
            side[SLOPE + 3 * k + i] = first[i] * width
        side[ENDS + 2 * k] = side[ENDS + 2 * k + 1] = 0.0
        if width > 0.0:
            side[ENDS + 2 * k] = (cell.low[k] - weights[k]) / width
            side[ENDS + 2 * k + 1] = (cell.high[k] - weights[k]) / width
