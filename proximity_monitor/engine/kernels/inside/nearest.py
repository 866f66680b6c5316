"""The nearest point of one hierarchy to a single point."""

from __future__ import annotations

from collections import namedtuple

import numpy as np
from numba import uint64

from ..base.jit import implements, inlined, kernel, loop16
from ..base.lanes import lowest, not_above, smallest
from ..base.precise import accurate_cross
from ..base.vectors import along, clamped, dot, sub
from ..elements.primitives import corners
from ..elements.triangles import point_face
from ..tree.layout import (
    CENTRE_X,
    CENTRE_Y,
    CENTRE_Z,
    HALF_U,
    HALF_V,
    RADIUS,
    U_X,
    U_Y,
    U_Z,
    V_X,
    V_Y,
    V_Z,
    WIDTH,
    first_of,
)
from . import visit
from .tolerance import limit_of
from .visit import at_root, descend

Point = namedtuple("Point", "place slack share spare radius")
"""The query for the triangle nearest to a point. The answer is (distance, triangle, limit). Volumes
not below the limit are pruned: they can improve the distance by less than the tolerance only (see
tolerance.py)."""

Middle = namedtuple("Middle", "place slack")
"""The query for a volume whose middle is near a point; see `_middle_gaps`."""

_ALL = (1 << WIDTH) - 1
_TINY = np.float32(1e-30)
_ZERO, _HALF = np.float32(0.0), np.float32(0.5)


@loop16
def point_gaps(nodes, base, x, y, z, margin, gaps):
    """Write lower bounds of a point's distance to each lane of the node at `base`, node units.

    The nearest point of a rectangle is the projection with both parameters clamped. The margin
    covers float32 and axes that are not exactly perpendicular (see SINGLE_MARGIN).
    """
    for k in range(WIDTH):
        i = base + uint64(k)
        dx = x - nodes[i + CENTRE_X]
        dy = y - nodes[i + CENTRE_Y]
        dz = z - nodes[i + CENTRE_Z]
        ux, uy, uz = nodes[i + U_X], nodes[i + U_Y], nodes[i + U_Z]
        vx, vy, vz = nodes[i + V_X], nodes[i + V_Y], nodes[i + V_Z]
        a, b = nodes[i + HALF_U], nodes[i + HALF_V]
        s = min(max(dx * ux + dy * uy + dz * uz, -a), a)
        t = min(max(dx * vx + dy * vy + dz * vz, -b), b)
        dx = dx - s * ux - t * vx
        dy = dy - s * uy - t * vy
        dz = dz - s * uz - t * vz
        gaps[k] = np.sqrt(dx * dx + dy * dy + dz * dz) - nodes[i + RADIUS] - margin


@loop16
def _middle_gaps(nodes, base, x, y, z, gaps):
    """Write a point's distance to the inner half of each lane's rectangle, node units.

    A large volume reaches far beyond its triangles, most of all in its corners. So the place of its
    middle predicts better than its bound how near its triangles are. The radius of an unused lane
    is far below zero.
    """
    for k in range(WIDTH):
        i = base + uint64(k)
        dx = x - nodes[i + CENTRE_X]
        dy = y - nodes[i + CENTRE_Y]
        dz = z - nodes[i + CENTRE_Z]
        ux, uy, uz = nodes[i + U_X], nodes[i + U_Y], nodes[i + U_Z]
        vx, vy, vz = nodes[i + V_X], nodes[i + V_Y], nodes[i + V_Z]
        a, b = _HALF * nodes[i + HALF_U], _HALF * nodes[i + HALF_V]
        s = min(max(dx * ux + dy * uy + dz * uz, -a), a)
        t = min(max(dx * vx + dy * vy + dz * vz, -b), b)
        dx = dx - s * ux - t * vx
        dy = dy - s * uy - t * vy
        dz = dz - s * uz - t * vz
        gaps[k] = np.sqrt(dx * dx + dy * dy + dz * dz) - min(nodes[i + RADIUS], _ZERO)


