"""Solids of revolution beside a few points and segments, as the cores of spheres and capsules.

If such a core lies on the axis, nearest points form whole circles. Pairs of patches and triangles
would have to be divided all along these. But every point of the profile turns through the
half-plane of a point, so the distances in it tell all. They also serve for solids that are not
convex, which planes do not hold off.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.memory import on_stack
from ..base.tables import has_profile, revolution_of
from ..base.vectors import moved, norm, sub
from ..elements.primitives import corners
from ..revolution.closest import nearest_on
from ..revolution.meridian import MARGIN
from ..revolution.straight import FAR, NEARER, segment_beside
from ..revolution.triangle import nearest_of_triangle
from ..surface.facing import vector
from .beyond_plane import is_held_off
from .revolution_mesh import frame_of, keep_nearest

_FEW = 8
"""A core may have so many points and segments; searches of more of them open their volumes."""

_SPARE = 4e-13
"""Share of a point's distance from the frame's origin and of `frame[4, 0]` to which the nearest
point of the profile is found. The error of an arc and the margins take up most of it, so that an
arc that is a circle around the point need not be divided."""

_ROUNDS = 8
"""Most local minima that are looked for, one after the other."""

_LOOK = 4
"""Bounds in the half-plane that count as a step of a search."""


@inlined
def is_core(surface, mesh, state):
    """Return whether a search begins beside a core, and has nothing to collect."""
    progress = state.progress[0]
    begins = progress.bound_tests == 0 and progress.open > 0
    if not (begins and len(mesh.triangles) <= _FEW and has_profile(surface)):
        return False
    return state.collected.shape[0] == 0 and _is_thin(mesh)


@kernel
def _is_thin(mesh):
    """Return whether all triangles are points or segments: two of their corners are equal."""
    for t in range(len(mesh.triangles)):
        a, b, c = corners(mesh.triangles, t)
        if a != b and a != c and b != c:
            return False
    return True


@kernel
def go_beside(surface, mesh, state):
    """Find the nearest points, and end the search if no others are nearer; return the steps."""
    progress, solid = state.progress[0], revolution_of(surface)
    motion = on_stack(12, 0.0)
    frame_of(solid, state.motions[0], motion)
    looks, held = 0, True
    for t in range(len(mesh.triangles)):
        if progress.distance - progress.slack <= progress.stop:
            held = False  # the others may be nearer still
            break
        if is_held_off(mesh, t, progress):
            continue
        progress.primitive_tests += 1
        a, b, c = corners(mesh.triangles, t)
        triangle = moved(motion, a), moved(motion, b), moved(motion, c)
        if a == b and a == c:
            beyond, more = _point_beyond(surface, mesh, state, solid, t, triangle[0])
        else:
            beyond, more = _segment_beyond(surface, mesh, state, solid, t, triangle, a == b)
        looks += more
        held = held and beyond
    progress.bound_tests += looks
    if held:
        progress.open = progress.waiting = 0
    return 1 + looks // _LOOK


@kernel
def _point_beyond(surface, mesh, state, solid, t, y):
    """Return whether a point is beyond the limit, and the looks; keep it if it is nearer."""
    progress, size = state.progress[0], solid.frame[4, 0]
    rho, margin = np.sqrt(y[0] * y[0] + y[1] * y[1]), MARGIN * (size + norm(y))
    spare = _SPARE * (size + norm(y))
    least, away, piece, at, looks = nearest_on(solid, rho, y[2], margin, 0.0, spare)
    if away - margin < progress.distance:
        keep_nearest(surface, mesh, state, solid, t, piece, at, y, 1.0 / 3.0, 1.0 / 3.0)
    return least - 2.0 * progress.slack >= progress.limit, looks


@kernel
def _segment_beyond(surface, mesh, state, solid, t, triangle, along_w):
    """Return whether a segment is beyond the limit, and the looks; keep nearer points of it.

    The segment leads from the triangle's first corner to its third if ALONG_W, else to its second.
    """
    progress, size = state.progress[0], solid.frame[4, 0]
    p = triangle[0]
    h = sub(triangle[2] if along_w else triangle[1], p)
    s, looks = 0.5, 0
    if t == progress.element_b:
        weights = vector(progress.weights_b)
        s = weights[2] if along_w else weights[1]
    for _ in range(_ROUNDS):
        v, w = (0.0, s) if along_w else (s, 0.0)
        here, y, v, w = nearest_of_triangle(
            solid, triangle, v, w, _SPARE * size, progress.rel_err, progress.abs_err, np.inf
        )
        if here.distance < progress.distance:
            keep_nearest(surface, mesh, state, solid, t, here.piece, here.t, y, v, w)
        limit = progress.limit + 2.0 * progress.slack
        found, s, more = segment_beside(solid, p, h, limit)
        looks += more
        if found == FAR:
            return True, looks
        if found != NEARER:
            break
    return False, looks
