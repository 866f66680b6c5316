"""The `robots` section: each robot's links become bodies, and its joints what moves them."""

from __future__ import annotations

import difflib
import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from proximity_monitor import engine
from proximity_monitor.scene.bodies import read_colour, read_pose, read_solid, read_topic
from proximity_monitor.scene.description import Body, Compound, Part, Robot, Unit
from proximity_monitor.scene.kinematics import Joint, Kinematics
from proximity_monitor.scene.paths import mesh_path, model_path
from proximity_monitor.scene.primitives import load_model
from proximity_monitor.scene.report import Keys, Report, SceneError
from proximity_monitor.scene.urdf import Link, Urdf, UrdfError, read_urdf

_UNFIT = re.compile(r"[^a-z0-9_]")


@dataclass(frozen=True)
class Robots:
    """What the section adds to a scene."""

    robots: tuple[Robot, ...]
    bodies: tuple[Body, ...]
    """The links that have a shape, in the order of the robots and of their descriptions."""
    groups: Mapping[str, list[str]]
    """By a robot's name, its bodies."""
    excluded: frozenset[frozenset[str]]
    """Pairs of bodies not to watch."""


def read_robots(
    section: list[dict[str, Any]],
    bodies: tuple[Body, ...],
    folder: Path,
    unit: Unit,
    report: Report,
) -> Robots:
    """Make robots and the bodies of their links; what is wrong with them goes to the report.

    Args:
        section: obeys the schema.
        bodies: the scene's other bodies, whose names are taken.
        folder: the scene file's.
        unit: of the base poses; a robot description is in metres and radians.
        report: takes the problems.
    """
    taken = {body.name for body in bodies}
    robots, links, groups, excluded = [], [], {}, set()
    for index, data in enumerate(section):
        keys = ("robots", index)
        if data["name"] in taken:
            report.add((*keys, "name"), f"'{data['name']}' is taken; each robot needs its own name")
        taken.add(data["name"])
        urdf = _description(data["urdf"], (*keys, "urdf"), folder, report)
        reader = _Reader(data, keys, urdf, unit, report)
        robots.append(reader.robot)
        found = list(reader.bodies(taken))
        links += found
        groups[data["name"]] = [body.name for body in found]
        # Two links may have come to one name, which is told; it makes no pair.
        excluded.update(pair for pair in reader.excluded(found) if len(pair) == 2)
    return Robots(tuple(robots), tuple(links), groups, frozenset(excluded))


def _description(text: str, keys: Keys, folder: Path, report: Report) -> Urdf:
    try:
        return read_urdf(model_path(text, folder))
    except (SceneError, UrdfError) as error:
        report.add(keys, str(error))
        report.check()  # without its links, nothing that names them can be judged
        raise


