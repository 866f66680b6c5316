"""A proof that nothing in two cells is nearer than the limit: convexity around the nearest points.

For a unit vector n and the way D(p) between two points, with p the parameters of both, let
tau = D - n (n D) be the part of D across n. Where |D| <= U, |D| - n D = tau^2 / (|D| + n D) is at
least tau^2 / 2U, so for any m of 0 to 1/U

    F(p) = n D + m tau^2 / 2

is a lower bound of |D|. At the nearest points p0, with n along D and m = 1/U, its Hessian is that
of |D| itself. Where it is positive all over two cells that hold these points, F is at least
F(p0) + F'(p0) (p - p0) there: so both cells are done with. That is so in cells of a fixed size
however near the surfaces are, as m may be less than 1/U; a bound of the gap alone would have cells
divided until they are as small as the square root of what the answer may err by.

Where a tolerance leaves room below |D(p0)|, the Hessian may be as negative as that allows over the
cells' extent. Points of joints and of edges between triangles lie in several cells: each has its
own proof.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel, shared
from ..base.memory import on_stack, table_on_stack
from ..base.rounding import DOUBLE_EPS
from ..base.state import NONE, SurfaceTree
from ..base.vectors import along, dot, moved, norm, rotated, scaled, sub, turned_back
from .cells import net_of
from .evaluate import jet_at, point_at
from .facing import vector
from .ranges import errors_of, ranges_of, slope_error

PROOF_STEPS = 4
"""Steps of a search that a proof takes as long as."""

_ROUNDING = 1e-9
"""Share of the Hessian's diagonal that is left out, for all that rounding does to it."""


def can_be_proven(tree, cells, index):
    """Whether a cell can be taken in such a proof: a stub."""


def find_in(tree, cells, index, element, weights):
    """Whether a cell holds a point of an element, perhaps of a neighbour: a stub.

    Returns also its weights on the cell's own element, and the point, metres, in its model's frame.
    """


def put_side(tree, cells, nets, index, weights, d, side):
    """Write a Side about a cell: see `_SIDE`; d is the direction n in its model's frame: a stub."""


_SIDE = 32
"""Numbers about a cell, parameters being 0 to 1 over it. By u, and then by v: the middle of the
derivative 0, 3 (3 numbers each), how far it may be from there 6, 7, the derivative at the point
8, 11, how far back and forth the parameter may go from there 14 to 17; of the second derivatives by
uu, uv and vv: middle 18, half length 21 of the product with n, the largest length 24. How many
times a point's rounding the derivatives at the point may err by 27, 28. Whether the sum of both
parameters is 1 at the most as well 29."""

_STRETCH = 1.0 + 1e-5
"""By what lengths of b are increased: a pose may change them by RIGID_TOLERANCE."""

_OUTWEIGHING = 4.0
"""How many times the largest bend, per squared length, m is where the surfaces nearly touch."""


@kernel
def is_done(tree_a, tree_b, state, a, b, slack):
    """Whether nothing in two cells improves the answer, and the steps that it took to know.

    Only where both hold the nearest points found so far. `slack` is what their bound may err by.
    """
    progress, waiting, motion = state.progress[0], state.waiting, state.motions[0]
    if not (
        progress.distance > progress.slack
        and can_be_proven(tree_a, waiting.cells_a, a)
        and can_be_proven(tree_b, waiting.cells_b, b)
    ):
        return False, 0
    at_a, at_b = vector(progress.weights_a), vector(progress.weights_b)
    found, at_a, p = find_in(tree_a, waiting.cells_a, a, progress.element_a, at_a)
    if not found:
        return False, 0
    found, at_b, q = find_in(tree_b, waiting.cells_b, b, progress.element_b, at_b)
    if not found:
        return False, 0
    way = sub(moved(motion, q), p)
    distance = norm(way)
    if not distance - slack > progress.enough:
        return False, 1
    n = scaled(way, (1.0 - 4.0 * DOUBLE_EPS) / distance)
    sides = table_on_stack(2, _SIDE, 0.0)
    put_side(tree_a, waiting.cells_a, waiting.nets_a, a, at_a, n, sides[0])
    put_side(tree_b, waiting.cells_b, waiting.nets_b, b, at_b, turned_back(motion, n), sides[1])
    limit = progress.enough + slack
    return _surpasses(sides, n, motion, distance, progress.slack, limit), PROOF_STEPS


