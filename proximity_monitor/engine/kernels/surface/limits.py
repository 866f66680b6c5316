"""Bounds of the lengths of a part's derivatives, and of their changes, from its control points.

The derivatives of a Bezier surface are Bezier surfaces too. Each lies in the convex hull of its own
control points, which are differences of those of the surface. Parameters run from 0 to 1 over the
part. Unlike those of ranges.py, these bounds belong to no direction: those of a whole piece are
computed once, and serve all queries (see minimum.py).

A rational part is seen from a point c in its middle. With the numerator N, the weight w,
M = N - c w and the surface S, w (S - c) = M. So by differentiation

    w S_u = M_u - (S - c) w_u
    w S_uv = M_uv - S_u w_v - S_v w_u - (S - c) w_uv
    w S_uuv = M_uuv - 2 S_uv w_u - S_uu w_v - 2 S_u w_uv - S_v w_uu - (S - c) w_uuv

and so on. If all weights are 1, the right-hand side is just the difference of control points.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import entry, inlined, kernel
from ..base.memory import on_stack
from ..base.trees import NONE
from ..base.vectors import add, along, dot, norm, scaled
from .parts import EACH, NUMBERS, corner_of, margin_about, take_whole
from .ranges import slope_error

Limits = namedtuple("Limits", "u v uu uv vv uuu uuv uvv vvv of_uuu of_uuv of_uvv of_vvv")
"""Bounds of the lengths of derivatives, metres; and of these products of them, square metres:
3 S_u S_uu, 2 S_u S_uv + S_uu S_v, 2 S_v S_uv + S_vv S_u and 3 S_v S_vv."""

_Ball = namedtuple("_Ball", "middle length spread")
"""A ball of vectors: its middle, a bound of the middle's length, and a bound of its radius."""

_MORE = 1.0 + 1e-9
"""Factor by which lengths are increased, to cover the rounding of sums."""

_MOST_WEIGHTS = 4.0
"""If the ratio of a part's weights is not below this, nothing is known of the part."""

_RATIONAL = 512.0
"""A rational derivative may err by this many times the error of control points, times the degrees:
derivatives are sums of up to seven products of others with weights, of two factors each. The ratio
of the weights counts once for each order."""


@kernel
def _ball(middle, spread):
    length = norm(middle) * _MORE
    return _Ball(middle, length, spread * _MORE + 1e-12 * length)


@inlined
def _difference(parts, k, step):
    m = k + step
    return (
        parts[m] - parts[k], parts[m + 1] - parts[k + 1],
        parts[m + 2] - parts[k + 2], parts[m + 3] - parts[k + 3],
    )  # fmt: skip


