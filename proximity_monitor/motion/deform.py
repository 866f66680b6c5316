"""Bodies whose control points follow a field: bend, twist, stretch, wave, breathe."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from proximity_monitor.motion.motion import Motion, counted

if TYPE_CHECKING:
    from proximity_monitor.engine import Model


@dataclass(frozen=True, eq=False)
class Field:
    """How the control points of a body, such as a mesh's vertices, move, in closed form.

    With c the centre, a unit axis and b the unit direction across it, a point at rest is
    ``x = c + s a + p``, p perpendicular to a. Let r be the greatest ``|s|`` of these points
    and ``g = sin(2π f t + φ)``, so that without a phase the body is at rest at t = 0. The fields:

    - stretch: ``c + e^(A g) s a + e^(-A g / 2) p``, which keeps every volume;
    - breathe: ``c + e^(A g) (x - c)``;
    - twist: ``c + s a + R(a, A g s / r) p``, with R a right-handed turn about a: the farthest end
      turns by A;
    - bend: the axis becomes an arc of curvature ``k = A g / r`` towards b, its length kept:
      ``c + (sin(k s) / k - u sin(k s)) a + ((1 - cos(k s)) / k + u cos(k s)) b + (p - u b)`` with
      ``u = p · b``;
    - wave: ``x + A sin(2π (s / λ - f t) - φ) b``, which travels along a and is never at rest.

    Attributes:
        field: its name.
        amplitude: A; radians of twist and bend, metres of wave, else a number.
        frequency_hz: f.
        phase: φ, radians.
        axis: (3,) a, model frame; unused by breathe.
        across: (3,) b, perpendicular to a; of bend and wave.
        wavelength: λ, metres; of wave.
        centre: (3,) c, model frame, metres; None: the middle of the points' bounding box.
    """

    field: Literal["bend", "twist", "wave", "stretch", "breathe"]
    amplitude: float
    frequency_hz: float
    phase: float = 0.0
    axis: NDArray[np.float64] | None = None
    across: NDArray[np.float64] | None = None
    wavelength: float | None = None
    centre: NDArray[np.float64] | None = None

    def moved(self, rest: NDArray[np.float64], t: float) -> NDArray[np.float64]:
        """Return where points (n, 3) of the body at rest are at t seconds; metres, model frame."""
        turn = math.tau * self.frequency_hz * t + self.phase
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

    def _bent(
        self, along: NDArray[np.float64], aside: NDArray[np.float64], angle: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """The arc's point at each angle k s, with the offset from the axis turned along.

        sin(k s) / k and (1 - cos(k s)) / k are written without a division, as k may be 0.
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
            fields: by body name.
            models: of those bodies, as they are at rest.
        """
        self._fields = dict(fields)
        self._rest = {name: models[name].control_points for name in fields}
        self._names = {name: models[name].control_name for name in fields}

    @property
    def bodies(self) -> tuple[str, ...]:
        """No bodies: it drives no poses."""
        return ()

    @property
    def period_s(self) -> float | None:
        """The longest period of a body, seconds; None if nothing moves."""
        slowest = min((f.frequency_hz for f in self._fields.values() if f.frequency_hz), default=0)
        return 1.0 / slowest if slowest else None

    def poses(self, t: float) -> dict[str, np.ndarray]:
        """Return no pose."""
        return {}

    @property
    def control_names(self) -> dict[str, str]:
        """What the control points of each body are called."""
        return dict(self._names)

    def control_points(self, t: float) -> dict[str, np.ndarray]:
        """Return the control points (n, 3) of each body at t seconds, model frame, metres.

        Raises:
            ValueError: t is not finite.
        """
        if not math.isfinite(t):
            raise ValueError(f"t: {t} is no time")
        return {name: each.moved(self._rest[name], t) for name, each in self._fields.items()}

    def describe(self) -> str:
        """Return e.g. ``deform: 1 body, twist at 0.5 Hz``."""
        kinds = [f"{each.field} at {each.frequency_hz:g} Hz" for each in self._fields.values()]
        return f"deform: {counted(len(kinds), 'body', 'bodies')}, {', '.join(dict.fromkeys(kinds))}"


def from_settings(settings: Mapping[str, Any], models: Mapping[str, Model]) -> Deform:
    """Return the effect that the section `motion.deform` of a scene describes."""
    fields = {name: Field(**each) for name, each in settings["bodies"].items()}
    return Deform(fields, models)