@shared
def _surpasses(sides, n, motion, distance, slack, limit):
    """Whether |D| is at least `limit` all over two sides; `slack` is what `distance` errs by."""
    middles, spreads = table_on_stack(4, 3, 0.0), on_stack(4, 0.0)
    slopes, rises, ends = on_stack(4, 0.0), on_stack(4, 0.0), on_stack(4, 0.0)
    left = distance - limit - 16.0 * DOUBLE_EPS * distance  # n is that much shorter than a unit
    bends = 0.0
    reach = 0.0  # how far across n the way may lead at most
    across = 0.0
    for i in range(4):
        side, k = sides[i // 2], i % 2
        middle, first = _three(side, 3 * k), _three(side, 8 + 3 * k)
        if i < 2:  # of a: the way goes from there
            middle, first = scaled(middle, -1.0), scaled(first, -1.0)
        else:
            middle, first = rotated(motion, middle), rotated(motion, first)
        slopes[i], rises[i] = dot(middle, n), dot(first, n)
        middle = along(middle, n, -slopes[i])
        middles[i, 0], middles[i, 1], middles[i, 2] = middle
        spreads[i] = _STRETCH * side[6 + k]
        reach += norm(middle) + spreads[i]
        low, high = side[14 + 2 * k], side[15 + 2 * k]
        ends[i] = 0.0
        if low == 0.0 and high > 0.0:
            ends[i] = 1.0
        elif high == 0.0 and low < 0.0:
            ends[i] = -1.0
        # The derivatives at the points err as the points do, times the degree.
        left -= slack * side[27 + k] * (high - low)
        across += norm(first) * (high - low)
        squared = dot(middle, middle)
        if squared > 0.0:
            bends = max(bends, (abs(side[18 + 2 * k]) + side[21 + 2 * k]) / squared)
    left += _least_rise(sides[0], rises[0], rises[1]) + _least_rise(sides[1], rises[2], rises[3])
    # tau vanishes at the points but for what these err by, and that times m is a slope as well. So
    # where they are very near each other a smaller m serves: one that outweighs their bends.
    m = 1.0 / distance
    more = m * slack * across
    if (
        more < slack
        and left >= more
        and _is_least(sides, middles, spreads, slopes, ends, reach, m, left - more)
    ):
        return True
    m = min(m, _OUTWEIGHING * bends)
    left -= m * slack * across
    return left >= 0.0 and _is_least(sides, middles, spreads, slopes, ends, reach, m, left)


@inlined
def _least_rise(side, u, v):
    """The least that n D rises by from the point on over a side, with its derivatives there."""
    if side[29] == 0.0:
        return min(u * side[14], u * side[15]) + min(v * side[16], v * side[17])
    corner = u * side[14] + v * side[16]
    return min(corner, min(u * side[15] + v * side[16], u * side[14] + v * side[17]))


@kernel
def _is_least(sides, middles, spreads, slopes, ends, reach, m, left):
    """Whether F is nowhere less by more than `left` than its tangent at the points.

    A parameter that ends there, where F rises all over the cells as it leaves its end, is as good
    as fixed. Of the others the Hessian has to be positive, by Cholesky's factors, when so much is
    added to its diagonal as makes that difference. What it may differ by from that of the middles
    is subtracted there: with |E_ij| at most R_ij, x E x is at least minus the sum of
    x_i^2 R_ij w_j / w_i, for any w > 0.
    """
    hessian, errors = table_on_stack(4, 4, 0.0), table_on_stack(4, 4, 0.0)
    held = on_stack(4, 0.0)
    for i in range(4):
        size = norm(_row(middles, i)) + spreads[i]
        held[i] = ends[i] * slopes[i] - spreads[i] - m * reach * size
        if ends[i] == 0.0:
            held[i] = 0.0
    extent = 0.0
    for i in range(4):
        for j in range(i + 1):
            if held[i] > 0.0 or held[j] > 0.0:
                hessian[i, j] = errors[i, j] = errors[j, i] = 0.0
                continue
            one, other = _row(middles, i), _row(middles, j)
            value = m * dot(one, other)
            error = spreads[i] * norm(other) + spreads[j] * norm(one) + spreads[i] * spreads[j]
            half = 0.0
            if i // 2 == j // 2:
                side, k = sides[i // 2], i % 2 + j % 2
                value += side[18 + k] if i >= 2 else -side[18 + k]
                error += reach * side[24 + k]
                half = side[21 + k]
            hessian[i, j] = value
            errors[i, j] = errors[j, i] = _STRETCH * (m * error + half)
        if hessian[i, i] == 0.0 and errors[i, i] == 0.0:
            hessian[i, i] = 1.0  # a parameter that there is not
            continue
        side, k = sides[i // 2], i % 2
        most = max(-side[14 + 2 * k], side[15 + 2 * k])
        extent += (abs(hessian[i, i]) + errors[i, i]) * most * most
    # F may be less by half the sum of what is added times the squares of the extents.
    share = left / extent if extent > 0.0 else 0.0
    weights = on_stack(4, 0.0)
    for i in range(4):
        hessian[i, i] += share * (abs(hessian[i, i]) + errors[i, i])
        if not hessian[i, i] > errors[i, i]:
            return False
        weights[i] = 1.0 / np.sqrt(hessian[i, i])
    for i in range(4):
        hessian[i, i] *= 1.0 - _ROUNDING
        for j in range(4):
            hessian[i, i] -= errors[i, j] * weights[j] / weights[i]
    for i in range(4):
        for j in range(i + 1):
            value = hessian[i, j]
            for k in range(j):
                value -= hessian[i, k] * hessian[j, k]
            if i != j:
                hessian[i, j] = value / hessian[j, j]
            elif value > 0.0:
                hessian[i, i] = np.sqrt(value)
            else:
                return False
    return True


@inlined
def _three(numbers, at):
    return (numbers[at], numbers[at + 1], numbers[at + 2])


@inlined
def _row(table, i):
    return (table[i, 0], table[i, 1], table[i, 2])


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


@implements(put_side, SurfaceTree)
@kernel
def _put_side(tree, cells, nets, index, weights, d, side):
    cell = cells[index]
    piece = tree.pieces[cell.element]
    ranges = ranges_of(piece, nets, net_of(cells, nets, index), d, vector(cell.centre))
    _, du, dv, _, _, _ = jet_at(piece, tree.nets, weights[0], weights[1])
    width_u, width_v = cell.high[0] - cell.low[0], cell.high[1] - cell.low[1]
    for i in range(3):
        side[i], side[3 + i] = ranges.along_u[i], ranges.along_v[i]
        side[8 + i], side[11 + i] = du[i] * width_u, dv[i] * width_v
    side[14] = (cell.low[0] - weights[0]) / width_u
    side[15] = (cell.high[0] - weights[0]) / width_u
    side[16] = side[17] = 0.0
    if width_v > 0.0:
        side[16] = (cell.low[1] - weights[1]) / width_v
        side[17] = (cell.high[1] - weights[1]) / width_v
    p, q = float(piece.degree_u), float(piece.degree_v)
    once, twice = errors_of(piece, cell.margin)
    side[6] = ranges.spread_u + once * p
    side[7] = ranges.spread_v + once * q
    side[18], side[19], side[20] = ranges.middle_uu, ranges.middle_uv, ranges.middle_vv
    side[21] = ranges.half_uu + twice * p * p
    side[22] = ranges.half_uv + twice * p * q
    side[23] = ranges.half_vv + twice * q * q
    side[24] = ranges.most_uu + twice * p * p
    side[25] = ranges.most_uv + twice * p * q
    side[26] = ranges.most_vv + twice * q * q
    share = slope_error(piece, tree.nets)
    side[27], side[28] = share * p * width_u, share * q * width_v
    side[29] = 0.0