@kernel
def _differences(parts, at, c, count_i, count_j, in_u, in_v, one, other, third, factor):
    """Return the box around a derivative of M, and the range of the same derivative of the weight.

    The derivative's control points are differences of points `one` numbers apart. If `other` is not
    0, they are differences of such differences `other` numbers apart, and likewise for `third`.
    Returns middle and half diagonal, middle and half length, and the largest length of the
    derivative.
    """
    x_low = y_low = z_low = w_low = np.inf
    x_high = y_high = z_high = w_high = -np.inf
    square = 0.0
    for i in range(count_i):
        for j in range(count_j):
            k = at + i * in_u + j * in_v
            x, y, z, w = _difference(parts, k, one)
            if other != 0:
                a, b, d, e = _difference(parts, k + other, one)
                x, y, z, w = a - x, b - y, d - z, e - w
            if third != 0:
                a, b, d, e = _difference(parts, k + third, one)
                f, g, h, m = _difference(parts, k + third + other, one)
                x, y, z, w = (f - a) - x, (g - b) - y, (h - d) - z, (m - e) - w
            x, y, z = x - c[0] * w, y - c[1] * w, z - c[2] * w
            x_low, x_high = min(x_low, x), max(x_high, x)
            y_low, y_high = min(y_low, y), max(y_high, y)
            z_low, z_high = min(z_low, z), max(z_high, z)
            w_low, w_high = min(w_low, w), max(w_high, w)
            square = max(square, x * x + y * y + z * z)
    if x_high < x_low:
        return (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0
    half = 0.5 * factor
    middle = half * (x_low + x_high), half * (y_low + y_high), half * (z_low + z_high)
    spread = half * norm((x_high - x_low, y_high - y_low, z_high - z_low))
    longest = factor * np.sqrt(square)
    return middle, spread, half * (w_low + w_high), half * (w_high - w_low), longest


@inlined
def _over(middle, spread, inverse, ratio, error):
    """Divide a ball by weights that differ by at most a share `ratio` from 1 / `inverse`."""
    middle = scaled(middle, inverse)
    return _ball(middle, inverse * (1.0 + ratio) * spread + ratio * norm(middle) + error)


@inlined
def _most(ball):
    return ball.length + ball.spread


@inlined
def _product(one, other):
    """Return the middle of the products of two balls' vectors, and how far they may be from it."""
    return (
        dot(one.middle, other.middle),
        one.length * other.spread + one.spread * (other.length + other.spread),
    )


@kernel
def limits_of_part(piece, parts, at, margin):
    """Return the Limits of a part: net at `at`, error of control points `margin`, metres."""
    p, q = np.int64(piece.degree_u), np.int64(piece.degree_v)
    s, t = float(p), float(q)
    n, in_u, in_v = q + 1, EACH * (q + 1), EACH
    c = scaled(add(corner_of(piece, parts, at, 0), corner_of(piece, parts, at, 3)), 0.5)
    low, high, square = np.inf, 0.0, 0.0
    for i in range(np.int64(piece.points)):
        k = at + EACH * i
        w = parts[k + 3]
        x, y, z = parts[k] / w - c[0], parts[k + 1] / w - c[1], parts[k + 2] / w - c[2]
        low, high, square = min(low, w), max(high, w), max(square, x * x + y * y + z * z)
    if not high < _MOST_WEIGHTS * low:
        x = np.inf
        return Limits(x, x, x, x, x, x, x, x, x, x, x, x, x)
    reach = np.sqrt(square) * _MORE + margin
    inverse, ratio = 0.5 * (1.0 / low + 1.0 / high), (high - low) / (high + low)
    worst = inverse * (1.0 + ratio)
    error = 8.0 * margin  # third derivatives are differences of eight points
    if piece.rational:
        error *= _RATIONAL * (high / low) ** 3.0
    m, r, wu, wu_half, _ = _differences(parts, at, c, p, n, in_u, in_v, in_u, 0, 0, s)
    most_wu = abs(wu) + wu_half
    u = _over(m, r + reach * most_wu, inverse, ratio, error * s)
    m, r, wv, wv_half, _ = _differences(parts, at, c, p + 1, q, in_u, in_v, in_v, 0, 0, t)
    most_wv = abs(wv) + wv_half
    v = _over(m, r + reach * most_wv, inverse, ratio, error * t)
    m, r, w, half, _ = _differences(
        parts, at, c, p - 1, n, in_u, in_v, in_u, in_u, 0, s * (s - 1.0)
    )
    w_uu = abs(w) + half
    r += 2.0 * (u.length * wu_half + u.spread * most_wu) + reach * w_uu
    uu = _over(along(m, u.middle, -2.0 * wu), r, inverse, ratio, error * s * s)
    m, r, w, half, _ = _differences(parts, at, c, p, q, in_u, in_v, in_u, in_v, 0, s * t)
    w_uv = abs(w) + half
    r += u.length * wv_half + u.spread * most_wv + v.length * wu_half + v.spread * most_wu
    m = along(along(m, u.middle, -wv), v.middle, -wu)
    uv = _over(m, r + reach * w_uv, inverse, ratio, error * s * t)
    m, r, w, half, _ = _differences(
        parts, at, c, p + 1, q - 1, in_u, in_v, in_v, in_v, 0, t * (t - 1.0)
    )
    w_vv = abs(w) + half
    r += 2.0 * (v.length * wv_half + v.spread * most_wv) + reach * w_vv
    vv = _over(along(m, v.middle, -2.0 * wv), r, inverse, ratio, error * t * t)
    size_u, size_v = _most(u), _most(v)
    size_uu, size_uv, size_vv = _most(uu), _most(uv), _most(vv)
    _, _, w, half, most = _differences(
        parts, at, c, p - 2, n, in_u, in_v, in_u, in_u, in_u, s * (s - 1.0) * (s - 2.0)
    )
    uuu = most + 3.0 * (size_uu * most_wu + size_u * w_uu) + reach * (abs(w) + half)
    _, _, w, half, most = _differences(
        parts, at, c, p - 1, q, in_u, in_v, in_u, in_u, in_v, s * (s - 1.0) * t
    )
    uuv = most + 2.0 * (size_uv * most_wu + size_u * w_uv) + size_uu * most_wv
    uuv += size_v * w_uu + reach * (abs(w) + half)
    _, _, w, half, most = _differences(
        parts, at, c, p, q - 1, in_u, in_v, in_v, in_v, in_u, s * t * (t - 1.0)
    )
    uvv = most + 2.0 * (size_uv * most_wv + size_v * w_uv) + size_vv * most_wu
    uvv += size_u * w_vv + reach * (abs(w) + half)
    _, _, w, half, most = _differences(
        parts, at, c, p + 1, q - 2, in_u, in_v, in_v, in_v, in_v, t * (t - 1.0) * (t - 2.0)
    )
    vvv = most + 3.0 * (size_vv * most_wv + size_v * w_vv) + reach * (abs(w) + half)
    of_uuu, more = _product(u, uu)
    of_uuu = 3.0 * (abs(of_uuu) + more)
    one, more = _product(u, uv)
    other, still = _product(v, uu)
    of_uuv = abs(2.0 * one + other) + 2.0 * more + still
    one, more = _product(v, uv)
    other, still = _product(u, vv)
    of_uvv = abs(2.0 * one + other) + 2.0 * more + still
    of_vvv, more = _product(v, vv)
    of_vvv = 3.0 * (abs(of_vvv) + more)
    return Limits(
        size_u, size_v, size_uu, size_uv, size_vv,
        _MORE * (worst * uuu + error * s * s * s), _MORE * (worst * uuv + error * s * s * t),
        _MORE * (worst * uvv + error * s * t * t), _MORE * (worst * vvv + error * t * t * t),
        _MORE * of_uuu, _MORE * of_uuv, _MORE * of_uvv, _MORE * of_vvv,
    )  # fmt: skip


@kernel
def limits_of(piece):
    """Return the Limits of a whole piece."""
    f = piece.limits
    return Limits(f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8], f[9], f[10], f[11], f[12])


