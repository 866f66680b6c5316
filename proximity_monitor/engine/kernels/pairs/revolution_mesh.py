"""Solids of revolution beside meshes: what a search gains from the profile.

The search begins with a local minimum, found by alternating point queries as in search/approach.py.
After each query, Newton's method finds where the triangle is nearest (see revolution/triangle.py).
Then a plane dismisses the parts of the mesh that are no nearer (see beyond_plane.py).
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64, int64

from ..base.jit import implements, inlined, kernel
from ..base.lanes import lowest
from ..base.lazy import lazy
from ..base.memory import on_stack
from ..base.state import Dividing
from ..base.tables import has_profile, revolution_of
from ..base.trees import MeshTree, SurfaceTree
from ..base.vectors import along, dot, moved, moved_back, scaled, sub
from ..elements.direction import begin_of, take_direction
from ..elements.primitives import corners
from ..inside.nearest import Point, begin_nearest, nearest, point_triangle, walk
from ..inside.visit import ROOM
from ..revolution.places import place_of
from ..revolution.triangle import foot_of, gradient_at, nearest_of_triangle, normal_between
from ..search import stubs
from ..surface.facing import vector
from ..surface.measure import measure_near
from ..tree.layout import WIDTH, first_of, last_of, row
from . import divided
from .beyond_plane import (
    is_held_off,
    lanes_before,
    lanes_on,
    lay_plane,
    plane_across,
)

_TURNS, _STEPS = 8, 32
"""Most turns of a descent, and most steps of each search for the triangle nearest to a point."""

_GAIN = 1e-12
"""A gain of a turn below this share of the distance counts as none. Nearest points of a profile are
found to this share of `frame[4, 0]`, the length to which the errors of its arcs are relative."""

_NEARER = 0.999
"""Another plane is laid once the distance is below this share of that at the last plane."""

_FAILED = 2
"""After so many planes beside parts of the mesh that held off too little, a search lays no more."""

_USEFUL = 0.9
"""A plane is of use only if a node's middle is beyond it by this share of its distance."""

LEAF_STEPS = 4
"""Cost of the triangles of a leaf, in steps of a search."""

DESCENT_STEPS = 32
"""Least cost of a turn of a descent, in steps of a search."""

LOOK = 4
"""Bounds in the half-plane, or arcs looked at there, that count as a step of a search."""


@inlined
def is_convex(surface):
    """Return whether it is a nearly convex solid of revolution: then there is one local minimum."""
    return has_profile(surface) and revolution_of(surface).frame[4, 1] > 0.0


@kernel
def frame_of(solid, motion, made):
    """Write the motion (12,) from a mesh's frame to that of a profile into `made`.

    `motion` leads to the frame of the profile's model.
    """
    f = solid.frame
    for i in range(3):
        axis = row(f, i)
        for j in range(3):
            made[3 * i + j] = (
                axis[0] * motion[j] + axis[1] * motion[3 + j] + axis[2] * motion[6 + j]
            )
        made[9 + i] = dot(axis, sub((motion[9], motion[10], motion[11]), row(f, 3)))


@inlined
def _in_model(solid, v):
    """Turn a vector of the profile's frame into the model's."""
    f = solid.frame
    return along(along(scaled(row(f, 0), v[0]), row(f, 1), v[1]), row(f, 2), v[2])


@kernel
def _nearest_triangle(mesh, p, t, found):
    """Find a triangle of a mesh that is nearest to a point, or nearly; begin with triangle t.

    Returns it, its distance, and the weights v and w of its nearest point. `found` is room for
    sixteen float32.
    """
    stack, bounds = on_stack(ROOM, np.int32(0)), on_stack(ROOM, 0.0)
    distance, t, top = begin_nearest(mesh, p, t, stack, bounds)
    distance, t, _, _ = nearest(mesh, p, distance, t, top, 0.0, 0.0, stack, bounds, found, _STEPS)
    a, b, c = corners(mesh.triangles, t)
    _, v, w = point_triangle(p, a, b, c)
    return t, distance, v, w


@kernel
def _first_triangle(solid, mesh, motion, spare, most, found):
    """Find a triangle near the point of the solid that is nearest to the middle of the mesh."""
    middle = scaled(row(mesh.centres, 0), mesh.scale[0])
    foot = moved_back(motion, foot_of(solid, moved(motion, middle), spare, most))
    return _nearest_triangle(mesh, foot, walk(Point(foot, 0.0, 0.0, 0.0, 0.0), mesh, found), found)


@kernel
def keep_nearest(surface, mesh, state, solid, t, piece, at, y, v, w):
    """Keep a point of a triangle and the solid's nearest point, if none known is nearer.

    The point is y in the profile's frame; the nearest point of the profile is on `piece`, at `at`.
    """
    element, at = place_of(solid, piece, at, math.atan2(y[1], y[0]))
    measure_near(surface, mesh, state, element, at, t, (1.0 - v - w, v, w), 0)