@kernel
def _on_segment(p, a, e):
    """Find the nearest point a + s e of a segment or point; return (s, squared distance)."""
    r, ee = sub(p, a), dot(e, e)
    s = clamped(dot(r, e) / ee) if ee > 0.0 else 0.0
    g = along(r, e, -s)
    return s, dot(g, g)


@inlined
def point_outline(p, a, b, c):
    """Do the same as `point_triangle` for a triangle's edges alone."""
    v, best = _on_segment(p, a, sub(b, a))
    w = 0.0
    s, d = _on_segment(p, a, sub(c, a))
    if d < best:
        best, v, w = d, 0.0, s
    s, d = _on_segment(p, b, sub(c, b))
    if d < best:
        best, v, w = d, 1.0 - s, s
    return best, v, w


@kernel
def point_triangle(p, a, b, c):
    """Find the nearest point a + v (b - a) + w (c - a) of a triangle, segment or point.

    Returns (squared distance, v, w).
    """
    best, v, w = point_outline(p, a, b, c)
    e, f = sub(b, a), sub(c, a)
    n = accurate_cross(e, f)
    nn = dot(n, n)
    if nn > 0.0:
        inside, x, y, d = point_face(p, a, e, f, n, nn)
        if inside and d < best:
            best, v, w = d, x, y
    return best, v, w


@implements(visit.lane_gaps, Point)
@inlined
def _lane_gaps(query, nodes, base, x, y, z, margin, gaps):
    point_gaps(nodes, base, x, y, z, margin, gaps)


@implements(visit.lane_gaps, Middle)
@inlined
def _lane_middles(query, nodes, base, x, y, z, margin, gaps):
    _middle_gaps(nodes, base, x, y, z, gaps)


@inlined
def answer_at(query, distance, t):
    """Return the answer to a Point query: `distance` to triangle t, and the limit."""
    return distance, np.int64(t), limit_of(distance, query.share, query.spare, query.radius)


@implements(visit.limit, Point)
@inlined
def _limit(query, answer):
    return answer[2]


@implements(visit.meet, Point)
@inlined
def _meet(query, tree, t, answer):
    a, b, c = corners(tree.triangles, t)
    distance = np.sqrt(point_triangle(query.place, a, b, c)[0])
    return answer_at(query, distance, t) if distance < answer[0] else answer


@kernel
def begin_nearest(tree, p, nearby, stack, bounds):
    """Begin a search for a model's point nearest to p, with `nearby` as the first triangle.

    p is in the model's frame. Returns what `nearest` continues with: the distance so far, the
    triangle, and the stack's height.
    """
    a, b, c = corners(tree.triangles, nearby)
    return np.sqrt(point_triangle(p, a, b, c)[0]), nearby, at_root(stack, bounds)


@kernel
def nearest(tree, p, best, nearby, top, slack, spare, stack, bounds, found, steps):
    """Continue a search for at most `steps` steps; return (distance, triangle, height, steps left).

    Distances are in metres, triangles in tree order. If the stack is then empty (height 0), the
    distance is that to the triangle, correct up to `slack`. The true distance is smaller by at most
    the larger of `slack` and `spare`.
    """
    query = Point(p, slack, 0.0, max(slack, spare), 0.0)
    answer = answer_at(query, best, nearby)
    answer, top, steps = descend(query, tree, answer, top, stack, bounds, found, steps)
    return answer[0], answer[1], top, steps


@kernel
def walk(query, tree, found):
    """Descend to the nearest lane on each level; return the first element of the leaf reached.

    A Point query takes the lane with the least bound, a Middle query the one with nearest middle.
    """
    child = tree.children[0]
    while child >= 0:
        visit.visit(query, tree, child, np.inf, found)
        least = smallest(found, 0, _ALL)
        # If float32 does not serve, this takes the first lane, which is always used.
        k = lowest(not_above(found, 0, least + np.float32(1e-6) * (abs(least) + _TINY)))
        child = tree.children[child * WIDTH + k]
    return first_of(child)
