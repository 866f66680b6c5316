"""Write the feet of the largest ball found: the surface points nearest to its centre."""

from __future__ import annotations

from ..base.jit import entry, kernel
from ..base.state import (
    FEATURE_A,
    FEATURE_B,
    POINT_A,
    POINT_B,
    RADIUS_A,
    SURFACE_A,
    SURFACE_B,
)
from ..base.trees import SWEPT, MeshTree
from ..base.vectors import moved
from .ball_point import place_of
from .ball_state import OF_CELLS, ball_at
from .feet import foot_of
from .solid_table import solid_at

_POINTS, _FEATURES = (POINT_A, POINT_B), (FEATURE_A, FEATURE_B)
_SURFACES = SURFACE_A, SURFACE_B


KIND_A = KIND_B = MeshTree
"""The kinds of both trees. Other entries substitute other kinds (see pairs/balls.py)."""


@entry
def write_ball(solids, memory, pose_a, pose_b, row, first):
    """Write to an answer `row` (ANSWER,) the boundary points of both solids nearest to the centre.

    `first` tells which model of the answer, 0 or 1, the first solid is.
    """
    tree_a, labels_a, _ = solid_at(KIND_A, solids[0])
    tree_b, labels_b, _ = solid_at(KIND_B, solids[1])
    state = ball_at(OF_CELLS, memory)
    write_foot(tree_a, labels_a, state, 0, pose_a, row, first)
    write_foot(tree_b, labels_b, state, 1, pose_b, row, 1 - first)
    write_surface(state.best[0].way[0], pose_a, tree_a.scale[SWEPT], row, first)
    write_surface(state.best[0].way[1], pose_a, tree_b.scale[SWEPT], row, 1 - first)


@kernel
def write_foot(tree, labels, state, k, pose, row, side):
    """Write the foot of the best point on the nearest element of solid k."""
    best = state.best[0]
    place, parameters = foot_of(tree, moved(state.motions[k], place_of(best)), k, best)
    write_point(pose, place, parameters, labels[best.near[k]], row, side)


@kernel
def write_point(pose, place, parameters, label, row, side):
    """Write to an answer a model's point, converted to the world, its parameters and its label.

    `place` is in the model's frame.
    """
    placed = in_world(pose, place)
    point, feature = _POINTS[side], _FEATURES[side]
    for i in range(3):
        row[point + i], row[feature + i] = placed[i], parameters[i]
    row[feature + 3] = label


@kernel
def in_world(pose, x):
    """Return point x, of the frame at `pose`, in the world."""
    return (
        pose[0, 0] * x[0] + pose[0, 1] * x[1] + pose[0, 2] * x[2] + pose[0, 3],
        pose[1, 0] * x[0] + pose[1, 1] * x[1] + pose[1, 2] * x[2] + pose[1, 3],
        pose[2, 0] * x[0] + pose[2, 1] * x[1] + pose[2, 2] * x[2] + pose[2, 3],
    )


@kernel
def write_surface(way, pose, swept, row, side):
    """Write the point of a swept surface; the point of its core is in the row already.

    `way` points into the solid, in the frame of `pose`. It does not matter if nothing is swept.
    """
    row[RADIUS_A + side] = -1.0
    for i in range(3):
        inward = pose[i, 0] * way[0] + pose[i, 1] * way[1] + pose[i, 2] * way[2]
        row[_SURFACES[side] + i] = row[_POINTS[side] + i] - swept * inward
