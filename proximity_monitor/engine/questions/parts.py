"""Whether a part of one of two models whose surfaces are apart lies inside the other: in slices."""

from __future__ import annotations

import math
from collections.abc import Sequence
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.motion import relative_motion_pair
from ..kernels.inside import contain
from ..kernels.inside.solids import WHOLE, Region
from ..models.mesh import TriangleMesh
from .run import LONG_SLICE, SLICE


class PartSearch:
    """The memory of that question at two poses.

    Args:
        models: two.
        poses: two (4, 4), model to world.
        regions: where the models have an inside: everywhere within a closed surface, or nowhere.
    """

    __slots__ = (
        "_models",
        "_motions",
        "_progress",
        "_regions",
        "_scratch",
        "_slack",
        "found",
        "points",
    )

    found: tuple[int, int]
    """The model, and its triangle, that may lie inside the other."""

    def __init__(
        self,
        models: Sequence[TriangleMesh],
        poses: Sequence[NDArray[np.float64]],
        regions: Sequence[Region],
    ) -> None:
        self._models = models
        self._regions = regions
        self._motions = np.empty((2, 12))
        self._slack = relative_motion_pair(
            poses[0], poses[1], sum(float(model._tree.scale[2]) for model in models), self._motions
        )
        self._progress = np.zeros((2, 2), np.int64)
        room = 1 + max(model.depth for model in models) * 15
        self._scratch = np.empty((2, 2, room), np.int32)
        self.points = 0
        self.found = (-1, -1)

    def search(self, apart: float, deadline: float) -> bool | None:
        """Whether a part may lie inside, the surfaces being `apart` metres or more apart.

        None where the deadline came first, after one slice at least.
        """
        if not apart > 4.0 * self._slack:
            return True
        steps = LONG_SLICE if deadline == math.inf else SLICE
        if self.found[0] >= 0:
            return True
        for body in range(2):
            holder, motion = self._models[1 - body], self._motions[1 - body]
            if self._regions[1 - body].inside != WHOLE:
                continue
            while True:
                t = contain.look_for_part(
                    holder._tree, self._models[body]._tree, self._regions[body].samples,
                    motion, self._slack, apart, self._progress[body], *self._scratch[body], steps,
                )  # fmt: skip
                if t >= 0:
                    self.found = body, int(t)
                    return True
                if t == contain.NONE:
                    break
                if perf_counter() >= deadline:
                    return None
        return False
