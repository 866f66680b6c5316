"""Whether a part of one model lies inside another, if their surfaces do not meet: in slices."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.motion import relative_motion_pair
from ..kernels.base.trees import SurfaceTree
from ..kernels.inside import contain
from ..kernels.inside.solids import WHOLE, Region
from ..kernels.surface.contain import look_for_part_in_surface
from ..models.model import Model
from .slices import slices_until


class PartSearch:
    """A search for such a part at two poses, and its memory.

    Args:
        models: two.
        poses: two (4, 4), model to world.
        regions: where either model has an inside; neither has holes.
    """

    __slots__ = (
        "_cores",
        "_motions",
        "_progress",
        "_regions",
        "_sampled",
        "_scratch",
        "_slack",
        "part",
    )

    part: tuple[int, int] | None
    """The number of the model whose part may lie inside the other, and a triangle of that part; or
    None if no such part is known."""

    def __init__(
        self,
        models: Sequence[Model],
        poses: Sequence[NDArray[np.float64]],
        regions: Sequence[Region],
    ) -> None:
        self._cores = [model._hierarchy for model in models]
        self._sampled = [core.sampled() for core in self._cores]
        self._regions = regions
        self._motions = np.empty((2, 12))
        sizes = [float(core.tree.scale[2]) for core in self._cores]
        self._slack = relative_motion_pair(*poses, *sizes, self._motions)
        self._slack += sum(core.error for core in self._cores)
        self._progress = np.zeros((2, 2), np.int64)
        room = 1 + max(core.depth for core in self._cores) * 15
        self._scratch = np.empty((2, 2, room), np.int32)
        self.part = None

    @property
    def points(self) -> int:
        """Points tested, one of each part; a model of more than `contain.FEW` parts counts 1."""
        return int(self._progress[:, 0].sum())

    def search(self, apart: float, deadline: float) -> bool | None:
        """Find whether a part may lie inside, if the surfaces are at least `apart` metres apart.

        Search at least one slice; return None if the deadline came first. Surfaces so close that
        rounding hides their gap may touch: then the answer is True, but no part is known.
        """
        if not apart > 4.0 * self._slack:
            return True
        slices = slices_until(deadline)
        if self.part is not None:
            return True
        for body in range(2):
            motion = self._motions[1 - body]
            if self._regions[1 - body].inside != WHOLE:
                continue
            holder, look = self._sampled[1 - body], contain.look_for_part_in_mesh
            if isinstance(self._cores[1 - body].tree, SurfaceTree):
                holder, look = self._cores[1 - body].table_of_all, look_for_part_in_surface
            while True:
                t = look(
                    holder, self._sampled[body], self._regions[body].samples,
                    motion, self._slack, apart, self._progress[body], *self._scratch[body],
                    slices.steps,
                )  # fmt: skip
                if t >= 0:
                    self.part = body, int(t)
                    return True
                if t == contain.NONE:
                    break
                if slices.over():
                    return None
        return False
