"""Heights of a surface's elements over paraboloids (bowls), for queries of `inside/ball_bowls.py`.

Let w P be the homogeneous control points of a part, and s, a and b linear functions of P. The
height over a paraboloid is s - (k a² + l b²) / 2. The height times w² is a sum of products of
Bernstein polynomials, so it has Bernstein form itself, of twice the degrees (Farin 2002, section
6.10). Its coefficients, each divided by that of w², bound the height. If the surface bends like the
paraboloid, the bounds are tight without a division of the part.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel
from ..base.memory import on_stack
from ..base.rounding import DOUBLE_EPS
from ..base.trees import SurfaceTree
from ..base.vectors import cross, dot
from ..inside import feet, visit
from ..inside.ball_bowls import Bowl, height_over
from . import height
from .edges import place_on
from .evaluate import jet_at
from .parts import EACH, least_along

_MOST_POINTS = 64
"""Most control points. With more, the products take too long, and the part is divided instead."""

_COEFFICIENTS = 1024

_PRODUCTS = 1024.0 * DOUBLE_EPS
"""Bound of the rounding error of a height's coefficient, as a share of its terms.

All coefficients together sum at most 64 times 64 products, and each one at most 64 of them. The
factors err by less than 64 u. The divisor is such a sum as well, of positive terms.
"""

_EDGE_ON = 0.1
"""A surface has a height along a direction only if the sine of their angle exceeds this."""


@implements(height.highest, Bowl)
@inlined
def _highest(query, piece, parts, at, margin):
    n = query.normal
    high = -least_along(piece, parts, at, (-n[0], -n[1], -n[2]))
    return query.rise * (high + margin) + query.sink


@implements(height.height_at, Bowl)
@inlined
def _height_at(query, d):
    return height_over(query, d)


@implements(height.between, Bowl)
@kernel
def _between(query, piece, parts, at, margin, high, crossing):
    """Return the least coefficient, and the largest one plus the rounding error, at most `high`."""
    p, q = np.int64(piece.degree_u), np.int64(piece.degree_v)
    if (p + 1) * (q + 1) > _MOST_POINTS:
        return -np.inf, high
    s, w = on_stack(_MOST_POINTS, 0.0), on_stack(_MOST_POINTS, 0.0)
    a, b = on_stack(_MOST_POINTS, 0.0), on_stack(_MOST_POINTS, 0.0)
    above, below = on_stack(_COEFFICIENTS, 0.0), on_stack(_COEFFICIENTS, 0.0)
    n, rise, first, second = query.normal, query.rise, query.first, query.second
    # The control points include the binomials, which cancel in the final quotient.
    k, reach, of_u = 0, 0.0, 1.0
    for i in range(p + 1):
        of_v = of_u
        for j in range(q + 1):
            x, y, z = parts[at], parts[at + 1], parts[at + 2]
            s[k] = of_v * rise * (n[0] * x + n[1] * y + n[2] * z)
            a[k] = of_v * (first[0] * x + first[1] * y + first[2] * z)
            b[k] = of_v * (second[0] * x + second[1] * y + second[2] * z)
            w[k] = of_v * parts[at + 3]
            reach = max(reach, (abs(x) + abs(y) + abs(z)) / parts[at + 3])
            of_v = of_v * (q - j) / (j + 1.0)
            at += EACH
            k += 1
        of_u = of_u * (p - i) / (i + 1.0)
    wide = 2 * q + 1
    count = (2 * p + 1) * wide
    for k in range(count):
        above[k] = below[k] = 0.0
    half_1, half_2 = 0.5 * query.bend_1, 0.5 * query.bend_2
    for i in range(p + 1):
        for j in range(q + 1):
            k = i * (q + 1) + j
            s_k, w_k, a_k, b_k = s[k], w[k], half_1 * a[k], half_2 * b[k]
            for m in range(p + 1):
                to, one = (i + m) * wide + j, m * (q + 1)
                for _ in range(q + 1):
                    above[to] += s_k * w[one] - a_k * a[one] - b_k * b[one]
                    below[to] += w_k * w[one]
                    to += 1
                    one += 1
    least, found = np.inf, -np.inf
    for k in range(count):
        value = above[k] / below[k]
        least, found = min(least, value), max(found, value)
    steep = rise + max(abs(query.bend_1), abs(query.bend_2)) * (reach + margin)
    return least, min(high, found + steep * (2.0 * margin + _PRODUCTS * reach))


implements(visit.meet, Bowl, SurfaceTree)(height.height_in)


@implements(feet.bend_at, SurfaceTree)
@kernel
def _bend_at(tree, k, point, n, e, f):
    element, u, v = place_on(tree, point.near[k], point.spot[k, 0], point.spot[k, 1])
    place, du, dv, duu, duv, dvv = jet_at(tree.pieces[element], tree.nets, u, v)
    nothing = (0.0, 0.0), (0.0, 0.0, 0.0)
    normal = cross(du, dv)
    # Determinant of the map from (u, v) to coordinates along e and f, which are normal to n.
    e_u, e_v, f_u, f_v = dot(e, du), dot(e, dv), dot(f, du), dot(f, dv)
    det = e_u * f_v - e_v * f_u
    if not abs(det) > _EDGE_ON * np.sqrt(dot(normal, normal)):
        return False, place, nothing[0], nothing[1]
    u_e, u_f, v_e, v_f = f_v / det, -e_v / det, -f_u / det, e_u / det
    h_u, h_v = dot(n, du), dot(n, dv)
    g1, g2 = h_u * u_e + h_v * v_e, h_u * u_f + h_v * v_f
    uu = dot(n, duu) - g1 * dot(e, duu) - g2 * dot(f, duu)
    uv = dot(n, duv) - g1 * dot(e, duv) - g2 * dot(f, duv)
    vv = dot(n, dvv) - g1 * dot(e, dvv) - g2 * dot(f, dvv)
    k11 = uu * u_e * u_e + 2.0 * uv * u_e * v_e + vv * v_e * v_e
    k12 = uu * u_e * u_f + uv * (u_e * v_f + u_f * v_e) + vv * v_e * v_f
    k22 = uu * u_f * u_f + 2.0 * uv * u_f * v_f + vv * v_f * v_f
    return True, place, (g1, g2), (k11, k12, k22)
