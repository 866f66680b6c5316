"""The `motion` section: settings of its effects, checked against the bodies and converted to SI.

Each effect is a module with ``read(data, keys, bodies, unit, report, folder)``: `data` obeys the
schema, `keys` is its place in the file, `folder` is the scene file's folder. `read` claims every
body that the effect drives by ``bodies.drive(name, keys)``, and returns the settings. Problems go
to the report.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from proximity_monitor.scene.description import Body, Robot, Unit
from proximity_monitor.scene.effects import bag, deform, dynamics, script, slider_crank
from proximity_monitor.scene.effects.cast import Cast
from proximity_monitor.scene.report import Keys, Report

Reader = Callable[[Mapping[str, Any], Keys, Cast, Unit, Report, Path], dict[str, Any]]

_EFFECTS: dict[str, Reader] = {
    "slider_crank": slider_crank.read,
    "script": script.read,
    "bag": bag.read,
    "dynamics": dynamics.read,
    "deform": deform.read,
}
"""The readers by key of the section, as the schema allows it."""


def read_motion(
    section: Mapping[str, Any],
    bodies: tuple[Body, ...],
    unit: Unit,
    report: Report,
    folder: Path,
    robots: Sequence[Robot] = (),
) -> Mapping[str, Mapping[str, Any]]:
    """Return ``{effect: settings}`` in metres, radians and seconds, read-only, in the file's order.

    Problems go to the report; if there are any, the settings must not be used.
    """
    cast = Cast(bodies, report, robots)
    return MappingProxyType(
        {
            effect: MappingProxyType(
                _EFFECTS[effect](data, ("motion", effect), cast, unit, report, folder)
            )
            for effect, data in section.items()
        }
    )
