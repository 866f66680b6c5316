"""What every motion offers."""

from __future__ import annotations

from typing import Protocol

import numpy as np


class Motion(Protocol):
    """Poses of some of a scene's bodies as a function of time."""

    @property
    def bodies(self) -> tuple[str, ...]:
        """The names of the bodies that this motion drives."""

    @property
    def period_s(self) -> float | None:
        """The time after which the poses repeat, in seconds; None where they do not."""

    def poses(self, t: float) -> dict[str, np.ndarray]:
        """Return the pose of each driven body at time t.

        Args:
            t: seconds since the start of the motion.

        Returns:
            By body name, a (4, 4) float64 matrix that maps its model to the world, in metres.

        Raises:
            ValueError: t is not finite.
        """

    def describe(self) -> str:
        """Return one line that says which effect runs, on how many bodies and how fast."""
