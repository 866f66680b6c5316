"""The monitor's last messages: the scene, and the last tick. Metres and seconds."""

from __future__ import annotations

import json
import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from proximity_monitor.scene import Thresholds
from proximity_monitor.scene.alerts import Level
from proximity_monitor.scene.state import PairStatus
from proximity_monitor.scene.watch import LISTED_SILENT

PairNames = tuple[tuple[str, str], ...]
LEVELS = tuple(level.value for level in Level)
_, WARN, STOP, STALE = range(len(LEVELS))
STATUSES = tuple(status.value for status in PairStatus)
_, _, BOUNDED, INTERSECTING, OVERLAPPING, UNKNOWN = range(len(STATUSES))


def refuse_surrogates(told: Any) -> None:
    """Refuse JSON content with a text that is not Unicode, because it cannot be sent to a browser.

    Raises:
        ValueError: a text has one half of a surrogate pair alone.
    """
    try:
        json.dumps(told, ensure_ascii=False).encode()
    except UnicodeEncodeError as error:
        half = error.object[error.start].encode("ascii", "backslashreplace").decode()
        raise ValueError(
            f"a text in it is not Unicode: it has the lone surrogate {half}"
        ) from error


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
    """The topic of its PoseStamped; None: it has none, so it cannot be dragged."""
    point: bool
    mesh: str
    """A checksum of its mesh; different checksums prove that meshes differ."""
    colour: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)
    """Red, green, blue, opacity."""
    pose: tuple[float, ...] | None = None
    """x y z in metres and quaternion w x y z of a fixed body; None: it moves."""
    range: float = math.inf
    """Metres; unlisted pairs of this body are certainly farther apart than this."""

    @classmethod
    def read(cls, told: Mapping[str, Any]) -> Body:
        """Read one body of ~/scene; lists become tuples, so that bodies can be compared."""
        values = {key: tuple(x) if isinstance(x, list) else x for key, x in told.items()}
        least = values.get("range")
        return cls(**values | {"range": math.inf if least is None else least})


@dataclass(frozen=True)
class SceneInfo:
    """The content of ~/scene."""

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
    path: str = ""
    """The path of the scene's file on the monitor's machine."""
    checksum: int = 0
    """A checksum of the bodies' names; ~/pairs of the same scene has the same one."""
    words: tuple[str, ...] = ()
    """The words for the codes in ~/pairs."""
    attachments: Mapping[str, str] = field(default_factory=dict)
    """The parent's name by the child's, as set; some may wait until both poses are known."""
    held: Mapping[str, str] = field(default_factory=dict)
    """The attachments in force: such a child moves with its parent, and not by itself."""
    unwatched: frozenset[tuple[str, str]] = frozenset()
    """The pairs that are not watched because one body is attached to the other."""

    @classmethod
    def read(cls, text: str) -> SceneInfo:
        """Read the JSON of ~/scene.

        Raises:
            ValueError: the text is not what a monitor of this version publishes.
        """
        try:
            told: dict[str, Any] = json.loads(text)
            refuse_surrogates(told)
            thresholds = told["own_thresholds"]
            return cls(
                name=told["name"],
                description=told["description"],
                frame=told["frame"],
                unit=Unit(**told["unit"]),
                bodies=tuple(map(Body.read, told["bodies"])),
                deforming=frozenset(told["deforming"]),
                pairs=told["pairs"],
                thresholds=Thresholds(**told["thresholds"]),
                own_thresholds={
                    (each.pop("a"), each.pop("b")): Thresholds(**each) for each in thresholds
                },
                own_parameters=told["own_parameters"],
                settings=told["settings"],
                path=told["path"],
                checksum=told["checksum"],
                words=tuple(told["words"]),
                attachments=told["attachments"],
                held=told["held"],
                unwatched=frozenset(map(tuple, told["unwatched"])),
            )
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(
                f"~/scene cannot be interpreted ({error}): do monitor and display have the same"
                " version?"
            ) from error

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of all bodies."""
        return tuple(body.name for body in self.bodies)

    @cached_property
    def moving(self) -> tuple[str, ...]:
        """The names of the moving bodies, in the order of ~/poses."""
        return tuple(body.name for body in self.bodies if body.moving)

    @property
    def key(self) -> Hashable:
        """Identifies the scene. If it changes, all that depends on the scene is rebuilt."""
        return self.name, self.frame, self.unit, self.bodies

    def body(self, name: str) -> Body:
        """Return a body by its name."""
        return next(body for body in self.bodies if body.name == name)

    def thresholds_of(self, pair: tuple[str, str]) -> Thresholds:
        """Return the thresholds of a pair, given by the names of its bodies."""
        return self.own_thresholds.get(pair, self.thresholds)

    def warn_and_stop(self, names: PairNames) -> tuple[np.ndarray, np.ndarray]:
        """Return warn (k,) and stop (k,) of pairs, given by their names, in metres."""
        known = self._warn_and_stop.get("last")
        if known is None or known[0] is not names:  # most ticks share the same names
            common, own = self.thresholds, self.own_thresholds
            warn, stop = (np.full(len(names), x, float) for x in (common.warn, common.stop))
            for i in [i for i, name in enumerate(names) if name in own] if own else ():
                warn[i], stop[i] = own[names[i]].warn, own[names[i]].stop
            known = self._warn_and_stop["last"] = (names, warn, stop)
        return known[1:]

    @cached_property
    def _warn_and_stop(self) -> dict[str, tuple]:
        return {}


@lru_cache(maxsize=16)
def places(names: PairNames) -> Mapping[tuple[str, str], int]:
    """Return the row of each pair. Cached: ticks that list the same pairs share the result."""
    return {name: i for i, name in enumerate(names)}


@lru_cache(maxsize=16)
def rows_of(names: PairNames) -> Mapping[str, Sequence[int]]:
    """Return the rows of each body's pairs. Cached as `places` is."""
    found: dict[str, list[int]] = {}
    for i, pair in enumerate(names):
        for name in pair:
            found.setdefault(name, []).append(i)
    return found


