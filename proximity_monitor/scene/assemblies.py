"""Splits a body whose model file is an assembly: one body per part, placed as in the file."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from typing import Any

from proximity_monitor import engine
from proximity_monitor.scene.description import Body
from proximity_monitor.scene.naming import EVERYTHING, fitting, safe
from proximity_monitor.scene.report import Keys, Report


def parts_of(
    body: Body,
    data: dict[str, Any],
    keys: Keys,
    report: Report,
    read_topic: Callable[[str, Keys, Report], str],
    taken: Collection[str],
) -> Iterator[Body]:
    """Yield the bodies that a scene file's body stands for: its model's parts, or the body itself.

    A part has its name and colour from the model file, unless the scene gives a colour. It is named
    NAME/PART if its own name is `taken` by the assembly itself or by earlier bodies. The key `pose`
    is the pose of the assembly. The parts in `moving_parts`, or all parts with `moving`, have
    topics of their own, and their poses are those of their own frames. Problems go to the report; a
    body whose file cannot be read stands for none.
    """
    placements: list[engine.Placement] = []
    if body.model is not None and data.get("parts", True):
        try:
            placements = engine.load_placements(body.model, scale=body.scale)
        except (engine.ModelError, OSError) as error:
            report.add((*keys, "model"), str(error))
            return
    if len(placements) < 2:
        if "moving_parts" in data:
            problem = "is only for an assembly of several parts, without 'parts: false'; remove it"
            report.add((*keys, "moving_parts"), problem)
        yield body
        return
    if "topic" in data:
        message = "each part of an assembly has its own topic; write 'moving: true' instead, or "
        report.add((*keys, "topic"), message + "add 'parts: false' if it is one rigid body")
    names = _names(body.name, [each.name for each in placements], {*taken, EVERYTHING})
    loose = set(data.get("moving_parts", ()))
    for missing in loose - {*names, *(each.name for each in placements)}:
        report.add((*keys, "moving_parts"), f"there is no part '{missing}'", (missing, names))
    for name, placed in zip(names, placements, strict=True):
        # A body's name means that body alone; a part's name from the file means all such parts.
        moves = body.moving or name in loose or placed.name in loose.difference(names)
        pose = topic = None
        if moves:
            topic = read_topic(f"bodies/{safe(name)}/pose", keys, report)
        else:
            pose = body.pose @ placed.pose
            pose.setflags(write=False)
        colour = body.colour if "colour" in data or placed.colour is None else placed.colour
        yield replace(
            body, name=name, pose=pose, topic=topic, colour=colour, part=placed.model
        )  # fmt: skip


def _names(whole: str, parts: list[str], taken: Collection[str]) -> list[str]:
    """Return the parts' names: their own, changed if not allowed, taken, or used before."""
    made: list[str] = []
    for part in parts:
        own = fitting(part)
        base = fitting(f"{whole}/{own}") if own in taken else own
        name, number = base, 2
        while name in made or name in taken:
            name, number = fitting(base, f" {number}"), number + 1
        made.append(name)
    return made
