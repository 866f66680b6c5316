"""Motions: a scene names effects, which give the poses of its moving bodies."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

from proximity_monitor.motion import deform, dynamics
from proximity_monitor.motion.bag import Bag
from proximity_monitor.motion.deform import Deform, Field
from proximity_monitor.motion.dynamics import Dynamics
from proximity_monitor.motion.motion import Motion
from proximity_monitor.motion.script import Script
from proximity_monitor.motion.slider_crank import SliderCrank
from proximity_monitor.motion.together import Together
from proximity_monitor.scene.opening import load_models

if TYPE_CHECKING:
    from proximity_monitor.engine import Model
    from proximity_monitor.scene import Scene

    Maker = Callable[
        [Mapping[str, Any], Scene, Mapping[str, Model], bool, Callable[[], bool]], Motion
    ]

__all__ = [
    "Bag",
    "Deform",
    "Dynamics",
    "Field",
    "Motion",
    "Script",
    "SliderCrank",
    "Together",
    "from_scene",
]

_EFFECTS: dict[str, Maker] = {
    "slider_crank": lambda settings, scene, models, *how: SliderCrank(**settings),
    "script": lambda settings, scene, models, *how: Script(**settings),
    "bag": lambda settings, scene, models, *how: Bag(**settings, frame=scene.frame),
    "dynamics": dynamics.from_settings,
    "deform": lambda settings, scene, models, *how: deform.from_settings(settings, scene, models),
}
"""Makers of effects by their key in a scene's `motion` section. They are called as
maker(settings, scene, models, live, stopped)."""


def from_scene(
    scene: Scene,
    models: Mapping[str, Model] | None = None,
    *,
    live: bool = False,
    stopped: Callable[[], bool] = lambda: False,
) -> Motion:
    """Return the motion that a scene's `motion` section describes: all of its effects together.

    Args:
        scene: the loaded scene.
        models: the models of the scene's bodies by name (see `scene.opening.load_models`). None:
            they are loaded when an effect needs them.
        live: whether poses are needed in real time. If so, an effect that cannot keep up falls
            behind, as its settings say. Otherwise poses depend only on the requested time.
        stopped: returns whether the program is to end. A motion that computes for long calls it
            between its steps. If it returns True, the motion returns early, with poses of any time.

    Raises:
        ValueError: the scene has no such section, or an effect cannot be made, for example because
            a bag does not match the scene. The message names the file.
    """
    if scene.motion is None:
        raise ValueError(
            f"{scene.path}: has no 'motion' section, so nothing moves its bodies; add one "
            f"({', '.join(_EFFECTS)}), or publish their poses"
        )
    shapes = _Models(scene) if models is None else models
    effects = [
        _EFFECTS[name](settings, scene, shapes, live, stopped)
        for name, settings in scene.motion.items()
        if name != "deform" or "dynamics" not in scene.motion  # `dynamics` includes the deforming
    ]
    return effects[0] if len(effects) == 1 else Together(effects)


class _Models(Mapping):
    """A scene's models, loaded on first use because most motions need none."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene

    @cached_property
    def _loaded(self) -> dict[str, Model]:
        return load_models(self._scene)

    def __getitem__(self, name: str) -> Model:
        return self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._loaded)

    def __len__(self) -> int:
        return len(self._loaded)
