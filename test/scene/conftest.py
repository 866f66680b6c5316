"""Scene files made for one test."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from proximity_monitor.scene import Scene, SceneError, load_scene

Load = Callable[[str], Scene]


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Write a text to a scene file, beside a model file `part.stl`, and load it."""
    (tmp_path / "part.stl").write_text("")

    def write_and_load(text: str) -> Scene:
        path = tmp_path / "scene.yaml"
        path.write_text(text, encoding="utf-8")
        return load_scene(path)

    return write_and_load


@pytest.fixture
def problems(load: Load) -> Callable[[str], list[str]]:
    """Return a function that loads a faulty text and returns the error's lines without path."""

    def message_lines(text: str) -> list[str]:
        with pytest.raises(SceneError) as caught:
            load(text)
        return [line.partition("scene.yaml:")[2] for line in str(caught.value).splitlines()]

    return message_lines
