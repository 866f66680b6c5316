"""The `bodies` section: makes Body records from checked data."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from proximity_monitor.scene.assemblies import parts_of
from proximity_monitor.scene.description import (
    Body,
    Box,
    Capsule,
    Cloud,
    Cone,
    Cylinder,
    Point,
    Primitive,
    Sphere,
    Torus,
    Unit,
)
from proximity_monitor.scene.naming import rooted, safe
from proximity_monitor.scene.paths import model_path
from proximity_monitor.scene.poses import pose_matrix
from proximity_monitor.scene.report import Keys, Report, SceneError, listed, shown

_GREY = (0.7, 0.7, 0.7, 1.0)
_TOPIC = re.compile(r"(~/|/)?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")

_LONGEST_TOPIC = 200
"""Characters of a topic; DDS allows 255, with the node's namespace and the parts that ROS adds."""


def read_bodies(
    section: list[dict[str, Any]], folder: Path, unit: Unit, report: Report
) -> tuple[tuple[Body, ...], dict[str, list[str]]]:
    """Return the bodies, and the names of each assembly's parts; problems go to the report.

    Raises:
        SceneError: if an assembly cannot be read. What names its parts cannot be checked then.
    """
    bodies: list[Body] = []
    groups: dict[str, list[str]] = {}
    names: dict[str, int] = {}
    topics: dict[str, int] = {}
    complete = True
    for index, data in enumerate(section):
        keys = ("bodies", index)
        whole = _body(data, keys, folder, unit, report)
        # Two bodies of one name also share their default topic; report one problem, not two.
        own = _unique(whole.name, names, (*keys, "name"), report)
        found = list(parts_of(whole, data, keys, report, read_topic, names))
        for body in found:
            if body.name != whole.name:
                own = _unique(body.name, names, (*keys, "name"), report)
            if own and body.topic is not None:
                _unique(body.topic, topics, (*keys, "topic"), report)
        if any(body.part is not None for body in found):
            groups[whole.name] = [body.name for body in found]
        complete = complete and bool(found)
        bodies += found
    if not complete:
        report.check()
    return tuple(bodies), groups


def check_topics(bodies: Iterable[Body], file: str) -> None:
    """Check that no two bodies read their poses from one topic, as ``x`` and ``/x`` may be.

    `read_bodies` compares the topics as they are written, because under a namespace these two
    differ. Here they are those of a node without a namespace.

    Raises:
        SceneError: for all bodies that share a topic; the message begins with `file`.
    """
    readers: dict[str, list[str]] = {}
    for body in bodies:
        if body.topic is not None:
            readers.setdefault(rooted(body.topic), []).append(f"'{body.name}'")
    shared = [
        f"{file}: bodies {listed(names)} read their poses from one topic,"
        f" {topic} without a namespace; give each a topic of its own"
        for topic, names in readers.items()
        if len(names) > 1
    ]
    if shared:
        raise SceneError("\n".join(shared))


def _unique(name: str, seen: dict[str, int], keys: Keys, report: Report) -> bool:
    if name in seen:
        report.add(keys, f"'{name}' is already used on line {seen[name]}; each body needs its own")
        return False
    seen[name] = report.line(keys)
    return True


def _body(data: dict[str, Any], keys: Keys, folder: Path, unit: Unit, report: Report) -> Body:
    model = None
    if "model" in data:
        try:
            model = model_path(data["model"], folder)
        except SceneError as error:
            report.add((*keys, "model"), str(error))
    primitive = None
    if "primitive" in data:
        primitive = _primitive(data["primitive"], (*keys, "primitive"), unit, report)
    if isinstance(primitive, Cone | Torus) and data.get("solid") == "robust":
        report.add(
            (*keys, "solid"), "robust is only for meshes; a cone or torus is a solid already"
        )
    pose = topic = cloud = None
    if "cloud" in data:
        primitive, cloud = Point(), _cloud(data["cloud"], (*keys, "cloud"), unit, report)
    elif "pose" in data:
        pose = read_pose(data["pose"], (*keys, "pose"), unit, report)
    else:
        topic = data.get("topic", f"bodies/{safe(data['name'])}/pose")
        read_topic(topic, (*keys, "topic"), report)
    return Body(
        name=data["name"],
        model=model,
        primitive=primitive,
        scale=float(data.get("scale", 1.0)),
        pose=pose,
        topic=topic,
        colour=read_colour(data),
        **read_solid(data, keys, report),
        deviation=unit.to_metre * data.get("deviation", 0.0),
        deforming=data.get("deforming", False),
        cloud=cloud,
    )


