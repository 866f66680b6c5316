"""Finds the scene that a user names, and loads its models."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from proximity_monitor import engine
from proximity_monitor.scene.paths import bundled, bundled_names
from proximity_monitor.scene.primitives import load_model
from proximity_monitor.scene.source import read

if TYPE_CHECKING:
    from proximity_monitor.scene.description import Scene


def find_scene(text: str) -> Path:
    """Return the scene file that `text` means: a path, or the name of a bundled scene.

    `text` is a path if it ends in .yaml or .yml, contains a folder, or names an existing file.

    Raises:
        SceneError: it is no path, and no scene of that name is bundled.
    """
    path = Path(text).expanduser()
    if path.suffix in (".yaml", ".yml") or len(path.parts) > 1 or path.is_file():
        return path
    return bundled(text)


def descriptions() -> dict[str, str]:
    """Return the one-line description of each bundled scene by name; empty if it has none.

    Raises:
        SceneError: a scene file does not read as YAML.
    """
    said = {}
    for name in bundled_names():
        data, _ = read(bundled(name))
        said[name] = str(data.get("description", ""))
    return said


def load_models(scene: Scene) -> dict[str, engine.Model]:
    """Return each body's model in metres by name; rigid bodies that look the same share one.

    Raises:
        FileNotFoundError, engine.ModelError: as `scene.load_model`.
    """
    shared: dict[tuple, engine.Model] = {}
    models = {}
    for body in scene.bodies:
        own = body.name if body.deforming else None
        look = (
            body.model, body.part, body.primitive, body.scale, body.solid, body.deviation, own
        )  # fmt: skip
        if look not in shared:
            shared[look] = load_model(body, scene.unit)
        models[body.name] = shared[look]
    return models
