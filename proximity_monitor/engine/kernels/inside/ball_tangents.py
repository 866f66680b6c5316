"""Bound a depth in a cell of space linearly, from the nearest triangle or point of a surface.

A point is no deeper than its distance d from any triangle T of the surface, and d is convex. Let c
be the centre of the cell and g the gradient of d at c. Then d(y) - d(c) - g · (y - c) is convex as
well, so it is largest at a corner of the cell. Let e be this largest value. Then everywhere in the
cell

    f(y) <= d(c) + e + g · (y - c) + r.

Around an edge or a corner that points into the solid, e is quadratic in the size of the cell. In
contrast, a plane above which the solid has nothing (`ball_caps`) must lie above both faces of the
edge.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import shared
from ..base.vectors import moved
from .ball_caps import PLANE
from .feet import facet_of
from .nearest import point_triangle


@shared
def tangent(tree, motion, k, at, point, centre, half, row):
    """Write a row of `CELL.rows` from the triangle nearest to a cell's centre; return whether.

    `point` is the POINT of the centre; the other arguments are as for `ball_caps.plane`. The row is
    raised by PLANE slacks: each distance errs by one slack, the rest by less than three.
    """
    if point.side[k] < 0 or not point.away[k] > 8.0 * at.slack:
        return False
    a, b, c = facet_of(tree, k, point)
    sign = 1.0 if point.side[k] > 0 else -1.0
    axes = at.axes
    x, y, z = 0.0, 0.0, 0.0
    for i in range(3):
        way = sign * point.way[k, i]
        x += axes[0, i] * way
        y += axes[1, i] * way
        z += axes[2, i] * way
    most = 0.0
    for corner in range(8):
        u = half[0] if corner & 1 else -half[0]
        v = half[1] if corner & 2 else -half[1]
        w = half[2] if corner & 4 else -half[2]
        p = moved(motion, (
            point.place[0] + u * axes[0, 0] + v * axes[1, 0] + w * axes[2, 0],
            point.place[1] + u * axes[0, 1] + v * axes[1, 1] + w * axes[2, 1],
            point.place[2] + u * axes[0, 2] + v * axes[1, 2] + w * axes[2, 2],
        ))  # fmt: skip
        away = np.sqrt(point_triangle(p, a, b, c)[0])
        most = max(most, away - point.away[k] - (u * x + v * y + w * z))
    row[0], row[1], row[2] = -x, -y, -z
    row[3] = point.away[k] + most + at.swept[k] + PLANE * at.slack
    row[3] -= x * centre[0] + y * centre[1] + z * centre[2]
    return True
