"""`script`: bodies by timed key poses, hinges, slides or pose tables; robots' joints by keys."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from proximity_monitor.scene.description import Unit
from proximity_monitor.scene.effects.cast import Cast
from proximity_monitor.scene.effects.pose_table import read_poses
from proximity_monitor.scene.effects.values import direction, frozen, metres
from proximity_monitor.scene.paths import model_path
from proximity_monitor.scene.poses import UNIT_LENGTH, pose_matrix
from proximity_monitor.scene.report import Keys, Report, SceneError

_HINGE, _SLIDE = "angles_deg", "offsets"


def read(
    data: Mapping[str, Any], keys: Keys, bodies: Cast, unit: Unit, report: Report, folder: Path
) -> dict[str, Any]:
    """Return `loop`, and `bodies` and `joints` by name, as `motion.Script` takes them.

    A body has `times` (n,) and either `positions` (n, 3) and `quaternions` (n, 4), or `values`
    (n,) of its `hinge` or `slide`. A joint has `times`, `values` and `kind`, the key in the file.
    """
    if not data.keys() & {"bodies", "joints"}:
        report.add(keys, "needs the key 'bodies' or the key 'joints'")
    moved = {}
    for name, path in data.get("bodies", {}).items():
        at = (*keys, "bodies", name)
        bodies.drive(name, at, or_root=True)
        moved[name] = MappingProxyType(_path(path, at, unit, report, folder))
    joints = {}
    for name, joint in data.get("joints", {}).items():
        (kind,) = joint
        values = _values(joint, (*keys, "joints", name), unit, report)
        joints[name] = MappingProxyType({"kind": kind, **values})
    return {
        "loop": data.get("loop", True),
        "bodies": MappingProxyType(moved),
        "joints": MappingProxyType(joints),
    }


def _path(
    path: Mapping[str, Any], keys: Keys, unit: Unit, report: Report, folder: Path
) -> dict[str, Any]:
    if "keys" in path:
        return _key_poses(path["keys"], (*keys, "keys"), unit, report)
    if "csv" in path:
        return _table(path["csv"], (*keys, "csv"), unit, report, folder)
    (kind,) = path
    joint, at = path[kind], (*keys, kind)
    frame = {"axis": frozen(direction(joint, at, "axis", report)), "pose": np.eye(4)}
    if kind == "hinge":
        frame["origin"] = metres(joint["origin"], unit)
    if "pose" in joint:
        pose = joint["pose"]
        turn = _quaternion(pose, (*at, "pose"), report)
        frame["pose"] = pose_matrix(metres(pose["position"], unit), turn)
    frozen(frame["pose"])
    return {kind: MappingProxyType(frame), **_values(joint, at, unit, report)}


def _key_poses(
    entries: Sequence[Mapping[str, Any]], keys: Keys, unit: Unit, report: Report
) -> dict[str, Any]:
    quaternions = [_quaternion(each, (*keys, i), report) for i, each in enumerate(entries)]
    places = [(*keys, i, "t") for i in range(len(entries))]
    return {
        "times": _times([each["t"] for each in entries], places, report),
        "positions": metres([each["position"] for each in entries], unit),
        "quaternions": frozen(np.array(quaternions, dtype=np.float64)),
    }


def _table(text: str, keys: Keys, unit: Unit, report: Report, folder: Path) -> dict[str, Any]:
    try:
        times, positions, quaternions = read_poses(model_path(text, folder), unit)
    except SceneError as error:
        report.add(keys, str(error))
        return {}
    return {
        "times": frozen(times),
        "positions": frozen(positions),
        "quaternions": frozen(quaternions),
    }


def _values(
    joint: Mapping[str, Any], keys: Keys, unit: Unit, report: Report
) -> dict[str, np.ndarray]:
    """Return times (seconds) and values (radians or metres) of a joint's keys."""
    kind = _HINGE if _HINGE in joint else _SLIDE
    entries = joint[kind]
    places = [(*keys, kind, i) for i in range(len(entries))]
    values = np.array([value for _, value in entries], dtype=np.float64)
    return {
        "times": _times([t for t, _ in entries], places, report),
        "values": frozen(np.radians(values)) if kind == _HINGE else metres(values, unit),
    }


def _times(times: Sequence[float], places: Sequence[Keys], report: Report) -> np.ndarray:
    for i in range(1, len(times)):
        if not times[i] > times[i - 1]:
            report.add(
                places[i],
                f"must be later than the previous key, {times[i - 1]:g} s (got {times[i]:g})",
            )
    return frozen(np.array(times, dtype=np.float64))


def _quaternion(pose: Mapping[str, Any], keys: Keys, report: Report) -> list[float]:
    """Return an orientation x, y, z, w of length exactly 1, from a `rotation` or `quaternion`."""
    if "rotation" in pose:
        turn = pose["rotation"]
        axis = direction(turn, (*keys, "rotation"), "axis", report)
        half = math.radians(turn["angle_deg"]) / 2.0
        return [*(math.sin(half) * axis).tolist(), math.cos(half)]
    given = pose.get("quaternion", (0.0, 0.0, 0.0, 1.0))
    length = math.hypot(*given)
    if not abs(length - 1.0) <= UNIT_LENGTH:
        report.add(
            (*keys, "quaternion"), f"must have length 1 (got {length:.6g}); divide it by its length"
        )
        return [0.0, 0.0, 0.0, 1.0]
    return [part / length for part in given]
