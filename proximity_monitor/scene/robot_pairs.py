"""The pairs of a robot's own links that are not watched."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import Any

from proximity_monitor import engine
from proximity_monitor.scene.description import Body, Robot, Unit
from proximity_monitor.scene.kinematics import Kinematics
from proximity_monitor.scene.primitives import load_model
from proximity_monitor.scene.report import Keys, Report, listed
from proximity_monitor.scene.srdf import Srdf

_SAME = 1e-5
"""Two links touch if their gap is at most this fraction of the smaller link's radius. Descriptions
round: 1.5708 for a right angle turns a link by 4e-6 radians too far."""

Pairs = Iterator[frozenset[str]]


def excluded(
    data: Mapping[str, Any],
    keys: Keys,
    robot: Robot,
    names: Mapping[str, str],
    bodies: list[Body],
    srdf: Srdf | None,
    unit: Unit,
    report: Report,
) -> Pairs:
    """Yield the pairs of the robot's own bodies that are not to be watched.

    Args:
        data: the robot's entry in the file.
        keys: the place of the entry.
        robot: the robot that it describes.
        names: the body by link, for links with a shape.
        bodies: the bodies of these links.
        srdf: the semantic description that the entry names, if any.
        unit: the scene's.
        report: takes the problems.
    """
    links = robot.kinematics.links
    apart = itertools.chain(
        _rigid(robot.kinematics, names),
        _adjacent(robot.kinematics, names) if data.get("exclude_adjacent", True) else (),
        _named(data.get("exclude", ()), (*keys, "exclude"), names, report),
        () if srdf is None else _disabled(srdf, (*keys, "srdf"), links, report),
    )
    for pair in apart:
        if names.keys() >= pair:
            yield frozenset(names[link] for link in pair)
    if data.get("exclude_touching", False):
        yield from _touching(robot, bodies, (*keys, "exclude_touching"), unit, report)


def _rigid(kinematics: Kinematics, names: Mapping[str, str]) -> Pairs:
    """Yield the pairs of links whose clearance never changes."""
    units = {link: kinematics.unit(link) for link in names}
    for a, b in itertools.combinations(names, 2):
        if units[a] == units[b]:
            yield frozenset((a, b))


def _adjacent(kinematics: Kinematics, names: Mapping[str, str]) -> Pairs:
    for link in names:
        parents = (joint.parent for joint in kinematics.path(link))
        # Links without a shape, such as tool frames, do not count as being between others.
        if (parent := next((each for each in parents if each in names), None)) is not None:
            yield frozenset((link, parent))


def _named(pairs: list[list[str]], keys: Keys, names: Mapping[str, str], report: Report) -> Pairs:
    for index, pair in enumerate(pairs):
        for at, link in enumerate(pair):
            if link not in names:
                report.add(
                    (*keys, index, at),
                    f"the robot has no link '{link}' with a shape",
                    (link, names),
                )
        if pair[0] == pair[1]:
            report.add(
                (*keys, index), f"'{pair[0]}' and '{pair[1]}' are the same link; name two links"
            )
        yield frozenset(pair)


def _disabled(srdf: Srdf, keys: Keys, links: tuple[str, ...], report: Report) -> Pairs:
    told = set()
    for rule in srdf.rules:
        for link in set(rule.links) - set(links) - told:
            told.add(link)
            # An SRDF file often serves several variants of a robot; MoveIt ignores this, too.
            report.warn(keys, f"{srdf.path}:{rule.line}: the robot has no link '{link}'")
    return srdf.disabled(links)


def _touching(robot: Robot, bodies: list[Body], keys: Keys, unit: Unit, report: Report) -> Pairs:
    """Yield the pairs that touch, overlap or contain one another where the robot starts.

    If it is not certain whether a pair touches, it stays watched, because nobody would notice a
    pair that is wrongly left out. The report names it.
    """
    if not all(body.primitive.parts for body in bodies):
        return  # a mesh is missing, which was reported
    poses = {body.name: body.pose for body in bodies} | robot.poses({})
    try:
        models = {body.name: load_model(body, unit) for body in bodies}
    except (OSError, engine.ModelError) as error:
        report.add(keys, str(error))
        return
    touching, open_ = [], []
    for a, b in itertools.combinations(models, 2):
        found = engine.signed_distance(models[a], poses[a], models[b], poses[b], rel_err=1.0)
        same = _SAME * min(models[a].radius, models[b].radius)
        if found.lower <= same:
            (touching if found.upper <= same else open_).append((a, b))
    for pairs, said in (
        (touching, "not watched, because they touch at the robot's start positions"),
        (open_, "watched, although they may touch at the robot's start positions (their deviations "
                "leave it open); list those that do in 'exclude'"),
    ):  # fmt: skip
        if pairs:
            report.warn(keys, f"{said}: {listed([f'{a} - {b}' for a, b in pairs])}")
    yield from map(frozenset, touching)
