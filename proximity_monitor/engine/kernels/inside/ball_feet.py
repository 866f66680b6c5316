"""Where the surfaces are nearest to the centre of the largest ball found."""

from __future__ import annotations

from ..base.jit import entry, kernel
from ..base.state import FEATURE_A, FEATURE_B, POINT_A, POINT_B, RADIUS_A, RADIUS_B, SWEPT
from ..base.vectors import dot, moved, sub
from ..elements.primitives import corners, mixed
from .ball_point import place_of
from .ball_state import CELL, ball_at
from .nearest import point_triangle
from .solid_table import solid_at

_POINTS, _FEATURES = (POINT_A, POINT_B), (FEATURE_A, FEATURE_B)


@entry
def write_ball(solids, memory, pose_a, pose_b, row):
    """Write the boundary points of both solids nearest to the centre into an answer (ANSWER,)."""
    tree_a, faces_a, _ = solid_at(solids[0])
    tree_b, faces_b, _ = solid_at(solids[1])
    state = ball_at(CELL, memory)
    write_foot(tree_a, faces_a, state, 0, pose_a, row, 0)
    write_foot(tree_b, faces_b, state, 1, pose_b, row, 1)
    best = state.best[0]
    centre = in_world(pose_a, place_of(best))
    a = (row[POINT_A], row[POINT_A + 1], row[POINT_A + 2])
    b = (row[POINT_B], row[POINT_B + 1], row[POINT_B + 2])
    row[RADIUS_A] = _aimed(centre, a, b, best.side[0]) * tree_a.scale[SWEPT]
    row[RADIUS_B] = _aimed(centre, b, a, best.side[1]) * tree_b.scale[SWEPT]


@kernel
def write_foot(tree, faces, state, k, pose, row, side):
    """Write the point of the nearest triangle of solid k that is nearest to the best point."""
    best = state.best[0]
    t = best.near[k]
    a, b, c = corners(tree.triangles, t)
    _, v, w = point_triangle(moved(state.motions[k], place_of(best)), a, b, c)
    weights = (max(1.0 - v - w, 0.0), v, w)
    write_point(pose, mixed((a, b, c), weights), weights, faces[t], row, side)


@kernel
def write_point(pose, place, parameters, label, row, side):
    """Write a model's point into an answer: its place in the model's frame, and where it lies."""
    placed = in_world(pose, place)
    point, feature = _POINTS[side], _FEATURES[side]
    for i in range(3):
        row[point + i], row[feature + i] = placed[i], parameters[i]
    row[feature + 3] = label


@kernel
def in_world(pose, x):
    """A point in the world."""
    return (
        pose[0, 0] * x[0] + pose[0, 1] * x[1] + pose[0, 2] * x[2] + pose[0, 3],
        pose[1, 0] * x[0] + pose[1, 1] * x[1] + pose[1, 2] * x[2] + pose[1, 3],
        pose[2, 0] * x[0] + pose[2, 1] * x[1] + pose[2, 2] * x[2] + pose[2, 3],
    )


@kernel
def _aimed(centre, point, other, side):
    """The sign of the radius that leads from a core's point to the swept surface.

    An answer takes the surface's point along the way to the other core's point. A swept surface is
    nearest to a centre on the far side of it, seen from the core's point, or on the near side where
    the centre is inside the core.
    """
    away = dot(sub(centre, point), sub(other, point))
    return -1.0 if (away < 0.0) != (side > 0) else 1.0
