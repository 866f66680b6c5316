"""A plane between a solid of revolution and a mesh: all of the mesh that it holds off is dismissed.

How far such a solid reaches along a direction its profile tells, to the last digits where that is
of lines and circles (see revolution/reach.py). So the plane across the way between the nearest
points, laid against the solid, holds off whatever of the mesh is beyond it by as much as these are
apart. Of two convex models that is everything: where the nearest points are found, the search ends.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.lanes import lowest, not_above
from ..base.memory import on_stack
from ..base.rounding import DOUBLE_EPS, GAP_SHARE
from ..base.vectors import dot, norm, scaled, turned_back
from ..bounds.cross import along_node
from ..elements.primitives import corners
from ..revolution.reach import reach_of
from ..surface.facing import vector
from ..tree.layout import WIDTH, first_of, last_of, row

_ALL = (1 << WIDTH) - 1

_NODES, _OPEN = 16, 64
"""Nodes of a mesh that are looked at for one plane at most, and those that may be open."""

PLANE_STEPS = 4
"""Steps of a search that laying a plane takes as long as, besides one for each node."""

_CONVEX = 0.9
"""Share of the limit that a plane has to hold off of the nearest triangle for it to be of use."""

_ROUNDING = 64.0 * DOUBLE_EPS
"""What a reach along a unit vector errs by, as a share of the length P that arcs err by a share of
and of the frame's distance from the origin: the products with the frame's axes err by less than 12
u P, as these are perpendicular, and units, but for 4 u each, and that with its origin by 4 u."""


@kernel
def _reach_along(tree, n):
    """How far a solid of revolution reaches along a unit vector of its frame, at most; metres."""
    frame = tree.frame
    x, y, z = dot(row(frame, 0), n), dot(row(frame, 1), n), dot(row(frame, 2), n)
    origin = row(frame, 3)
    across = np.sqrt(x * x + y * y)
    reach = reach_of(tree, tree.arcs[:0], 0, 0.0, across, z, -np.inf)
    return dot(origin, n) + reach + _ROUNDING * (frame[4, 0] + norm(origin))


@kernel
def lay_plane(surface, mesh, state, flip):
    """Lay a plane against a solid of revolution, across the way between the nearest points.

    `flip` says that the solid is b. Where the plane holds off all of the mesh, nothing is open
    then. Returns the steps that this took.
    """
    progress = state.progress[0]
    plane = progress.plane
    n, own = vector(progress.normal_b), vector(progress.normal_a)
    if flip:
        n, own = scaled(own, -1.0), scaled(n, -1.0)
    plane[0], plane[1], plane[2] = n
    plane[3] = _reach_along(surface, own) - progress.offset + GAP_SHARE * progress.slack
    plane[4] = progress.distance
    t = progress.element_a if flip else progress.element_b
    if begin_of(mesh, t, n) - plane[3] < _CONVEX * progress.limit:
        plane[3] = np.inf  # the solid reaches farther elsewhere
        return PLANE_STEPS
    held, nodes = _holds_all(mesh, progress)
    if held:
        progress.open = progress.waiting = 0
    return PLANE_STEPS + nodes


@kernel
def plane_across(surface, motion, normal, slack):
    """The plane laid against a solid of revolution across a unit vector of the profile's frame.

    `motion` leads from the mesh to the solid's frame. Returns what `progress.plane` begins with:
    a vector that is no longer than a unit, in the mesh's frame, and how far the solid reaches.

    The products with the mesh's points err by 11.9 u of these, as those of b in GAP_SHARE, and the
    mesh may be a: twice the slack holds 20 u of either.
    """
    f, share = surface.frame, 1.0 - 16.0 * DOUBLE_EPS
    x, y, z = share * normal[0], share * normal[1], share * normal[2]
    n = (
        x * f[0, 0] + y * f[1, 0] + z * f[2, 0],
        x * f[0, 1] + y * f[1, 1] + z * f[2, 1],
        x * f[0, 2] + y * f[1, 2] + z * f[2, 2],
    )
    end = _reach_along(surface, n) - dot(n, (motion[9], motion[10], motion[11])) + 2.0 * slack
    return turned_back(motion, n), end


@kernel
def _holds_all(mesh, progress):
    """Whether a plane holds off all triangles of a mesh, and how many nodes that took to see."""
    stack, lows = on_stack(_OPEN, np.int32(0)), on_stack(WIDTH, np.float32(0.0))
    stack[0] = mesh.children[0]
    top, nodes = 1, 0
    while top > 0:
        top -= 1
        child = np.int64(stack[top])
        if child < 0:
            for t in range(first_of(child), last_of(child) + 1):
                if not is_held_off(mesh, t, progress):
                    return False, nodes
            continue
        nodes += 1
        if nodes > _NODES or top + WIDTH > _OPEN:
            return False, nodes
        left = lanes_before(mesh, child, progress, progress.limit, lows)
        while left:
            k = lowest(left)
            left &= left - 1
            stack[top] = mesh.children[child * WIDTH + k]
            top += 1
    return True, nodes


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
    return begin_of(mesh, t, vector(progress.plane)) - progress.plane[3] >= progress.limit


@inlined
def begin_of(mesh, t, n):
    """Where a triangle begins along a vector, metres."""
    a, b, c = corners(mesh.triangles, t)
    return min(min(dot(a, n), dot(b, n)), dot(c, n))
