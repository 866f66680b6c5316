"""Ranges of a cell's derivatives, from the differences of its control points.

The derivatives of a Bezier surface are Bezier surfaces too, so each lies in the convex hull of its
own control points. Parameters run from 0 to 1 over the cell. For a rational cell, these are the
derivatives of numerator and weight, and those of the quotient follow from them.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import kernel, shared
from ..base.memory import on_stack
from ..base.vectors import norm, scaled
from .subdivide import PROJECTED

Ranges = namedtuple(
    "Ranges", "across_u spread_u middle_u half_u across_v spread_v middle_v half_v"
    " middle_uu half_uu middle_uv half_uv middle_vv half_vv"
)  # fmt: skip
"""For each derivative, metres: middle and half length of the range of its product with a direction
d. For the first derivatives also `across`, a vector near their parts across d, x - d (d x), which
differ from it by at most `spread`.
"""


@kernel
def _first(nets, at, room, p, n, step_i, step_j, factor, d):
    """Return middle and half diagonal of the box around derivatives by a parameter, across d.

    Also returns middle and half length of the range of their products with d.
    """
    x_low = y_low = z_low = low = np.inf
    x_high = y_high = z_high = high = -np.inf
    for i in range(p + 1 - step_i):
        for j in range(n - step_j):
            k = at + i * n + j
            m = k + step_i * n + step_j
            x = nets[m] - nets[k]
            y = nets[m + room] - nets[k + room]
            z = nets[m + 2 * room] - nets[k + 2 * room]
            value = d[0] * x + d[1] * y + d[2] * z
            low, high = min(low, value), max(high, value)
            x, y, z = x - d[0] * value, y - d[1] * value, z - d[2] * value
            x_low, x_high = min(x_low, x), max(x_high, x)
            y_low, y_high = min(y_low, y), max(y_high, y)
            z_low, z_high = min(z_low, z), max(z_high, z)
    x, y, z = x_high - x_low, y_high - y_low, z_high - z_low
    middle = 0.5 * factor * (x_low + x_high), 0.5 * factor * (y_low + y_high)
    return (
        (middle[0], middle[1], 0.5 * factor * (z_low + z_high)),
        0.5 * factor * np.sqrt(x * x + y * y + z * z),
        0.5 * factor * (low + high),
        0.5 * factor * (high - low),
    )


@kernel
def _second(nets, at, room, p, n, step, other, count_i, count_j, factor, d):
    """Return middle and half length of the range of d times a second derivative.

    The differences are of the points k, k + step, k + other and k + step + other.
    """
    low, high = np.inf, -np.inf
    for i in range(count_i):
        for j in range(count_j):
            k = at + i * n + j
            value = 0.0
            for axis in range(3):
                m = k + axis * room
                x = (nets[m + step + other] - nets[m + step]) - (nets[m + other] - nets[m])
                value += d[axis] * x
            low, high = min(low, value), max(high, value)
    if high < low:
        return 0.0, 0.0
    return 0.5 * factor * (low + high), 0.5 * factor * (high - low)


_RATIONAL = 32.0
"""A rational cell's derivatives may err by this many times as much as others: see `_quotients`."""

_MOST_WEIGHTS = 2.0
"""If the ratio of a cell's weights is not below this, its ranges are infinite."""

_NET, _NUMERATOR = 256, 768
"""Most control points, of degree 15 in both directions; and the number of their coordinates."""


@shared
def ranges_of(piece, nets, at, d, centre):
    """Return the Ranges of a cell of a piece, with its net at `at`; d is a direction in its frame.

    `centre` is a point near the cell. The rounding errors of the control points are not included.
    """
    p, q = np.int64(piece.degree_u), np.int64(piece.degree_v)
    if piece.rational:
        return _quotients(piece, nets, at, d, centre)
    return _of_net(nets, at, np.int64(piece.room), p, q, d)


@kernel
def errors_of(piece, margin):
    """Return the errors of first and second derivatives if control points err by `margin`, metres.

    Multiply the first by the degree, the second by the product of both degrees.
    """
    share = _RATIONAL if piece.rational else 1.0
    # Differences of two control points, or of four, err by 2 or 4 margins. The rounding of these,
    # of their products with a direction and of their parts across it is below 16 u P or 24 u P,
    # that is 4 or 6 margins: NET_SPLIT makes a margin at least 4 u P.
    return 6.0 * share * margin, 10.0 * share * margin


@kernel
def slope_error(piece, nets):
    """Return by how many times the error of points a derivative at one may err, for each degree.

    The derivative's control points are differences of two. The derivative of a rational piece is
    (N_u - w_u S) / w, so the ratio of the largest weight to the least counts: twice for N_u, twice
    for the error of w_u in its product with S, and twice for that of S.
    """
    if not piece.rational:
        return 2.0
    low, high = np.inf, 0.0
    for k in range(piece.points):
        w = nets[piece.net + 3 * piece.room + k]
        low, high = min(low, w), max(high, w)
    return 6.0 * high / low


@kernel
def _of_net(nets, at, room, p, q, d):
    """Return the Ranges of a net of degrees p and q."""
    n = q + 1
    none = (0.0, 0.0, 0.0)
    across_u, spread_u, middle_u, half_u = _first(nets, at, room, p, n, 1, 0, float(p), d)
    across_v, spread_v, middle_v, half_v = none, 0.0, 0.0, 0.0
    if q > 0:
        across_v, spread_v, middle_v, half_v = _first(nets, at, room, p, n, 0, 1, float(q), d)
    uu = _second(nets, at, room, p, n, n, n, p - 1, n, p * (p - 1.0), d)
    uv = _second(nets, at, room, p, n, n, 1, p, q, float(p * q), d)
    vv = _second(nets, at, room, p, n, 1, 1, p + 1, q - 1, q * (q - 1.0), d)
    return Ranges(
        across_u, spread_u, middle_u, half_u, across_v, spread_v, middle_v, half_v,
        uu[0], uu[1], uv[0], uv[1], vv[0], vv[1],
    )  # fmt: skip


