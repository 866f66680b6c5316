"""Where the poses of moving bodies come from: the effect that a scene names, and nothing else."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from proximity_monitor.motion.motion import Motion
from proximity_monitor.motion.slider_crank import SliderCrank

if TYPE_CHECKING:
    from proximity_monitor.scene import Scene

__all__ = ["Motion", "SliderCrank", "from_scene"]

_EFFECTS: dict[str, Callable[..., Motion]] = {"slider_crank": SliderCrank}
"""By the key that a scene's `motion` section holds; its settings are the keyword arguments."""


def from_scene(scene: Scene) -> Motion:
    """Return the motion that a scene's `motion` section describes.

    Raises:
        ValueError: the scene has no such section.
    """
    if scene.motion is None:
        raise ValueError(
            f"{scene.path}: has no 'motion' section, so nothing moves its bodies; add one "
            f"({', '.join(_EFFECTS)}), or publish their poses"
        )
    ((effect, settings),) = scene.motion.items()
    return _EFFECTS[effect](**settings)
