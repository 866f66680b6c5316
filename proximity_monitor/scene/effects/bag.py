"""`bag`: poses recorded in a ROS 2 bag. Its path is checked here; the motion opens it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from proximity_monitor.scene.description import Unit
from proximity_monitor.scene.effects.cast import Cast
from proximity_monitor.scene.paths import model_path
from proximity_monitor.scene.report import Keys, Report, SceneError


def read(
    data: Mapping[str, Any], keys: Keys, bodies: Cast, unit: Unit, report: Report, folder: Path
) -> dict[str, Any]:
    """Return the arguments of `motion.Bag` except the frame.

    `topics` gives by topic a body's name for PoseStamped, or a tuple of names for PoseArray.
    """
    path = None
    try:
        path = model_path(data["path"], folder, or_folder=True)
    except SceneError as error:
        report.add((*keys, "path"), str(error))
    topics: dict[str, str | tuple[str, ...]] = {}
    for topic, moved in data["topics"].items():
        at = (*keys, "topics", topic)
        if isinstance(moved, str):
            bodies.drive(moved, at, or_root=True)
            topics[topic] = moved
        else:
            for i, name in enumerate(moved):
                bodies.drive(name, (*at, i), or_root=True)
            topics[topic] = tuple(moved)
    return {
        "path": path,
        "topics": MappingProxyType(topics),
        "rate": float(data.get("rate", 1.0)),
        "seek_s": float(data.get("seek_s", 0.0)),
        "loop": data.get("loop", True),
    }
