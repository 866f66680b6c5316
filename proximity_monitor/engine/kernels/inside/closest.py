"""The nearest points of one hierarchy to many points in the world."""

from __future__ import annotations

import numpy as np

from ..base.jit import entry, kernel
from ..base.memory import on_stack
from ..base.rounding import OFFSET_MARGIN, POINT_FLOOR, POINT_MARGIN
from ..base.tables import tree_at
from ..base.trees import DEVIATION, SWEPT, MeshTree
from ..base.vectors import along, cross, dot, face_normal, scaled, sub, unit
from ..elements.primitives import corners, mixed
from ..elements.swept import core_of, lower_of, surface_points, upper_of
from ..tree.layout import WIDTH
from .angles import side_of
from .nearest import Point, answer_at, begin_nearest, point_triangle
from .solid_table import solid_at
from .solids import NOWHERE
from .tolerance import distance_of, share_of_error, spare_of_error
from .visit import descend

NONE = -1
"""The triangle of a point that is not done, or farther than the largest distance asked for."""

_ONE_POINT = 4
"""Cost of a point in `closest_points`, in steps, besides its descent."""

_SIDE = 4
"""Cost of a point in `sides`, in steps, besides finding its side."""

TELLING = 1e-6
"""Share of the model's size. If sides are asked for, distances up to it are found even if they are
beyond the largest distance: near a surface, rounding hides the side of a point."""


@entry
def closest_points(
    model, pose, points, max_distance, rel_err, abs_err, signed, first, steps,
    stack, stacked, going, bounds, feet, triangles, normals,
):  # fmt: skip
    """Find the points of a mesh at `pose` nearest to points (k, 3) in the world, from `first` on.

    `model` is the table of the mesh's hierarchy. The volumes may be of any kind, because boxes may
    be taken for swept spheres. The point found may be farther than the nearest one by the relative
    or the absolute error, whichever is larger.

    Returns how many points are done: all, or as many as fit into about `steps` steps. The search
    for the next point may then be under way: `going` (3,) holds its distance so far, its triangle,
    and the number of its entries in `stack` and `stacked`; all three are 0 if none is under way.

    Writes certified `bounds` (k, 2) and `triangles` (k,) in tree order. For points nearer than
    `max_distance` metres, also writes `feet` (k, 3) in the world and `normals` (k, 3), which may
    be (0, 3). For other points, the triangle is NONE and the upper bound infinite. If `signed`, the
    bounds are those of the distance to the triangles, and no feet or normals are written; `sides`
    turns this into answers.
    """
    tree, _ = tree_at(MeshTree, model)
    found = on_stack(WIDTH, np.float32(0.0))
    radius, deviation = tree.scale[SWEPT], tree.scale[DEVIATION]
    farthest = core_of(max_distance, radius, deviation)
    telling = TELLING * tree.scale[2] if signed else 0.0
    share = share_of_error(rel_err)
    for k in range(first, points.shape[0]):
        if steps <= 0:
            return k
        p, slack = image_of(tree, pose, points, k)
        spare = spare_of_error(tree, abs_err, slack)
        query = Point(p, slack, share, spare, radius)
        # A point at this distance is beyond `farthest` even after rounding by one slack.
        beyond = distance_of(farthest + slack, share, spare, radius)
        distance, nearby, top = going[0], np.int64(going[1]), np.int64(going[2])
        if top == 0:
            steps -= _ONE_POINT
            nearby = max(np.int64(triangles[k - 1]), 0) if k > 0 else 0
            distance, nearby, top = begin_nearest(tree, p, nearby, stack, stacked)
            told = distance_of(telling, share, spare, radius)
            distance = min(distance, max(beyond, told))
        answer = answer_at(query, distance, nearby)
        answer, top, steps = descend(query, tree, answer, top, stack, stacked, found, max(steps, 1))
        distance, nearby, least = answer
        going[0], going[1], going[2] = distance, nearby, top
        if top > 0:
            return k
        near = distance < beyond
        triangles[k] = nearby if near else NONE
        if signed:
            bounds[k, 0] = max(least, 0.0)
            bounds[k, 1] = distance + slack if near else np.inf
            continue
        bounds[k, 0] = max(lower_of(least, radius, deviation), 0.0)
        bounds[k, 1] = np.inf
        if near:
            bounds[k, 1] = upper_of(distance + slack, radius, deviation)
            _surface(tree, pose, p, nearby, 0, slack, k, feet, normals)
    return points.shape[0]


