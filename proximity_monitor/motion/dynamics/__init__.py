"""Rigid-body dynamics with contacts from the engine's closest points."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import deepcopy
from functools import partial
from typing import TYPE_CHECKING, Any

from proximity_monitor.motion import deform
from proximity_monitor.motion.dynamics.effect import Dynamics
from proximity_monitor.motion.dynamics.settings import ContactLaw, Forces, RigidBody
from proximity_monitor.motion.dynamics.world import World

if TYPE_CHECKING:
    from proximity_monitor.engine import Model
    from proximity_monitor.scene import Scene

__all__ = ["ContactLaw", "Dynamics", "Forces", "RigidBody", "World", "from_settings"]


_LONGEST_S = 0.1
"""The default limit (seconds) of computing per pose: the player's period, but at most this long."""


def from_settings(
    settings: Mapping[str, Any],
    scene: Scene,
    models: Mapping[str, Model],
    live: bool,
    stopped: Callable[[], bool],
) -> Dynamics:
    """Return the effect that the section `motion.dynamics` of a scene describes.

    If the scene also has `motion.deform`, the effect deforms its bodies by it. If `live`, the time
    limits of the scene hold; if the scene has none, computing may take as long as the time between
    two poses. If not `live`, each pose belongs exactly to the requested time.

    Raises:
        ValueError: a body that moves encloses no volume, or two bodies touch at the start. The
            message names the file and the bodies.
    """
    soft = None
    if "deform" in scene.motion:
        soft = deform.from_settings(scene.motion["deform"], scene, models)

    def made(name: str, **start: Any) -> RigidBody:
        if soft is None or name not in soft.control_names:
            return RigidBody(name, models[name], **start)
        shape = partial(soft.shape, name)
        return RigidBody(name, deepcopy(models[name]), **start, shape=shape)

    bodies = [made(name, **body) for name, body in settings["bodies"].items()]
    poses = {body.name: body.pose for body in scene.bodies}
    bodies += [made(name, pose=poses[name]) for name in settings["obstacles"]]
    law = settings["contacts"]
    forces = Forces(
        contacts=None if law is None else ContactLaw(**law),
        **{
            name: settings[name]
            for name in ("gravity", "friction", "restitution", "linear_damping", "angular_damping")
        },
    )
    times = {name: settings[name] for name in ("substep_s", "period_s")}
    if live:
        limits = {name: settings[name] for name in ("max_substeps", "budget_s")}
        if set(limits.values()) == {None}:
            limits["budget_s"] = min(1.0 / scene.rate_hz, _LONGEST_S)
        times |= limits
    try:
        return Dynamics(bodies, forces, **times, deform=soft, stopped=stopped)
    except ValueError as error:
        raise ValueError(f"{scene.path}: motion.{error}") from None