@dataclass(frozen=True, eq=False)
class Pairs:
    """The listed pairs of one tick as arrays of k rows, in the scene's order.

    A body is silent if its pose, joints or shape is too old. The pairs of a silent body are stale.
    """

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
    """(k,) seconds since the bounds answered the present poses; 0 while they do, inf if never."""
    stamp_s: np.ndarray
    """(k,) stamp of the older of the two poses; NaN while one is unknown."""
    silent: tuple[str, ...]
    """For each pair, why its bodies are silent; empty if none is."""
    features: Mapping[int, tuple[str, str]] = field(default_factory=dict)
    """By row of a pair at warn or stop, the elements on which its closest points lie, such as
    ``patch 4 1 0.8``: the kind of the element, its index, and the place on it."""
    silent_bodies: Mapping[int, tuple[str, ...]] = field(default_factory=dict)
    """By row of a stale pair, the names of its silent bodies."""

    def __len__(self) -> int:
        """Return how many pairs are listed."""
        return len(self.names)

    @cached_property
    def places(self) -> Mapping[tuple[str, str], int]:
        """The row of each pair."""
        return places(self.names)  # kept as an attribute, because a look-up hashes all names

    @cached_property
    def rows_of(self) -> Mapping[str, Sequence[int]]:
        """The rows of the pairs of each body that has any."""
        return rows_of(self.names)

    @cached_property
    def silent_names(self) -> frozenset[str]:
        """All silent bodies that have a listed pair."""
        return frozenset(name for bodies in self.silent_bodies.values() for name in bodies)

    @cached_property
    def all_silent(self) -> bool:
        """Whether certainly all pairs of silent bodies are listed; of very many, only some are."""
        return np.count_nonzero(self.level == STALE) < LISTED_SILENT

    @cached_property
    def heard_names(self) -> frozenset[str]:
        """The bodies that are certainly not silent, among those that have a listed pair."""
        told = (
            i for i, level in enumerate(self.level) if level != STALE or i in self.silent_bodies
        )
        return frozenset(name for i in told for name in self.names[i]) - self.silent_names

    @cached_property
    def touching(self) -> np.ndarray:
        """(k,) whether the bodies certainly touch, cross or overlap."""
        return (self.status == INTERSECTING) | (self.status == OVERLAPPING) | (self.upper <= 0.0)


@dataclass(frozen=True, eq=False)
class Frame:
    """A tick: its stamp, poses and pairs."""

    stamp_s: float
    poses: np.ndarray
    """(m, 7) poses of the moving bodies in the scene's order: x y z in metres, quaternion w x y z;
    all zeros if a body has no pose."""
    pairs: Pairs
    whole: bool = True
    """Whether `pairs` holds all pairs that the tick listed."""

    def pose(self, row: int) -> np.ndarray | None:
        """Return the pose (7,) of a moving body; None: it has none."""
        pose = self.poses[row]
        return pose if pose[3:].any() else None


@dataclass(frozen=True)
class Health:
    """The monitor's report about its own work, sent each second."""

    schedule: Mapping[str, str] = field(default_factory=dict)
    """Values of the task "schedule" by key; "message" is the summary."""
    clearance: Mapping[str, str] = field(default_factory=dict)
    """Values of the task "clearance", about the pairs."""

    def number(self, key: str) -> float:
        """Return a value as a number; NaN if there is none."""
        return float(self.schedule.get(key, math.nan))


@dataclass(frozen=True)
class Playing:
    """A player's last report of its motion; the moment follows from it until the next report."""

    moment_s: float
    """Seconds of motion at `stamp_s`."""
    stamp_s: float
    speed: float
    """Seconds of motion per second; 0: it stands still."""
    period_s: float | None
    """Seconds after which the motion repeats or stops; None: it does neither."""
    repeats: bool = True
    """Whether it repeats after its period."""

    @classmethod
    def read(cls, text: str) -> Playing:
        """Read the JSON of a player's ~/motion.

        Raises:
            ValueError: the text is not what a player of this version publishes.
        """
        try:
            told = cls(**json.loads(text))
            numbers = (told.moment_s, told.stamp_s, told.speed, told.period_s or 1.0)
            if not all(math.isfinite(each) for each in numbers):
                raise ValueError("a number is not finite")
        except (TypeError, ValueError) as error:
            raise ValueError(f"a player's ~/motion cannot be interpreted: {error}") from error
        return told

    def at(self, stamp_s: float) -> float:
        """Return the moment of the motion at a stamp, within the period."""
        moment = self.moment_s + max(stamp_s - self.stamp_s, 0.0) * self.speed
        if not self.period_s:
            return moment
        return moment % self.period_s if self.repeats else min(moment, self.period_s)
