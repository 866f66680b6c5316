"""The nearest points of one hierarchy to many points in the world."""

from __future__ import annotations

import numpy as np

from ..tolerances import POINT_FLOOR, POINT_MARGIN
from .jit import entry
from .memory import on_stack
from .nearest import begin_nearest, nearest, point_triangle
from .primitives import corners, mixed
from .state import DEVIATION, SWEPT
from .swept import lower_of, surface_points, upper_of
from .volumes import WIDTH

_TO_THE_END = 1 << 62


@entry
def closest_points(tree, pose, points, stack, bounds, answers, feet, triangles):
    """Nearest points on a model at `pose` to points (k, 3) in the world.

    Writes answers (k, 2) the certified bounds, feet (k, 3) in the world, and triangles (k,) in
    tree order.
    """
    found = on_stack(WIDTH, np.float32(0.0))
    nearby, radius = 0, tree.scale[SWEPT]
    for k in range(points.shape[0]):
        d = (points[k, 0] - pose[0, 3], points[k, 1] - pose[1, 3], points[k, 2] - pose[2, 3])
        p = (
            pose[0, 0] * d[0] + pose[1, 0] * d[1] + pose[2, 0] * d[2],
            pose[0, 1] * d[0] + pose[1, 1] * d[1] + pose[2, 1] * d[2],
            pose[0, 2] * d[0] + pose[1, 2] * d[1] + pose[2, 2] * d[2],
        )
        slack = POINT_MARGIN * (abs(p[0]) + abs(p[1]) + abs(p[2]) + tree.scale[2]) + POINT_FLOOR
        distance, nearby, top = begin_nearest(tree, p, nearby, stack, bounds)
        distance, nearby, _, _ = nearest(
            tree, p, distance, nearby, top, slack, 0.0, stack, bounds, found, _TO_THE_END
        )
        answers[k, 0] = max(lower_of(distance - slack, radius, tree.scale[DEVIATION]), 0.0)
        answers[k, 1] = upper_of(distance + slack, radius, tree.scale[DEVIATION])
        triangles[k] = nearby
        a, b, c = corners(tree.triangles, nearby)
        _, v, w = point_triangle(p, a, b, c)
        foot = mixed((a, b, c), (max(1.0 - v - w, 0.0), v, w))
        foot, _ = surface_points(foot, p, radius, 0.0)
        for i in range(3):
            feet[k, i] = pose[i, 3]
            for j in range(3):
                feet[k, i] += pose[i, j] * foot[j]
