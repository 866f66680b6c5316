"""The `robots` section: each robot's links become bodies, and its joints move them."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, NoReturn

import numpy as np

from proximity_monitor.scene.bodies import read_colour, read_pose, read_solid, read_topic
from proximity_monitor.scene.description import Body, Compound, Part, Robot, Root, Unit
from proximity_monitor.scene.kinematics import Joint, Kinematics
from proximity_monitor.scene.markup import Arguments, is_xacro
from proximity_monitor.scene.naming import fitting, rooted
from proximity_monitor.scene.paths import mesh_path, model_path
from proximity_monitor.scene.report import Keys, Report, SceneError, listed, meant
from proximity_monitor.scene.robot_pairs import excluded
from proximity_monitor.scene.srdf import Srdf, SrdfError, read_srdf
from proximity_monitor.scene.urdf import Link, Urdf, UrdfError, parse_urdf, read_urdf

Describe = Callable[[str], str]
"""Returns the robot description that is published on a topic, and may wait for it."""

_ROUNDED = 1e-5
"""Radians or metres by which a position may exceed a limit: descriptions round pi to 3.14159."""

_UNFIT = re.compile(r"[^a-z0-9_]")


@dataclass(frozen=True)
class Robots:
    """What the section adds to the scene."""

    robots: tuple[Robot, ...]
    bodies: tuple[Body, ...]
    """The links that have a shape, in the order of the robots and of their descriptions."""
    groups: Mapping[str, list[str]]
    """Names of a robot's bodies, by the robot's name."""
    excluded: frozenset[frozenset[str]]
    """Pairs of bodies that are not watched."""


def read_robots(
    section: list[dict[str, Any]],
    bodies: tuple[Body, ...],
    assemblies: Collection[str],
    folder: Path,
    unit: Unit,
    report: Report,
    describe: Describe | None,
) -> Robots:
    """Make robots and the bodies of their links; their problems go to the report.

    Args:
        section: the file's section, which obeys the schema.
        bodies: the scene's other bodies, whose names are taken.
        assemblies: the names of the assemblies, which are taken as well.
        folder: the scene file's.
        unit: of the base poses; a robot description is in metres and radians.
        report: takes the problems.
        describe: for descriptions that come from topics; None: such a robot is a problem.
    """
    taken = {*assemblies, *(body.name for body in bodies)}
    robots, links, groups, apart = [], [], {}, set()
    for index, data in enumerate(section):
        keys = ("robots", index)
        if data["name"] in taken:
            report.add((*keys, "name"), f"'{data['name']}' is already used; choose another name")
        taken.add(data["name"])
        urdf, srdf = _descriptions(data, keys, folder, report, describe)
        reader = _Reader(data, keys, urdf, unit, report)
        robots.append(reader.robot)
        found = list(reader.bodies(taken))
        links += found
        groups[data["name"]] = [body.name for body in found]
        # Two links that got the same body name, which was reported, make no pair.
        apart.update(
            pair
            for pair in excluded(data, keys, reader.robot, reader.names, found, srdf, unit, report)
            if len(pair) == 2
        )
    return Robots(tuple(robots), tuple(links), groups, frozenset(apart))


def _descriptions(
    data: Mapping[str, Any],
    keys: Keys,
    folder: Path,
    report: Report,
    describe: Describe | None,
) -> tuple[Urdf, Srdf | None]:
    """Read a robot's description, and its semantic description if it names one."""
    # Arguments of xacro files are text, even if YAML would read a number, for example.
    given = {name: report.texts[*keys, "xacro_args", name] for name in data.get("xacro_args", {})}
    arguments = Arguments(given)
    key, srdf = "urdf", None
    if not isinstance(data[key], str):
        read_topic(data[key]["topic"], (*keys, key, "topic"), report)
        report.check()
    try:
        urdf = _urdf(data[key], folder, arguments, describe)
        key = "srdf"
        if key in data:
            srdf = read_srdf(model_path(data[key], folder), arguments)
        key = "xacro_args"
        if arguments and not any(is_xacro(Path(str(data.get(each)))) for each in ("urdf", "srdf")):
            raise SceneError("apply only to xacro files, whose names end in .xacro; remove them")
        for name in given.keys() - arguments.asked:
            known = meant(name, sorted(arguments.asked))
            report.warn((*keys, key, name), f"no xacro file has the argument '{name}'{known}")
    except (SceneError, UrdfError, SrdfError) as error:
        report.add((*keys, key), str(error))
        report.check()  # nothing that names links can be checked without them
        raise
    return urdf, srdf


