"""Cells in the proofs that two of them are done with: the ranges of their derivatives."""

from __future__ import annotations

from ..base.jit import implements, inlined, kernel
from ..base.trees import NONE, SurfaceTree
from .cells import net_of
from .certificate import can_be_proven, find_in, put_point, put_ranges
from .evaluate import jet_at, point_at
from .facing import vector
from .form import ACROSS, CORNER, ENDS, ERRORS, HALF, HALVES, MIDDLE, SECOND, SLOPE, SPREAD
from .ranges import errors_of, ranges_of, slope_error


@implements(can_be_proven, SurfaceTree)
@inlined
def _can_be_proven(tree, cells, index):
    return tree.pieces[cells[index].element].edge == NONE


@implements(find_in, SurfaceTree)
@kernel
def _find_in(tree, cells, index, element, weights):
    cell = cells[index]
    if cell.element != element:
        one, other = tree.pieces[element], tree.pieces[cell.element]
        if one.patch != other.patch or one.edge != NONE:
            return False, weights, (0.0, 0.0, 0.0)
        u = _carried(weights[0], one.low[0], one.high[0], other.low[0], other.high[0])
        v = _carried(weights[1], one.low[1], one.high[1], other.low[1], other.high[1])
        weights = (u, v, 0.0)
    low, high = cell.low, cell.high
    if not (low[0] <= weights[0] <= high[0] and low[1] <= weights[1] <= high[1]):
        return False, weights, (0.0, 0.0, 0.0)
    return True, weights, point_at(tree.pieces[cell.element], tree.nets, weights[0], weights[1])


@inlined
def _carried(t, low, high, other_low, other_high):
    """A parameter of one piece as that of another; exact where it is where both end."""
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
    side[CORNER] = 0.0


@implements(put_point, SurfaceTree)
@kernel
def _put_point(tree, cells, index, weights, d, side):
    cell = cells[index]
    _, du, dv, _, _, _ = jet_at(tree.pieces[cell.element], tree.nets, weights[0], weights[1])
    for k in range(2):
        first, width = du if k == 0 else dv, cell.high[k] - cell.low[k]
        for i in range(3):
            side[SLOPE + 3 * k + i] = first[i] * width
        side[ENDS + 2 * k] = side[ENDS + 2 * k + 1] = 0.0
        if width > 0.0:
            side[ENDS + 2 * k] = (cell.low[k] - weights[k]) / width
            side[ENDS + 2 * k + 1] = (cell.high[k] - weights[k]) / width
