"""The nearest points of parametric surfaces: each point is a model of its own, at its own pose."""

from __future__ import annotations

import math
from threading import Event
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index
from ..kernels.inside.visit import ROOM
from ..kernels.surface.side import sides_of_surface
from ..models.shapes import points as points_model
from ..models.surface import Surface
from ..models.surface_mesh import unit_normals
from .run import Search
from .slices import slices_until

_A = slice(index.POINT_A, index.POINT_A + 3)
_TELLING = 1e-6
"""As in kernels/inside/closest.py."""

_PARAMETERS = slice(index.FEATURE_A, index.FEATURE_A + 2)


class SurfacePoints:
    """Finds the points of a surface that are nearest to many points, part by part.

    Args:
        model: the surface.
        pose: (4, 4) model to world, metres.
        max_distance: metres, beyond which nothing more is asked.
        deadline: of perf_counter, or None.
        signed: whether distances are negative inside; the model is a solid then.
    """

    def __init__(
        self, model: Surface, pose: NDArray[np.float64], max_distance: float,
        deadline: float | None, signed: bool,
    ) -> None:  # fmt: skip
        self._model, self._pose, self._signed = model, pose, signed
        self._limit, self._deadline = max_distance, deadline
        self._point = points_model(np.zeros((1, 3)))

    def find(
        self, given: NDArray[np.float64], first: int, stopped: Event,
        bounds: NDArray[np.float64], nearest: NDArray[np.float64], elements: NDArray[np.int32],
        normals: NDArray[np.float64],
    ) -> int:  # fmt: skip
        """Write what `questions.closest.Nearest` says of points (k, 3); returns how many are done.

        `first` is the number of the first. Its normals are written where there is room for any.
        """
        if first and self._is_over():
            return 0
        count, limit = len(given), self._limit
        if self._signed:  # a side is told where the surface is known to be far enough
            limit = max(limit, _TELLING * float(self._model._hierarchy.tree.scale[2]))
        poses = np.zeros((count, 4, 4))
        poses[:] = np.eye(4)
        poses[:, :3, 3] = given
        rows = np.full((count, index.ANSWER), np.nan)
        Search(self._model, self._point).run(
            np.tile(self._pose, (count, 1)), poses.reshape(-1, 4),
            limit=limit, deadline=self._deadline, first=first, stopped=stopped, answers=rows,
        )  # fmt: skip
        begun = int(np.count_nonzero(~np.isnan(rows[:, index.STATUS])))
        rows = rows[:begun]
        near = rows[:, index.UPPER] < self._limit
        bounds[:begun, 0] = rows[:, index.LOWER]
        bounds[:begun, 1] = np.where(near, rows[:, index.UPPER], math.inf)
        nearest[:begun] = rows[:, _A]
        elements[:begun] = np.where(near, rows[:, index.TREE_A], -1)
        if len(normals):
            self._normals(rows, normals)
        return self._sides(given, begun, stopped, bounds) if self._signed else begun

    def _is_over(self) -> bool:
        return self._deadline is not None and perf_counter() >= self._deadline

    def _sides(
        self, given: NDArray[np.float64], count: int, stopped: Event, bounds: NDArray[np.float64]
    ) -> int:
        """Make the first bounds signed ones; returns how many are done, at least one."""
        hierarchy = self._model._hierarchy
        stack, slices, done = np.empty(ROOM, np.int32), slices_until(self._deadline), 0
        while done < count and not stopped.is_set():
            done = sides_of_surface(
                hierarchy.tree, self._pose, given, done, count, slices.steps, stack, bounds
            )
            if slices.over():
                break
        return done

    def _normals(self, rows: NDArray[np.float64], normals: NDArray[np.float64]) -> None:
        """The surface's unit normals in the world, at the points of rows."""
        patches = rows[:, index.FEATURE_A + 3].astype(np.int64)
        for patch in np.unique(patches):
            of = patches == patch
            u, v = rows[of, _PARAMETERS].T
            found = unit_normals(self._model._hierarchy.nets[patch], u, v)
            normals[: len(rows)][of] = found @ self._pose[:3, :3].T
