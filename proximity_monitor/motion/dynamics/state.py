"""Where bodies are and how they move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass
class RigidBodyState:
    """A row a body, world frame.

    Attributes:
        centre: (n, 3) metres, of mass.
        turn: (n, 4) unit quaternions w, x, y, z: model to world.
        velocity: (n, 3) metres per second, of the centre of mass.
        momentum: (n, 3) kg m²/s, angular, about the centre of mass.
    """

    centre: NDArray[np.float64]
    turn: NDArray[np.float64]
    velocity: NDArray[np.float64]
    momentum: NDArray[np.float64]

    def copy(self) -> RigidBodyState:
        """Return the same in arrays of its own."""
        return RigidBodyState(*(array.copy() for array in vars(self).values()))
