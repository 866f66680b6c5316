"""A proof that nothing in two cells is nearer than the points found: convexity around them.

For a unit vector n and the way D(p) between two points, with p the parameters of both, let
tau = D - n (n D) be the part of D across n. Where |D| <= U, |D| - n D = tau^2 / (|D| + n D) is at
least tau^2 / 2U, so for any m of 0 to 1/U

    F(p) = n D + m tau^2 / 2

is a lower bound of |D|. At the nearest points, with n along D and m = 1/U, its Hessian is that of
|D| itself. Where it is positive all over two cells that hold these points p0, F is at least
F(p0) + F'(p0) (p - p0) there: so both cells are done with. That is so in cells of a fixed size
however near the surfaces are, as m may be less than 1/U; a bound of the gap alone would have cells
divided until they are as small as the square root of what the answer may err by.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel, shared
from ..base.memory import on_stack, table_on_stack
from ..base.rounding import DOUBLE_EPS
from ..base.state import NONE, SurfaceTree
from ..base.vectors import along, dot, norm, rotated, scaled
from .cells import net_of
from .evaluate import jet_at
from .ranges import ranges_of

_ROUNDING = 1e-9
"""Share of the Hessian's diagonal that is left out, for all that rounding does to it."""


def is_certifiable(tree, cells, index, element, weights):
    """Whether a cell holds a point of its element, and can be taken in such a proof: a stub."""


def put_side(tree, cells, nets, index, weights, d, side):
    """Write a Side about a cell: see `_SIDE`; d is the direction n in its model's frame: a stub."""


_SIDE = 32
"""Numbers about a cell, parameters being 0 to 1 over it. By u, and then by v: the middle of the
derivative 0, 3 (3 numbers each), how far it may be from there 6, 7, the derivative at the point
8, 11, how far back and forth the parameter may go from there 14 to 17; of the second derivatives by
uu, uv and vv: middle 18, half length 21 of the product with n, the largest length 24. How many
times a point's rounding the derivatives at the point may err by 27, 28."""

_STRETCH = 1.0 + 1e-5
"""By what lengths of b are increased: a pose may change them by RIGID_TOLERANCE."""

_OUTWEIGHING = 4.0
"""How many times the largest bend, per squared length, m is where the surfaces nearly touch."""


@kernel
def certified(tree_a, tree_b, state, a, b):
    """A lower bound of the distance of two cells, metres, from convexity; -inf where there is none.

    Only where both hold the nearest points found so far.
    """
    progress, waiting, motion = state.progress[0], state.waiting, state.motions[0]
    at_a = (progress.weights_a[0], progress.weights_a[1], progress.weights_a[2])
    at_b = (progress.weights_b[0], progress.weights_b[1], progress.weights_b[2])
    if not (
        is_certifiable(tree_a, waiting.cells_a, a, progress.element_a, at_a)
        and is_certifiable(tree_b, waiting.cells_b, b, progress.element_b, at_b)
    ):
        return -np.inf
    if not progress.distance > progress.slack:
        return -np.inf
    sides = table_on_stack(2, _SIDE, 0.0)
    n = (progress.normal_a[0], progress.normal_a[1], progress.normal_a[2])
    turned = (
        motion[0] * n[0] + motion[3] * n[1] + motion[6] * n[2],
        motion[1] * n[0] + motion[4] * n[1] + motion[7] * n[2],
        motion[2] * n[0] + motion[5] * n[1] + motion[8] * n[2],
    )
    put_side(tree_a, waiting.cells_a, waiting.nets_a, a, at_a, n, sides[0])
    put_side(tree_b, waiting.cells_b, waiting.nets_b, b, at_b, turned, sides[1])
    return _bound(sides, n, motion, progress.distance, progress.slack)


