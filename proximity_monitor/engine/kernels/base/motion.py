"""From two poses to the relative motions that the search works with.

A motion is twelve numbers: a row-major rotation and the translation, in metres.
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
    """Largest entry of |RᵀR - I| and of the last row's difference from (0, 0, 0, 1).

    Infinity where the pose is not finite, mirrors, or lies beyond the largest coordinate.
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
        if not abs(pose[i, 3]) <= LARGEST_COORDINATE:  # nor is a NaN
            return float("inf")
    bottom = pose[3, 0] + pose[3, 1] + pose[3, 2] + pose[3, 3]
    # Each comparison is false for a NaN.
    if determinant > 0.0 and bottom < 2.0:
        return worst
    return float("inf")


@entry
def pose_deviation(pose):
    """`deviation`, for Python."""
    return deviation(pose)


@kernel
def is_rigid(error):
    """Whether a pose of that `deviation` keeps lengths to RIGID_TOLERANCE: |RᵀR - I| / 2."""
    return error <= 2.0 * RIGID_TOLERANCE


@kernel
def relative_motions(pose_a, pose_b, b_to_a, a_to_b):
    """Write the motions between two models' frames, from their poses in the world.

    The translations are subtracted first, in the world: models that are near each other keep their
    precision however far both are from the origin. Every number of `b_to_a` is rounded once, for
    what it errs by moves all of b. The transpose serves as the inverse; the
    distance is the one in a's frame after `b_to_a`, as PQP, FCL and coal take it too, so a pose of
    six digits gives the same answer in all of them. `a_to_b` serves bounds alone, whose margin
    pays for what is missing to an exact inverse.
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
    """What a point that was moved by one of `relative_motions` errs by, metres.

    No point of the models lies farther from its origin than the sizes, the origins are `apart`, and
    `error` is the sum of both poses' `deviation`.
    """
    imperfect = POINT_MARGIN + POSE_MARGIN * error
    return imperfect * (size_a + size_b + apart) + POINT_FLOOR


@entry
def relative_motion_pair(pose_a, pose_b, size_a, size_b, motions):
    """Write the motions (2, 12) b to a and a to b; returns `slack_of_bounds`."""
    relative_motions(pose_a, pose_b, motions[0], motions[1])
    t = motions[0]
    apart = abs(t[9]) + abs(t[10]) + abs(t[11])
    return slack_of_bounds(size_a, size_b, apart, deviation(pose_a) + deviation(pose_b))
