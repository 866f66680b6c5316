"""How far a surface reaches along a direction, from a point that may be where it reaches farthest.

Bounding volumes dismiss whatever reaches less far. For that point p and the direction n,
n . (S - p) of a piece is the quotient of a Bezier function N and the weight. The coefficients of N
are n . (P_i - p) w_i. If all are negative, so is N. Otherwise, from a point of the piece that
reaches about farthest, N grows by no more than

    N_u x + N_v y - (a x² + b y²) / 2 + h |x y|

for steps x and y. The coefficients of its second derivatives give a, b and h: no -N_uu is below a,
no -N_vv below b, and no |N_uv| above h. If p is a maximum of the whole surface, such as the nearest
point to a model beyond its convex hull, the answer is right to rounding. If a piece reaches
farther, the search ends.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import implements, inlined, kernel, shared
from ..base.memory import on_stack
from ..base.rounding import DOUBLE_EPS
from ..base.trees import NONE
from ..base.vectors import dot
from ..bounds.volumes import lows_along
from ..elements.errors import points_err
from ..inside import visit
from ..inside.visit import ROOM, TO_THE_END, at_root, descend
from ..tree.layout import WIDTH
from .edges import point_on
from .facing import closest_in, vector
from .minimum import Rectangle, least_around

Farther = namedtuple("Farther", "place slack normal element u v most")
"""The query; `place` is the element's point at u and v. The answer, metres, is minus a bound of how
far the surface reaches beyond `place` along the normal. Below minus `most`, the search ends."""

_ROUNDING, _EACH = 32.0 * DOUBLE_EPS, 16.0 * DOUBLE_EPS
"""Error of the product of a unit vector with a point, as a share of the largest norm P of a point;
and what each degree of a Bezier function of such products adds. With weights below 1, a coefficient
errs by 12 u P and is below 2 P, and a step of de Casteljau's method adds 3 u of that."""

_STEPS = 3
"""Newton steps towards the point of a piece that reaches farthest."""

_NUMBERS, _ROW = 256, 16
"""Room for the coefficients of a piece, and for one row of them."""


@implements(visit.lane_gaps, Farther)
@inlined
def _lane_gaps(query, nodes, base, x, y, z, margin, gaps):
    n = query.normal
    nx, ny, nz = np.float32(-n[0]), np.float32(-n[1]), np.float32(-n[2])
    lows_along(nodes, base, nx, ny, nz, gaps)
    place = x * nx + y * ny + z * nz + margin
    for k in range(WIDTH):
        gaps[k] -= place


@implements(visit.limit, Farther)
@inlined
def _limit(query, answer):
    return answer if answer >= -query.most else -np.inf


@implements(visit.meet, Farther)
@kernel
def _meet(query, tree, t, answer):
    piece = tree.pieces[t]
    if piece.edge != NONE:  # an edge lies on a piece of its patch
        return answer
    moves, u, v = t != query.element, query.u, query.v
    if moves:
        e, f = vector(piece.along_u), vector(piece.along_v)
        u, v = closest_in(vector(piece.centre), e, f, query.place)
        u, v = 0.5 + 0.5 * u, 0.5 + 0.5 * v
    return min(answer, -_beyond(tree, piece, query.place, query.normal, u, v, moves))


@kernel
def _beyond(tree, piece, p, n, u, v, moves):
    """Bound how far a piece reaches beyond p along n, except for the error of its points.

    It reaches about farthest at u, v; or near there, if it MOVES to look for the place.
    """
    nets, size = tree.nets, tree.scale[2]
    c, least, most, base, room = on_stack(_NUMBERS, 0.0), np.inf, -np.inf, piece.net, piece.room
    height = dot(n, p)
    for i in range(piece.points):
        at = base + i
        w = nets[at + 3 * room]
        own = n[0] * nets[at] + n[1] * nets[at + room] + n[2] * nets[at + 2 * room]
        c[i] = own - height * w
        least, most = min(least, w), max(most, c[i])
    return _largest(piece, c, u, v, moves, size) / least if most > 0.0 else 0.0


