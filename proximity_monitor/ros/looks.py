"""The looks of bodies: the triangles that ~/parts shows, and normals for curved bodies."""

from __future__ import annotations

from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from proximity_monitor import engine
from proximity_monitor.cdr import as_octahedral

ROUNDNESS = 0.005
"""How far the triangles may be from the body's surface, as a fraction of the body's radius."""


class Look(NamedTuple):
    """The triangles of a body."""

    corners: np.ndarray
    """(3 n, 3) the corners of the n triangles, metres, model frame."""
    normals: np.ndarray
    """(3 n, 2) the surface's normals there, as `cdr.as_octahedral`; (0, 2) if the body is flat."""
    solid: bool
    """Whether the body has an inside."""
    off: float
    """Largest distance of the triangles from the part the body stands for, metres; inf: unknown."""


class Looks:
    """Looks by model; a model is drawn once for all its bodies, and again if its shape changes."""

    def __init__(self) -> None:
        """Begin without looks."""
        self._kept: WeakKeyDictionary[engine.Model, tuple[int, Look]] = WeakKeyDictionary()

    def of(self, model: engine.Model) -> Look:
        """Return how a model looks now."""
        revision, look = self._kept.get(model, (-1, None))
        if look is None or revision != model.revision:
            look = _drawn(model)
            self._kept[model] = model.revision, look
        return look


def _drawn(model: engine.Model) -> Look:
    shown = model.display_mesh(ROUNDNESS * model.radius)
    normals = shown.corner_normals()
    return Look(
        shown.corners().reshape(-1, 3),
        np.empty((0, 2)) if normals is None else as_octahedral(normals.reshape(-1, 3)),
        model.is_solid,
        shown.off + model.deviation,
    )
