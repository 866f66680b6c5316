"""From two poses to the relative motions that a search uses.

A motion is twelve numbers: a row-major rotation matrix, then the translation in metres.
"""

from __future__ import annotations

from .jit import entry, kernel
from .precise import dot_precise, two_sum
from .rounding import (
    LARGEST_COORDINATE,
    POINT_FLOOR,
    POINT_MARGIN,
    POSE_MARGIN,
    RIGID_TOLERANCE,
)


@kernel
def deviation(pose):
    """Return the largest entry of |RᵀR - I| and of the last row's difference from (0, 0, 0, 1).

    Return infinity if the pose is not finite, mirrors, or lies beyond the largest coordinate.
    """
    worst = 0.0
    for i in range(3):
        for j in range(3):
            product = pose[0, i] * pose[0, j] + pose[1, i] * pose[1, j] + pose[2, i] * pose[2, j]
            worst = max(worst, abs(product - (1.0 if i == j else 0.0)))
    for j in range(4):
        worst = max(worst, abs(pose[3, j] - (1.0 if j == 3 else 0.0)))
    determinant = (
        pose[0, 0] * (pose[1, 1] * pose[2, 2] - pose[1, 2] * pose[2, 1])
        - pose[0, 1] * (pose[1, 0] * pose[2, 2] - pose[1, 2] * pose[2, 0])
        + pose[0, 2] * (pose[1, 0] * pose[2, 1] - pose[1, 1] * pose[2, 0])
    )
    for i in range(3):
        if not abs(pose[i, 3]) <= LARGEST_COORDINATE:  # also true for a NaN
            return float("inf")
    bottom = pose[3, 0] + pose[3, 1] + pose[3, 2] + pose[3, 3]
    # Each comparison is false for a NaN.
    if determinant > 0.0 and bottom < 2.0:
        return worst
    return float("inf")


@entry
def pose_deviation(pose):
    """Return `deviation`; this is the entry for Python."""
    return deviation(pose)


@kernel
def is_rigid(error):
    """Return whether a pose with this `deviation` preserves lengths to RIGID_TOLERANCE.

    The relative change of a length is |RᵀR - I| / 2.
    """
    return error <= 2.0 * RIGID_TOLERANCE


@kernel
def relative_motions(pose_a, pose_b, b_to_a, a_to_b):
    """Write the motions between two models' frames, from their poses in the world.

    The translations are subtracted first, in the world frame. So models that are near each other
    keep their precision however far both are from the origin. Every number of `b_to_a` is rounded
    only once, because its error moves all of b. The transpose serves as the inverse. The distance
    is taken in a's frame after `b_to_a`, as in PQP, FCL and coal, so a pose of six digits gives the
    same answer in all of them. `a_to_b` is used only for bounds, whose margin covers its difference
    from an exact inverse.
    """
    x, dx = two_sum(pose_b[0, 3], -pose_a[0, 3])
    y, dy = two_sum(pose_b[1, 3], -pose_a[1, 3])
    z, dz = two_sum(pose_b[2, 3], -pose_a[2, 3])
    none = (0.0, 0.0, 0.0)
    for i in range(3):
        row = (pose_a[0, i], pose_a[1, i], pose_a[2, i])
        for j in range(3):
            column = (pose_b[0, j], pose_b[1, j], pose_b[2, j])
            product = dot_precise(row, column, none)
            b_to_a[3 * i + j] = product
            a_to_b[3 * j + i] = product
        b_to_a[9 + i] = dot_precise(row, (x, y, z), (dx, dy, dz))
        a_to_b[9 + i] = -(pose_b[0, i] * x + pose_b[1, i] * y + pose_b[2, i] * z)


@kernel
def slack_of_bounds(size_a, size_b, apart, error):
    """Return the largest error (m) of a point moved by one of the `relative_motions`.

    No point of a model lies farther from the model's origin than its size (m). The origins are
    `apart` metres apart. `error` is the sum of both poses' `deviation`.
    """
    imperfect = POINT_MARGIN + POSE_MARGIN * error
    return imperfect * (size_a + size_b + apart) + POINT_FLOOR


@entry
def relative_motion_pair(pose_a, pose_b, size_a, size_b, motions):
    """Write the motions (2, 12), b to a and a to b; return `slack_of_bounds`."""
    relative_motions(pose_a, pose_b, motions[0], motions[1])
    t = motions[0]
    apart = abs(t[9]) + abs(t[10]) + abs(t[11])
    return slack_of_bounds(size_a, size_b, apart, deviation(pose_a) + deviation(pose_b))