@shared
def _bound(sides, n, motion, distance, slack):
    """What `certified` returns, of two sides."""
    middles, spreads = table_on_stack(4, 3, 0.0), on_stack(4, 0.0)
    slopes, ends = on_stack(4, 0.0), on_stack(4, 0.0)
    loss = 16.0 * DOUBLE_EPS * distance  # n is no longer than a unit, and that much shorter
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
        slopes[i] = dot(middle, n)
        middle = along(middle, n, -slopes[i])
        middles[i, 0], middles[i, 1], middles[i, 2] = middle
        spreads[i] = _STRETCH * side[6 + k]
        reach += norm(middle) + spreads[i]
        low, high = side[14 + 2 * k], side[15 + 2 * k]
        slope = dot(first, n)
        ends[i] = 0.0
        if low == 0.0 and high > 0.0:
            ends[i] = 1.0
        elif high == 0.0 and low < 0.0:
            ends[i] = -1.0
        loss -= min(slope * low, slope * high)
        # The derivatives at the points err as the points do, times the degree.
        loss += slack * side[27 + k] * (high - low)
        across += norm(first) * (high - low)
        squared = dot(middle, middle)
        if squared > 0.0:
            bends = max(bends, (abs(side[18 + 2 * k]) + side[21 + 2 * k]) / squared)
    if loss > distance:
        return -np.inf
    # tau vanishes at the points but for what these err by, and that times m is a slope as well. So
    # where they are very near each other a smaller m serves: one that outweighs their bends.
    m = 1.0 / distance
    if _is_least(sides, middles, spreads, slopes, ends, reach, m) and m * slack * across < slack:
        return distance - loss - m * slack * across
    m = min(m, _OUTWEIGHING * bends)
    if _is_least(sides, middles, spreads, slopes, ends, reach, m):
        return distance - loss - m * slack * across
    return -np.inf


@kernel
def _is_least(sides, middles, spreads, slopes, ends, reach, m):
    """Whether F is convex all over two cells, in the parameters that do not end at the points.

    One that does, where F rises all over the cells as it leaves its end, is as good as fixed there.
    Of the others the Hessian has to be positive, by Cholesky's factors. What it may differ by from
    that of the middles is subtracted from the diagonal: with |E_ij| at most R_ij, x E x is at least
    minus the sum of x_i^2 R_ij w_j / w_i, for any w > 0.
    """
    hessian, errors = table_on_stack(4, 4, 0.0), table_on_stack(4, 4, 0.0)
    held = on_stack(4, 0.0)
    for i in range(4):
        size = norm(_row(middles, i)) + spreads[i]
        held[i] = ends[i] * slopes[i] - spreads[i] - m * reach * size
        if ends[i] == 0.0:
            held[i] = 0.0
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
        if not hessian[i, i] > errors[i, i]:
            return False
    weights = on_stack(4, 0.0)
    for i in range(4):
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


@implements(is_certifiable, SurfaceTree)
@inlined
def _holds(tree, cells, index, element, weights):
    cell = cells[index]
    if (
        cell.element != element
        or tree.pieces[element].rational
        or tree.pieces[element].edge != NONE
    ):
        return False
    return cell.low[0] <= weights[0] <= cell.high[0] and cell.low[1] <= weights[1] <= cell.high[1]


@implements(put_side, SurfaceTree)
@kernel
def _put_side(tree, cells, nets, index, weights, d, side):
    cell = cells[index]
    piece = tree.pieces[cell.element]
    ranges = ranges_of(piece, nets, net_of(cells, nets, index), d)
    _, du, dv, _, _, _ = jet_at(piece, tree.nets, weights[0], weights[1])
    width_u, width_v = cell.high[0] - cell.low[0], cell.high[1] - cell.low[1]
    for i in range(3):
        side[i], side[3 + i] = ranges.along_u[i], ranges.along_v[i]
        side[8 + i], side[11 + i] = du[i] * width_u, dv[i] * width_v
    side[6], side[7] = ranges.spread_u, ranges.spread_v
    side[14] = (cell.low[0] - weights[0]) / width_u
    side[15] = (cell.high[0] - weights[0]) / width_u
    side[16] = side[17] = 0.0
    if width_v > 0.0:
        side[16] = (cell.low[1] - weights[1]) / width_v
        side[17] = (cell.high[1] - weights[1]) / width_v
    # Differences of control points, of which each may err by the margin.
    p, q, margin = float(piece.degree_u), float(piece.degree_v), cell.margin
    side[6] += 2.0 * p * margin
    side[7] += 2.0 * q * margin
    side[18], side[19], side[20] = ranges.middle_uu, ranges.middle_uv, ranges.middle_vv
    side[21] = ranges.half_uu + 4.0 * p * p * margin
    side[22] = ranges.half_uv + 4.0 * p * q * margin
    side[23] = ranges.half_vv + 4.0 * q * q * margin
    side[24] = ranges.most_uu + 4.0 * p * p * margin
    side[25] = ranges.most_uv + 4.0 * p * q * margin
    side[26] = ranges.most_vv + 4.0 * q * q * margin
    side[27], side[28] = 2.0 * p * width_u, 2.0 * q * width_v
