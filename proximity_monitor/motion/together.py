"""Several motions at once; each drives its own bodies and joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from proximity_monitor.motion.motion import Motion, common_period


class Together(Motion):
    """The union of motions."""

    def __init__(self, parts: Sequence[Motion]) -> None:
        """Keep the parts.

        Raises:
            ValueError: two parts drive the same body.
        """
        self._parts = tuple(parts)
        bodies = self.bodies
        for name in bodies:
            if bodies.count(name) > 1:
                raise ValueError(f"motion: {name!r} is driven by more than one effect")

    @property
    def bodies(self) -> tuple[str, ...]:
        """All driven bodies, in the order of the parts."""
        return tuple(name for part in self._parts for name in part.bodies)

    @property
    def period_s(self) -> float | None:
        """Seconds after which all parts repeat at once, or are at rest; None if that never is.

        The parts repeat at once after the least common multiple of their periods. If some repeat
        and others come to rest, the union does neither.
        """
        periods = [part.period_s for part in self._parts]
        if None in periods:
            return None
        if not self.repeats:
            return max(periods)
        return common_period(periods) if all(part.repeats for part in self._parts) else None

    @property
    def once_s(self) -> float | None:
        """The time until each part was shown once; None if a part has no end."""
        lengths = [part.once_s for part in self._parts]
        return None if None in lengths else max(lengths)

    @property
    def repeats(self) -> bool:
        """Whether any part goes on after its period."""
        return any(part.repeats for part in self._parts)

    def seek(self, t: float) -> None:
        """Prepare all parts for times from t seconds on.

        Raises:
            ValueError: t is not finite.
        """
        for part in self._parts:
            part.seek(t)

    def poses(self, t: float) -> dict[str, np.ndarray]:
        """Return the poses (4, 4) of all bodies at t seconds.

        Raises:
            ValueError: t is not finite.
        """
        return {name: pose for part in self._parts for name, pose in part.poses(t).items()}

    @property
    def control_names(self) -> dict[str, str]:
        """The name of the control points of each deforming body."""
        return {name: each for part in self._parts for name, each in part.control_names.items()}

    def control_points(self, t: float) -> dict[str, np.ndarray]:
        """Return the control points (n, 3) of all deforming bodies at t seconds.

        Raises:
            ValueError: t is not finite.
        """
        return {name: each for part in self._parts for name, each in part.control_points(t).items()}

    def joints(self, t: float) -> dict[str, float]:
        """Return the positions of all joints at t seconds.

        Raises:
            ValueError: t is not finite.
        """
        return {name: each for part in self._parts for name, each in part.joints(t).items()}

    @property
    def trouble(self) -> str:
        """What went wrong so far in any part; empty if all is well."""
        return "; ".join(part.trouble for part in self._parts if part.trouble)

    def describe(self) -> str:
        """Return the parts' lines."""
        return "\n".join(part.describe() for part in self._parts)
