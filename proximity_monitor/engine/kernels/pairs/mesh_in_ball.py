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
from ..base.memory import on_stack
from ..base.state import NONE, Dividing, MeshTree, SurfaceTree
from ..base.vectors import along, dot, moved, norm, scaled, sub
from ..elements.direction import begin_along, end_along, gap_between
from ..elements.primitives import corners
from ..inside.visit import ROOM
from ..search import stubs
from ..surface.empty_ball import LOOKS, empty_ball, find_ball, is_in_ball, nearest_on
from ..surface.facing import vector
from ..surface.measure import MINIMUM_STEPS, measure_near
from ..surface.newton import MOST
from ..surface.reach import support_of
from ..surface.sides import near
from ..tree.layout import WIDTH, row
from . import lanes_in_ball  # noqa: F401 - it implements the same of volumes
from .beyond_plane import is_held_off
from .revolution_mesh import go_down, is_convex, is_due

_STEPS, _LOOK = 48, 2
"""Steps of a search that looking for a ball takes as long as, but for what improving the nearest
points takes; and those of a look at a rectangle of a piece."""

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

_TURNS, _FEW_TURNS, _NEAR_STEPS = 10, 5, 32
"""Times that the nearest points are improved first, at the most, and where it is soon; and steps of
each search for a near triangle."""

_LITTLE = 1e-6
"""Share of the distance, or of its square, less than which ends the turns."""


@inlined
def _reach(tree):
    return tree.centres[0, 3] * tree.scale[0]


@kernel
def _nearest_points(state, flip):
    """The elements and weights of the nearest points known: the surface's first, then the mesh's.

    `flip` says that the surface is b.
    """
    progress = state.progress[0]
    a, wa = progress.element_a, vector(progress.weights_a)
    b, wb = progress.element_b, vector(progress.weights_b)
    return (b, wb, a, wa) if flip else (a, wa, b, wb)


@kernel
def _improve(tree_a, tree_b, state, surface, mesh, flip, turns):
    """Move the nearest points known to where the models are nearest near by, in so many turns.

    Returns whether they are there, and the steps.

    In turns: the point of the surface nearest to the mesh's point, the triangle nearest to that,
    and Newton's method between both. Between models that are near each other for their size such
    projections go in small steps. So they are made from a place behind the mesh's point: from the
    middle of a ball, all of its surface is as near. Where that leads nowhere, from the point.
    """
    progress = state.progress[0]
    to_surface, to_mesh = state.motions[1 if flip else 0], state.motions[0 if flip else 1]
    stack, bounds = on_stack(ROOM, np.int32(0)), on_stack(ROOM, 0.0)
    found, slack = on_stack(WIDTH, np.float32(0.0)), progress.bound_slack
    behind, steps, cost, surely = _reach(mesh), 0, 0, False
    for _ in range(turns):
        before = progress.distance
        s, ws, t, wt = _nearest_points(state, flip)
        p = stubs.witness(surface, s, ws)
        q = moved(to_surface, stubs.witness(mesh, t, wt))
        place = along(q, sub(q, p), behind / before)
        if surely:
            other, u, v, looks = nearest_on(surface, s, ws[0], ws[1], place)
            from_s = (u, v, 0.0)
            cost += looks
        else:
            other, from_s = near(surface, place, s, ws, _NEAR_STEPS, slack, stack, bounds, found)
            steps += _NEAR_STEPS
        new = stubs.witness(surface, other, from_s)
        last, from_t = near(
            mesh, moved(to_mesh, new), t, wt, _NEAR_STEPS, slack, stack, bounds, found
        )
        steps += _NEAR_STEPS
        way = sub(new, p)
        little = dot(way, way) < _LITTLE * before * before
        if little and other == s and last == t:
            if surely:
                return True, steps + _LOOK * cost
            surely = True
            continue
        if flip:
            measure_near(tree_a, tree_b, state, last, from_t, other, from_s, MOST)
        else:
            measure_near(tree_a, tree_b, state, other, from_s, last, from_t, MOST)
        steps += MINIMUM_STEPS
        if not progress.distance > progress.slack or cost >= LOOKS:
            break
        if not progress.distance < before * (1.0 - _LITTLE):
            if not surely:
                surely = True
            elif little or behind == 0.0:
                return True, steps + _LOOK * cost
            else:
                behind = 0.0
    return False, steps + _LOOK * cost