def _urdf(
    source: str | Mapping[str, str],
    folder: Path,
    arguments: Mapping[str, str],
    describe: Describe | None,
) -> Urdf:
    if isinstance(source, str):
        return read_urdf(model_path(source, folder), arguments)
    topic = source["topic"]
    if describe is None:
        raise SceneError(
            f"the description comes from the topic {topic}, so only the nodes can use this scene; "
            "name a file in 'urdf' to use it here"
        )
    return parse_urdf(describe(topic), f"topic {topic}", folder)


class _Reader:
    """Reads one robot of the section."""

    def __init__(
        self, data: Mapping[str, Any], keys: Keys, urdf: Urdf, unit: Unit, report: Report
    ) -> None:
        self._data, self._keys, self._urdf = data, keys, urdf
        self._unit, self._report = unit, report
        self.names: dict[str, str] = {}
        """Name of the body by name of the link, for links with a shape."""
        kinematics = urdf.kinematics
        base = np.eye(4)
        if "pose" in data:
            base = read_pose(data["pose"], (*keys, "pose"), unit, report)
        base = np.eye(4) if base is None else base
        base.setflags(write=False)
        start = self._start(kinematics)
        shaped = [link.name for link in urdf.links if self._shapes(link)]
        plain = {link: self._body_name(_UNFIT.sub("_", link.lower())) for link in shaped}
        count = Counter(plain.values())
        for link, name in plain.items():
            # If several links get the same plain name, each keeps its own spelling.
            self.names[link] = name if count[name] == 1 else self._body_name(fitting(link))
        if not self.names:
            self._tell_nothing_to_watch()
        self._warn_of_shapes()
        root = self._root() if "root" in data else None
        self.robot = Robot(
            name=data["name"],
            kinematics=kinematics,
            base=base,
            topic=read_topic(data.get("topic", "joint_states"), (*keys, "topic"), report),
            start=MappingProxyType(start),
            links=MappingProxyType(
                {
                    name: link
                    for link, name in self.names.items()
                    if root is not None or kinematics.drivers(link)
                }
            ),
            root=root,
        )

    def _root(self) -> Root:
        data, name = self._data["root"], self._data["name"]
        topic = data.get("topic", f"bodies/{name}/pose")
        read_topic(topic, (*self._keys, "root", "topic"), self._report)
        return Root(topic, data.get("frame", name))

    def _kinds(self) -> tuple[str, str]:
        """Return which kind of link shapes is watched, and which kind is not."""
        wanted = self._data.get("meshes", "collision")
        return wanted, {"collision": "visual", "visual": "collision"}[wanted]

    def _warn_of_shapes(self) -> None:
        wanted, other = self._kinds()
        links = [
            link.name
            for link in self._urdf.links
            if link.name not in self.names and getattr(link, other)
        ]
        if links:
            self._report.warn(
                (*self._keys, "meshes"),
                f"not watched, because they have only a {other} shape: {listed(links)}; give them "
                f"a {wanted} shape, or set 'meshes: {other}'",
            )

    def _tell_nothing_to_watch(self) -> NoReturn:
        wanted, other = self._kinds()
        way_out = "; remove the robot"
        if any(getattr(link, other) for link in self._urdf.links):
            way_out = f", but some have a {other} shape: set 'meshes: {other}'"
        self._report.add(
            (*self._keys, "meshes"),
            f"no link of {self._data['name']} has a {wanted} shape{way_out}",
        )
        self._report.check()

    def _start(self, kinematics: Kinematics) -> dict[str, float]:
        """Return the file's start positions; report unknown joints and exceeded limits."""
        start = {}
        free = {joint.name: joint for joint in kinematics.free}
        for kind in ("angles_deg", "offsets"):
            for name, value in self._data.get(kind, {}).items():
                keys = (*self._keys, kind, name)
                if (joint := _joint(name, kind, free, keys, self._report)) is None:
                    continue
                # Converts the file's values to the description's units.
                factor = math.radians(1.0) if kind == "angles_deg" else self._unit.to_metre
                start[name] = factor * value
                if not joint.lower - _ROUNDED <= start[name] <= joint.upper + _ROUNDED:
                    low, high = joint.lower / factor, joint.upper / factor
                    self._report.add(
                        keys,
                        f"must be within its limits, {low:.6g} to {high:.6g} (got {value:g})",
                    )
        return start

    def _shapes(self, link: Link) -> tuple:
        return link.collision if self._data.get("meshes") != "visual" else link.visual

    def _body_name(self, link: str) -> str:
        """Return ``ROBOT_LINK``, or the link's name if it begins with ``ROBOT_`` already."""
        robot = self._data["name"]
        return link if link.startswith(f"{robot}_") else fitting(f"{robot}_{link}")

    def bodies(self, taken: set[str]) -> Iterator[Body]:
        """Yield the bodies of links that have a shape, and add their names to `taken`."""
        robot, kinematics = self.robot, self._urdf.kinematics
        poses = kinematics.poses(kinematics.values(robot.start), robot.base)
        standing = dict(zip(kinematics.links, poses, strict=True))
        for link in self._urdf.links:
            if link.name not in self.names:
                continue
            name = self.names[link.name]
            if name in taken:
                self._report.add(
                    (*self._keys, "name"),
                    f"link '{link.name}' would become the body '{name}', but that name is already "
                    "used; give the robot another name",
                )
            taken.add(name)
            pose = None
            if name not in robot.links:  # only fixed joints lead to it, and the root does not move
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


