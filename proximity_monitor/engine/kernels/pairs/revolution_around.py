"""Solids of revolution around small meshes: a box in a bore, or in a hollow cone.

No plane holds off a mesh that a solid surrounds, and long pairs of patches and triangles that are
very near each other would have to be divided often, because rounding tilts the way between them.
But in the half-plane (rho, z) of its points, rho of a triangle is convex. So along a normal that
points away from the axis, the mesh reaches no farther than its farthest corner, and parts of the
profile that are beyond are bounded by the corners alone. In a convex solid the nearest point of a
mesh is a corner, and these bounds suffice.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.lazy import lazy
from ..base.memory import on_stack, table_on_stack
from ..base.state import Dividing
from ..base.tables import has_profile, revolution_of
from ..base.trees import NONE, MeshTree, SurfaceTree
from ..base.vectors import dot, moved, norm
from ..elements.primitives import corners, mixed
from ..revolution.closest import nearest_in
from ..revolution.coaxial import circle_of, is_round
from ..revolution.meridian import chord_of
from ..revolution.reach import bulge, most_in
from ..revolution.straight import PAIR_MARGIN, SHORT, STACK, put, put_parts, sector_around
from ..search.stack import close_all
from ..surface.facing import vector
from ..tree.layout import radius_of, row
from .revolution_mesh import LOOK, frame_of, keep_nearest

_FEW = 64
"""Meshes of more triangles are searched by their volumes."""

_AHEAD, _TILT = 0.1, 1e-3
"""It pays to try if no corner is farther ahead of the nearest point than this share of the distance
and this share of the mesh's radius, along the way to the solid, which rounding may tilt."""

_LOOKS = 1 << 12
"""Most parts of a profile that are bounded."""


@inlined
def is_around(surface, mesh, state):
    """Return whether a search begins around a small mesh, or goes on there.

    If pairs wait beside a core, this is not asked.
    """
    progress = state.progress[0]
    if progress.beside > 0:
        return True
    begins = progress.bound_tests == 0 and progress.open > 0
    if not (begins and len(mesh.triangles) <= _FEW and has_profile(surface)):
        return False
    return state.collected.shape[0] == 0 and _is_promising(surface, mesh, state)


@kernel
def _is_promising(surface, mesh, state):
    """Return whether the solid is farther from the axis than the nearest point of the mesh.

    Besides, no corner of the mesh may be much nearer along the same way.
    """
    progress, solid = state.progress[0], revolution_of(surface)
    if not progress.slack < progress.distance < np.inf:
        return False
    motion = on_stack(12, 0.0)
    frame_of(solid, state.motions[0], motion)
    triangle = corners(mesh.triangles, progress.element_b)
    y = moved(motion, mixed(triangle, vector(progress.weights_b)))
    n = vector(progress.normal_a)
    x, z = dot(row(solid.frame, 0), n), -dot(row(solid.frame, 2), n)
    rho = np.sqrt(y[0] * y[0] + y[1] * y[1])
    x = -(x * y[0] + dot(row(solid.frame, 1), n) * y[1]) / max(rho, 1e-300)
    if x < 0.0:
        return False
    most = _AHEAD * progress.distance + _TILT * radius_of(mesh)
    for t in range(len(mesh.triangles)):
        for p in corners(mesh.triangles, t):
            p = moved(motion, p)
            if x * (np.sqrt(p[0] * p[0] + p[1] * p[1]) - rho) + z * (p[2] - y[2]) > most:
                return False
    return True


@inlined
def _least_beyond(points, count, x, z, nx, nz):
    """Return how far the line through (x, z) is beyond all points along a normal.

    Returns also which point is nearest, or ahead the most.
    """
    least, nearest = np.inf, 0
    for k in range(count):
        gap = nx * (x - points[k, 0]) + nz * (z - points[k, 1])
        if gap < least:
            least, nearest = gap, k
    return least, nearest


@kernel
def _beyond_chord(points, count, x0, z0, x1, z1, bulges):
    """Return how far a chord is beyond all points along its normal away from the axis, metres.

    `bulges` is how far what stands for it reaches beyond the chord: to its left, and to its right.
    Returns also the nearest point.
    """
    hx, hz = x1 - x0, z1 - z0
    length = np.sqrt(hx * hx + hz * hz)
    nx, nz, side = 1.0, 0.0, max(bulges[0], bulges[1])
    if length > 0.0:
        nx, nz, side = hz / length, -hx / length, bulges[0]
        if nx < 0.0 or (nx == 0.0 and nz * (z0 - points[0, 1]) < 0.0):
            nx, nz, side = -nx, -nz, bulges[1]
    least, nearest = _least_beyond(points, count, x0, z0, nx, nz)
    other, also = _least_beyond(points, count, x1, z1, nx, nz)
    if other < least:
        least, nearest = other, also
    return least - side, nearest


