"""A plane between a surface and a mesh: all of the mesh that it holds off is dismissed.

So is what lies in an empty ball of the surface: see mesh_in_ball.py.

The plane across the way between the nearest points, laid against the surface, holds off whatever of
the mesh is beyond it by as much as these are apart. Of two convex models that is everything: where
the nearest points are found, the search ends. How far a surface reaches along a direction, its
pieces tell (see surface/reach.py), and of a solid of revolution its profile, wherever that is.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel
from ..base.lanes import lowest, not_above
from ..base.memory import on_stack
from ..base.rounding import DOUBLE_EPS, GAP_SHARE
from ..base.state import Dividing
from ..base.tables import has_profile, revolution_of
from ..base.trees import MeshTree
from ..base.vectors import dot, turned_back
from ..bounds.cross import along_node, left_between
from ..elements.direction import begin_of
from ..revolution.outline import outline_along
from ..surface.facing import vector
from ..surface.reach import reach_along
from ..tree.layout import EMPTY, WIDTH, first_of, last_of
from .in_ball import is_within, lanes_beyond

_ALL = (1 << WIDTH) - 1

_NODES, _OPEN = 64, 512
"""Nodes of a mesh that are looked at for one plane at most, and those that may be open."""

PLANE_STEPS = 4
"""Steps of a search that laying a plane takes as long as, besides one for each node."""

REST = 16
"""Searches along a motion for which no plane is laid beside a surface after one told too little."""

_CONVEX = 0.9
"""Share of the limit that a plane has to hold off of the nearest triangle for it to be of use."""


@kernel
def _end_along(tree, n, element, u, v, most):
    """Where a surface ends along a vector no longer than a unit, at the most; see `reach_along`."""
    if has_profile(tree):
        return outline_along(revolution_of(tree), n)
    return reach_along(tree, n, element, u, v, most)


@kernel
def lay_plane(surface, mesh, state):
    """Lay a plane against a surface, across the way between the nearest points.

    Where it holds off all of the mesh, nothing is open then. Returns the steps that this took.
    """
    progress = state.progress[0]
    plane, n = progress.plane, vector(progress.normal_b)
    plane[0], plane[1], plane[2] = n
    progress.laid = progress.distance
    s, ws, t = progress.element_a, progress.weights_a, progress.element_b
    most = progress.distance - progress.limit
    end = _end_along(surface, vector(progress.normal_a), s, ws[0], ws[1], most)
    plane[3] = end - progress.offset + GAP_SHARE * progress.slack
    if begin_of(n, mesh.triangles, t) - plane[3] < _CONVEX * progress.limit:
        plane[3] = np.inf  # the surface reaches farther elsewhere
        return PLANE_STEPS
    return PLANE_STEPS + end_where_held(mesh, progress)


@kernel
def plane_across(solid, motion, normal, slack):
    """The plane laid against a solid of revolution across a unit vector of the profile's frame.

    `motion` leads from the mesh to the solid's frame. Returns what `progress.plane` begins with:
    a vector that is no longer than a unit, in the mesh's frame, and how far the solid reaches.

    The products with the mesh's points err by 11.9 u of these, as those of b in GAP_SHARE: twice
    the slack holds 20 u of either.
    """
    f, share = solid.frame, 1.0 - 16.0 * DOUBLE_EPS
    x, y, z = share * normal[0], share * normal[1], share * normal[2]
    n = (
        x * f[0, 0] + y * f[1, 0] + z * f[2, 0],
        x * f[0, 1] + y * f[1, 1] + z * f[2, 1],
        x * f[0, 2] + y * f[1, 2] + z * f[2, 2],
    )
    end = outline_along(solid, n) - dot(n, (motion[9], motion[10], motion[11])) + 2.0 * slack
    return turned_back(motion, n), end


@implements(left_between, Dividing, MeshTree)
@kernel
def _left(waiting, tree, node, progress, limit, reaches):
    return _left_of(tree, node, progress, limit, reaches)


@kernel
def _left_of(tree, node, progress, limit, reaches):
    lanes = lanes_before(tree, node, progress, limit, reaches)
    return lanes & lanes_beyond(tree, node, progress, limit, reaches) if lanes else lanes


@kernel
def end_where_held(mesh, progress):
    """End a search where plane and ball hold off all triangles of the mesh: nothing is open then.

    Returns how many nodes were looked at.
    """
    stack, lows = on_stack(_OPEN, np.int32(0)), on_stack(WIDTH, np.float32(0.0))
    stack[0] = mesh.children[0]
    top, nodes = 1, 0
    room = min(progress.ball[3], progress.ball[4]) - progress.limit
    while top > 0:
        top -= 1
        child = np.int64(stack[top])
        if child < 0:
            for t in range(first_of(child), last_of(child) + 1):
                if not (is_held_off(mesh, t, progress) or is_within(mesh, t, progress.ball, room)):
                    return nodes
            continue
        nodes += 1
        if nodes > _NODES or top + WIDTH > _OPEN:
            return nodes
        left = _left_of(mesh, child, progress, progress.limit, lows)
        while left:
            k = lowest(left)
            left &= left - 1
            below = mesh.children[child * WIDTH + k]
            if below != EMPTY:
                stack[top] = below
                top += 1
    progress.open = progress.waiting = 0
    return nodes


@inlined
def lanes_before(mesh, node, progress, limit, lows):
    """The bits of the lanes of a node that the plane does not hold off beyond `limit`, metres.

    `lows` is room for sixteen float32. Bits of unused lanes are not among them.
    """
    if not progress.plane[3] < np.inf:
        return _ALL
    plane = progress.plane
    return lanes_on(mesh, node, vector(plane), plane[3] + progress.bound_slack, limit, lows)[0]


@inlined
def lanes_on(mesh, node, n, end, limit, lows):
    """The bits of the lanes of a node that may begin less than `limit` beyond `end` along a vector.

    Returns also how far beyond that the node's centre lies, metres; how much less its lanes do is
    written to `lows`, in node units. Unused lanes are beyond every limit.
    """
    begin = along_node(mesh, node, n, 1.0, lows) - end
    return not_above(lows, 0, np.float32(min((limit - begin) * mesh.scale[1], 1e29))), begin


@inlined
def is_held_off(mesh, t, progress):
    """Whether the plane holds off a triangle beyond the limit; see `gap_between`."""
    return begin_of(progress.plane, mesh.triangles, t) - progress.plane[3] >= progress.limit