@kernel
def _find(tree_a, tree_b, state, surface, mesh, flip, soon):
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
    found, steps = _improve(
        tree_a, tree_b, state, surface, mesh, flip, _FEW_TURNS if soon else _TURNS
    )
    distance = progress.distance
    if not distance > progress.slack or (soon and not found):
        return steps
    s, ws, _, _ = _nearest_points(state, flip)
    n = scaled(vector(progress.normal_b), -1.0) if flip else vector(progress.normal_a)
    reach = _reach(surface) + _reach(mesh)
    middle = scaled(row(mesh.centres, 0), mesh.scale[0])
    middle = moved(state.motions[1 if flip else 0], middle)
    c, own, others, cost = empty_ball(
        surface, s, ws[0], ws[1], n, _LARGE * reach, _MORE * reach, middle
    )
    error = progress.bound_slack * (1.0 + norm(c) / size)
    ball[0], ball[1], ball[2] = moved(state.motions[0 if flip else 1], c)
    ball[3], ball[4], ball[5] = own - error, others - error, distance
    progress.leaning, progress.support = s, support_of(surface, s, ws[0], ws[1], n)
    return steps + _STEPS + _LOOK * cost


@inlined
def _is_soon(progress):
    """Whether it is time to look for a ball though few pairs of elements were compared.

    Not where a clearance far below the distance found so far is all that is asked for.
    """
    soon = progress.bound_tests >= _SOON and progress.leaning == NONE and progress.open > 0
    return soon and progress.limit > _ASKED * progress.distance


@kernel
def _look(tree_a, tree_b, state, surface, mesh, flip):
    """Lay a plane between the nearest points, which are improved first; returns the steps taken."""
    steps = 0
    if not is_convex(surface) and state.progress[0].laid == np.inf:
        _, steps = _improve(tree_a, tree_b, state, surface, mesh, flip, _FEW_TURNS)
    return steps + go_down(tree_a, tree_b, state, surface, mesh, flip, False)


@implements(stubs.look_ahead, Dividing, SurfaceTree, MeshTree)
@inlined
def _look_ahead_of_a(waiting, tree_a, tree_b, state):
    if is_due(state.progress[0], tree_a):
        return _look(tree_a, tree_b, state, tree_a, tree_b, False)
    if not _is_soon(state.progress[0]):
        return 0
    return _find(tree_a, tree_b, state, tree_a, tree_b, False, True)


@implements(stubs.look_ahead, Dividing, MeshTree, SurfaceTree)
@inlined
def _look_ahead_of_b(waiting, tree_a, tree_b, state):
    if is_due(state.progress[0], tree_b):
        return _look(tree_a, tree_b, state, tree_b, tree_a, True)
    if not _is_soon(state.progress[0]):
        return 0
    return _find(tree_a, tree_b, state, tree_b, tree_a, True, True)


@implements(find_ball, SurfaceTree, MeshTree)
@inlined
def _find_ball_of_a(tree_a, tree_b, state):
    return _find(tree_a, tree_b, state, tree_a, tree_b, False, False)


@implements(find_ball, MeshTree, SurfaceTree)
@inlined
def _find_ball_of_b(tree_a, tree_b, state):
    return _find(tree_a, tree_b, state, tree_b, tree_a, True, False)


@inlined
def _is_in_ball(tree, t, surface, element, progress):
    own, room = progress.ball[3], progress.ball[4]
    if surface.pieces[element].edge != NONE:  # nothing is known of it but of the piece it lies on
        room = min(own, room)
    elif element == progress.leaning:
        room = own
    room -= progress.limit
    if not room > 0.0:
        return False
    centre = vector(progress.ball)
    a, b, c = corners(tree.triangles, t)
    a, b, c = sub(a, centre), sub(b, centre), sub(c, centre)
    return max(max(dot(a, a), dot(b, b)), dot(c, c)) <= room * room


@inlined
def _is_beyond(progress, element, end, begin):
    """Whether an element and a triangle are beyond the limit along the direction of the ball."""
    same = element == progress.leaning and progress.distance == progress.ball[5]
    return same and gap_between(progress, end, begin) >= progress.limit


@implements(is_in_ball, SurfaceTree, MeshTree)
@inlined
def _is_b_in_ball(tree_a, tree_b, state, a, b):
    progress = state.progress[0]
    begin = begin_along(progress, tree_b.triangles, b)
    if _is_beyond(progress, a, progress.support, begin):
        return True
    return is_held_off(tree_b, b, progress) or _is_in_ball(tree_b, b, tree_a, a, progress)


@implements(is_in_ball, MeshTree, SurfaceTree)
@inlined
def _is_a_in_ball(tree_a, tree_b, state, a, b):
    progress = state.progress[0]
    end = end_along(progress, tree_a.triangles, a)
    if _is_beyond(progress, b, end, -progress.support):
        return True
    return is_held_off(tree_a, a, progress) or _is_in_ball(tree_a, a, tree_b, b, progress)