class _Reader:
    """One robot of the section."""

    def __init__(
        self, data: Mapping[str, Any], keys: Keys, urdf: Urdf, unit: Unit, report: Report
    ) -> None:
        self._data, self._keys, self._urdf = data, keys, urdf
        self._unit, self._report = unit, report
        self._names: dict[str, str] = {}
        kinematics = urdf.kinematics
        base = np.eye(4)
        if "pose" in data:
            base = read_pose(data["pose"], (*keys, "pose"), unit, report)
        base = np.eye(4) if base is None else base
        base.setflags(write=False)
        start = self._start(kinematics)
        for link in urdf.links:
            if self._shapes(link):
                self._names[link.name] = self._body_name(link.name)
        self.robot = Robot(
            name=data["name"],
            kinematics=kinematics,
            base=base,
            topic=read_topic(data.get("topic", "joint_states"), (*keys, "topic"), report),
            start=MappingProxyType(start),
            links=MappingProxyType(
                {name: link for link, name in self._names.items() if kinematics.drivers(link)}
            ),
        )

    def _start(self, kinematics: Kinematics) -> dict[str, float]:
        """The positions that the file gives, of joints that exist and can have them."""
        start = {}
        for kind in ("angles_deg", "offsets"):
            for name, value in self._data.get(kind, {}).items():
                keys = (*self._keys, kind, name)
                if (joint := _joint(name, kind, kinematics.free, keys, self._report)) is None:
                    continue
                # What the file's values are in those of the description.
                factor = math.radians(1.0) if kind == "angles_deg" else self._unit.to_metre
                start[name] = factor * value
                if not joint.lower <= start[name] <= joint.upper:
                    low, high = joint.lower / factor, joint.upper / factor
                    self._report.add(
                        keys, f"must be {low:.6g} to {high:.6g}, its limits (got {value:g})"
                    )
        return start

    def _shapes(self, link: Link) -> tuple:
        return link.collision if self._data.get("meshes") != "visual" else link.visual

    def _body_name(self, link: str) -> str:
        """``ROBOT_LINK`` in the letters that a body's name may have."""
        robot, name = self._data["name"], _UNFIT.sub("_", link.lower())
        return name if name.startswith(f"{robot}_") else f"{robot}_{name}"

    def bodies(self, taken: set[str]) -> Iterator[Body]:
        """The links that have a shape; their names are added to those that are taken."""
        robot, kinematics = self.robot, self._urdf.kinematics
        poses = kinematics.poses(kinematics.values(robot.start), robot.base)
        standing = dict(zip(kinematics.links, poses, strict=True))
        for link in self._urdf.links:
            if link.name not in self._names:
                continue
            name = self._names[link.name]
            if name in taken:
                self._report.add(
                    (*self._keys, "name"),
                    f"link '{link.name}' would be the body '{name}', a name that is taken",
                )
            taken.add(name)
            pose = None
            if name not in robot.links:  # it hangs on fixed joints alone
                pose = standing[link.name]
                pose.setflags(write=False)
            yield Body(
                name=name,
                model=None,
                primitive=Compound(tuple(self._parts(link))),
                scale=1.0,
                pose=pose,
                topic=None,
                colour=read_colour(self._data),
                **read_solid(self._data, self._keys, self._report),
            )

    def _parts(self, link: Link) -> Iterator[Part]:
        for shape in self._shapes(link):
            found = shape.geometry
            if isinstance(found, str):
                try:
                    found = mesh_path(found, self._urdf.path)
                except SceneError as error:
                    self._report.add((*self._keys, "urdf"), f"link '{link.name}': {error}")
                    continue
            yield Part(found, shape.scale, shape.xyz, shape.rpy)

    def excluded(self, bodies: list[Body]) -> Iterator[frozenset[str]]:
        """The pairs of the robot's own bodies that are not to be watched."""
        kinematics, names = self._urdf.kinematics, self._names
        units = {link: kinematics.unit(link) for link in names}
        for a, b in itertools.combinations(names, 2):
            if units[a] == units[b]:  # their clearance never changes
                yield frozenset((names[a], names[b]))
        if self._data.get("exclude_adjacent", True):
            for link in names:
                parents = (joint.parent for joint in kinematics.path(link))
                # Links without a shape, as for tool frames, stand between others in name alone.
                if (parent := next((each for each in parents if each in names), None)) is not None:
                    yield frozenset((names[link], names[parent]))
        for index, pair in enumerate(self._data.get("exclude", ())):
            keys = (*self._keys, "exclude", index)
            for at, link in enumerate(pair):
                if link not in names:
                    self._report.add(
                        (*keys, at), f"no link '{link}' has a shape{_meant(link, names)}"
                    )
            if pair[0] == pair[1]:
                self._report.add(keys, f"'{pair[0]}' and '{pair[1]}' are one link; name two")
            if all(link in names for link in pair):
                yield frozenset(names[link] for link in pair)
        if self._data.get("exclude_touching", False):
            yield from self._touching(bodies)

    def _touching(self, bodies: list[Body]) -> Iterator[frozenset[str]]:
        """The pairs that touch where the robot starts."""
        if not all(body.primitive.parts for body in bodies):
            return  # a mesh is missing, which is told
        poses = {body.name: body.pose for body in bodies} | self.robot.poses({})
        try:
            models = {body.name: load_model(body, self._unit) for body in bodies}
        except (OSError, engine.ModelError) as error:
            self._report.add((*self._keys, "exclude_touching"), str(error))
            return
        for a, b in itertools.combinations(models, 2):
            if engine.collide(models[a], poses[a], models[b], poses[b]).colliding:
                yield frozenset((a, b))


def check_script(section: Mapping[str, Any], robots: tuple[Robot, ...], report: Report) -> None:
    """Report the joints that a `script` names and no robot has, or has of another kind."""
    free = [joint for robot in robots for joint in robot.kinematics.free]
    for name, joint in section.get("script", {}).get("joints", {}).items():
        (kind,) = joint
        _joint(name, kind, free, ("motion", "script", "joints", name), report)


def _joint(name: str, kind: str, free: Sequence[Joint], keys: Keys, report: Report) -> Joint | None:
    """The joint of a name whose positions the file gives as `kind`: angles_deg or offsets."""
    by_name = {joint.name: joint for joint in free}
    if name not in by_name:
        report.add(keys, f"no joint '{name}' can be set{_meant(name, by_name)}")
        return None
    slides = by_name[name].kind == "prismatic"
    if slides != (kind == "offsets"):
        does, wanted = ("slides", "offsets") if slides else ("turns", "angles_deg")
        report.add(keys, f"'{name}' {does}; its positions are '{wanted}'")
        return None
    return by_name[name]


def _meant(name: str, known: Mapping[str, Any]) -> str:
    near = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean '{near[0]}'?" if near else f"; known are {', '.join(known) or 'none'}"