def check_script(section: Mapping[str, Any], robots: tuple[Robot, ...], report: Report) -> None:
    """Report a `script`'s joints that are unknown, ambiguous, of another kind, or share a topic."""
    free = joints_of(robots)
    firsts = {called: owned[0][1] for called, owned in free.items()}
    for name, joint in section.get("script", {}).get("joints", {}).items():
        keys, owned = ("motion", "script", "joints", name), free.get(name, [])
        if len(owned) > 1:
            owners = " or ".join(f"'{robot.name}/{joint.name}'" for robot, joint in owned)
            report.add(keys, f"is a joint of several robots; write {owners}")
            continue
        (kind,) = joint
        found = _joint(name, kind, firsts, keys, report)
        for other in robots if found else ():
            robot = owned[0][0]
            names = [each.name for each in other.kinematics.free]
            shared = rooted(other.topic) == rooted(robot.topic)
            if other is not robot and shared and found.name in names:
                report.add(
                    keys,
                    f"robots '{robot.name}' and '{other.name}' read '{found.name}' from the same "
                    f"topic, {rooted(robot.topic)} (without a namespace); give each its own topic",
                )


def joints_of(robots: Sequence[Robot]) -> dict[str, list[tuple[Robot, Joint]]]:
    """Return the joints that a script may move, by the names it may use: JOINT or ROBOT/JOINT."""
    found: dict[str, list[tuple[Robot, Joint]]] = {}
    for robot in robots:
        for joint in robot.kinematics.free:
            found.setdefault(joint.name, []).append((robot, joint))
    for robot in robots:
        for joint in robot.kinematics.free:
            found.setdefault(f"{robot.name}/{joint.name}", [(robot, joint)])
    return found


def _joint(
    name: str, kind: str, free: Mapping[str, Joint], keys: Keys, report: Report
) -> Joint | None:
    """Return a free joint by name; None, with a problem in the report, if it does not fit.

    `kind` is the key under which the file gives the joint's positions: angles_deg or offsets.
    """
    if name not in free:
        report.add(keys, f"'{name}' is not a joint whose position can be set", (name, free))
        return None
    slides = free[name].kind == "prismatic"
    if slides != (kind == "offsets"):
        does, wanted = ("slides", "offsets") if slides else ("turns", "angles_deg")
        report.add(keys, f"'{name}' {does}; give its positions as '{wanted}'")
        return None
    return free[name]
