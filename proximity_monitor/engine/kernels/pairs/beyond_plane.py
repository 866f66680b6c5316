"""A plane between a surface and a mesh, which dismisses the parts of the mesh beyond it.

The plane is perpendicular to the line between the nearest points, and the whole surface lies on one
side of it. It holds off the parts of the mesh that lie beyond it by at least the limit. Between two
convex models that is the whole mesh, so the search ends once the nearest points are found.

How far a surface reaches along a direction comes from its pieces (see surface/reach.py). For a
solid of revolution it comes from the profile, wherever the solid reaches farthest, unless the gap
is small beside the errors of the profile's arcs.

Parts of the mesh in an empty ball of the surface are dismissed, too: see mesh_in_ball.py.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel
from ..base.lanes import lowest, not_above
from ..base.lazy import lazy
from ..base.memory import on_stack
from ..base.rounding import DOUBLE_EPS, GAP_SHARE
from ..base.state import Dividing
from ..base.tables import has_profile, revolution_of
from ..base.trees import MeshTree, SurfaceTree
from ..base.vectors import dot, turned_back
from ..bounds.cross import along_node, left_between
from ..elements.direction import begin_of
from ..revolution.outline import outline_along
from ..search.stack import close_all
from ..surface.facing import vector
from ..surface.reach import reach_along
from ..tree.layout import EMPTY, WIDTH, first_of, last_of
from .in_ball import is_within, lanes_beyond

_ALL = (1 << WIDTH) - 1

_NODES, _OPEN = 64, 512
"""Most nodes of a mesh that are visited for one plane, and room for the open ones."""

PLANE_STEPS = 4
"""Cost of laying a plane, in steps of a search; each node visited costs one step more."""

REST = 16
"""Searches along a motion that lay no plane beside a surface that is not convex, after a plane laid
there did not end its search."""

_USEFUL = 0.9
"""A plane is of use only if the nearest triangle is beyond it by this share of the limit."""


@lazy((SurfaceTree,), (MeshTree,), Dividing)
def lay_plane(surface, mesh, state):
    """Lay a plane against a surface, perpendicular to the line between the nearest points.

    If plane and ball hold off the whole mesh, no pair stays open. Returns the cost in steps.
    """
    progress = state.progress[0]
    plane, n, along = progress.plane, vector(progress.normal_b), vector(progress.normal_a)
    plane[0], plane[1], plane[2] = n
    progress.laid = progress.distance
    begin = begin_of(n, mesh.triangles, progress.element_b)
    # The surface may reach so far along the normal.
    room = begin - _USEFUL * progress.limit + progress.offset - GAP_SHARE * progress.slack
    end, steps = np.inf, PLANE_STEPS
    if has_profile(surface):
        end = outline_along(revolution_of(surface), along)
    if end > room:  # there is no profile, or the errors of its arcs are too large for a small gap
        s, ws = progress.element_a, progress.weights_a
        most = progress.distance - progress.limit
        end, steps = reach_along(surface, along, s, ws[0], ws[1], most), 2 * PLANE_STEPS
    plane[3] = end - progress.offset + GAP_SHARE * progress.slack
    if begin - plane[3] < _USEFUL * progress.limit:
        plane[3] = np.inf  # the surface reaches farther elsewhere
        return steps
    return steps + end_where_held(mesh, progress)


@kernel
def plane_across(solid, motion, normal, slack):
    """Lay a plane against a solid of revolution, perpendicular to a unit vector of its profile.

    `normal` is in the profile's frame; `motion` leads from the mesh's frame to the solid's. Returns
    what `progress.plane` holds: a vector no longer than a unit, in the mesh's frame, and how far
    the solid reaches along it at most.

    A product with a point of the mesh errs by 11.9 u of the point's norm, as for b in GAP_SHARE.
    Twice the slack covers 20 u of the norms of either model.
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
    """End a search if plane and ball hold off all triangles of the mesh: no pair stays open.

    Returns how many nodes were visited.
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
    close_all(progress)
    return nodes


@inlined
def lanes_before(mesh, node, progress, limit, lows):
    """Return the bits of the lanes of a node that the plane does not hold off beyond `limit`, m.

    If no plane is known, these are all bits; otherwise those of unused lanes are not set. `lows` is
    room for sixteen float32.
    """
    if not progress.plane[3] < np.inf:
        return _ALL
    plane = progress.plane
    return lanes_on(mesh, node, vector(plane), plane[3] + progress.bound_slack, limit, lows)[0]


@inlined
def lanes_on(mesh, node, n, end, limit, lows):
    """Return the bits of the lanes of a node that may begin less than `limit` beyond `end` along n.

    Returns also how far beyond `end` the node's centre lies, metres. Writes to `lows` where each
    lane begins, relative to the centre, in node units. Unused lanes are beyond every limit.
    """
    begin = along_node(mesh, node, n, 1.0, lows) - end
    return not_above(lows, 0, np.float32(min((limit - begin) * mesh.scale[1], 1e29))), begin


@inlined
def is_held_off(mesh, t, progress):
    """Return whether the plane holds off a triangle beyond the limit; see `gap_between`."""
    return begin_of(progress.plane, mesh.triangles, t) - progress.plane[3] >= progress.limit