@kernel
def _quotients(piece, nets, at, d, c):
    """Return the Ranges of a rational cell, by the quotient rule.

    With the numerator N, the weight w, M = N - c w and the surface S, S - c = M / w and

        S_u = (M_u - (S - c) w_u) / w
        S_uv = (M_uv - S_u w_v - S_v w_u - (S - c) w_uv) / w

    The middles are those of M_u and of M_uv - S_u w_v - S_v w_u over a mean weight. The terms left
    out shrink with the cell, because S - c and the derivatives of w do. All this holds for products
    with d too, and for the parts across d, which are no longer.

    Rounding: if the projected points err by e, a coordinate of N or c w errs by at most e times the
    largest weight, and w by e / P times it, for points of length P. The products and the quotient
    repeat that: S_u errs by 2 p e 4 W, and S_uv by 4 p q e 9 W, where W, the ratio of the largest
    weight to the mean one plus what the others add to it, is below 3.
    """
    p, q, room = np.int64(piece.degree_u), np.int64(piece.degree_v), np.int64(piece.room)
    n = q + 1
    points = (p + 1) * n
    numerator, weights = on_stack(_NUMERATOR, 0.0), on_stack(_NET, 0.0)
    first = at + PROJECTED * room
    low, high = np.inf, 0.0
    reach = reach_along = 0.0
    for k in range(points):
        w = nets[first + 3 * room + k]
        weights[k] = w
        low, high = min(low, w), max(high, w)
        along = squared = 0.0
        for axis in range(3):
            numerator[axis * _NET + k] = nets[first + axis * room + k] - c[axis] * w
            away = nets[at + axis * room + k] - c[axis]
            squared += away * away
            along += away * d[axis]
        reach, reach_along = max(reach, squared), max(reach_along, abs(along))
    reach = np.sqrt(reach)
    of = _of_net(numerator, 0, _NET, p, q, d)
    if not high < _MOST_WEIGHTS * low:
        return Ranges(
            of.across_u, np.inf, 0.0, np.inf, of.across_v, np.inf, 0.0, np.inf,
            0.0, np.inf, 0.0, np.inf, 0.0, np.inf,
        )  # fmt: skip
    inverse, error = 0.5 * (1.0 / low + 1.0 / high), (high - low) / (high + low)
    wu, half_wu = _weight(weights, p, n, n, n, p, n, 0, float(p))
    wv, half_wv = _weight(weights, p, n, 1, 1, p + 1, q, 0, float(q))
    most_u, most_v = abs(wu) + half_wu, abs(wv) + half_wv
    wuu, half = _weight(weights, p, n, n, n, p - 1, n, 1, p * (p - 1.0))
    most_uu = abs(wuu) + half
    wuv, half = _weight(weights, p, n, n, 1, p, q, 1, float(p * q))
    most_uv = abs(wuv) + half
    wvv, half = _weight(weights, p, n, 1, 1, p + 1, q - 1, 1, q * (q - 1.0))
    most_vv = abs(wvv) + half
    more = 1.0 + error
    u, spread_u = _over(of.across_u, of.spread_u, reach * most_u, inverse, error)
    v, spread_v = _over(of.across_v, of.spread_v, reach * most_v, inverse, error)
    du, half_u = inverse * of.middle_u, more * (of.half_u + reach_along * most_u)
    dv, half_v = inverse * of.middle_v, more * (of.half_v + reach_along * most_v)
    half_u, half_v = inverse * half_u + error * abs(du), inverse * half_v + error * abs(dv)
    middle_uu = of.middle_uu - 2.0 * du * wu
    half_uu = of.half_uu + 2.0 * (abs(du) * half_wu + half_u * most_u) + reach_along * most_uu
    middle_uv = of.middle_uv - du * wv - dv * wu
    half_uv = of.half_uv + abs(du) * half_wv + half_u * most_v + abs(dv) * half_wu
    half_uv += half_v * most_u + reach_along * most_uv
    middle_vv = of.middle_vv - 2.0 * dv * wv
    half_vv = of.half_vv + 2.0 * (abs(dv) * half_wv + half_v * most_v) + reach_along * most_vv
    return Ranges(
        u, spread_u, du, half_u, v, spread_v, dv, half_v,
        inverse * middle_uu, inverse * (more * half_uu + error * abs(middle_uu)),
        inverse * middle_uv, inverse * (more * half_uv + error * abs(middle_uv)),
        inverse * middle_vv, inverse * (more * half_vv + error * abs(middle_vv)),
    )  # fmt: skip


@kernel
def _over(middle, spread, more, inverse, error):
    """Return a derivative of the quotient: its middle, and how far the derivative may be from it.

    The middle is the numerator's, over a mean weight. `more` bounds the term with the weight's
    derivative. Weights differ by at most a share `error` from the mean, which is 1 / `inverse`.
    """
    u = scaled(middle, inverse)
    return u, inverse * (1.0 + error) * (spread + more) + error * norm(u)


@kernel
def _weight(weights, p, n, step, other, count_i, count_j, second, factor):
    """Return middle and half length of the range of a derivative of the weight."""
    low, high = np.inf, -np.inf
    for i in range(count_i):
        for j in range(count_j):
            k = i * n + j
            x = weights[k + step] - weights[k]
            if second:
                x = (weights[k + step + other] - weights[k + other]) - x
            low, high = min(low, x), max(high, x)
    if high < low:
        return 0.0, 0.0
    return 0.5 * factor * (low + high), 0.5 * factor * (high - low)
