"""Records of what a scene file says, in SI units: metres, radians, seconds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from proximity_monitor.scene.kinematics import Kinematics


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
    """A cylinder about z, centred on the origin; lengths in metres.

    If `segments` is set, a prism with that many sides stands for it. The cylinder's surface is at
    most ``radius * tan(pi / segments / 2) ** 2`` from the prism's; bounds are widened by that.
    """

    radius: float
    height: float
    segments: int | None = None
    """Sides of the prism; None: the cylinder is exact."""


@dataclass(frozen=True)
class Sphere:
    """A sphere around the origin; metres."""

    radius: float
    subdivisions: int | None = None
    """How often its icosahedron is subdivided; None: the sphere is exact."""


@dataclass(frozen=True)
class Capsule:
    """All points within `radius` of a segment along z, centred on the origin; metres. Exact."""

    radius: float
    length: float
    """Length of the segment; the capsule is longer by twice its radius."""


@dataclass(frozen=True)
class Cone:
    """A cone or frustum about z, centred on the origin; lengths in metres. Exact."""

    radius: float
    """Radius at the lower end."""
    height: float
    top_radius: float = 0.0
    """Radius at the upper end; 0: an apex."""


@dataclass(frozen=True)
class Torus:
    """A ring about z, centred on the origin; metres. Exact."""

    radius: float
    """Distance from the axis to the centre line of the tube."""
    tube: float
    """Radius of the tube, at most `radius`."""


@dataclass(frozen=True)
class Point:
    """A single point, the body's origin: a probe's tip."""


@dataclass(frozen=True)
class Part:
    """One shape of a compound, placed in the compound's frame."""

    shape: Path | Box | Cylinder | Sphere | Capsule
    """A model file in metres, absolute, or a primitive."""
    scale: tuple[float, float, float]
    """Factors along the shape's own axes, not 0; a negative factor mirrors the shape."""
    xyz: tuple[float, float, float]
    """The shape's origin, metres."""
    rpy: tuple[float, float, float]
    """The shape's orientation: turns about the fixed x, y and z axes in this order, radians."""


@dataclass(frozen=True)
class Compound:
    """Several shapes as one rigid body: a robot's link."""

    parts: tuple[Part, ...]


Primitive = Box | Cylinder | Sphere | Capsule | Cone | Torus | Point | Compound


Solid = bool | Literal["robust"] | None
"""Whether a model must be a solid, as for `engine.load`; "robust" bridges holes in a mesh."""


@dataclass(frozen=True)
class Cloud:
    """Points that arrive on a topic, with a ball of `radius` metres around each."""

    topic: str
    radius: float
    frame: str
    """The body in whose frame the points are given; empty: the scene's frame."""


@dataclass(frozen=True, eq=False)
class Body:
    """One body: its shape, and either a fixed pose or the source of its poses."""

    name: str
    model: Path | None
    """An existing file, absolute; None for a primitive."""
    primitive: Primitive | None
    scale: float
    """Factor on the shape, in addition to the scene's unit."""
    pose: np.ndarray | None
    """(4, 4) model to world in metres, read-only; None for a moving body."""
    topic: str | None
    """Topic of a moving body's poses. None for a fixed body, for a cloud, and for a robot's link,
    whose poses follow from joint positions (see `Robot`)."""
    colour: tuple[float, float, float, float]
    """Red, green, blue, opacity, each 0 to 1."""
    solid: Solid = None
    """Whether it must be a solid, as for `engine.load`; None: it is if its model encloses one."""
    solid_at: str = ""
    """The place in the file that sets `solid`, for messages."""
    deviation: float = 0.0
    """How far the model's surface may be from that of the part it stands for, metres."""
    deforming: bool = False
    """Whether its control points change while the monitor runs."""
    part: str | None = None
    """Which part of an assembly its model is, as for `engine.load`; None: the whole file."""
    cloud: Cloud | None = None
    """Source of its points if it is a point cloud; its `primitive` is then a point, for the time
    before the first cloud arrives."""

    @property
    def moving(self) -> bool:
        """Whether it can move: it has no fixed pose."""
        return self.pose is None

    @property
    def posed(self) -> bool:
        """Whether it receives poses of its own. A cloud does not: it moves with its frame."""
        return self.moving and self.cloud is None


@dataclass(frozen=True)
class Thresholds:
    """Clearances in metres; ``warn >= stop >= 0``. A distance equal to a threshold triggers it."""

    warn: float
    stop: float
    hysteresis: float
    """Metres by which a clearance must exceed a threshold before its alert ends."""
    hold_s: float = 0.0
    """Seconds for which the clearance must exceed it without a break before the alert ends."""


Question = Literal["distance", "within", "collide"]
"""The question about a pair: its distance, or only on which side of its thresholds the distance
lies, or only whether the two bodies touch."""


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
    """False if the thresholds are the scene's defaults."""
    question: Question = "distance"
    range: float = float("inf")
    """Metres; a pair that is certainly farther apart is not searched."""


@dataclass(frozen=True)
class Root:
    """Source of the poses of a robot's moving root link."""

    topic: str
    frame: str
    """The root link's frame on /tf."""


@dataclass(frozen=True, eq=False)
class Robot:
    """Bodies that are the links of one robot, and how its joints move them."""

    name: str
    kinematics: Kinematics
    base: np.ndarray
    """(4, 4) pose of its root link in the world, metres, read-only; identity if the link moves."""
    topic: str
    """Topic of its joint positions."""
    start: Mapping[str, float]
    """Joint positions from the file, which hold until others arrive; radians or metres."""
    links: Mapping[str, str]
    """Name of the link by name of its body, for the moving bodies."""
    root: Root | None = None
    """None if its root link is fixed at `base`."""

    def poses(
        self, positions: Mapping[str, float], base: np.ndarray | None = None
    ) -> dict[str, np.ndarray]:
        """Return the pose (4, 4) in metres, model to world, of each moving body.

        Args:
            positions: joint positions by name, radians or metres. A missing position is taken from
                `start`, else it is 0. Names of joints that are not free are skipped.
            base: (4, 4) pose of its root link in the world, metres; None: the robot's own `base`.

        Raises:
            ValueError: a position is not finite.
        """
        kinematics = self.kinematics
        base = self.base if base is None else base
        poses = kinematics.poses(kinematics.values({**self.start, **positions}), base)
        by_link = dict(zip(kinematics.links, poses, strict=True))
        return {body: by_link[link] for body, link in self.links.items()}


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
    """Computing time of one tick, seconds."""
    bodies: tuple[Body, ...]
    pairs: Sequence[WatchedPair]
    motion: Mapping[str, Mapping[str, Any]] | None
    """Settings by name of the effect, in SI units (see `effects`)."""
    thresholds: Thresholds
    """The default thresholds of all pairs."""
    description: str = ""
    """One line about what the scene shows."""
    robots: tuple[Robot, ...] = ()
    """The robots; their links are among `bodies`."""
    warnings: tuple[str, ...] = ()
    """Warnings about the file for the user, each with the line and the key."""
