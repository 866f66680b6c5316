"""Where the surfaces are nearest to the centre of the largest ball found, or to a deepest point."""

from __future__ import annotations

from ..base.jit import entry, kernel
from ..base.state import FEATURE_A, FEATURE_B, POINT_A, POINT_B, RADIUS_A, RADIUS_B, SWEPT
from ..base.vectors import dot, moved, sub
from ..elements.primitives import corners, mixed
from .ball_point import place_of
from .ball_state import CELL, PIECE, ball_at
from .nearest import point_triangle
from .solid_table import solid_at

_POINTS, _FEATURES = (POINT_A, POINT_B), (FEATURE_A, FEATURE_B)


@entry
def write_ball(solids, memory, pose_a, pose_b, row):
    """Write the boundary points of both solids nearest to the centre into an answer (ANSWER,)."""
    tree_a, faces_a, _ = solid_at(solids[0])
    tree_b, faces_b, _ = solid_at(solids[1])
    state = ball_at(CELL, memory)
    _write_foot(tree_a, faces_a, state, 0, pose_a, row, 0)
    _write_foot(tree_b, faces_b, state, 1, pose_b, row, 1)
    best = state.best[0]
    centre = _in_world(pose_a, place_of(best))
    a = (row[POINT_A], row[POINT_A + 1], row[POINT_A + 2])
    b = (row[POINT_B], row[POINT_B + 1], row[POINT_B + 2])
    row[RADIUS_A] = _aimed(centre, a, b, best.side[0]) * tree_a.scale[SWEPT]
    row[RADIUS_B] = _aimed(centre, b, a, best.side[1]) * tree_b.scale[SWEPT]


@entry
def write_deepest(models, memory, solid, pose, pose_surface, row):
    """Write the deepest point of a surface, and the solid's nearest to it, into an answer.

    Args:
        models: (2, 2, n) tables, that of the solid first.
        memory: that of a search for the deepest point.
        solid: which of the two models of the answer the solid is, 0 or 1.
        pose: (4, 4) the solid's, model to world.
        pose_surface: (4, 4) the surface's.
        row: (ANSWER,) written.
    """
    tree, faces, _ = solid_at(models[0])
    surface, others, _ = solid_at(models[1])
    state = ball_at(PIECE, memory)
    _write_foot(tree, faces, state, 0, pose, row, solid)
    _write_foot(surface, others, state, 1, pose_surface, row, 1 - solid)
    row[RADIUS_A] = row[RADIUS_B] = 0.0
    row[RADIUS_A + solid] = -tree.scale[SWEPT]


@kernel
def _write_foot(tree, faces, state, k, pose, row, side):
    """Write the point of the nearest triangle of solid k that is nearest to the best point."""
    best = state.best[0]
    t = best.near[k]
    a, b, c = corners(tree.triangles, t)
    _, v, w = point_triangle(moved(state.motions[k], place_of(best)), a, b, c)
    weights = (max(1.0 - v - w, 0.0), v, w)
    foot = _in_world(pose, mixed((a, b, c), weights))
    point, feature = _POINTS[side], _FEATURES[side]
    for i in range(3):
        row[point + i], row[feature + i] = foot[i], weights[i]
    row[feature + 3] = faces[t]


@kernel
def _in_world(pose, x):
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
