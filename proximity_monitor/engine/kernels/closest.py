"""The nearest points of one hierarchy to many points in the world."""

from __future__ import annotations

import numpy as np

from ..tolerances import POINT_FLOOR, POINT_MARGIN
from .jit import entry, kernel
from .memory import on_stack
from .nearest import begin_nearest, nearest, point_triangle
from .primitives import corners, mixed
from .state import DEVIATION, SWEPT
from .swept import core_of, lower_of, surface_points, upper_of
from .vectors import dot, face_normal, sub, unit
from .volumes import WIDTH

_TO_THE_END = 1 << 62

NONE = -1
"""The triangle of a point that is beyond the largest distance asked for, or not done."""

_ONE_POINT = 4
"""Steps that a point takes as long as besides those of its descent."""


@entry
def closest_points(
    tree, pose, points, max_distance, first, steps, stack, stacked, bounds, feet, triangles, normals
):
    """Nearest points on a model at `pose` to points (k, 3) in the world, from the first one on.

    Returns how many are done: all, or as many as about `steps` steps suffice for, at least one more
    than before. Writes bounds (k, 2), certified, and triangles (k,) in tree order, and of those
    nearer than `max_distance` metres feet (k, 3) in the world and their normals (k, 3), which may
    be (0, 3); of the others the triangle is NONE and the upper bound infinite. `stack` and
    `stacked` are scratch.
    """
    found = on_stack(WIDTH, np.float32(0.0))
    radius, deviation = tree.scale[SWEPT], tree.scale[DEVIATION]
    farthest = core_of(max_distance, radius, deviation)
    nearby = max(np.int64(triangles[first - 1]), 0) if first > 0 else 0
    for k in range(first, points.shape[0]):
        if steps <= 0:
            return k
        d = (points[k, 0] - pose[0, 3], points[k, 1] - pose[1, 3], points[k, 2] - pose[2, 3])
        p = _turned_back(pose, d)
        slack = POINT_MARGIN * (abs(p[0]) + abs(p[1]) + abs(p[2]) + tree.scale[2]) + POINT_FLOOR
        distance, nearby, top = begin_nearest(tree, p, nearby, stack, stacked)
        reach = farthest + 2.0 * slack  # less one slack it is beyond, whatever rounding does
        distance = min(distance, reach)
        distance, nearby, _, left = nearest(
            tree, p, distance, nearby, top, slack, 0.0, stack, stacked, found, _TO_THE_END
        )
        steps -= _ONE_POINT + _TO_THE_END - left
        bounds[k, 0] = max(lower_of(distance - slack, radius, deviation), 0.0)
        if distance == reach:
            bounds[k, 1], triangles[k] = np.inf, NONE
            continue
        bounds[k, 1] = upper_of(distance + slack, radius, deviation)
        triangles[k] = nearby
        triangle = corners(tree.triangles, nearby)
        _, v, w = point_triangle(p, triangle[0], triangle[1], triangle[2])
        core = mixed(triangle, (max(1.0 - v - w, 0.0), v, w))
        foot, _ = surface_points(core, p, radius, 0.0)
        for i in range(3):
            feet[k, i] = pose[i, 3]
            for j in range(3):
                feet[k, i] += pose[i, j] * foot[j]
        if k < normals.shape[0]:
            way = sub(p, core)
            normal = face_normal(triangle)
            if radius > 0.0 and dot(way, way) > slack * slack:
                normal = unit(way)
            for i in range(3):
                normals[k, i] = (
                    pose[i, 0] * normal[0] + pose[i, 1] * normal[1] + pose[i, 2] * normal[2]
                )
    return points.shape[0]


@kernel
def _turned_back(pose, d):
    """A vector of the world in the frame of a pose."""
    return (
        pose[0, 0] * d[0] + pose[1, 0] * d[1] + pose[2, 0] * d[2],
        pose[0, 1] * d[0] + pose[1, 1] * d[1] + pose[2, 1] * d[2],
        pose[0, 2] * d[0] + pose[1, 2] * d[1] + pose[2, 2] * d[2],
    )
