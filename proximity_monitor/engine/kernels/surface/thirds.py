"""How long the third derivatives of a part are at most, from the differences of control points.

Parameters run from 0 to 1 over the part. With them, Taylor's formula at any of its points bounds
all lower derivatives over the whole part (see minimum.py). They belong to no direction: those of a
whole piece are found out once, and serve all queries.

A rational part is seen from a point c in its middle. With the numerator N, the weight w, M = N - c w
and the surface S, w (S - c) = M, so by differentiation

    w S_u = M_u - (S - c) w_u
    w S_uv = M_uv - S_u w_v - S_v w_u - (S - c) w_uv
    w S_uuv = M_uuv - 2 S_uv w_u - S_uu w_v - 2 S_u w_uv - S_v w_uu - (S - c) w_uuv

and the like.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import entry, inlined, kernel
from ..base.memory import on_stack
from ..base.state import NONE
from ..base.vectors import norm
from .parts import EACH, NUMBERS, corner_of, margin_about, take_whole
from .ranges import slope_error

Thirds = namedtuple("Thirds", "uuu uuv uvv vvv")
"""Metres; no derivative is longer."""

_MORE = 1.0 + 1e-9
"""By what they are increased, for all that rounding does to the sums."""

_ERRORS, _RATIONAL = 8.0, 512.0
"""How many times what control points err by a third derivative may err by, times the degrees: it is
a difference of eight. Of a rational one a product with derivatives of the weight adds as much as
the largest weight is of the least, three times, for six products and their own errors."""


@kernel
def _longest(parts, at, c, count_i, count_j, in_u, in_v, one, other, third, factor):
    """The largest length of a derivative of M, and the largest of that of the weight.

    Its control points are differences of points `one` numbers apart, or of such differences that
    are `other`, and then `third` numbers apart, where these are not 0.
    """
    square = of_weight = 0.0
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
            square, of_weight = max(square, x * x + y * y + z * z), max(of_weight, abs(w))
    return factor * np.sqrt(square), factor * of_weight


@inlined
def _difference(parts, k, step):
    m = k + step
    return (
        parts[m] - parts[k], parts[m + 1] - parts[k + 1],
        parts[m + 2] - parts[k + 2], parts[m + 3] - parts[k + 3],
    )  # fmt: skip


@kernel
def thirds_of_part(piece, parts, at, margin):
    """Of a part whose net is at `at`, and whose control points err by `margin`, metres."""
    p, q = np.int64(piece.degree_u), np.int64(piece.degree_v)
    s, t = float(p), float(q)
    n, in_u, in_v = q + 1, EACH * (q + 1), EACH
    c = (0.0, 0.0, 0.0)
    if piece.rational:
        c = corner_of(piece, parts, at, 0)
    uuu, w_uuu = _longest(
        parts, at, c, p - 2, n, in_u, in_v, in_u, in_u, in_u, s * (s - 1.0) * (s - 2.0)
    )
    uuv, w_uuv = _longest(parts, at, c, p - 1, q, in_u, in_v, in_u, in_u, in_v, s * (s - 1.0) * t)
    uvv, w_uvv = _longest(parts, at, c, p, q - 1, in_u, in_v, in_v, in_v, in_u, s * t * (t - 1.0))
    vvv, w_vvv = _longest(
        parts, at, c, p + 1, q - 2, in_u, in_v, in_v, in_v, in_v, t * (t - 1.0) * (t - 2.0)
    )
    error = _ERRORS * margin
    if piece.rational:
        low, high, reach = np.inf, 0.0, 0.0
        for i in range(np.int64(piece.points)):
            k = at + EACH * i
            w = parts[k + 3]
            away = parts[k] / w - c[0], parts[k + 1] / w - c[1], parts[k + 2] / w - c[2]
            low, high, reach = min(low, w), max(high, w), max(reach, norm(away))
        reach += margin
        inverse = 1.0 / low
        # What control points err by is charged to each derivative, with the weights' ratio.
        error *= _RATIONAL * (high * inverse) ** 3.0
        u, wu = _longest(parts, at, c, p, n, in_u, in_v, in_u, 0, 0, s)
        v, wv = _longest(parts, at, c, p + 1, q, in_u, in_v, in_v, 0, 0, t)
        uu, w_uu = _longest(parts, at, c, p - 1, n, in_u, in_v, in_u, in_u, 0, s * (s - 1.0))
        uv, w_uv = _longest(parts, at, c, p, q, in_u, in_v, in_u, in_v, 0, s * t)
        vv, w_vv = _longest(parts, at, c, p + 1, q - 1, in_u, in_v, in_v, in_v, 0, t * (t - 1.0))
        u, v = (u + reach * wu) * inverse + error * s, (v + reach * wv) * inverse + error * t
        uu = (uu + 2.0 * u * wu + reach * w_uu) * inverse + error * s * s
        uv = (uv + u * wv + v * wu + reach * w_uv) * inverse + error * s * t
        vv = (vv + 2.0 * v * wv + reach * w_vv) * inverse + error * t * t
        uuu += 3.0 * (uu * wu + u * w_uu) + reach * w_uuu
        uuv += 2.0 * (uv * wu + u * w_uv) + uu * wv + v * w_uu + reach * w_uuv
        uvv += 2.0 * (uv * wv + v * w_uv) + vv * wu + u * w_vv + reach * w_uvv
        vvv += 3.0 * (vv * wv + v * w_vv) + reach * w_vvv
        uuu, uuv, uvv, vvv = uuu * inverse, uuv * inverse, uvv * inverse, vvv * inverse
    return Thirds(
        _MORE * (uuu + error * s * s * s), _MORE * (uuv + error * s * s * t),
        _MORE * (uvv + error * s * t * t), _MORE * (vvv + error * t * t * t),
    )  # fmt: skip


@kernel
def thirds_of(piece):
    """Of a whole piece."""
    return Thirds(piece.thirds[0], piece.thirds[1], piece.thirds[2], piece.thirds[3])


@kernel
def thirds_in(thirds, wide_u, wide_v):
    """Of a part by a piece's own parameters, where the part is so wide."""
    u, v = 1.0 / wide_u, (1.0 / wide_v if wide_v > 0.0 else 0.0)
    return Thirds(
        thirds.uuu * u * u * u, thirds.uuv * u * u * v, thirds.uvv * u * v * v,
        thirds.vvv * v * v * v,
    )  # fmt: skip


