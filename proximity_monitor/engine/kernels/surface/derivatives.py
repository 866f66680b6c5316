"""Balls around a part's points and derivatives, from the differences of its control points.

The derivatives of a Bezier surface are Bezier surfaces again, so each lies in the convex hull of
its own control points. Parameters run from 0 to 1 over the part. Unlike those of ranges.py, these
bounds belong to no direction: what is known of a whole piece is found out once and serves all
queries.

A rational one is seen from a point c in its middle. With the numerator N, the weight w, M = N - c w
and the surface S, w (S - c) = M, so by differentiation

    S_u = (M_u - (S - c) w_u) / w
    S_uv = (M_uv - S_u w_v - S_v w_u - (S - c) w_uv) / w

and the like. Where all weights are 1 that is the difference of control points itself.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import entry, inlined, kernel
from ..base.memory import on_stack
from ..base.state import NONE
from ..base.vectors import along, norm, scaled, sub
from .parts import EACH, NUMBERS, margin_about, take_whole
from .ranges import MOST_WEIGHTS, errors_of, slope_error

Ball = namedtuple("Ball", "middle length spread")
"""Vectors: their middle, no less than its length, and no less than how far they are from it."""

Derivatives = namedtuple("Derivatives", "place u v uu uv vv")
"""Balls, metres, around a part's points and its derivatives. All that rounding has done and will do
to products with a middle is included in the spread: 1e-12 of its length."""

_EACH = 5
"""Numbers of a ball in `PIECE.derivatives`."""

_MORE = 1.0 + 1e-9
_PRODUCTS = 1e-12
_NONE = (0.0, 0.0, 0.0)


@kernel
def _rounded(middle, spread):
    """A ball with all that rounding does."""
    length = norm(middle) * _MORE
    return Ball(middle, length, spread * _MORE + _PRODUCTS * length)


@kernel
def _differences(parts, at, c, count_i, count_j, stride_i, stride_j, one, other, factor):
    """Middle and half diagonal of the box around a derivative of M, and of that of the weight.

    Its control points are differences of those `one` numbers apart; where `other` is not 0, of such
    differences which are that far apart.
    """
    x_low = y_low = z_low = w_low = np.inf
    x_high = y_high = z_high = w_high = -np.inf
    for i in range(count_i):
        for j in range(count_j):
            k = at + i * stride_i + j * stride_j
            m = k + one
            x, y, z = parts[m] - parts[k], parts[m + 1] - parts[k + 1], parts[m + 2] - parts[k + 2]
            w = parts[m + 3] - parts[k + 3]
            if other != 0:
                k += other
                m += other
                x = (parts[m] - parts[k]) - x
                y = (parts[m + 1] - parts[k + 1]) - y
                z = (parts[m + 2] - parts[k + 2]) - z
                w = (parts[m + 3] - parts[k + 3]) - w
            x, y, z = x - c[0] * w, y - c[1] * w, z - c[2] * w
            x_low, x_high = min(x_low, x), max(x_high, x)
            y_low, y_high = min(y_low, y), max(y_high, y)
            z_low, z_high = min(z_low, z), max(z_high, z)
            w_low, w_high = min(w_low, w), max(w_high, w)
    if x_high < x_low:
        return _NONE, 0.0, 0.0, 0.0
    half = 0.5 * factor
    middle = half * (x_low + x_high), half * (y_low + y_high), half * (z_low + z_high)
    spread = half * norm((x_high - x_low, y_high - y_low, z_high - z_low))
    return middle, spread, half * (w_low + w_high), half * (w_high - w_low)


@inlined
def _over(middle, spread, inverse, error, rounding):
    """A ball divided by weights that differ by a share `error` from the inverse of `inverse`."""
    middle = scaled(middle, inverse)
    spread = inverse * (1.0 + error) * spread + error * norm(middle)
    return _rounded(middle, spread + rounding)


@kernel
def derivatives_of_part(piece, parts, at, margin):
    """What is known of a part whose net is at `at`, and whose control points err by `margin`.

    Its place is as its net has it. Where its weights differ too much spreads are infinite.
    """
    p, q = np.int64(piece.degree_u), np.int64(piece.degree_v)
    points = np.int64(piece.points)
    low, high = np.inf, 0.0
    x_low = y_low = z_low = np.inf
    x_high = y_high = z_high = -np.inf
    for i in range(points):
        k = at + EACH * i
        w = parts[k + 3]
        inverse = 1.0 / w
        x, y, z = parts[k] * inverse, parts[k + 1] * inverse, parts[k + 2] * inverse
        x_low, x_high = min(x_low, x), max(x_high, x)
        y_low, y_high = min(y_low, y), max(y_high, y)
        z_low, z_high = min(z_low, z), max(z_high, z)
        low, high = min(low, w), max(high, w)
    c = 0.5 * (x_low + x_high), 0.5 * (y_low + y_high), 0.5 * (z_low + z_high)
    reach = 0.5 * norm((x_high - x_low, y_high - y_low, z_high - z_low)) + margin
    place = _rounded(c, reach)
    if not high < MOST_WEIGHTS * low:
        nothing = Ball(_NONE, 0.0, np.inf)
        return Derivatives(place, nothing, nothing, nothing, nothing, nothing)
    inverse, error = 0.5 * (1.0 / low + 1.0 / high), (high - low) / (high + low)
    once, twice = errors_of(piece, margin)
    n, in_u, in_v = q + 1, EACH * (q + 1), EACH
    m, r, wu, half_wu = _differences(parts, at, c, p, n, in_u, in_v, in_u, 0, float(p))
    most_u = abs(wu) + half_wu
    u = _over(m, r + reach * most_u, inverse, error, once * p)
    m, r, wv, half_wv = _differences(parts, at, c, p + 1, q, in_u, in_v, in_v, 0, float(q))
    most_v = abs(wv) + half_wv
    v = _over(m, r + reach * most_v, inverse, error, once * q)
    m, r, ww, half = _differences(
        parts, at, c, p - 1, n, in_u, in_v, in_u, in_u, float(p * (p - 1))
    )
    r += 2.0 * (u.length * half_wu + u.spread * most_u) + reach * (abs(ww) + half)
    uu = _over(along(m, u.middle, -2.0 * wu), r, inverse, error, twice * p * p)
    m, r, ww, half = _differences(parts, at, c, p, q, in_u, in_v, in_u, in_v, float(p * q))
    r += u.length * half_wv + u.spread * most_v + v.length * half_wu + v.spread * most_u
    m = along(along(m, u.middle, -wv), v.middle, -wu)
    uv = _over(m, r + reach * (abs(ww) + half), inverse, error, twice * p * q)
    m, r, ww, half = _differences(
        parts, at, c, p + 1, q - 1, in_u, in_v, in_v, in_v, float(q * (q - 1))
    )
    r += 2.0 * (v.length * half_wv + v.spread * most_v) + reach * (abs(ww) + half)
    vv = _over(along(m, v.middle, -2.0 * wv), r, inverse, error, twice * q * q)
    return Derivatives(place, u, v, uu, uv, vv)


@inlined
def _put(row, i, ball):
    at = _EACH * i
    row[at], row[at + 1], row[at + 2] = ball.middle
    row[at + 3], row[at + 4] = ball.length, ball.spread


@inlined
def _get(row, i):
    at = _EACH * i
    return Ball((row[at], row[at + 1], row[at + 2]), row[at + 3], row[at + 4])


@kernel
def derivatives_of(piece, p):
    """What is known of a whole piece, its place as seen from a point p."""
    row = piece.derivatives
    place = _get(row, 0)
    middle = sub(place.middle, p)
    place = Ball(middle, norm(middle) * _MORE, place.spread)
    return Derivatives(place, _get(row, 1), _get(row, 2), _get(row, 3), _get(row, 4), _get(row, 5))


@entry
def fit_derivatives(pieces, nets, scale):
    """Write what is known of the derivatives of pieces (m,); of edges nothing.

    Args:
        pieces: (m,) PIECE.
        nets: their control nets.
        scale: of their SurfaceTree.
    """
    parts = on_stack(NUMBERS, 0.0)
    for i in range(len(pieces)):
        piece = pieces[i]
        if piece.edge != NONE:
            continue
        take_whole(piece, nets, _NONE, parts)
        made = derivatives_of_part(piece, parts, 0, margin_about(scale, piece, scale[2], 0))
        row = piece.derivatives
        _put(row, 0, made.place)
        _put(row, 1, made.u)
        _put(row, 2, made.v)
        _put(row, 3, made.uu)
        _put(row, 4, made.uv)
        _put(row, 5, made.vv)
        piece.slope = slope_error(piece, nets)
