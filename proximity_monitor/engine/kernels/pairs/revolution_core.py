"""Solids of revolution beside a few points and segments, as the cores of spheres and capsules.

If such a core lies on the axis, nearest points form whole circles. Pairs of patches and triangles
would have to be divided all along these. But every point of the profile turns through the
half-plane of a point, so the distances in it tell all. They also serve for solids that are not
convex, which planes do not hold off.

A search ends beside a core before any pair of volumes is opened, or goes on as beside other meshes.
It may be cut anywhere: what is left waits in `Dividing.pairs`, which hold nothing else until then.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.lazy import lazy
from ..base.memory import on_stack
from ..base.state import Dividing
from ..base.tables import has_profile, revolution_of
from ..base.trees import NONE, MeshTree, SurfaceTree
from ..base.vectors import along, moved, norm, sub
from ..elements.primitives import corners
from ..revolution.closest import (
    enough,
    halves_beside,
    nearer_on_piece,
    nearest_on_arc,
    nearest_under,
)
from ..revolution.meridian import MARGIN
from ..revolution.straight import (
    CUT,
    FAR,
    NEARER,
    OPEN,
    STACK,
    foot_on_axis,
    put,
    segment_beside,
)
from ..revolution.triangle import nearest_of_triangle
from ..search.stack import close_all
from ..surface.facing import vector
from .beyond_plane import is_held_off
from .revolution_mesh import LOOK, frame_of, keep_nearest

_FEW = 128
"""A core may have so many points and segments; searches of more of them open their volumes."""

_SPARE = 4e-13
"""Share of `frame[4, 0]` to which the nearest point of a profile is found on the way along a
segment. The error of an arc and the margins take up most of it, so that an arc that is a circle
around the point need not be divided."""

_LEAST = 64
"""Looks with which such a way is useful, if a slice has few left."""

_LOOKS = 1 << 16
"""Most looks for each point or segment of a core."""

_LEFT = 2 * STACK
"""The row of `Dividing.pairs` with the least bound of the arcs that nothing can be proven of."""

_WHOLE = -1.0
"""In place of where a part of a piece begins: the pair is one that a search begins with."""


@inlined
def is_core(surface, mesh, state):
    """Return whether a search begins beside a core, or goes on there, with nothing to collect."""
    progress = state.progress[0]
    if progress.beside > 0:
        return state.waiting.pairs[0].b != NONE
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
def _begin(mesh, progress, pairs):
    """Let all triangles wait that no plane holds off, the last one found nearest on top."""
    top, first = 0, progress.element_b
    for k in range(len(mesh.triangles)):
        t = k if k != first else len(mesh.triangles) - 1
        if k == len(mesh.triangles) - 1:
            t = first
        if not is_held_off(mesh, t, progress):
            put(pairs, top, -np.inf, 0, t, _WHOLE, 0.0, 0.0, 1.0)
            top += 1
    pairs[_LEFT].bound = np.inf
    progress.beside = top


@lazy((SurfaceTree,), (MeshTree,), Dividing)
def go_beside(surface, mesh, state):
    """Find the nearest points, and end the search if no others are nearer; return the steps.

    If the steps of the slice do not suffice, all of them are taken.
    """
    progress, pairs, solid = state.progress[0], state.waiting.pairs, revolution_of(surface)
    motion = on_stack(12, 0.0)
    frame_of(solid, state.motions[0], motion)
    if progress.beside == 0:
        _begin(mesh, progress, pairs)
    top, room, looks = progress.beside, LOOK * progress.steps, 0
    most = _LOOKS * len(mesh.triangles) - progress.bound_tests
    held = True
    while top > 0 and held and looks < room:
        if progress.distance - progress.slack <= progress.stop:
            held = False  # the others may be nearer still
            break
        first = pairs[2 * top - 2]
        t, begins = np.int64(first.b), first.normal[0] == _WHOLE
        a, b, c = corners(mesh.triangles, t)
        triangle = moved(motion, a), moved(motion, b), moved(motion, c)
        p, along_w = triangle[0], a == b
        h = sub(triangle[2] if along_w else triangle[1], p)
        progress.primitive_tests += begins
        if a == b and a == c:
            _, top, more = _point_beside(surface, mesh, state, solid, t, p, top, room - looks)
            looks += more
            continue
        if begins:
            foot = foot_on_axis(p, h)
            if t == progress.element_b:
                weights = vector(progress.weights_b)
                s = weights[2] if along_w else weights[1]
                looks += _go_along(surface, mesh, state, solid, t, triangle, along_w, s, room)
            put(pairs, top - 1, -np.inf, 0, t, 0.0, 0.0, 0.0, foot)
            put(pairs, top, -np.inf, 0, t, 0.0, 0.0, foot, 1.0)
            top += 1
            continue
        limit = progress.limit + 2.0 * progress.slack
        found, s, top, more = segment_beside(solid, p, h, limit, pairs, top, room - looks)
        looks += more
        if found == NEARER:
            before, pair = progress.distance, pairs[2 * top - 2]
            i, low, high = np.int64(pair.a), pair.normal[0], pair.normal[1]
            looks += _keep_on_part(
                surface, mesh, state, solid, t, triangle, along_w, s, i, low, high
            )
            looks += _go_along(surface, mesh, state, solid, t, triangle, along_w, s, room - looks)
            if not progress.distance < before:
                pair.normal[2] = 1.0  # it is halved next
        held = found != OPEN and looks < most
    progress.bound_tests += looks
    progress.beside = top if held else 0
    least = pairs[_LEFT].bound
    for k in range(top):
        least = min(least, pairs[2 * k].bound)
    least -= 2.0 * progress.slack
    if held and least >= progress.limit:
        close_all(progress)
        progress.beside = 0
    if progress.beside == 0:
        return 1 + looks // LOOK
    # Everything else is beyond the limit.
    state.open.bounds[0] = max(state.open.bounds[0], min(least, progress.limit))
    return progress.steps


@kernel
def _point_beside(surface, mesh, state, solid, t, y, top, room):
    """Look for points of the profile nearer to a point than the limit, and keep the nearest.

    Arcs wait in `pairs`, as in `segment_beside`. Returns FAR or CUT, how many wait, and the looks.
    """
    progress, pairs, size = state.progress[0], state.waiting.pairs, solid.frame[4, 0] + norm(y)
    rho, margin = np.sqrt(y[0] * y[0] + y[1] * y[1]), MARGIN * size
    looks = 0
    while top > 0 and pairs[2 * top - 2].b == t:
        if looks >= room:
            return CUT, top, looks
        pair = pairs[2 * top - 2]
        i, bound = np.int64(pair.a), pair.bound
        top -= 1
        limit = progress.limit + 2.0 * progress.slack
        if bound >= limit:
            continue
        looks += 1
        arc = solid.arcs[i]
        child = np.int64(arc.child)
        if child != NONE and top + 2 <= STACK:
            first, second = halves_beside(solid.arcs, child, rho, y[2], margin)
            near = 0 if first <= second else 1  # is looked at first
            put(pairs, top + 1 - near, max(bound, first), child, t, 0.0, 0.0, 0.0, 0.0)
            put(pairs, top + near, max(bound, second), child + 1, t, 0.0, 0.0, 0.0, 0.0)
            top += 2
            continue
        known = progress.distance
        spare = 0.5 * (known - limit)  # the rest is for how exactly the kept point is measured
        least, distance, piece, at, more = nearest_on_arc(
            solid, arc, rho, y[2], margin, 0.0, spare, known + margin, np.int64(0), 0.0
        )
        looks += more
        if distance < known + margin:
            keep_nearest(surface, mesh, state, solid, t, piece, at, y, 1.0 / 3.0, 1.0 / 3.0)
        bound = max(bound, min(least, enough(distance, 0.0, spare)))
        if bound >= progress.limit + 2.0 * progress.slack:
            continue
        if progress.distance < known:
            top += 1  # it is looked at again
        else:
            # Nearer points, found later, may still show that it is far enough.
            pairs[_LEFT].bound = min(pairs[_LEFT].bound, bound)
    return FAR, top, looks


@kernel
def _go_along(surface, mesh, state, solid, t, triangle, along_w, s, room):
    """Go from the point s of a segment to one that is nearer to the solid, in about `room` looks.

    Keep it if it is nearer than all others; return the looks. The segment leads from the triangle's
    first corner to its third if ALONG_W, else to its second.
    """
    progress, size = state.progress[0], solid.frame[4, 0]
    v, w = (0.0, s) if along_w else (s, 0.0)
    here, y, v, w, looks = nearest_of_triangle(
        solid, triangle, v, w, _SPARE * size, progress.rel_err, progress.abs_err, np.inf,
        max(room, _LEAST),
    )  # fmt: skip
    if here.distance < progress.distance:
        keep_nearest(surface, mesh, state, solid, t, here.piece, here.t, y, v, w)
    return looks


@kernel
def _keep_on_part(surface, mesh, state, solid, t, triangle, along_w, s, i, low, high):
    """Keep the point s of a segment if a part of the profile is nearer to it than all known points.

    The part is that of arc i, or that of the piece ~i from `low` to `high`. A way along the segment
    may end early, at a point that is no nearer; but a small part is known by few looks. Returns
    these.
    """
    progress, (a, b, c) = state.progress[0], triangle
    v, w = (0.0, s) if along_w else (s, 0.0)
    y = along(along(a, sub(b, a), v), sub(c, a), w)
    rho = np.sqrt(y[0] * y[0] + y[1] * y[1])
    if i >= 0:
        spare = _SPARE * solid.frame[4, 0]
        _, distance, piece, at, looks = nearest_under(solid, i, rho, y[2], 0.0, 0.0, spare, _LEAST)
    else:
        piece, looks = ~i, 2
        at, distance = nearer_on_piece(
            solid.curves[piece], low, high, rho, y[2], 0.5 * (low + high)
        )
    if distance < progress.distance:
        keep_nearest(surface, mesh, state, solid, t, piece, at, y, v, w)
    return looks
