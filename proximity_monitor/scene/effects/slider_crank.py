"""`slider_crank`: a crank that turns at constant speed, and the pistons that it moves."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from proximity_monitor.scene.description import Unit
from proximity_monitor.scene.effects.cast import Cast
from proximity_monitor.scene.effects.values import direction, frozen, metres
from proximity_monitor.scene.report import Keys, Report

# Largest cosine between two directions that are meant to be perpendicular and are made so: files
# give few digits.
_PERPENDICULAR = 1e-3
# An offset away from the axis would change the stroke. At most this fraction of the crank's radius
# is rounding.
_ALONG = 1e-6


def read(
    data: Mapping[str, Any], keys: Keys, bodies: Cast, unit: Unit, report: Report, folder: Path
) -> dict[str, Any]:
    """Return the arguments of `motion.SliderCrank`."""
    bodies.drive(data["crank"], (*keys, "crank"))
    axis = direction(data, keys, "crank_axis", report)
    slide = direction(data, keys, "slide_direction", report)
    leaning = float(axis @ slide)
    if abs(leaning) > _PERPENDICULAR:
        angle = math.degrees(math.acos(max(-1.0, min(1.0, leaning))))
        report.add(
            (*keys, "slide_direction"),
            f"must be perpendicular to crank_axis (got {angle:.4g} degrees between them)",
        )
    else:
        slide = slide - leaning * axis
        slide /= np.linalg.norm(slide) or 1.0
    radius, rod = data["crank_radius"], data["rod_length"]
    if rod <= radius:
        report.add(
            (*keys, "rod_length"),
            f"must be more than crank_radius, {radius:g} {unit.symbol}, or the crank cannot turn "
            f"(got {rod:g})",
        )
    pistons = {}
    for name, piston in data["pistons"].items():
        at = (*keys, "pistons", name)
        bodies.drive(name, at)
        offset = np.array(piston["offset"], dtype=np.float64)
        with np.errstate(over="ignore", invalid="ignore"):
            aside = float(np.linalg.norm(offset - (offset @ axis) * axis))
        if axis.any() and not aside <= _ALONG * radius:
            report.add(
                (*at, "offset"),
                f"must be parallel to crank_axis (it is {aside:g} {unit.symbol} off the axis)",
            )
        pistons[name] = MappingProxyType(
            {"phase": math.radians(piston["phase_deg"]), "offset": metres(offset, unit)}
        )
    return {
        "crank": data["crank"],
        "crank_origin": metres(data["crank_origin"], unit),
        "crank_axis": frozen(axis),
        "slide_direction": frozen(slide),
        "crank_radius": unit.to_metre * radius,
        "rod_length": unit.to_metre * rod,
        "speed": data["rpm"] * math.tau / 60.0,
        "pistons": MappingProxyType(pistons),
    }
