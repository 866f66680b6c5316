"""The interface of every motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

_MOST = 100
_SAME = 1e-6
"""As a share of a period: two moments no farther apart are one."""


class Motion(Protocol):
    """Poses of some of a scene's bodies as a function of time.

    An implementation derives from this class, so it has no control points and no joints unless it
    overrides these methods. It may be stateful: a request advances it to the requested time. If
    that time is before the last one, it starts again from the beginning or, in real time, waits.
    """

    @property
    def bodies(self) -> tuple[str, ...]:
        """The names of the driven bodies."""

    @property
    def period_s(self) -> float | None:
        """Seconds after which the motion repeats or comes to rest; None if it does neither."""

    @property
    def once_s(self) -> float | None:
        """Seconds until the whole motion was shown once; None if it never was."""
        return self.period_s

    @property
    def repeats(self) -> bool:
        """Whether the motion begins again after its period; otherwise it rests."""
        return True

    def seek(self, t: float) -> None:
        """Prepare for times from t seconds on, without a time limit.

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
            whose pose is not known yet, as before its first recorded pose, is left out.

        Raises:
            ValueError: t is not finite.
        """

    @property
    def control_names(self) -> dict[str, str]:
        """The name of the control points of each deforming body; see `engine.Model`."""
        return {}

    def control_points(self, t: float) -> dict[str, np.ndarray]:
        """Return the control points of each deforming body at time t; see `engine.Model`.

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
        """What went wrong so far without raising an error, and the remedy; empty if all is well."""
        return ""

    def describe(self) -> str:
        """Return one line per effect: what runs, on how many bodies and how fast."""


def common_period(periods: Sequence[float]) -> float | None:
    """Return the least common multiple of periods, seconds.

    None: there is none within `_MOST` times the longest of them.
    """
    longest = max(periods)
    for count in range(1, _MOST + 1):
        turns = [count * longest / each for each in periods]
        if all(abs(each - round(each)) <= _SAME for each in turns):
            return count * longest
    return None


def within_period(t: float, period_s: float) -> float:
    """Return the time within a period, seconds. A period includes its end, so the end is shown."""
    return t % period_s or (period_s if t > 0.0 else 0.0)
