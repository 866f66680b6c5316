"""The winding number of a surface that need not be closed, with a certified error.

The generalised winding number w (Jacobson et al. 2013, section 4) is the sum of the solid angles of
the triangles as seen from the point, over 4 pi. A far cluster of triangles counts as one dipole
with its area vector N (Barill et al. 2018, "Fast winding numbers for soups and clouds", section 3).
Let q be the point, c the cluster's centre, r the radius of a ball around c that holds the cluster,
and A its area:

    4 pi w = integral of (x - q) · n / |x - q|³ = N · (c - q) / |c - q|³ + e,
    |e| <= 2 A r / (|c - q| - r)³,

because the derivative of (x - q) / |x - q|³ has a norm of at most 2 / |x - q|³.

The rim is the set of open edges of the surface. It alone determines how w changes from point to
point: the gradient of a solid angle is the integral of (x - q) × dx / |x - q|³ around the triangle
(law of Biot and Savart), and edges between two faces cancel. Let L be the length of the rim. Along
a path of length s that does not cross the surface and stays at least d away from the rim, w changes
by at most s L / (4 pi d²). Far from a hole, w is nearly an integer and stays so.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.jit import allocating_entry, implements, inlined, kernel, shared
from ..base.memory import on_stack
from ..base.precise import volume
from ..base.rounding import DOUBLE_EPS
from ..base.trees import MeshTree
from ..base.vectors import cross, dot, norm, sub
from ..elements.primitives import corners
from ..tree.layout import EMPTY, WIDTH, first_of, last_of
from .nearest import Point, answer_at, begin_nearest
from .solids import HALF
from .visit import ROOM, TO_THE_END, descend
from .winding import UNKNOWN, ray_steps, winding_number

AREA, RADIUS, LOST, MOMENTS = 6, 7, 8, 9
"""Columns of the moments of a lane's triangles, in metres and square metres. First centre and area
vector, three numbers each; then the area, the radius of a ball around the centre that holds the
triangles, and the error of the area vector."""

_SHARES = (0.2, 0.02, 0.0)
"""Error allowed to all dipoles together, in windings. The values are tried in turn until the side
of a point is certain. The last, 0, allows no dipole."""

_NODE_STEPS = 4
"""Cost of a node's moments, in steps; one triangle's solid angle costs one step."""

_FOUR_PI = 4.0 * math.pi

_ROUNDING = 80.0 * DOUBLE_EPS
"""Error of a triangle's solid angle before the arc tangent, as a share of the lengths' product P.

P is the product of the three lengths. The differences err by u. Each of the six products of the
determinant errs by 9 u P more at most, together below 18 u P. Each of the four terms of the
denominator errs by 12 u P, and their sum by 12 u P: below 64 u P. Together less than 80 u P.
"""

_LEAST_PRODUCT = 1e-250
"""Below this, cubic metres, the lengths' product nears the subnormals and would lose digits."""

_PRECISE = 128.0 * DOUBLE_EPS * DOUBLE_EPS
"""Error of the determinant alone in twice the precision, as a share of P. It errs by 32 u² of its
six products (see `precise.orientation`), whose magnitudes sum to at most 3 P."""

_LEAST_PAIR = 1e-200
"""Least product, square metres, of any two of the lengths for which _PRECISE holds. Above it, the
loss through underflow is far less than that error."""


@kernel
def _solid_angle(p, triangle):
    """Return half the solid angle of a triangle seen from p, and its error.

    Van Oosterom and Strackee 1983, "The solid angle of a plane triangle", equation 8.
    """
    a, b, c = sub(triangle[0], p), sub(triangle[1], p), sub(triangle[2], p)
    la, lb, lc = norm(a), norm(b), norm(c)
    product = la * lb * lc
    above = dot(a, cross(b, c))
    below = product + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb
    size, error = np.sqrt(above * above + below * below), _ROUNDING * product
    if not (product > _LEAST_PRODUCT and size > 4.0 * error):
        return 0.0, math.pi
    if below < 0.0 and abs(above) <= error:
        # p is close to the triangle: a wrong sign would give -pi instead of pi.
        above = volume(*triangle, p)
        least = product / max(la, max(lb, lc))
        if not (abs(above) > _PRECISE * product and least > _LEAST_PAIR):
            return 0.0, math.pi
    # Up to a right angle, an angle is at most pi / 2 times its sine.
    return np.arctan2(above, below), 1.6 * error / (size - error) + 16.0 * DOUBLE_EPS


