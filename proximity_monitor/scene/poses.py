"""Position and quaternion to a pose matrix."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

#: How far a quaternion's length may be from 1. People and messages round to three digits or more;
#: anything further off is a mistake (an axis and an angle, wxyz order with a bad number, zeros).
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
    x, y, z, w = (part / length for part in quaternion)
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = position
    return pose