def _cloud(data: dict[str, Any], keys: Keys, unit: Unit, report: Report) -> Cloud:
    topic = read_topic(data["topic"], (*keys, "topic"), report)
    return Cloud(topic, unit.to_metre * data.get("radius", 0.0), data.get("frame", ""))


def check_clouds(section: list[dict[str, Any]], bodies: tuple[Body, ...], report: Report) -> None:
    """Report the clouds of the file's section `bodies` whose frame is no body."""
    posed = [body.name for body in bodies if body.cloud is None]
    for index, data in enumerate(section):
        frame = data.get("cloud", {}).get("frame", "")
        if frame and frame not in posed:
            report.add(
                ("bodies", index, "cloud", "frame"),
                f"'{frame}' is not a body with a pose; known: {listed(posed)}; leave 'frame' out "
                "to use the scene's frame",
            )


def _primitive(data: dict[str, Any], keys: Keys, unit: Unit, report: Report) -> Primitive:
    ((kind, values),) = data.items()
    if kind == "box":
        x, y, z = (unit.to_metre * length for length in values["size"])
        return Box((x, y, z))
    if kind == "point":
        return Point()
    radius = unit.to_metre * values["radius"]
    if kind == "cylinder":
        return Cylinder(radius, unit.to_metre * values["height"], values.get("segments"))
    if kind == "capsule":
        return Capsule(radius, unit.to_metre * values["length"])
    if kind == "cone":
        top_radius = unit.to_metre * values.get("top_radius", 0.0)
        return Cone(radius, unit.to_metre * values["height"], top_radius)
    if kind == "torus":
        ring, tube = values["radius"], values["tube"]
        if tube > ring:
            found = f"must be at most the radius, {shown(ring)} (got {shown(tube)})"
            report.add((*keys, kind, "tube"), found)
        return Torus(radius, unit.to_metre * tube)
    return Sphere(radius, values.get("subdivisions"))


def read_topic(topic: str, keys: Keys, report: Report) -> str:
    """Return a topic; a problem with its name goes to the report."""
    if not _TOPIC.fullmatch(topic):
        report.add(
            keys,
            "must be a topic name: words of letters, digits and underscores that do not begin with "
            f"a digit, separated by single slashes (got {shown(topic)})",
        )
    elif len(topic) > _LONGEST_TOPIC:
        report.add(
            keys, f"must have at most {_LONGEST_TOPIC} characters as a topic (got {len(topic)})"
        )
    return topic


def read_solid(data: Mapping[str, Any], keys: Keys, report: Report) -> dict[str, Any]:
    """Return the arguments `solid` and `solid_at` of `Body`; empty if the data has no `solid`."""
    if "solid" not in data:
        return {}
    return {"solid": data["solid"], "solid_at": report.place((*keys, "solid"))}


def read_colour(data: Mapping[str, Any]) -> tuple[float, float, float, float]:
    """Return the red, green, blue and opacity of a body or robot."""
    red, green, blue, *opacity = data.get("colour", _GREY)
    return float(red), float(green), float(blue), float(opacity[0]) if opacity else 1.0


def read_pose(data: dict[str, Any], keys: Keys, unit: Unit, report: Report) -> np.ndarray | None:
    """Return a (4, 4) pose in metres, read-only; None, with a problem in the report, if bad."""
    position = [unit.to_metre * length for length in data["position"]]
    try:
        pose = pose_matrix(position, data.get("quaternion", (0.0, 0.0, 0.0, 1.0)))
    except ValueError as error:
        report.add((*keys, "quaternion"), str(error))
        return None
    pose.setflags(write=False)
    return pose