@kernel
def limits_in(of, wide_u, wide_v):
    """Convert the Limits of a part of width `wide_u`, `wide_v` to its piece's own parameters."""
    u, v = 1.0 / wide_u, (1.0 / wide_v if wide_v > 0.0 else 0.0)
    uu, uv, vv = u * u, u * v, v * v
    return Limits(
        of.u * u, of.v * v, of.uu * uu, of.uv * uv, of.vv * vv,
        of.uuu * uu * u, of.uuv * uu * v, of.uvv * u * vv, of.vvv * vv * v,
        of.of_uuu * uu * u, of.of_uuv * uu * v, of.of_uvv * u * vv, of.of_vvv * vv * v,
    )  # fmt: skip


@entry
def fit_limits(pieces, nets, scale):
    """Write to pieces (m,) what searches from points need to know; edges are skipped.

    Args:
        pieces: (m,) PIECE; `centre`, `along_u`, `along_v`, `limits` and `slope` are written.
        nets: control nets of the pieces.
        scale: scale of their SurfaceTree.
    """
    parts = on_stack(NUMBERS, 0.0)
    for i in range(len(pieces)):
        piece = pieces[i]
        if piece.edge != NONE:
            continue
        take_whole(piece, nets, (0.0, 0.0, 0.0), parts)
        of = limits_of_part(piece, parts, 0, margin_about(scale, piece, scale[2], 0))
        limits = piece.limits
        limits[0], limits[1], limits[2], limits[3], limits[4] = of.u, of.v, of.uu, of.uv, of.vv
        limits[5], limits[6], limits[7], limits[8] = of.uuu, of.uuv, of.uvv, of.vvv
        limits[9], limits[10], limits[11], limits[12] = of.of_uuu, of.of_uuv, of.of_uvv, of.of_vvv
        piece.slope = slope_error(piece, nets)
        a, b = corner_of(piece, parts, 0, 0), corner_of(piece, parts, 0, 1)
        c, d = corner_of(piece, parts, 0, 2), corner_of(piece, parts, 0, 3)
        for k in range(3):
            piece.centre[k] = 0.25 * ((a[k] + b[k]) + (c[k] + d[k]))
            piece.along_u[k] = 0.25 * ((c[k] - a[k]) + (d[k] - b[k]))
            piece.along_v[k] = 0.25 * ((b[k] - a[k]) + (d[k] - c[k]))
