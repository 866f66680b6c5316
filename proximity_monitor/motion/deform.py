"""Bodies whose control points follow a field: bend, twist, stretch, wave, breathe, morph."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from proximity_monitor.motion.motion import Motion, common_period
from proximity_monitor.scene import load_model
from proximity_monitor.scene.naming import counted

if TYPE_CHECKING:
    from proximity_monitor.engine import Model
    from proximity_monitor.scene import Scene


@dataclass(frozen=True, eq=False)
class Field:
    """How the control points of a body, such as a mesh's vertices, move, in closed form.

    Let c be the centre, a the unit vector of the axis, and b a unit vector perpendicular to a. Let
    a point at rest be ``x = c + s a + p``, with p perpendicular to a. Let r be the greatest ``|s|``
    of all points, and ``g = sin(2π f t + φ)``. So without a phase, the body is at rest at t = 0,
    except for wave. The fields:

    - stretch: ``c + e^(A g) s a + e^(-A g / 2) p``, which keeps every volume;
    - breathe: ``c + e^(A g) (x - c)``;
    - twist: ``c + s a + R(a, A g s / r) p``, where R is a right-handed rotation about a: the
      farthest end turns by A;
    - bend: the axis becomes an arc of curvature ``k = A g / r`` towards b and keeps its length:
      ``c + (sin(k s) / k - u sin(k s)) a + ((1 - cos(k s)) / k + u cos(k s)) b + (p - u b)`` with
      ``u = p · b``;
    - wave: ``x + A sin(2π (s / λ - f t) - φ) b``, which travels along a and is never at rest;
    - morph: through other shapes and back to the shape at rest, in equal parts of a period. From
      one shape to the next, each point moves on a straight line, by the share ``sin²(π τ / 2)``
      of it, with τ from 0 to 1.

    Attributes:
        field: the name of the field.
        frequency_hz: f.
        amplitude: A; radians for twist and bend, metres for wave, no unit for stretch and breathe;
            unused by morph.
        phase: φ, radians.
        axis: (3,) a, unit vector, model frame; unused by breathe and morph.
        across: (3,) b, unit vector perpendicular to a; for bend and wave.
        wavelength: λ, metres; for wave.
        centre: (3,) c, model frame, metres; None: the middle of the points' bounding box.
        shapes: (k, n, 3) metres, model frame; for morph: the points of the other shapes.
    """

    field: Literal["bend", "twist", "wave", "stretch", "breathe", "morph"]
    frequency_hz: float
    amplitude: float = 0.0
    phase: float = 0.0
    axis: NDArray[np.float64] | None = None
    across: NDArray[np.float64] | None = None
    wavelength: float | None = None
    centre: NDArray[np.float64] | None = None
    shapes: NDArray[np.float64] | None = None

    def moved(self, rest: NDArray[np.float64], t: float) -> NDArray[np.float64]:
        """Return the positions at t seconds of points (n, 3) given at rest; metres, model frame."""
        turn = math.tau * self.frequency_hz * t + self.phase
        if self.field == "morph":
            return self._between(rest, turn)
        now = self.amplitude * math.sin(turn)
        centre = self.centre
        if centre is None:
            centre = 0.5 * (rest.min(axis=0) + rest.max(axis=0))
        x = rest - centre
        if self.field == "breathe":
            return centre + math.exp(now) * x
        along = x @ self.axis
        if self.field == "wave":
            lift = self.amplitude * np.sin(math.tau * along / self.wavelength - turn)
            return rest + lift[:, None] * self.across
        aside = x - along[:, None] * self.axis
        if self.field == "stretch":
            stretched = math.exp(now) * along
            return centre + stretched[:, None] * self.axis + math.exp(-0.5 * now) * aside
        angle = now / (np.abs(along).max() or 1.0) * along
        if self.field == "twist":
            around = np.cross(self.axis, aside)
            aside = np.cos(angle)[:, None] * aside + np.sin(angle)[:, None] * around
            return centre + along[:, None] * self.axis + aside
        return centre + self._bent(along, aside, angle)

    def _between(self, rest: NDArray[np.float64], turn: float) -> NDArray[np.float64]:
        """Return the points between one shape and the next; `turn` grows by 2π per period."""
        stops = [rest, *self.shapes]
        place = turn / math.tau % 1.0 * len(stops)
        before = min(int(place), len(stops) - 1)
        share = math.sin(0.5 * math.pi * (place - before)) ** 2
        return (1.0 - share) * stops[before] + share * stops[(before + 1) % len(stops)]

    def _bent(
        self, along: NDArray[np.float64], aside: NDArray[np.float64], angle: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the arc's points at the angles k s, plus the offsets from the axis, turned along.

        sin(k s) / k and (1 - cos(k s)) / k are computed without a division, because k may be 0.
        """
        height = aside @ self.across
        forward = along * np.sinc(angle / math.pi) - height * np.sin(angle)
        towards = along * np.sinc(angle / math.tau) * np.sin(0.5 * angle) + height * np.cos(angle)
        rest = aside - height[:, None] * self.across
        return rest + forward[:, None] * self.axis + towards[:, None] * self.across


