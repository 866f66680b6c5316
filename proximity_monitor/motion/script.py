"""Scripted motion: bodies and joints that follow timed keys."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from proximity_monitor.motion import screw
from proximity_monitor.motion.motion import Motion, within_period
from proximity_monitor.scene.naming import counted


class Script(Motion):
    """Bodies that move by screws between key poses, or on hinges and slides; and joints.

    A joint's position is linear between its keys. A body rests before its first key and after its
    last one. At the time of a key, the pose is exactly the key's pose.
    """

    def __init__(
        self,
        bodies: Mapping[str, Mapping[str, Any]],
        joints: Mapping[str, Mapping[str, np.ndarray]],
        loop: bool,
    ) -> None:
        """Make the paths.

        Args:
            bodies: by name, `times` (n,) in seconds, increasing from 0 or more, and one of these:
                key poses, as `positions` (n, 3) in metres and `quaternions` (n, 4) x, y, z, w of
                length 1; or `values` (n,) in radians for a `hinge` with `origin` (3,), `axis` (3,)
                of length 1 and `pose` (4, 4) at angle 0; or `values` (n,) in metres for a `slide`
                with `axis` and `pose`.
            joints: by name, `times` (n,) and `values` (n,) in radians or metres.
            loop: whether all begin again after the latest of all keys.
        """
        self._names = tuple(bodies)
        self._paths = screw.Paths([_path(**body) for body in bodies.values()])
        self._joints = {name: (each["times"], each["values"]) for name, each in joints.items()}
        followed = (*bodies.values(), *joints.values())
        self._end_s = max((float(each["times"][-1]) for each in followed), default=0.0)
        self._loop = loop

    @property
    def bodies(self) -> tuple[str, ...]:
        """The bodies that have a path, in the scene file's order."""
        return self._names

    @property
    def period_s(self) -> float | None:
        """The time of the latest of all keys, seconds; None if nothing moves."""
        return self._end_s or None

    @property
    def repeats(self) -> bool:
        """Whether the script plays in a loop."""
        return self._loop

    def poses(self, t: float) -> dict[str, np.ndarray]:
        """Return the poses (4, 4), model to world in metres, of all bodies at t seconds.

        Raises:
            ValueError: t is not finite.
        """
        return dict(zip(self._names, self._paths.at(self._time(t)), strict=True))

    def joints(self, t: float) -> dict[str, float]:
        """Return the joints' positions at t seconds, in radians or metres.

        Raises:
            ValueError: t is not finite.
        """
        now = self._time(t)
        return {name: float(np.interp(now, *keys)) for name, keys in self._joints.items()}

    def describe(self) -> str:
        """Return e.g. ``script: 3 bodies, 2 joints, 4 s in a loop``."""
        driven = [counted(len(self._names), "body", "bodies")] if self._names else []
        if self._joints:
            driven.append(counted(len(self._joints), "joint", "joints"))
        how = "in a loop" if self._loop else "once"
        return f"script: {', '.join(driven)}, {self._end_s:g} s {how}"

    def _time(self, t: float) -> float:
        """Return the time within the script, seconds."""
        if not math.isfinite(t):
            raise ValueError(f"t: must be finite (got {t})")
        return within_period(t, self._end_s) if self._loop and self._end_s else t


def _path(
    times: np.ndarray,
    positions: np.ndarray | None = None,
    quaternions: np.ndarray | None = None,
    values: np.ndarray | None = None,
    hinge: Mapping[str, np.ndarray] | None = None,
    slide: Mapping[str, np.ndarray] | None = None,
) -> screw.Path:
    if hinge is not None:
        return screw.hinged(times, values, **hinge)
    if slide is not None:
        return screw.sliding(times, values, **slide)
    return screw.through(times, positions, quaternions)
