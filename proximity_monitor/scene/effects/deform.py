"""`deform`: bodies whose control points follow a field."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from proximity_monitor.scene.description import Unit
from proximity_monitor.scene.effects.cast import Cast
from proximity_monitor.scene.effects.values import direction, frozen, metres
from proximity_monitor.scene.paths import model_path
from proximity_monitor.scene.report import Keys, Report, SceneError

_ACROSS = ("bend", "wave")
"""Fields that also have a direction across the axis."""

_MOST_STRETCH = 10.0
"""Largest logarithm of a factor: a factor above twenty thousand is useless, and may overflow."""

_PERPENDICULAR = 1e-3
"""Largest cosine between two directions that are made perpendicular: files give few digits."""


def read(
    data: Mapping[str, Any], keys: Keys, bodies: Cast, unit: Unit, report: Report, folder: Path
) -> dict[str, Any]:
    """Return, under the key `bodies`, the arguments of `motion.Field` by name of the body."""
    fields = {}
    for name, body in data["bodies"].items():
        at = (*keys, "bodies", name)
        found = bodies.find(name, at)
        if found is not None and not found.deforming:
            report.add(at, f"'{name}' is rigid; give it 'deforming: true'")
        fields[name] = MappingProxyType(_field(body, at, unit, report, folder))
    return {"bodies": MappingProxyType(fields)}


def _field(
    data: Mapping[str, Any], keys: Keys, unit: Unit, report: Report, folder: Path
) -> dict[str, Any]:
    kind = data["field"]
    axis = across = None
    if "axis" in data and kind not in ("breathe", "morph"):
        axis = direction(data, keys, "axis", report)
    for key, kinds in (
        ("amplitude", ("bend", "twist", "stretch", "wave", "breathe")),
        ("axis", ("bend", "twist", "stretch", "wave")),
        ("towards", _ACROSS),
        ("wavelength", ("wave",)),
        ("through", ("morph",)),
    ):
        if (key in data) != (kind in kinds):
            if key in data:
                report.add((*keys, key), f"cannot be used with the field '{kind}'")
            else:
                report.add(keys, f"the field '{kind}' needs the key '{key}'")
    if "towards" in data and axis is not None:
        across = direction(data, keys, "towards", report)
        if axis.any() and across.any() and abs(leaning := float(axis @ across)) > _PERPENDICULAR:
            angle = math.degrees(math.acos(max(-1.0, min(1.0, leaning))))
            report.add(
                (*keys, "towards"),
                f"must be perpendicular to axis (got {angle:.4g} degrees between them)",
            )
        else:
            across = across - float(axis @ across) * axis
            across /= np.linalg.norm(across) or 1.0
    amplitude = float(data.get("amplitude", 0.0))
    if kind in ("bend", "twist"):
        amplitude = math.radians(amplitude)
    elif kind == "wave":
        amplitude *= unit.to_metre
    elif abs(amplitude) > _MOST_STRETCH:
        report.add(
            (*keys, "amplitude"),
            f"must be from -{_MOST_STRETCH:g} to {_MOST_STRETCH:g} for the field '{kind}', because "
            f"it is the logarithm of a factor (got {amplitude:g})",
        )
    return {
        "field": kind,
        "amplitude": amplitude,
        "frequency_hz": float(data["frequency_hz"]),
        "phase": math.radians(data.get("phase_deg", 0.0)),
        "axis": None if axis is None else frozen(axis),
        "across": None if across is None else frozen(across),
        "wavelength": unit.to_metre * data["wavelength"] if "wavelength" in data else None,
        "centre": metres(data["centre"], unit) if "centre" in data else None,
        "through": _paths(data.get("through", ()), (*keys, "through"), report, folder),
    }


def _paths(names: Sequence[str], keys: Keys, report: Report, folder: Path) -> tuple[Path, ...]:
    """Return the model files whose shapes a body takes; problems go to the report."""
    found = []
    for index, name in enumerate(names):
        try:
            found.append(model_path(name, folder))
        except SceneError as error:
            report.add((*keys, index), str(error))
    return tuple(found)
