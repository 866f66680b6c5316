"""The state of rigid bodies: poses and motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass
class RigidBodyState:
    """The state of all bodies, one row per body, in the world frame.

    Attributes:
        centre: (n, 3) metres, the centre of mass.
        turn: (n, 4) unit quaternions w, x, y, z: model to world.
        velocity: (n, 3) metres per second, of the centre of mass.
        momentum: (n, 3) kg m²/s, angular momentum about the centre of mass.
    """

    centre: NDArray[np.float64]
    turn: NDArray[np.float64]
    velocity: NDArray[np.float64]
    momentum: NDArray[np.float64]

    def copy(self) -> RigidBodyState:
        """Return a copy with its own arrays."""
        return RigidBodyState(*(array.copy() for array in vars(self).values()))


def quaternion(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unit quaternion w, x, y, z of a rotation (3, 3) (Shepperd 1978)."""
    r = rotation
    trace = np.trace(r)
    squares = np.array([trace, *(2.0 * np.diag(r) - trace)])
    k = int(np.argmax(squares))
    outer = np.array(
        [
            [1 + trace, r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
            [0.0, 1 + squares[1], r[0, 1] + r[1, 0], r[2, 0] + r[0, 2]],
            [0.0, 0.0, 1 + squares[2], r[1, 2] + r[2, 1]],
            [0.0, 0.0, 0.0, 1 + squares[3]],
        ]
    )
    outer += np.triu(outer, 1).T
    return outer[k] / np.linalg.norm(outer[k])