@kernel
def _winding(tree, moments, p, share, stack):
    """Return the winding number of a surface around p, its error, and the steps used.

    Dipoles contribute at most `share`, in windings, to the error.
    """
    total, lost, steps = 0.0, 0.0, 0
    whole = 0.0
    for lane in range(WIDTH):
        whole += moments[lane, AREA]
    stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        node = stack[top]
        steps += _NODE_STEPS
        for lane in range(node * WIDTH, (node + 1) * WIDTH):
            child = tree.children[lane]
            if child == EMPTY:
                continue
            m = moments[lane]
            away = (m[0] - p[0], m[1] - p[1], m[2] - p[2])
            far = norm(away)
            gap = far * (1.0 - 1e-14) - m[RADIUS]
            if gap > 0.0:
                cubed = far * far * far
                error = 2.0 * m[AREA] * m[RADIUS] / (gap * gap * gap) + (
                    m[LOST] + 32.0 * DOUBLE_EPS * m[AREA]
                ) / (far * far)
                if error <= _FOUR_PI * share * m[AREA] / whole:
                    term = dot(away, (m[3], m[4], m[5])) / cubed
                    total += term
                    lost += error + 4.0 * DOUBLE_EPS * (abs(term) + abs(total))
                    continue
            if child >= 0:
                stack[top] = child
                top += 1
                continue
            steps += last_of(child) - first_of(child) + 1
            for t in range(first_of(child), last_of(child) + 1):
                angle, error = _solid_angle(p, corners(tree.triangles, t))
                total += 2.0 * angle
                lost += 2.0 * error + 4.0 * DOUBLE_EPS * (abs(angle) + abs(total))
    return total / _FOUR_PI, lost / _FOUR_PI * (1.0 + 1e-6), steps


@kernel
def _from_rim(region, p):
    """Return a lower bound of p's distance to the rim, reduced by 1 %, and the steps used."""
    stack, bounds = on_stack(ROOM, np.int32(0)), on_stack(ROOM, 0.0)
    found = on_stack(WIDTH, np.float32(0.0))
    away, near, top = begin_nearest(region.rim_tree, p, 0, stack, bounds)
    query = Point(p, 0.0, 1e-3, 0.0, 0.0)
    answer, _, left = descend(
        query, region.rim_tree, answer_at(query, away, near), top, stack, bounds, found, TO_THE_END
    )
    return answer[0] * (1.0 - 1e-2), TO_THE_END - left


def is_outside(tree, region, p, radius, q, slack, stack):
    """Stub of `surely_outside`, because only meshes have holes."""


def half_side(tree, region, p, least, slack, stack):
    """Do the same as `side_of` if the inside is HALF. A stub."""


@implements(is_outside, MeshTree)
@shared
def surely_outside(tree, region, p, radius, q, slack, stack):
    """Return whether q and all points reached from q are certainly outside; and the steps used.

    The solid has holes. A point is reached if a path from q to it stays in the ball of `radius`
    around p, does not cross the surface and is at most four radii long.
    """
    rim, steps = _from_rim(region, p)
    rim -= radius + 2.0 * slack
    if not rim > 0.0:
        return False, steps
    change = 4.0 * radius * region.rim / (_FOUR_PI * rim * rim)
    for share in _SHARES:
        winding, error, more = _winding(tree, region.moments, q, share, stack)
        steps += more
        if abs(winding) + error + change < 0.5:
            return True, steps
        if abs(winding) - error + change >= 0.5:
            break
    return False, steps