@entry
def fit_thirds(pieces, nets, scale):
    """Write what is known of pieces (m,) for searches from points; of edges nothing.

    Args:
        pieces: (m,) PIECE; `centre`, `along_u`, `along_v`, `thirds` and `slope` are written.
        nets: their control nets.
        scale: of their SurfaceTree.
    """
    parts = on_stack(NUMBERS, 0.0)
    for i in range(len(pieces)):
        piece = pieces[i]
        if piece.edge != NONE:
            continue
        take_whole(piece, nets, (0.0, 0.0, 0.0), parts)
        found = thirds_of_part(piece, parts, 0, margin_about(scale, piece, scale[2], 0))
        thirds = piece.thirds
        thirds[0], thirds[1], thirds[2], thirds[3] = found.uuu, found.uuv, found.uvv, found.vvv
        piece.slope = slope_error(piece, nets)
        a, b = corner_of(piece, parts, 0, 0), corner_of(piece, parts, 0, 1)
        c, d = corner_of(piece, parts, 0, 2), corner_of(piece, parts, 0, 3)
        for k in range(3):
            piece.centre[k] = 0.25 * ((a[k] + b[k]) + (c[k] + d[k]))
            piece.along_u[k] = 0.25 * ((c[k] - a[k]) + (d[k] - b[k]))
            piece.along_v[k] = 0.25 * ((b[k] - a[k]) + (d[k] - c[k]))
