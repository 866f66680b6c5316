"""Makes pose and rotation matrices from positions, quaternions, axes and angles."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

_CROSS = np.array(
    [[0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]],
    dtype=np.float64,
)
"""A vector times this matrix gives the nine entries of the vector's cross product matrix."""

#: How far a quaternion's length may be from 1. People and messages round to three digits or more.
#: A larger error is a mistake (an axis and an angle, wxyz order with a bad number, zeros).
UNIT_LENGTH = 1e-3


def pose_matrix(position: Sequence[float], quaternion: Sequence[float]) -> np.ndarray:
    """Return the rigid motion that turns by a quaternion and then moves by a position.

    Args:
        position: (3,) x, y, z.
        quaternion: (4,) x, y, z, w, of length 1 to within `UNIT_LENGTH`; normalised exactly.

    Returns:
        (4, 4) float64.

    Raises:
        ValueError: a number is not finite, or the quaternion is not of length 1.
    """
    if not all(map(math.isfinite, (*position, *quaternion))):
        raise ValueError("position and quaternion must be finite")
    length = math.hypot(*quaternion)
    if abs(length - 1.0) > UNIT_LENGTH:
        raise ValueError(f"must have length 1 (got {length:.6g}); divide it by its length")
    rows = _rotation(*(part / length for part in quaternion))
    x, y, z = position
    return np.array([[*rows[0], x], [*rows[1], y], [*rows[2], z], [0.0, 0.0, 0.0, 1.0]], float)


def pose_matrices(positions: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
    """Return many rigid motions, as `pose_matrix` returns one; nothing is checked.

    Args:
        positions: (n, 3) x, y, z.
        quaternions: (n, 4) x, y, z, w of any length but 0; normalised exactly.

    Returns:
        (n, 4, 4) float64.
    """
    poses = np.zeros((len(positions), 4, 4))
    units = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    poses[:, :3, :3] = np.moveaxis(np.array(_rotation(*units.T)), -1, 0)
    poses[:, :3, 3] = positions
    poses[:, 3, 3] = 1.0
    return poses


def _rotation(x, y, z, w) -> list[list]:
    """Return the rotation of a unit quaternion, or of arrays of quaternions, row by row."""
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]


def rotations(axes: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Return right-handed rotations about axes by Rodrigues' formula, without cancellation.

    Args:
        axes: (..., 3) unit vectors, or 0 for no rotation.
        angles: (...) radians, of a shape that broadcasts with that of the axes.

    Returns:
        (..., 3, 3) float64.
    """
    cross = (axes @ _CROSS).reshape(*axes.shape[:-1], 3, 3)
    sine, versine = np.sin(angles), 2.0 * np.sin(0.5 * angles) ** 2
    return np.eye(3) + sine[..., None, None] * cross + versine[..., None, None] * (cross @ cross)


def rpy_matrix(rpy: Sequence[float]) -> np.ndarray:
    """Return the (3, 3) turn about the fixed x, y and z axes in this order, radians."""
    (sr, sp, sy), (cr, cp, cy) = ([f(angle) for angle in rpy] for f in (math.sin, math.cos))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def matrix_rpy(turn: np.ndarray) -> tuple[float, float, float]:
    """Return the angles, radians, for which `rpy_matrix` gives a (3, 3) rotation.

    If the pitch is a right angle, roll and yaw are not unique, but the returned two fit together.
    """
    yaw = math.atan2(turn[1, 0], turn[0, 0])
    sine, cosine = math.sin(yaw), math.cos(yaw)
    pitch = math.atan2(-turn[2, 0], cosine * turn[0, 0] + sine * turn[1, 0])
    roll = math.atan2(
        sine * turn[0, 2] - cosine * turn[1, 2], cosine * turn[1, 1] - sine * turn[0, 1]
    )
    return roll, pitch, yaw