@kernel
def _beyond_circle(points, count, arc):
    """Return how far all points are within a round arc's circle, towards the arc; or -infinity."""
    sector = sector_around(arc)
    if most_in(sector, -1.0, 0.0) > 0.0:  # somewhere it is nearer to the axis than its centre
        return -np.inf
    x, z, radius = circle_of(arc)
    far = -np.inf
    for k in range(count):
        far = max(far, most_in(sector, points[k, 0] - x, points[k, 1] - z))
    return radius - far - arc.error


@lazy((SurfaceTree,), (MeshTree,), Dividing)
def go_around(surface, mesh, state):
    """Find the corner of a mesh nearest to the solid; end the search if no other point is nearer.

    Returns the steps. If the steps of the slice do not suffice, all of them are taken.
    """
    progress, pairs, solid = state.progress[0], state.waiting.pairs, revolution_of(surface)
    arcs, rows = solid.arcs, table_on_stack(16, 3, 0.0)
    motion, points = on_stack(12, 0.0), table_on_stack(192, 2, 0.0)
    asked = on_stack(192, np.int8(0))
    frame_of(solid, state.motions[0], motion)
    count, size = 3 * len(mesh.triangles), 0.0
    for t in range(len(mesh.triangles)):
        k = 3 * t
        for p in corners(mesh.triangles, t):
            p = moved(motion, p)
            points[k, 0], points[k, 1] = np.sqrt(p[0] * p[0] + p[1] * p[1]), p[2]
            size, asked[k] = max(size, norm(p)), 0
            k += 1
    size += solid.frame[4, 0]
    margin, short = PAIR_MARGIN * size, SHORT * size
    if progress.beside == 0:
        put(pairs, 0, -np.inf, 0, NONE, 0.0, 0.0, 0.0, 0.0)
        progress.beside = 1
    top, room, looks, cost = progress.beside, LOOK * progress.steps, 0, 0
    held = True
    while top > 0 and held and cost < room:
        if progress.distance - progress.slack <= progress.stop:
            held = False  # the others may be nearer still
            break
        top -= 1
        pair = pairs[2 * top]
        i, low, high, bound = np.int64(pair.a), pair.normal[0], pair.normal[1], pair.bound
        if bound >= progress.limit + 2.0 * progress.slack:
            continue
        rounded = -np.inf
        if i >= 0:
            arc = arcs[i]
            x0, z0 = arc.middle[0] - arc.half[0], arc.middle[1] - arc.half[1]
            x1, z1 = arc.middle[0] + arc.half[0], arc.middle[1] + arc.half[1]
            left = right = arc.error
            if arc.sine < 0.0:
                right += bulge(arc)
            elif arc.sine > 0.0:
                left += bulge(arc)
            thick = max(left, right)
            # The normal to the right meets what bulges to the left sooner, and the other way.
            if is_round(arc):
                rounded = _beyond_circle(points, count, arc)
        else:
            x0, z0, x1, z1, thick = chord_of(solid.curves[~i], low, high, rows)
            left = right = thick
        least, nearest = _beyond_chord(points, count, x0, z0, x1, z1, (left, right))
        bound = max(bound, max(least, rounded) - margin)
        looks, cost = looks + 1, cost + 1 + count // 16
        if bound >= progress.limit + 2.0 * progress.slack:
            continue
        single = i < 0 or arcs[max(i, 0)].curve != NONE
        if single and asked[nearest] == 0:
            asked[nearest] = 1
            cost += _keep_corner(surface, mesh, state, solid, motion, nearest, margin, room - cost)
            if bound >= progress.limit + 2.0 * progress.slack:
                continue
        if least + 2.0 * thick < 0.0:
            held = False  # the solid does not surround all corners, so halves prove nothing
        elif top + 2 > STACK or thick <= short or progress.bound_tests + looks > _LOOKS:
            held = False
        else:
            more = put_parts(solid, rows, pairs, top, bound, i, NONE, low, high, 0.0, 0.0)
            held, top = more > 0, top + more
    progress.bound_tests += looks
    progress.beside = top if held else 0
    if top == 0 and held:
        close_all(progress)
    if top == 0 or not held:
        return 1 + cost // LOOK
    return progress.steps


@kernel
def _keep_corner(surface, mesh, state, solid, motion, k, margin, most):
    """Keep corner k % 3 of triangle k // 3 if it is nearer than all others; return the looks.

    They are about `most`.
    """
    progress, t = state.progress[0], k // 3
    progress.primitive_tests += 1
    triangle = corners(mesh.triangles, t)
    v, w = (1.0 if k % 3 == 1 else 0.0), (1.0 if k % 3 == 2 else 0.0)
    y = moved(motion, mixed(triangle, (1.0 - v - w, v, w)))
    rho = np.sqrt(y[0] * y[0] + y[1] * y[1])
    _, away, piece, at, looks = nearest_in(solid, rho, y[2], margin, 0.0, margin, most)
    if away - margin < progress.distance:
        keep_nearest(surface, mesh, state, solid, t, piece, at, y, v, w)
    return looks