@lazy((SurfaceTree,), (MeshTree,), Dividing, int64)
def go_down(surface, mesh, state, fresh):
    """Descend to a local minimum of the distance of a solid of revolution and a mesh.

    FRESH, begin with the middle of the mesh. Otherwise first lay a plane between the nearest points
    known, and go on from them. Each turn keeps the nearest points and lays a plane between them.
    Returns the cost in steps.
    """
    progress = state.progress[0]
    if not fresh:
        steps = lay_plane(surface, mesh, state)
        if progress.open == 0:
            return steps
    solid = revolution_of(surface)
    motion, found = on_stack(12, 0.0), on_stack(WIDTH, np.float32(0.0))
    frame_of(solid, state.motions[0], motion)
    spare = _GAIN * solid.frame[4, 0]
    most = LOOK * progress.steps
    t, weights = progress.element_b, vector(progress.weights_b)
    v, w = weights[1], weights[2]
    if fresh:
        t, _, v, w = _first_triangle(solid, mesh, motion, spare, most, found)
    steps = 0
    for _ in range(_TURNS):
        a, b, c = corners(mesh.triangles, t)
        triangle = moved(motion, a), moved(motion, b), moved(motion, c)
        here, y, v, w, looks = nearest_of_triangle(
            solid, triangle, v, w, spare, progress.rel_err, progress.abs_err, np.inf, most
        )
        steps += max(DESCENT_STEPS, looks // LOOK)
        most -= looks
        before = progress.distance
        keep_nearest(surface, mesh, state, solid, t, here.piece, here.t, y, v, w)
        if not progress.slack < progress.distance < before:
            break
        n = _in_model(solid, normal_between(here, triangle, v, w))
        take_direction(progress, state.motions[0], n)
        steps += lay_plane(surface, mesh, state)
        if progress.open == 0:
            break
        if most <= 0:
            break  # the slice is over
        foot = moved_back(motion, along(y, here.normal, -here.distance))
        t, distance, v, w = _nearest_triangle(mesh, foot, t, found)
        if not distance < here.distance * (1.0 - _GAIN):
            break
    progress.approached = progress.distance
    return steps


@lazy((SurfaceTree,), (MeshTree,), Dividing, int64, float64, nothing=(0, 0))
def open_beside(surface, mesh, state, lane, bound):
    """Open a volume of a mesh beside a solid of revolution, with a plane laid for that volume.

    The plane is perpendicular to the way from the solid to the middle of the node below. If the
    solid is not convex there, the plane holds off little, and the search goes on as beside other
    surfaces. Each triangle of a leaf has its own plane. Returns as `stubs.open_whole` does.
    """
    progress, solid = state.progress[0], revolution_of(surface)
    lows = on_stack(WIDTH, np.float32(0.0))
    child = np.int64(mesh.children[lane])
    motion = on_stack(12, 0.0)
    to_surface = state.motions[0]
    frame_of(solid, to_surface, motion)
    spare = _GAIN * solid.frame[4, 0]
    if child < 0:
        for t in range(first_of(child), last_of(child) + 1):
            if not is_held_off(mesh, t, progress) and not _is_farther(
                surface, mesh, state, solid, t, motion, to_surface, spare
            ):
                progress.futile += 1
                return 0, LEAF_STEPS
        return 1, LEAF_STEPS
    progress.bound_tests += WIDTH
    left = lanes_before(mesh, child, progress, progress.limit, lows)
    if not left:
        return 1, 1
    middle = scaled(row(mesh.centres, child), mesh.scale[0])
    here = gradient_at(solid, moved(motion, middle), spare, LOOK * progress.steps)
    n, end = plane_across(solid, to_surface, here.normal, progress.slack)
    if not dot(n, middle) - end > _USEFUL * here.distance:
        progress.futile += 1
        return 0, 1
    end += progress.bound_slack
    also_left, begin = lanes_on(mesh, child, n, end, progress.limit, lows)
    left &= also_left
    first = top = progress.open
    while left:
        k = lowest(left)
        left &= left - 1
        own = max(begin + lows[k] * mesh.scale[0], bound)
        if own < progress.limit:
            to = child * WIDTH + k
            stubs.push(state.open, state, first, top, 0, to, own)
            top += 1
    progress.open = top
    return 1, 2


@kernel
def _is_farther(surface, mesh, state, solid, t, motion, to_surface, spare):
    """Return whether a triangle is beyond the limit, by a plane laid where it is nearest.

    If the triangle is nearer than all found so far, keep it first, which lowers the limit.
    """
    progress = state.progress[0]
    a, b, c = corners(mesh.triangles, t)
    triangle = moved(motion, a), moved(motion, b), moved(motion, c)
    progress.primitive_tests += 1
    here, y, v, w, _ = nearest_of_triangle(
        solid, triangle, 1.0 / 3.0, 1.0 / 3.0, spare, progress.rel_err, progress.abs_err,
        progress.limit, LOOK * progress.steps,
    )  # fmt: skip
    if here.distance < progress.distance:
        keep_nearest(surface, mesh, state, solid, t, here.piece, here.t, y, v, w)
    n, end = plane_across(solid, to_surface, here.normal, progress.slack)
    if begin_of(n, mesh.triangles, t) - end >= progress.limit:
        return True
    there = normal_between(here, triangle, v, w)
    if there == here.normal:
        return False
    n, end = plane_across(solid, to_surface, there, progress.slack)
    return begin_of(n, mesh.triangles, t) - end >= progress.limit


@inlined
def _serves(progress, surface):
    """Return whether it pays to lay a plane for each volume and each triangle of a mesh."""
    return is_convex(surface) and progress.futile < _FAILED


@inlined
def is_due(progress, surface):
    """Return whether the distance has fallen so far that another plane may hold off more."""
    nearer = progress.slack < progress.distance < _NEARER * progress.laid
    return nearer and progress.open > 0 and (is_convex(surface) or progress.resting == 0)


@implements(divided.begin_below, SurfaceTree, MeshTree)
@kernel
def _begin_below(surface, mesh, state, fresh):
    if not has_profile(surface) or not (fresh or is_convex(surface)):
        return False
    if fresh or state.progress[0].distance > state.progress[0].slack:
        go_down(surface, mesh, state, int64(fresh))
    return True


@implements(stubs.open_whole, Dividing, SurfaceTree, MeshTree)
@inlined
def _open_whole(waiting, surface, mesh, state, a, b, bound, scratch):
    if a != 0 or not _serves(state.progress[0], surface):
        return False, 0
    opened, taken = open_beside(surface, mesh, state, b, bound)
    return opened != 0, taken