@inlined
def _beyond(region, p):
    """Return how far p is outside a solid's ball or box; if p is in both, minus how far inside."""
    ball, box = region.ball, region.box
    beyond = norm((p[0] - ball[0], p[1] - ball[1], p[2] - ball[2])) - ball[3]
    square = 0.0
    for i in range(3):
        over = max(box[0, i] - p[i], p[i] - box[1, i])
        beyond = max(beyond, over)
        square += max(over, 0.0) ** 2
    return max(beyond, np.sqrt(square)) if square > 0.0 else beyond


@implements(half_side, MeshTree)
@kernel
def _half(tree, region, p, least, slack, stack):
    """Do the same as `side_of`."""
    beyond = _beyond(region, p)
    outer = beyond - slack  # if positive, no point within this distance of p is inside
    if outer > least:
        return -1, outer, 1
    rim, steps = _from_rim(region, p)
    rim = max(rim - slack, least)
    for share in _SHARES:
        winding, error, more = _winding(tree, region.moments, p, share, stack)
        steps += more
        sure = abs(abs(winding) - 0.5) - error
        if sure <= 0.0:
            continue
        # Along a path of length s, w changes by at most s L / (4 pi rim (rim - s)), the integral of
        # L / (4 pi (rim - t)²). `clear` is the s for which this equals `sure`.
        clear = rim * (rim / (rim + region.rim / (_FOUR_PI * sure))) * (1.0 - 1e-9)
        clear = min(clear, least)
        side = 1 if abs(winding) > 0.5 else -1
        clear = min(clear, -beyond - slack) if side > 0 else max(clear, outer)
        if clear > 2.0 * slack:
            return side, clear, steps
    return (-1, outer, steps) if outer > 2.0 * slack else (0, 0.0, steps)


@kernel
def side_of(tree, region, p, least, slack, stack, gaps):
    """Find on which side of a surface p lies, and how far around p all points lie on that side.

    Args:
        tree: the surface's hierarchy.
        region: its Region.
        p: in the surface's frame, metres.
        least: metres, above `slack`: a lower bound of p's distance to the surface.
        slack: metres; the side holds for every point within `slack` of p.
        stack: scratch for a descent.
        gaps: scratch for a node's lanes.

    Returns:
        1 inside, -1 outside, or 0 if uncertain; the distance around p with the same side, metres (0
        if uncertain); and the steps used.
    """
    if region.inside == HALF:
        return half_side(tree, region, p, least, slack, stack)
    winding = winding_number(tree, p, slack, stack, gaps)
    if winding == UNKNOWN:
        return 0, 0.0, ray_steps(tree)
    return (-1 if winding == 0 else 1), least, ray_steps(tree)


@allocating_entry
def moments_of(triangles, children, ranges):
    """Return the moments of the triangles under every lane, (k, MOMENTS).

    Args:
        triangles: (m, 9) metres, tree order.
        children: (k,) as in MeshTree.
        ranges: (nodes, 2) the triangles under each node: first, and one after the last.
    """
    moments = np.zeros((len(children), MOMENTS))
    for lane in range(len(children)):
        child = children[lane]
        if child == EMPTY:
            continue
        if child >= 0:
            first, last = ranges[child, 0], ranges[child, 1]
        else:
            first, last = first_of(child), last_of(child) + 1
        m = moments[lane]
        for t in range(first, last):
            for i in range(9):
                m[i % 3] += triangles[t, i]
        for i in range(3):
            m[i] /= 3.0 * (last - first)
        centre, farthest, sizes = (m[0], m[1], m[2]), 0.0, 0.0
        for t in range(first, last):
            a, b, c = corners(triangles, t)
            e, f = sub(b, a), sub(c, a)
            n = cross(e, f)
            for i in range(3):
                m[3 + i] += 0.5 * n[i]
            m[AREA] += 0.5 * norm(n)
            sizes += np.sqrt(dot(e, e) * dot(f, f))
            for corner in (a, b, c):
                d = sub(corner, centre)
                farthest = max(farthest, dot(d, d))
        count = last - first
        m[RADIUS] = np.sqrt(farthest) * (1.0 + 1e-9)
        m[LOST] = (count + 16.0) * DOUBLE_EPS * sizes
        m[AREA] = m[AREA] * (1.0 + 1e-9) + m[LOST]
    return moments
