"""An empty ball of a surface, which dismisses all triangles of a mesh inside it.

Many pairs of pieces and triangles remain if the pieces bend by more than the triangles' distances
differ from the smallest one. Most of these triangles lie in an empty ball: it touches the surface
at its nearest point and holds no point of it (see surface/empty_ball.py). The distances of a
triangle's corners from the ball's centre show that.

If the nearest point of the mesh lies within a triangle or on an edge, the corners around it are a
little outside the ball. But the ball leans on, that is touches, one piece only. All other pieces
are farther from its centre, so a larger ball dismisses pairs with them. Pairs with the piece that
it leans on are dismissed along the direction between the nearest points, if that piece bends away.
"""

from __future__ import annotations

import numpy as np
from numba import int64

from ..base.jit import implements, inlined
from ..base.lazy import lazy
from ..base.state import Dividing
from ..base.trees import NONE, MeshTree, SurfaceTree
from ..base.vectors import moved, norm, scaled
from ..elements.direction import begin_along, gap_between
from ..search import stubs
from ..surface.empty_ball import empty_ball, find_ball, is_in_ball
from ..surface.facing import vector
from ..surface.reach import support_of
from ..tree.layout import WIDTH, radius_of, row
from .beyond_plane import REST, end_where_held, is_held_off, lay_plane
from .in_ball import is_within
from .mesh_nearer import LOOK, improve, nearest_points
from .revolution_around import go_around, is_around
from .revolution_core import go_beside, is_core
from .revolution_mesh import go_down, is_convex, is_due

_STEPS = 48
"""Cost of looking for a ball, in steps of a search, without improving the nearest points and the
looks at the surface."""

_LARGE, _MORE = 4.0, 2e-4
"""Largest radius of a ball, as a share of the radii of the spheres around both models; and, as such
a share, how much farther from its centre the search can know the other pieces to be."""

_SOON, _LOOKED = 16 * WIDTH, -2
"""Bounds of volumes after which a search looks for a first ball, since no volume inside a ball is
opened; and the value of `progress.leaning` that says that it has looked."""

_ASKED = 0.5
"""It looks for this first ball only if the limit exceeds this share of the distance so far."""

_LATER, _LEAST = 4, 8
"""The next ball is looked for when so many times as many pairs have been compared, and not before
so many."""

_TURNS, _FEW_TURNS = 10, 5
"""Most turns in which the nearest points are improved first; and the same for the first ball."""


@lazy((SurfaceTree,), (MeshTree,), Dividing, int64)
def look_for_ball(surface, mesh, state, soon):
    """Look for an empty ball beside the surface's nearest point; return the cost in steps.

    SOON, before much is known, give up unless a few turns find the nearest points.

    Moving the centre c errs as moving a point of the models does, but the norm of c may exceed
    `size`, the largest norm of a surface point. So the error is at most 1 + |c| / `size` times the
    slack of volumes. Moving the centre takes less than half of that (see POINT_MARGIN). The rest
    covers how much an imperfect rotation changes the length of the way to a corner of the mesh, and
    the rounding of that length, 8 u (|c| + |corner|).
    """
    progress, size = state.progress[0], surface.scale[2]
    ball = progress.ball
    if soon:
        progress.leaning = _LOOKED
    else:
        progress.due = max(_LATER * progress.compared, _LEAST)
    if not (progress.slack < progress.distance < ball[5] and size > 0.0):
        return 0
    found, steps = improve(surface, mesh, state, _FEW_TURNS if soon else _TURNS)
    distance = progress.distance
    if not distance > progress.slack or (soon and not found):
        return steps
    s, ws, _, _ = nearest_points(progress)
    n = vector(progress.normal_a)
    reach = radius_of(surface) + radius_of(mesh)
    middle = moved(state.motions[0], scaled(row(mesh.centres, 0), mesh.scale[0]))
    c, own, others, cost = empty_ball(
        surface, s, ws[0], ws[1], n, _LARGE * reach, _MORE * reach, middle,
        distance + radius_of(mesh),
    )  # fmt: skip
    error = progress.bound_slack * (1.0 + norm(c) / size)
    ball[0], ball[1], ball[2] = moved(state.motions[1], c)
    ball[3], ball[4], ball[5] = own - error, others - error, distance
    progress.leaning, progress.support = s, support_of(surface, s, ws[0], ws[1], n)
    return steps + _STEPS + LOOK * cost + end_where_held(mesh, progress)


@inlined
def _is_soon(progress):
    """Return whether to look for a first ball now, though few pairs of elements were compared.

    Not if the question is only about a clearance far below the distance found so far.
    """
    soon = progress.bound_tests >= _SOON and progress.leaning == NONE and progress.open > 0
    return soon and progress.limit > _ASKED * progress.distance


@lazy((SurfaceTree,), (MeshTree,), Dividing)
def look_for_plane(surface, mesh, state):
    """Improve the nearest points and lay a plane between them; return the cost in steps.

    A surface that is no convex solid has its nearest points improved for the first plane only.
    """
    progress, steps = state.progress[0], 0
    if is_convex(surface):
        return go_down(surface, mesh, state, 0)
    if progress.laid == np.inf:
        _, steps = improve(surface, mesh, state, _FEW_TURNS)
        if not progress.distance > progress.slack:
            return steps
    steps += lay_plane(surface, mesh, state)
    progress.resting = REST if progress.open > 0 else 0
    return steps


@implements(stubs.look_ahead, Dividing, SurfaceTree, MeshTree)
@inlined
def _look_ahead(waiting, surface, mesh, state):
    if is_core(surface, mesh, state):
        return go_beside(surface, mesh, state)
    if is_around(surface, mesh, state):
        return go_around(surface, mesh, state)
    if is_due(state.progress[0], surface):
        return look_for_plane(surface, mesh, state)
    if not _is_soon(state.progress[0]):
        return 0
    return look_for_ball(surface, mesh, state, 1)


@implements(find_ball, SurfaceTree, MeshTree)
@inlined
def _find_ball(surface, mesh, state):
    return look_for_ball(surface, mesh, state, 0)


@inlined
def _has_in_ball(tree, t, surface, element, progress):
    own, room = progress.ball[3], progress.ball[4]
    if surface.pieces[element].edge != NONE:  # it lies on a piece, the leaning one or another
        room = min(own, room)
    elif element == progress.leaning:
        room = own
    return is_within(tree, t, progress.ball, room - progress.limit)


@implements(is_in_ball, SurfaceTree, MeshTree)
@inlined
def _is_in_ball(surface, mesh, state, element, t):
    progress = state.progress[0]
    if element == progress.leaning and progress.distance == progress.ball[5]:
        begin = begin_along(progress, mesh.triangles, t)
        if gap_between(progress, progress.support, begin) >= progress.limit:
            return True
    if is_held_off(mesh, t, progress):
        return True
    return _has_in_ball(mesh, t, surface, element, progress)