@kernel
def _largest(piece, c, u, v, moves, size):
    """Return the largest value of a Bezier function N of a piece's degrees, or more; see above.

    Second differences err by four times as much as coefficients. `size` is the largest norm.
    """
    d, e = np.int64(piece.degree_u), np.int64(piece.degree_v)
    error = _ROUNDING * size
    least_a, least_b, most_a, most_b, h = np.inf, np.inf, -np.inf, -np.inf, 0.0
    for i in range(d + 1):
        for j in range(e + 1):
            at = i * (e + 1) + j
            if i < d - 1:
                bend = 2.0 * c[at + e + 1] - c[at] - c[at + 2 * (e + 1)]
                least_a, most_a = min(least_a, bend), max(most_a, bend)
            if j < e - 1:
                bend = 2.0 * c[at + 1] - c[at] - c[at + 2]
                least_b, most_b = min(least_b, bend), max(most_b, bend)
            if i < d and j < e:
                h = max(h, abs(c[at] + c[at + e + 2] - c[at + 1] - c[at + e + 1]))
    twice_u, twice_v = float(d * (d - 1)), float(e * (e - 1))
    a = twice_u * (least_a - 4.0 * error) if d > 1 else 0.0
    b = twice_v * (least_b - 4.0 * error) if e > 1 else 0.0
    h = d * e * (h + 4.0 * error)
    if e == 0:
        v = 0.0
    for _ in range(_STEPS if moves else 0):
        _, slope_u, slope_v = _jet(c, d, e, u, v)
        u = _step(u, slope_u, 0.5 * (a + twice_u * most_a) if d > 1 else 0.0)
        if e > 0:
            v = _step(v, slope_v, 0.5 * (b + twice_v * most_b) if e > 1 else 0.0)
    value, slope_u, slope_v = _jet(c, d, e, u, v)
    error += (d + e) * _EACH * size
    at = Rectangle(0.0, 1.0, 0.0, 1.0 if e > 0 else 0.0)
    less = least_around(
        -slope_u, 4.0 * d * error, a, -slope_v, 4.0 * e * error, b, h, at, u, v
    )  # fmt: skip
    return value + 2.0 * error - less


@inlined
def _step(t, slope, bend):
    step = slope / bend if bend > 0.0 else np.copysign(1.0, slope)
    return min(max(t + step, 0.0), 1.0)


@kernel
def _jet(c, d, e, u, v):
    """Return value and both first derivatives of a Bezier function of degrees d and e at u, v."""
    rows, slopes, line = on_stack(_ROW, 0.0), on_stack(_ROW, 0.0), on_stack(_ROW, 0.0)
    for i in range(d + 1):
        for j in range(e + 1):
            line[j] = c[i * (e + 1) + j]
        slopes[i] = _along(line, e, v)
        rows[i] = line[0]
    slope_v = slopes[0]
    if d > 0:
        _along(slopes, d, u)
        slope_v = slopes[0]
    slope_u = _along(rows, d, u)
    return rows[0], slope_u, slope_v


@kernel
def _along(line, degree, t):
    """Run de Casteljau's method in place: leave the value in line[0], return the derivative."""
    slope, s = 0.0, 1.0 - t
    for level in range(degree, 0, -1):
        if level == 1:
            slope = degree * (line[1] - line[0])
        for j in range(level):
            line[j] = s * line[j] + t * line[j + 1]
    return slope


@shared
def reach_along(tree, n, element, u, v, most):
    """Return how far a surface reaches along a vector no longer than a unit, in its frame; metres.

    That is an upper bound of the products of its points with n. Returns infinity if some piece may
    reach more than `most` farther than the given point of an element.
    """
    place = point_on(tree, element, u, v)
    stack, bounds = on_stack(ROOM, np.int32(0)), on_stack(ROOM, 0.0)
    found = on_stack(WIDTH, np.float32(0.0))
    query = Farther(place, points_err(tree), n, element, u, v, most)
    answer, _, _ = descend(
        query, tree, 0.0, at_root(stack, bounds), stack, bounds, found, TO_THE_END
    )  # fmt: skip
    if not answer >= -most:
        return np.inf
    return dot(place, n) - answer + points_err(tree) + _ROUNDING * tree.scale[2]


@kernel
def support_of(tree, element, u, v, n):
    """Bound from above the products of n with the points of an element; u, v is one of them.

    Returns infinity for an edge.
    """
    piece, place = tree.pieces[element], point_on(tree, element, u, v)
    if piece.edge != NONE:
        return np.inf
    beyond = max(_beyond(tree, piece, place, n, u, v, False), 0.0)
    return dot(place, n) + beyond + points_err(tree) + _ROUNDING * tree.scale[2]