@entry
def sides(
    solid, pose, points, first, last, steps, stack, bounds, feet, triangles, normals
):  # fmt: skip
    """Turn the results of `closest_points` for points `first` to `last` into signed answers.

    `solid` is the table of the hierarchy of all triangles and of its Region. Returns how many
    points are done: `last`, or as many as fit into about `steps` steps, at least one more.
    """
    tree, _, region = solid_at(MeshTree, solid)
    gaps = on_stack(WIDTH, np.float32(0.0))
    radius, deviation = tree.scale[SWEPT], tree.scale[DEVIATION]
    for k in range(first, last):
        if steps <= 0:
            return k
        steps -= _SIDE
        p, slack = image_of(tree, pose, points, k)
        low, high = bounds[k, 0], bounds[k, 1]
        side = -1
        if region.inside != NOWHERE:
            side = 0
            if low > 2.0 * slack:
                side, _, cost = side_of(tree, region, p, low, slack, stack, gaps)
                steps -= cost
        bounds[k, 0] = lower_of(low if side < 0 else -high, radius, deviation)
        bounds[k, 1] = _signed_upper_of(-low if side > 0 else high, radius, deviation)
        if triangles[k] != NONE:
            _surface(tree, pose, p, triangles[k], side, slack, k, feet, normals)
    return last


@kernel
def image_of(tree, pose, points, k):
    """Return point k in the model's frame, and the slack of it and of its distance, metres."""
    d = (points[k, 0] - pose[0, 3], points[k, 1] - pose[1, 3], points[k, 2] - pose[2, 3])
    p = (
        pose[0, 0] * d[0] + pose[1, 0] * d[1] + pose[2, 0] * d[2],
        pose[0, 1] * d[0] + pose[1, 1] * d[1] + pose[2, 1] * d[2],
        pose[0, 2] * d[0] + pose[1, 2] * d[1] + pose[2, 2] * d[2],
    )
    return p, POINT_MARGIN * (abs(p[0]) + abs(p[1]) + abs(p[2]) + tree.scale[2]) + POINT_FLOOR


@kernel
def _signed_upper_of(core, radius, deviation):
    """Return an upper bound of the signed distance, metres, from the core's; see swept.py."""
    if radius + deviation == 0.0:
        return core
    return core - radius + deviation + OFFSET_MARGIN * (abs(core) + radius + deviation)


@kernel
def _surface(tree, pose, p, t, side, slack, k, feet, normals):
    """Write to row k the surface point nearest to p, and its normal, in the world.

    p is in the model's frame; t is its nearest triangle. `side` is 1 if p is inside the core, -1 if
    outside. With 0 the distance is unsigned: a point within the swept balls is its own nearest
    point.
    """
    radius = tree.scale[SWEPT]
    triangle = corners(tree.triangles, t)
    _, v, w = point_triangle(p, triangle[0], triangle[1], triangle[2])
    core = mixed(triangle, (max(1.0 - v - w, 0.0), v, w))
    normal = face_normal(triangle)
    if radius > 0.0:
        way = sub(p, core)
        if dot(way, way) > slack * slack:
            normal = scaled(unit(way), -1.0 if side > 0 else 1.0)
        elif side != 0 and dot(normal, normal) == 0.0:
            normal = _perpendicular(triangle)
    foot = along(core, normal, radius)
    if side == 0:
        foot, _ = surface_points(core, p, radius, 0.0)
    for i in range(3):
        feet[k, i] = pose[i, 3]
        for j in range(3):
            feet[k, i] += pose[i, j] * foot[j]
    if k < normals.shape[0]:
        for i in range(3):
            normals[k, i] = pose[i, 0] * normal[0] + pose[i, 1] * normal[1] + pose[i, 2] * normal[2]


@kernel
def _perpendicular(triangle):
    """Return a unit vector perpendicular to a triangle without area."""
    e, f = sub(triangle[1], triangle[0]), sub(triangle[2], triangle[0])
    e = unit(e if dot(e, e) > dot(f, f) else f)
    if abs(e[0]) <= min(abs(e[1]), abs(e[2])):
        axis = (1.0, 0.0, 0.0)
    elif abs(e[1]) <= abs(e[2]):
        axis = (0.0, 1.0, 0.0)
    else:
        axis = (0.0, 0.0, 1.0)
    normal = unit(cross(e, axis))
    return normal if dot(normal, normal) > 0.0 else axis
