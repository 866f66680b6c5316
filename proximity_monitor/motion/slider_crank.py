"""A crankshaft that turns at constant speed and drives pistons through rods of fixed length."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from proximity_monitor.motion.motion import Motion
from proximity_monitor.scene.naming import counted
from proximity_monitor.scene.poses import rotations

# How far a direction may be from unit length, two directions from perpendicular, or an offset from
# the axis (as a fraction of crank_radius). A millionth covers the rounding of values with seven
# digits. More is a mistake, and the rods would change their length.
_ALIGNMENT = 1e-6


@dataclass(frozen=True)
class _Piston:
    name: str
    phase: float
    centre: np.ndarray  # the crank's centre at this cylinder: crank_origin + offset


class SliderCrank(Motion):
    """Crank and pistons.

    At time t the crank has turned by ``speed * t`` about its axis, right-handed; at angle 0 a
    piston of phase 0 is at top dead centre. With ``phi = speed * t + phase`` the wrist pin of a
    piston is ``crank_radius * cos(phi) + sqrt(rod_length**2 - (crank_radius * sin(phi))**2)``
    along the slide direction from ``crank_origin + offset``. Pistons keep the world's orientation.
    The crank's model has its origin at `crank_origin`, a piston's model at the wrist pin's centre.
    """

    def __init__(
        self,
        crank: str,
        crank_origin: np.ndarray,
        crank_axis: np.ndarray,
        slide_direction: np.ndarray,
        crank_radius: float,
        rod_length: float,
        speed: float,
        pistons: Mapping[str, Mapping[str, Any]],
    ) -> None:
        """Check and keep the mechanism.

        Args:
            crank: name of the turning body.
            crank_origin: (3,) a point on the crank's axis, metres.
            crank_axis: (3,) unit vector.
            slide_direction: (3,) unit vector, perpendicular to the axis.
            crank_radius: half the stroke, metres.
            rod_length: centre to centre, metres; more than the radius.
            speed: radians per second; negative turns the other way, 0 stands still.
            pistons: by body name, `phase` in radians and `offset` (3,) in metres along the axis.

        Raises:
            ValueError: a setting is invalid. The message names the key and the problem.
        """
        self._crank = crank
        self._origin = _vector(crank_origin, "crank_origin")
        self._axis = _direction(crank_axis, "crank_axis")
        self._slide = _direction(slide_direction, "slide_direction")
        if abs(self._axis @ self._slide) > _ALIGNMENT:
            raise _bad("slide_direction", "must be perpendicular to crank_axis")
        self._radius = _number(crank_radius, "crank_radius")
        self._rod = _number(rod_length, "rod_length")
        self._speed = _number(speed, "speed")
        if self._radius <= 0.0:
            raise _bad("crank_radius", f"must be positive, not {self._radius:g} m")
        if self._rod <= self._radius:
            raise _bad(
                "rod_length",
                f"{self._rod:g} m must exceed crank_radius ({self._radius:g} m), "
                "or the crank cannot turn",
            )
        if not pistons:
            raise _bad("pistons", "must name at least one piston")
        if crank in pistons:
            raise _bad("pistons", f"must not include the crank, {crank!r}")
        self._pistons = tuple(self._piston(name, values) for name, values in pistons.items())

    def _piston(self, name: str, values: Mapping[str, Any]) -> _Piston:
        phase = _number(values["phase"], f"pistons.{name}.phase")
        offset = _vector(values["offset"], f"pistons.{name}.offset")
        aside = np.linalg.norm(offset - (offset @ self._axis) * self._axis)
        if aside > _ALIGNMENT * self._radius:
            raise _bad(
                f"pistons.{name}.offset",
                f"must be parallel to crank_axis; {aside:g} m off it, the rod would not keep its "
                "length",
            )
        return _Piston(name, phase, self._origin + offset)

    @property
    def bodies(self) -> tuple[str, ...]:
        """The crank, then the pistons in the scene's order."""
        return (self._crank, *(piston.name for piston in self._pistons))

    @property
    def period_s(self) -> float | None:
        """Seconds per turn; None if the crank stands still."""
        return math.tau / abs(self._speed) if self._speed else None

    def poses(self, t: float) -> dict[str, np.ndarray]:
        """Return the poses (4, 4), model to world in metres, of all bodies at t seconds.

        Raises:
            ValueError: t is not finite.
        """
        if not math.isfinite(t):
            raise ValueError(f"t: must be finite (got {t})")
        angle = self._speed * t
        poses = {self._crank: self._turned(angle)}
        for piston in self._pistons:
            pose = np.eye(4)
            pose[:3, 3] = piston.centre + self._height(angle + piston.phase) * self._slide
            poses[piston.name] = pose
        return poses

    def describe(self) -> str:
        """Return e.g. ``slider_crank: 5 bodies, 60 rpm``."""
        rpm = self._speed * 60.0 / math.tau
        return f"slider_crank: {counted(len(self.bodies), 'body', 'bodies')}, {rpm:g} rpm"

    def _height(self, phi: float) -> float:
        across = self._radius * math.sin(phi)
        # A difference of squares as a product: nothing cancels if rod and radius are nearly equal.
        return self._radius * math.cos(phi) + math.sqrt((self._rod - across) * (self._rod + across))

    def _turned(self, angle: float) -> np.ndarray:
        """Return the crank's pose; its model's origin is at `crank_origin`."""
        pose = np.eye(4)
        pose[:3, :3] = rotations(self._axis, np.array(angle))
        pose[:3, 3] = self._origin
        return pose


def _bad(key: str, why: str) -> ValueError:
    return ValueError(f"slider_crank.{key}: {why}")


def _number(value: float, key: str) -> float:
    if not math.isfinite(value):
        raise _bad(key, f"{value} is not finite")
    return float(value)


def _vector(value: np.ndarray, key: str) -> np.ndarray:
    vector = np.array(value, dtype=np.float64)
    if vector.shape != (3,):
        raise _bad(key, f"needs three numbers, not shape {vector.shape}")
    if not np.isfinite(vector).all():
        raise _bad(key, f"{vector.tolist()} is not finite")
    return vector


def _direction(value: np.ndarray, key: str) -> np.ndarray:
    vector = _vector(value, key)
    length = float(np.linalg.norm(vector))
    if abs(length - 1.0) > _ALIGNMENT:
        raise _bad(key, f"must be a unit vector, not of length {length:g}")
    return vector / length
