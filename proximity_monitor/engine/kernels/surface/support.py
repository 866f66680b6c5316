"""How far a piece reaches along a direction that is about normal to it at one of its points.

Control points reach farther, by as much as the piece bends. Let f = -n S for a unit vector n and
the points S of the piece. Taylor's formula of minimum.py holds for f as it does for F there, with

    f_u = -n S_u,   f_uu = -n S_uu,   f_uv = -n S_uv,   |f_uuu| <= |S_uuu|,   |f_uuv| <= |S_uuv|

and the like. Where a piece bends away from the plane at that point, f is nowhere less than there.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel
from ..base.rounding import DOUBLE_EPS
from ..base.state import NONE
from ..base.vectors import dot
from ..elements.errors import points_err
from .evaluate import jet_at
from .limits import limits_of
from .minimum import Rectangle, least_around


@kernel
def support_of(tree, element, u, v, n):
    """An upper bound of the products of n with the points of a piece; u, v is one of these.

    Errors of derivatives are those of `bound_at`, but that n is known to the last digit; a product
    with it errs by 3 u of its factors. Infinity of an edge.
    """
    piece, slack = tree.pieces[element], points_err(tree)
    if piece.edge != NONE:
        return np.inf
    place, du, dv, duu, duv, dvv = jet_at(piece, tree.nets, u, v)
    limits = limits_of(piece)
    at = Rectangle(0.0, 1.0, 0.0, 1.0 if piece.degree_v > 0 else 0.0)
    k, m = max(u, 1.0 - u), max(v, at.high_v - v)
    once_u, once_v = piece.slope * piece.degree_u, piece.slope * piece.degree_v
    error_u, error_v = 2.0 * once_u * slack, 2.0 * once_v * slack
    share = 4.0 * DOUBLE_EPS
    a = -dot(n, duu) - (once_u * error_u + share * limits.uu)
    b = -dot(n, dvv) - (once_v * error_v + share * limits.vv)
    h = abs(dot(n, duv)) + (once_u * error_v + share * limits.uv)
    a -= limits.uuu * k * (1.0 / 3.0) + limits.uuv * m
    b -= limits.uvv * k + limits.vvv * m * (1.0 / 3.0)
    error_u, error_v = error_u + share * limits.u, error_v + share * limits.v
    less = least_around(-dot(n, du), error_u, a, -dot(n, dv), error_v, b, h, at, u, v)
    return dot(n, place) + slack - less
