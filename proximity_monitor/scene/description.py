"""What a scene file says, in SI units: metres, radians, seconds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Unit:
    """The length unit in which a scene file and its model files are written."""

    name: str
    to_metre: float
    symbol: str


UNITS = {
    "m": Unit("metre", 1.0, "m"),
    "mm": Unit("millimetre", 0.001, "mm"),
    "in": Unit("inch", 0.0254, "in"),
}


@dataclass(frozen=True)
class Box:
    """An axis-aligned box around the origin; `size` (x, y, z) in metres."""

    size: tuple[float, float, float]


@dataclass(frozen=True)
class Cylinder:
    """A prism of `segments` sides about z, centred on the origin; lengths in metres.

    Its corners lie on the cylinder, so its sides lie inside it, by at most
    ``radius * (1 - cos(pi / segments))``.
    """

    radius: float
    height: float
    segments: int


@dataclass(frozen=True)
class Sphere:
    """An icosahedron subdivided `subdivisions` times, its corners on the sphere; metres."""

    radius: float
    subdivisions: int


Primitive = Box | Cylinder | Sphere


@dataclass(frozen=True, eq=False)
class Body:
    """One body: its shape, and either a fixed pose or the topic that its poses come from."""

    name: str
    model: Path | None
    """An existing file, absolute; None for a primitive."""
    primitive: Primitive | None
    scale: float
    """Factor on the shape, beside the scene's unit."""
    pose: np.ndarray | None
    """(4, 4) model to world in metres, read-only; None for a moving body."""
    topic: str | None
    """Topic of the poses of a moving body; None for a fixed one."""
    colour: tuple[float, float, float, float]
    """Red, green, blue, opacity, each 0 to 1."""

    @property
    def moving(self) -> bool:
        """Whether poses arrive on a topic."""
        return self.topic is not None


@dataclass(frozen=True)
class Thresholds:
    """Clearances in metres; ``warn >= stop >= 0``. A distance equal to a threshold triggers it."""

    warn: float
    stop: float
    hysteresis: float
    """How far a clearance must exceed a threshold before its alert ends."""


@dataclass(frozen=True)
class WatchedPair:
    """Two bodies whose clearance is watched; `a` stands before `b` in the file."""

    a: str
    b: str
    rel_err: float
    abs_err: float
    """Metres."""
    thresholds: Thresholds
    own_thresholds: bool
    """False where the thresholds are the scene's defaults."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A whole scene. Bodies stand in the file's order, pairs in the order of their bodies."""

    path: Path
    """The file, absolute."""
    frame: str
    """frame_id of the world."""
    unit: Unit
    rate_hz: float
    budget_s: float
    """Computing time of one tick."""
    bodies: tuple[Body, ...]
    pairs: tuple[WatchedPair, ...]
    motion: Mapping[str, Any] | None
    """One effect: its name, and its settings in SI units (see `effects`)."""
    thresholds: Thresholds
    """The defaults of all pairs."""
