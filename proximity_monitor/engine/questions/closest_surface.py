"""The points of parametric surfaces nearest to many points."""

from __future__ import annotations

from dataclasses import dataclass
from threading import Event
from time import perf_counter
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.trees import RevolutionTree
from ..kernels.inside.visit import ROOM
from ..kernels.revolution.points import closest_points_of_revolution
from ..kernels.surface.closest import GOING, closest_points
from ..kernels.surface.side import sides_of_surface
from ..models.revolution import angle
from ..models.surface import Surface
from ..models.surface_mesh import unit_normals
from .slices import slices_until

if TYPE_CHECKING:
    from ..models.nurbs import Net


@dataclass(frozen=True, slots=True)
class PointsOnSurface:
    """Where points of a surface lie on its patches, as kernels wrote it.

    Angles and normals would take longer than a short budget lasts, so they are made when read.
    """

    nets: tuple[Net, ...]
    """The nets of the surface as the search saw them: the surface may be deformed later."""
    pose: NDArray[np.float64]
    """(4, 4) model to world."""
    parameters: NDArray[np.float64]
    """(k, 2) on patches; valid where a point was found."""
    turned: bool
    """Whether the second parameter stands for an angle; see `models.revolution.angle`."""
    wanted: bool
    """Whether normals were asked for."""

    @classmethod
    def of(cls, model: Surface, pose: NDArray[np.float64], count: int, wanted: bool) -> Self:
        """Make one for `count` points that are not found yet."""
        hierarchy = model._hierarchy
        turned = hierarchy.tree_kind is RevolutionTree
        return cls(hierarchy.nets, pose.copy(), np.zeros((count, 2)), turned, wanted)

    def places(self) -> NDArray[np.float64]:
        """Return the parameters (k, 2) as answers give them."""
        if not self.turned:
            return self.parameters
        return np.column_stack((self.parameters[:, 0], angle(self.parameters[:, 1])))

    def normals(self, patches: NDArray[np.int32]) -> NDArray[np.float64] | None:
        """Return unit normals (k, 3), world, on these patches, -1: none; None if not asked for."""
        if not self.wanted:
            return None
        made = np.empty((len(patches), 3))
        for patch in np.unique(patches[patches >= 0]):
            of = np.flatnonzero(patches == patch)
            u, v = self.parameters[of].T
            made[of] = unit_normals(self.nets[patch], u, v) @ self.pose[:3, :3].T
        return made


class SurfacePoints:
    """Finds the points of a surface that are nearest to many points, part by part.

    Args:
        model: the surface.
        pose: (4, 4) model to world, metres.
        max_distance: metres; of points farther away, nothing more is asked.
        errors: relative, and absolute in metres.
        deadline: a time of perf_counter, or None.
        signed: whether distances are negative inside; then the model is a solid.
    """

    def __init__(
        self, model: Surface, pose: NDArray[np.float64], max_distance: float,
        errors: tuple[float, float], deadline: float | None, signed: bool,
    ) -> None:  # fmt: skip
        self._hierarchy, self._pose, self._signed = model._hierarchy, pose, signed
        self._limit, self._errors, self._deadline = max_distance, errors, deadline

    def find(
        self, given: NDArray[np.float64], first: int, stopped: Event,
        bounds: NDArray[np.float64], nearest: NDArray[np.float64], elements: NDArray[np.int32],
        parameters: NDArray[np.float64],
    ) -> int:  # fmt: skip
        """Write fields of `questions.closest.Nearest` for points (k, 3); return how many are done.

        `first` is the number of the first of these points among all.
        """
        late = self._deadline is not None and perf_counter() >= self._deadline
        if first and late:
            return 0
        count, model = len(given), self._hierarchy.table_of_all
        turned = self._hierarchy.tree_kind is RevolutionTree
        stack, stacked, going = np.empty(ROOM, np.int32), np.empty(ROOM), np.zeros(GOING)
        slices, found, done = slices_until(self._deadline), 0, 0
        while done < count and not stopped.is_set():
            if turned:
                done = found = closest_points_of_revolution(
                    model, self._pose, given, self._limit, *self._errors, self._signed,
                    done, slices.steps, bounds, nearest, elements, parameters,
                )  # fmt: skip
            elif done == found:
                found = closest_points(
                    model, self._pose, given, self._limit, *self._errors, self._signed,
                    found, slices.steps, stack, stacked, going, bounds, nearest, elements,
                    parameters,
                )  # fmt: skip
            if turned or not self._signed:
                done = found
            elif done < found:
                done = sides_of_surface(
                    model, self._pose, given, done, found, slices.steps, stack, bounds
                )
            # Do at least one point, so that repeated calls come to an end.
            if slices.over() and (first or done):
                break
        return done
