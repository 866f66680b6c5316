"""Reads scene files: parses the text, notes line numbers, checks the schema, makes the scene."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Any

from proximity_monitor.scene import schema
from proximity_monitor.scene.bodies import check_clouds, read_bodies
from proximity_monitor.scene.description import UNITS, Scene
from proximity_monitor.scene.effects import read_motion
from proximity_monitor.scene.pairs import PairSettings, read_pairs, read_settings
from proximity_monitor.scene.report import Report, shown
from proximity_monitor.scene.robots import Describe, check_script, read_robots
from proximity_monitor.scene.source import read

_VERSION = 1


def load_scene(path: str | os.PathLike[str], describe: Describe | None = None) -> Scene:
    """Read a scene file.

    Model files are opened later, by `load_model`, with two exceptions: an assembly, because its
    parts become bodies, and the meshes of a robot with `exclude_touching`.

    Args:
        path: the file.
        describe: returns the robot description that is published on a topic, and may wait for it.
            None: scenes that name such a topic are refused.

    Returns:
        The scene in SI units.

    Raises:
        SceneError: one line for each problem, as ``FILE:LINE: KEY: what is wrong (got VALUE)``,
            sorted by line. The schema is checked first. Only a file that obeys it is checked for
            unknown names, missing model files and the like.
    """
    data, report = read(path)
    _check_version(data, report)
    schema.check(data, report)
    report.check()
    scene = _scene(data, Path(os.path.abspath(os.fspath(path))), report, describe)
    report.check()
    return scene


def _check_version(data: Any, report: Report) -> None:
    """Refuse another version at once: its keys may mean anything, so nothing else is checked."""
    if isinstance(data, dict) and "version" in data and ("version",) not in report.places():
        version = data["version"]
        if type(version) is not int or version != _VERSION:
            report.fail(
                f"version: {shown(version)} is not supported; "
                f"this release reads version {_VERSION}",
                report.line(("version",)),
            )


def _scene(data: dict[str, Any], path: Path, report: Report, describe: Describe | None) -> Scene:
    unit = UNITS[data["unit"]]
    limits = read_settings(data, (), PairSettings(), unit, report)
    defaults = dataclasses.replace(limits, own_thresholds=False)
    bodies, groups = read_bodies(data.get("bodies", []), path.parent, unit, report)
    robots = read_robots(
        data.get("robots", []), bodies, groups, path.parent, unit, report, describe
    )
    bodies += robots.bodies
    check_clouds(data.get("bodies", []), bodies, report)
    motion = None
    if "motion" in data:
        motion = read_motion(data["motion"], bodies, unit, report, path.parent, robots.robots)
        check_script(data["motion"], robots.robots, report)
    return Scene(
        path=path,
        frame=data.get("frame", "world"),
        unit=unit,
        rate_hz=float(data.get("rate_hz", 30.0)),
        budget_s=data.get("budget_ms", 8.0) / 1000.0,
        bodies=bodies,
        pairs=read_pairs(data.get("pairs", "all"), bodies, defaults, unit, report, robots, groups),
        motion=motion,
        description=data.get("description", ""),
        robots=robots.robots,
        thresholds=defaults.thresholds,
        warnings=report.warnings(),
    )
