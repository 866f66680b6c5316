"""Moves the nearest points known of a surface and a mesh, in turns, to a local minimum.

A turn chooses a place to look from, finds the point of the surface nearest to that place, then the
triangle nearest to that point, and runs Newton's method between the two. Plain projections from one
model onto the other would go in small steps between models that are near each other for their size.
So if the mesh faces the surface, the place lies behind the mesh's point: from the middle of a ball,
all of its surface is equally near. If the models cross nearby, the place lies on the line in which
their tangent planes meet. None of this proves anything.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.memory import on_stack
from ..base.vectors import across, along, dot, moved, norm, rotated, sub
from ..elements.primitives import corners
from ..inside.visit import ROOM
from ..search import stubs
from ..surface.edges import normal_on
from ..surface.empty_ball import LOOKS, nearest_on
from ..surface.facing import vector
from ..surface.measure import MINIMUM_STEPS, measure_near
from ..surface.newton import MOST
from ..surface.sides import near
from ..tree.layout import WIDTH, radius_of

LOOK = 2
"""Cost of a look at a rectangle of a piece, in steps of a search."""

_STEPS = 32
"""Steps of each search for a near piece or triangle."""

_LITTLE = 1e-6
"""A smaller change, as a share of the distance or of its square, ends the turns."""

_AWAY = 0.25
"""How far a point may go to where the models seem to cross, as a share of the smaller radius."""

_PARALLEL = 1e-3
"""Square of the sine of the angle between two normals above which their planes meet in a line."""

_GAIN, _SHORTER = 0.9, 0.25
"""If a step to a crossing leaves more than the first share of the distance, the next step goes at
most the second share as far."""


@inlined
def nearest_points(progress):
    """Return element and weights of the nearest points known, of the surface, then of the mesh."""
    s, ws = progress.element_a, vector(progress.weights_a)
    return s, ws, progress.element_b, vector(progress.weights_b)


@inlined
def _normal_of(mesh, t, motion):
    """Return the unit normal of a triangle, turned by the motion; zero if it has none."""
    a, b, c = corners(mesh.triangles, t)
    return rotated(motion, across(sub(b, a), sub(c, a)))


@kernel
def _aim(p, n, q, m, behind, far):
    """Choose the place from which to look for a point of the surface nearer than p.

    The mesh's point is q; `n` and `m` are the normals at p and q. If the models may cross within
    `far` of p, the place is on the line in which their tangent planes meet. Otherwise the place is
    `behind` metres behind q if the mesh faces p, else q itself.

    A mesh faces what is on its outer side. After looking from behind was in vain (`behind` is 0),
    the surface has to face the mesh, too. Models that do not face each other cross somewhere: then
    the place is on the way to that line. Models without an outer side only take longer.

    Returns also how far from p the place is if the models may cross, else infinity.
    """
    way = sub(q, p)
    apart = norm(way)
    cosine, height = dot(n, m), dot(m, way)
    faces = height <= 0.0 and (cosine <= 0.0 or behind > 0.0)
    squared = dot(n, n) - cosine * cosine
    away = abs(height) / np.sqrt(squared) if squared > _PARALLEL else np.inf
    if away < far or (not faces and apart < far and away < np.inf):
        share = height / squared
        if away > far:
            share, away = share * (far / away), far
        return along(along(p, m, share), n, -cosine * share), away
    return (along(q, way, behind / apart) if faces else q), np.inf


@kernel
def improve(surface, mesh, state, turns):
    """Move the nearest points known to a local minimum, in at most so many turns.

    Returns whether they reached it, and the cost in steps. They did if a search of the whole
    surface finds no point nearer to the place, and a search of the mesh no nearer triangle.
    """
    progress = state.progress[0]
    to_surface, to_mesh = state.motions[0], state.motions[1]
    stack, bounds = on_stack(ROOM, np.int32(0)), on_stack(ROOM, 0.0)
    found, slack = on_stack(WIDTH, np.float32(0.0)), progress.bound_slack
    behind, far = radius_of(mesh), _AWAY * min(radius_of(mesh), radius_of(surface))
    steps, cost, surely = 0, 0, False
    for _ in range(turns):
        before = progress.distance
        s, ws, t, wt = nearest_points(progress)
        p = stubs.witness(surface, s, ws)
        q = moved(to_surface, stubs.witness(mesh, t, wt))
        n, m = normal_on(surface, s, ws[0], ws[1]), _normal_of(mesh, t, to_surface)
        place, away = _aim(p, n, q, m, behind, far)
        crosses = away < np.inf
        if surely and not crosses:
            other, u, v, looks = nearest_on(surface, s, ws[0], ws[1], place)
            from_s = (u, v, 0.0)
            cost += looks
        else:
            other, from_s = near(surface, place, s, ws, _STEPS, slack, stack, bounds, found)
            steps += _STEPS
        new = stubs.witness(surface, other, from_s)
        last, from_t = near(mesh, moved(to_mesh, new), t, wt, _STEPS, slack, stack, bounds, found)
        steps += _STEPS
        way = sub(new, p)
        little = dot(way, way) < _LITTLE * before * before
        if little and other == s and last == t and not crosses:
            if surely:
                return True, steps + LOOK * cost
            surely = True
            continue
        measure_near(surface, mesh, state, other, from_s, last, from_t, MOST)
        steps += MINIMUM_STEPS
        if not progress.distance > progress.slack or cost >= LOOKS:
            break
        if crosses:
            if progress.distance > _GAIN * before:
                far = _SHORTER * away
        elif not progress.distance < before * (1.0 - _LITTLE):
            if behind > 0.0:
                behind = 0.0
            elif not surely:
                surely, behind = True, radius_of(mesh)
            elif little:
                return True, steps + LOOK * cost
    return False, steps + LOOK * cost
