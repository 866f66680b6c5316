"""The nearest point of one hierarchy to a single point."""

from __future__ import annotations

import numpy as np
from numba import float32, uint64

from ..base.jit import kernel, loop16
from ..base.lanes import lowest, not_above
from ..base.precise import cross_precise
from ..base.rounding import ILL_CONDITIONED, SINGLE_LIMIT, SINGLE_MARGIN
from ..base.vectors import along, cross, dot, sub
from ..elements.primitives import corners
from ..elements.triangles import point_face
from ..tree.layout import (
    CENTRE_X,
    CENTRE_Y,
    CENTRE_Z,
    HALF_U,
    HALF_V,
    RADIUS,
    STRIDE,
    U_X,
    U_Y,
    U_Z,
    V_X,
    V_Y,
    V_Z,
    WIDTH,
    first_of,
    last_of,
)


@loop16
def point_bounds(nodes, base, x, y, z, margin, bounds):
    """Lower bounds of a point's distance to each lane of the node at `base`, node units.

    The distance to a rectangle is that to the projection with both parameters clamped; what is
    missing to perpendicular axes, and float32, is in the margin (see SINGLE_MARGIN).
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
        bounds[k] = np.sqrt(dx * dx + dy * dy + dz * dz) - nodes[i + RADIUS] - margin


@kernel
def _on_segment(p, a, e):
    """Nearest point a + s e of a segment, which may be a point: (s, squared distance)."""
    r, ee = sub(p, a), dot(e, e)
    s = min(max(dot(r, e) / ee, 0.0), 1.0) if ee > 0.0 else 0.0
    g = along(r, e, -s)
    return s, dot(g, g)


@kernel
def point_triangle(p, a, b, c):
    """Nearest point a + v (b - a) + w (c - a) of a triangle, which may be a segment or a point.

    Returns (squared distance, v, w).
    """
    e, f = sub(b, a), sub(c, a)
    v, best = _on_segment(p, a, e)
    w = 0.0
    s, d = _on_segment(p, a, f)
    if d < best:
        best, v, w = d, 0.0, s
    s, d = _on_segment(p, b, sub(c, b))
    if d < best:
        best, v, w = d, 1.0 - s, s
    n = cross(e, f)
    if dot(n, n) < ILL_CONDITIONED * (dot(e, e) * dot(f, f)):
        n = cross_precise(e, f)
    nn = dot(n, n)
    if nn > 0.0:
        inside, x, y, d = point_face(p, a, e, f, n, nn)
        if inside and d < best:
            best, v, w = d, x, y
    return best, v, w


@kernel
def begin_nearest(tree, p, nearby, stack, bounds):
    """Begin a search for the point of a model nearest to p, both in its frame, at a triangle.

    Returns what `nearest` goes on with: the distance so far, the triangle, the stack's height.
    """
    a, b, c = corners(tree.triangles, nearby)
    stack[0], bounds[0] = 0, -1.0
    return np.sqrt(point_triangle(p, a, b, c)[0]), nearby, 1


@kernel
def nearest(tree, p, best, nearby, top, slack, spare, stack, bounds, found, steps):
    """Go on with a search, at most `steps` steps: (distance, triangle, height, steps left).

    Metres, triangles in tree order. Where the stack is empty then, the distance is that to the
    triangle and the true one at most `spare` smaller, right to `slack`.
    """
    unit = tree.scale[0]
    while top > 0 and steps > 0:
        top -= 1
        if bounds[top] >= best - max(slack, spare):
            continue
        steps -= 1
        child = stack[top]
        if child < 0:
            for t in range(first_of(child), last_of(child) + 1):
                a, b, c = corners(tree.triangles, t)
                distance = np.sqrt(point_triangle(p, a, b, c)[0])
                if distance < best:
                    best, nearby = distance, t
            continue
        x = p[0] / unit - tree.centres[child, 0]
        y = p[1] / unit - tree.centres[child, 1]
        z = p[2] / unit - tree.centres[child, 2]
        size = abs(x) + abs(y) + abs(z) + tree.centres[child, 3]
        if size + slack / unit < SINGLE_LIMIT:
            margin = float32(SINGLE_MARGIN * size + slack / unit)
            point_bounds(
                tree.nodes, uint64(child * STRIDE), float32(x), float32(y), float32(z), margin,
                found,
            )  # fmt: skip
        else:
            # Too far away for float32, or too small: then every lane is as good as the next.
            for k in range(WIDTH):
                empty = tree.nodes[uint64(child * STRIDE + k) + RADIUS] < 0.0
                found[k] = float32(1e30) if empty else float32(-1.0)
        reach = np.float32(min(best / unit * (1.0 + 1e-6), 1e29))
        first = top
        survivors = not_above(found, 0, reach)
        while survivors:
            k = lowest(survivors)
            survivors &= survivors - 1
            bound = found[k] * unit
            at = top
            while at > first and bounds[at - 1] < bound:
                bounds[at], stack[at] = bounds[at - 1], stack[at - 1]
                at -= 1
            bounds[at], stack[at] = bound, tree.children[child * WIDTH + k]
            top += 1
    return best, nearby, top, steps
