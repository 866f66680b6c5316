"""The `motion` section: settings of an effect, checked against the bodies and converted to SI."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from proximity_monitor.scene.description import Body, Unit
from proximity_monitor.scene.report import Keys, Report

# Directions are written down to a few digits: what is this near to perpendicular is meant to be,
# and is made so.
_PERPENDICULAR = 1e-3
# An offset that leaves the axis would change the stroke. Relative to the crank's radius, this much
# is rounding.
_ALONG = 1e-6


def read_motion(
    section: Mapping[str, Any], bodies: tuple[Body, ...], unit: Unit, report: Report
) -> Mapping[str, Any]:
    """Return ``{effect: settings}`` in metres, radians and seconds, read-only.

    What is wrong with the settings goes to the report; they are not to be used then.
    """
    ((effect, data),) = section.items()
    settings = _EFFECTS[effect](data, ("motion", effect), bodies, unit, report)
    return MappingProxyType({effect: MappingProxyType(settings)})


def _slider_crank(
    data: Mapping[str, Any], keys: Keys, bodies: tuple[Body, ...], unit: Unit, report: Report
) -> dict[str, Any]:
    crank = data["crank"]
    _check_moving(crank, (*keys, "crank"), bodies, report)
    axis = _direction(data, keys, "crank_axis", report)
    slide = _direction(data, keys, "slide_direction", report)
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
        _check_moving(name, at, bodies, report)
        if name == crank:
            report.add(at, f"'{name}' is the crank; a piston is another body")
        offset = np.array(piston["offset"], dtype=np.float64)
        with np.errstate(over="ignore", invalid="ignore"):
            aside = float(np.linalg.norm(offset - (offset @ axis) * axis))
        if axis.any() and not aside <= _ALONG * radius:
            report.add(
                (*at, "offset"),
                f"must lie along crank_axis (it leaves it by {aside:g} {unit.symbol})",
            )
        pistons[name] = MappingProxyType(
            {"phase": math.radians(piston["phase_deg"]), "offset": _metres(offset, unit)}
        )
    return {
        "crank": crank,
        "crank_origin": _metres(data["crank_origin"], unit),
        "crank_axis": _frozen(axis),
        "slide_direction": _frozen(slide),
        "crank_radius": unit.to_metre * radius,
        "rod_length": unit.to_metre * rod,
        "speed": data["rpm"] * math.tau / 60.0,
        "pistons": MappingProxyType(pistons),
    }


_EFFECTS: dict[str, Callable[..., dict[str, Any]]] = {"slider_crank": _slider_crank}
"""By the key that the schema allows in the section."""


def _check_moving(name: str, keys: Keys, bodies: tuple[Body, ...], report: Report) -> None:
    moving = {body.name: body.moving for body in bodies}
    if name not in moving:
        report.add(keys, f"no body is named '{name}'; known are {', '.join(moving)}")
    elif not moving[name]:
        report.add(keys, f"'{name}' is fixed; give it 'moving: true' in place of its pose")


def _direction(data: Mapping[str, Any], keys: Keys, key: str, report: Report) -> np.ndarray:
    """A unit vector; zeros, with a problem in the report, where none can be made."""
    length = math.hypot(*data[key])
    if not 0.0 < length < math.inf:
        report.add((*keys, key), f"must be a direction, of a length above 0 (got {data[key]})")
        return np.zeros(3)
    return np.array(data[key], dtype=np.float64) / length


def _metres(lengths: Any, unit: Unit) -> np.ndarray:
    return _frozen(unit.to_metre * np.array(lengths, dtype=np.float64))


def _frozen(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array
