"""The interface of every motion."""

from __future__ import annotations

from typing import Protocol

import numpy as np


class Motion(Protocol):
    """Poses of some of a scene's bodies as a function of time.

    An implementation derives from this class, and so has no control points and no joints unless it
    says otherwise. It may be stateful: asking for a time advances it to there, and a time before
    the last one starts it again from the beginning, or, in real time, waits there.
    """

    @property
    def bodies(self) -> tuple[str, ...]:
        """The names of the driven bodies."""

    @property
    def period_s(self) -> float | None:
        """Seconds after which the motion repeats or rests; None if it does neither."""

    @property
    def repeats(self) -> bool:
        """Whether the motion begins again after its period; else it rests."""
        return True

    def seek(self, t: float) -> None:
        """Prepare for times from t seconds on, however long that takes.

        Only a motion that may fall behind in real time needs it (see `motion.from_scene`).

        Raises:
            ValueError: t is not finite.
        """

    def poses(self, t: float) -> dict[str, np.ndarray]:
        """Return the pose of each driven body at time t.

        Args:
            t: seconds since the start of the motion.

        Returns:
            (4, 4) float64 matrices that map a model to the world, metres, by body name. A body
            whose pose is still unknown, as before its first recorded pose, is left out.

        Raises:
            ValueError: t is not finite.
        """

    @property
    def control_names(self) -> dict[str, str]:
        """What the control points of each deforming body are called, as `engine.Model` has it."""
        return {}

    def control_points(self, t: float) -> dict[str, np.ndarray]:
        """Return the control points of each deforming body at time t, as `engine.Model` has them.

        Returns:
            By body name, (n, 3) float64 in the frame of its model, in metres.

        Raises:
            ValueError: t is not finite.
        """
        return {}

    def joints(self, t: float) -> dict[str, float]:
        """Return the position of each driven joint of a robot at time t, in radians or metres.

        Raises:
            ValueError: t is not finite.
        """
        return {}

    @property
    def trouble(self) -> str:
        """What went wrong so far and is no error, and the way out; empty if all is well."""
        return ""

    def describe(self) -> str:
        """Return one line an effect: what runs, on how many bodies and how fast."""


def counted(number: int, one: str, many: str) -> str:
    """Return e.g. ``1 body`` or ``2 bodies``."""
    return f"{number} {one if number == 1 else many}"


def within_period(t: float, period_s: float) -> float:
    """Return the time within a period, seconds. Its end belongs to it, so that this is shown."""
    return t % period_s or (period_s if t > 0.0 else 0.0)
