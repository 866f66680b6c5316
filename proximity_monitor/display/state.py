"""What a monitor said last: the scene, and the frame of its last tick. Metres and seconds."""

from __future__ import annotations

import json
import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from proximity_monitor.scene import Thresholds

LEVELS = ("clear", "warn", "stop", "stale")
STATUSES = (
    "exact",
    "within tolerance",
    "bounded",
    "intersecting",
    "overlapping",
    "unknown pose",
)
PairNames = tuple[tuple[str, str], ...]
WARN, STOP, STALE = 1, 2, 3
BOUNDED, INTERSECTING, OVERLAPPING, UNKNOWN = 2, 3, 4, 5


@dataclass(frozen=True)
class Unit:
    """The length unit that people read."""

    symbol: str
    to_metre: float


@dataclass(frozen=True)
class Body:
    """One body of the scene."""

    name: str
    moving: bool
    topic: str | None
    """Where its PoseStamped are taken in; None: nowhere, so it cannot be dragged."""
    point: bool
    mesh: str
    """Another one where the mesh is another."""


@dataclass(frozen=True)
class SceneInfo:
    """What ~/scene says."""

    name: str
    description: str
    frame: str
    unit: Unit
    bodies: tuple[Body, ...]
    deforming: frozenset[str]
    pairs: int
    thresholds: Thresholds
    own_thresholds: Mapping[tuple[str, str], Thresholds]
    own_parameters: bool
    settings: Mapping[str, float | None]

    @classmethod
    def read(cls, text: str) -> SceneInfo:
        """Read the JSON of ~/scene.

        Raises:
            ValueError: it is not what a monitor of this version publishes.
        """
        try:
            told: dict[str, Any] = json.loads(text)
            limits = told["own_thresholds"]
            return cls(
                name=told["name"],
                description=told["description"],
                frame=told["frame"],
                unit=Unit(**told["unit"]),
                bodies=tuple(Body(**body) for body in told["bodies"]),
                deforming=frozenset(told["deforming"]),
                pairs=told["pairs"],
                thresholds=Thresholds(**told["thresholds"]),
                own_thresholds={
                    (each.pop("a"), each.pop("b")): Thresholds(**each) for each in limits
                },
                own_parameters=told["own_parameters"],
                settings=told["settings"],
            )
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(
                f"~/scene is not what this version of the display reads ({error}): is the monitor"
                " of the same version?"
            ) from error

    @cached_property
    def moving(self) -> tuple[str, ...]:
        """The names of the moving bodies, in the order of ~/poses."""
        return tuple(body.name for body in self.bodies if body.moving)

    @property
    def key(self) -> Hashable:
        """What makes it another scene where it changes: all that is built once stands on it."""
        return self.name, self.frame, self.unit, self.bodies

    def body(self, name: str) -> Body:
        """Return a body by its name."""
        return next(body for body in self.bodies if body.name == name)

    def thresholds_of(self, pair: tuple[str, str]) -> Thresholds:
        """Return the thresholds of a pair, given by the names of its bodies."""
        return self.own_thresholds.get(pair, self.thresholds)


@lru_cache(maxsize=16)
def shared(names: PairNames) -> PairNames:
    """Return the same object for the same names: the ticks of a session nearly all have them."""
    return names


@lru_cache(maxsize=16)
def places(names: PairNames) -> Mapping[tuple[str, str], int]:
    """Return the row of each pair; ticks that list the same pairs share it."""
    return {name: i for i, name in enumerate(names)}


@dataclass(frozen=True, eq=False)
class Pairs:
    """The listed pairs of one tick as arrays of k rows, in the scene's order."""

    names: PairNames
    lower: np.ndarray
    """(k,) metres; NaN while a pose is unknown. Negative where solids overlap."""
    upper: np.ndarray
    points: np.ndarray
    """(k, 2, 3) metres, in the fixed frame; NaN while a pose is unknown."""
    status: np.ndarray
    """(k,) positions in STATUSES."""
    level: np.ndarray
    """(k,) positions in LEVELS."""
    age_s: np.ndarray
    """(k,) seconds since the numbers answered the present poses."""
    stamp_s: np.ndarray
    """(k,) of the older of the two poses; NaN while one is unknown."""
    silent: tuple[str, ...]
    """Of each pair what is said of its silent bodies; empty where none is."""

    def __len__(self) -> int:
        """How many are listed."""
        return len(self.names)

    @property
    def places(self) -> Mapping[tuple[str, str], int]:
        """The row of each pair."""
        return places(self.names)

    @cached_property
    def touching(self) -> np.ndarray:
        """(k,) whether the bodies touch, cross or overlap, which is certain."""
        return (self.status == INTERSECTING) | (self.status == OVERLAPPING) | (self.upper <= 0.0)


@dataclass(frozen=True, eq=False)
class Frame:
    """A tick: the poses that it spoke of, and what it said of the pairs."""

    stamp_s: float
    poses: np.ndarray
    """(m, 7) of the moving bodies in the scene's order: x y z in metres, quaternion w x y z; all
    zeros where a body has no pose."""
    pairs: Pairs

    def pose(self, row: int) -> np.ndarray | None:
        """Return a body's pose (7,), None while it has none."""
        pose = self.poses[row]
        return pose if pose[3:].any() else None


@dataclass(frozen=True)
class Health:
    """What the monitor says of its own work each second."""

    schedule: Mapping[str, str] = field(default_factory=dict)
    """By key, and "message" for the whole."""

    def number(self, key: str) -> float:
        """Return a value as a number; NaN where it is not told."""
        return float(self.schedule.get(key, math.nan))
