"""The largest ball inside two solids: the memory of its search, the slices, the answer."""

from __future__ import annotations

import math
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.state import CUT
from ..kernels.inside import ball as kernel
from ..kernels.inside.ball_state import CELL, FULL, POINT, SEARCH, Ball
from ..models.mesh import TriangleMesh
from ..models.solid import sides_of
from .run import LONG_SLICE, SLICE

_CELLS = 64
"""Cells that there is room for at first."""

_SEEDS = 32
"""Points that a search may begin with."""


class BallSearch:
    """The memory of a search for the largest ball inside two solids.

    Args:
        a: first solid.
        b: second solid.
    """

    __slots__ = ("_ball", "_models")

    def __init__(self, a: TriangleMesh, b: TriangleMesh) -> None:
        self._models = a, b
        descent = 1 + max(a.depth, b.depth) * 15
        self._ball = Ball(
            np.zeros(1, SEARCH),
            np.zeros((2, 12)),
            np.zeros((_SEEDS, 3)),
            np.zeros(1, POINT),
            np.zeros(1, POINT),
            np.zeros(1, POINT),
            np.empty(_CELLS),
            np.zeros(_CELLS, np.int32),
            np.zeros(_CELLS, CELL),
            np.empty(descent, np.int32),
            np.empty(descent),
        )

    @property
    def _solids(self) -> tuple[tuple, ...]:
        a, b = self._models
        return a._tree, b._tree, sides_of(a).region, sides_of(b).region

    def begin(
        self,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        depth_err: float,
        abs_err: float,
    ) -> None:
        """Start a search, at the centre of the ball that the last one found."""
        kernel.begin_ball(*self._solids, pose_a, pose_b, depth_err, 0.5 * abs_err, self._ball)

    def add_seeds(self, points: NDArray[np.float64]) -> None:
        """Have the search begin at points (k, 3), in a's frame, too."""
        at = self._ball.at[0]
        first = int(at["seeds"])
        points = points[: _SEEDS - first]
        self._ball.seeds[first : first + len(points)] = points
        at["seeds"] = first + len(points)

    def search(self, deadline: float) -> bool:
        """Search until the end, or until the deadline, after one slice at least: then False."""
        steps = LONG_SLICE if deadline == math.inf else SLICE
        while True:
            code = kernel.search_ball(*self._solids, self._ball, steps)
            if code == FULL:
                self._make_room()
            elif code != CUT:
                return True
            if perf_counter() >= deadline:
                return False

    def _make_room(self) -> None:
        old = self._ball
        count = len(old.order)
        self._ball = old._replace(
            bounds=np.resize(old.bounds, 2 * count),
            order=np.concatenate((old.order, np.arange(count, 2 * count, dtype=np.int32))),
            cells=np.concatenate((old.cells, np.zeros(count, CELL))),
        )

    @property
    def radius(self) -> float:
        """Metres; of the largest ball found, certified; 0 where none is."""
        return float(self._ball.at[0]["radius"])

    @property
    def bounds(self) -> tuple[float, float]:
        """Certified bounds of the radius of the largest ball, metres."""
        at, radius = self._ball.at[0], self.radius
        upper = max(float(at["dropped"]), radius + 2.0 * float(at["slack"]))
        if at["size"]:
            upper = max(upper, float(self._ball.bounds[0]))
        return radius, upper
