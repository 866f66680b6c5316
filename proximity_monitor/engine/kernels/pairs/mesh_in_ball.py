"""The triangles of a mesh that lie in an empty ball of a surface: all are dismissed by that.

Pairs of a surface's pieces and triangles are many where pieces bend by more than the triangles are
farther than the nearest one. Most of these lie in a ball that touches the surface at its nearest
point (see surface/empty_ball.py), and the distances of their corners from its centre tell. About
the nearest point of the mesh, where it lies within a triangle or on an edge, corners are a little
outside: the pieces that the ball does not touch are farther from its centre than the one that it
leans on, and that one, where it bends away, is dismissed along the direction between both points.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel
from ..base.state import Dividing
from ..base.trees import NONE, MeshTree, SurfaceTree
from ..base.vectors import moved, norm, scaled
from ..elements.direction import begin_along, gap_between
from ..search import stubs
from ..surface.empty_ball import empty_ball, find_ball, is_in_ball
from ..surface.facing import vector
from ..surface.reach import support_of
from ..tree.layout import WIDTH, radius_of, row
from .beyond_plane import end_where_held, is_held_off
from .in_ball import is_within
from .mesh_nearer import LOOK, improve, nearest_points
from .revolution_mesh import go_down, is_convex, is_due

_STEPS = 48
"""Steps of a search that looking for a ball takes as long as, but for what improving the nearest
points and looks at the surface take."""

_LARGE, _MORE = 4.0, 2e-4
"""How large a ball is at the most, as a share of the spheres around both models; and how much
farther from its centre other pieces may be known to be."""

_SOON, _LOOKED = 16 * WIDTH, -2
"""Bounds of volumes after which a ball is looked for in any case, as no volume within it is opened;
and what tells that it has been."""

_ASKED = 0.5
"""Share of the distance found so far that is asked about at the least for that."""

_LATER, _LEAST = 4, 8
"""How many times as many pairs are compared until the next ball is looked for; and how many at the
least."""

_TURNS, _FEW_TURNS = 10, 5
"""Times that the nearest points are improved first, at the most, and where it is soon."""


@kernel
def _find(surface, mesh, state, soon):
    """Look for a ball of a surface beside its nearest point; returns the steps taken.

    SOON, before much is known, only where the nearest points are found in a few turns.

    Moving the centre c errs by no more than moving a point of the models does, but for its larger
    norm: that of a surface's point is at most `size`, so by 1 + |c| / `size` times the slack of
    volumes. That holds also for how much longer or shorter an imperfect rotation makes the way to a
    corner of the mesh, and for what the distance to that errs by, 8 u (|c| + |corner|): of the
    slack moving the centre takes less than half (see POINT_MARGIN).
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
    """Whether it is time to look for a ball though few pairs of elements were compared.

    Not where a clearance far below the distance found so far is all that is asked for.
    """
    soon = progress.bound_tests >= _SOON and progress.leaning == NONE and progress.open > 0
    return soon and progress.limit > _ASKED * progress.distance


@kernel
def _look(surface, mesh, state):
    """Lay a plane between the nearest points, which are improved first; returns the steps taken."""
    progress, steps = state.progress[0], 0
    if not is_convex(surface) and progress.laid == np.inf:
        _, steps = improve(surface, mesh, state, _FEW_TURNS)
        if not progress.distance > progress.slack:
            return steps
    return steps + go_down(surface, mesh, state, False)


@implements(stubs.look_ahead, Dividing, SurfaceTree, MeshTree)
@inlined
def _look_ahead(waiting, surface, mesh, state):
    if is_due(state.progress[0], surface):
        return _look(surface, mesh, state)
    if not _is_soon(state.progress[0]):
        return 0
    return _find(surface, mesh, state, True)


@implements(find_ball, SurfaceTree, MeshTree)
@inlined
def _find_ball(surface, mesh, state):
    return _find(surface, mesh, state, False)


@inlined
def _has_in_ball(tree, t, surface, element, progress):
    own, room = progress.ball[3], progress.ball[4]
    if surface.pieces[element].edge != NONE:  # nothing is known of it but of the piece it lies on
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
