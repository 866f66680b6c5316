"""`dynamics`: rigid bodies and the forces on them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from proximity_monitor.scene.bodies import read_pose
from proximity_monitor.scene.description import Unit
from proximity_monitor.scene.effects.cast import Cast
from proximity_monitor.scene.effects.values import frozen, metres
from proximity_monitor.scene.report import Keys, Report

_SUBSTEP_MS = 2.5
_NEEDS_CONTACTS = ("friction", "restitution")
_MARGIN = 0.0002
"""Metres: the gap that contacts keep unless the scene gives another."""


def read(
    data: Mapping[str, Any], keys: Keys, bodies: Cast, unit: Unit, report: Report, folder: Path
) -> dict[str, Any]:
    """Return the settings of `motion.dynamics`; None for settings that the section does not give.

    `bodies` gives, by name of the body, `density` in kg/m³, `pose` (4, 4), `velocity` (3,) in m/s
    and `spin` (3,) in rad/s. `obstacles` are names of fixed bodies.
    """
    moved = {}
    for name, body in data["bodies"].items():
        at = (*keys, "bodies", name)
        bodies.drive(name, at)
        moved[name] = MappingProxyType(
            {
                "pose": read_pose(body["pose"], (*at, "pose"), unit, report),
                "density": float(body["density"]),
                "velocity": metres(body.get("velocity", (0.0, 0.0, 0.0)), unit),
                "spin": frozen(np.radians(body.get("spin_deg_s", (0.0, 0.0, 0.0)))),
            }
        )
    contacts = data.get("contacts")
    if contacts is None:
        for name in _NEEDS_CONTACTS:
            if name in data:
                report.add((*keys, name), "needs 'contacts'; add that key, or remove this one")
    elif contacts["method"] == "impulse" and "stiffness" in contacts:
        report.add((*keys, "contacts", "stiffness"), "can be used only with the method 'penalty'")
    elif contacts["method"] == "penalty":
        if "stiffness" not in contacts:
            report.add((*keys, "contacts"), "the method 'penalty' needs the key 'stiffness'")
        if "restitution" in data:
            report.add(
                (*keys, "restitution"),
                "can be used only with the method 'impulse'; the springs of 'penalty' return the "
                "energy that they store",
            )
    damping = data.get("damping", {})
    gravity = data.get("gravity")
    return {
        "bodies": MappingProxyType(moved),
        "obstacles": () if contacts is None else _obstacles(contacts, keys, bodies, report),
        "gravity": None if gravity is None else frozen(np.array(gravity, dtype=np.float64)),
        "contacts": None if contacts is None else _law(contacts, unit),
        "friction": data.get("friction"),
        "restitution": data.get("restitution"),
        "linear_damping": damping.get("linear"),
        "angular_damping": damping.get("angular"),
        "substep_s": data.get("substep_ms", _SUBSTEP_MS) / 1000.0,
        "max_substeps": data.get("max_substeps"),
        "budget_s": data["budget_ms"] / 1000.0 if "budget_ms" in data else None,
        "period_s": data.get("period_s"),
    }


def _law(contacts: Mapping[str, Any], unit: Unit) -> Mapping[str, Any]:
    margin = unit.to_metre * contacts["margin"] if "margin" in contacts else _MARGIN
    return MappingProxyType(
        {
            "method": contacts["method"],
            "margin": margin,
            "stiffness": float(contacts.get("stiffness", 0.0)),
        }
    )


def _obstacles(
    contacts: Mapping[str, Any], keys: Keys, bodies: Cast, report: Report
) -> tuple[str, ...]:
    if "obstacles" not in contacts:
        return tuple(body.name for body in bodies.bodies if not body.moving)
    for index, name in enumerate(contacts["obstacles"]):
        at = (*keys, "contacts", "obstacles", index)
        body = bodies.find(name, at)
        if body is not None and body.moving:
            report.add(
                at,
                f"'{name}' moves, but an obstacle must be a fixed body, with a 'pose'; bodies "
                "under 'bodies' collide with each other in any case",
            )
    return tuple(contacts["obstacles"])