class Deform(Motion):
    """Bodies that change their shape and stay in place."""

    def __init__(self, fields: Mapping[str, Field], models: Mapping[str, Model]) -> None:
        """Keep the shapes at rest.

        Args:
            fields: the fields by body name.
            models: the models of these bodies, at rest.
        """
        self._fields = dict(fields)
        self._rest = {name: models[name].control_points for name in fields}
        self._names = {name: models[name].control_name for name in fields}

    @property
    def bodies(self) -> tuple[str, ...]:
        """No bodies: this motion drives no poses."""
        return ()

    @property
    def period_s(self) -> float | None:
        """Seconds after which all bodies repeat at once; None if they never do, or do not move."""
        periods = self._periods()
        return common_period(periods) if periods else None

    @property
    def once_s(self) -> float | None:
        """The longest period of any body, seconds; None if nothing moves."""
        return max(self._periods(), default=None)

    def _periods(self) -> list[float]:
        return [1.0 / f.frequency_hz for f in self._fields.values() if f.frequency_hz]

    def poses(self, t: float) -> dict[str, np.ndarray]:
        """Return no poses."""
        return {}

    @property
    def control_names(self) -> dict[str, str]:
        """The name of the control points of each body, such as vertices."""
        return dict(self._names)

    def control_points(self, t: float) -> dict[str, np.ndarray]:
        """Return the control points (n, 3) of each body at t seconds, model frame, metres.

        Raises:
            ValueError: t is not finite.
        """
        if not math.isfinite(t):
            raise ValueError(f"t: must be finite (got {t})")
        return {name: self.shape(name, t) for name in self._fields}

    def shape(self, name: str, t: float) -> np.ndarray:
        """Return the control points (n, 3) of one of the bodies at t seconds."""
        return self._fields[name].moved(self._rest[name], t)

    def describe(self) -> str:
        """Return e.g. ``deform: 1 body, twist at 0.5 Hz``."""
        kinds = [f"{each.field} at {each.frequency_hz:g} Hz" for each in self._fields.values()]
        return f"deform: {counted(len(kinds), 'body', 'bodies')}, {', '.join(dict.fromkeys(kinds))}"


def from_settings(settings: Mapping[str, Any], scene: Scene, models: Mapping[str, Model]) -> Deform:
    """Return the effect that the section `motion.deform` of a scene describes.

    Raises:
        ValueError: a shape to morph through is no model, or differs from its body in the number of
            control points.
    """
    fields = {}
    for name, each in settings["bodies"].items():
        shapes = _shapes(name, each["through"], scene, models[name])
        rest = {key: value for key, value in each.items() if key != "through"}
        fields[name] = Field(**rest, shapes=shapes)
    return Deform(fields, models)


def _shapes(
    name: str, through: Sequence[Path], scene: Scene, model: Model
) -> NDArray[np.float64] | None:
    """Return the control points (k, n, 3), metres, body frame, of the shapes to morph through."""
    if not through:
        return None
    body = next(body for body in scene.bodies if body.name == name)
    found = []
    for path in through:
        other = load_model(replace(body, model=path, primitive=None), scene.unit)
        if other.control_points.shape != model.control_points.shape:
            raise ValueError(
                f"{scene.path}: motion.deform.bodies.{name}.through: {path} has "
                f"{len(other.control_points)} {other.control_name}, but {name} has "
                f"{len(model.control_points)} {model.control_name}"
            )
        found.append(other.control_points)
    return np.stack(found)
