"""How deep two models overlap: the memory of the searches, their slices, and what they found.

There are three of them, with the same methods: of the largest ball inside two solids, of a
surface's deepest point in a solid, and of models that are nothing but swept, for which the distance
of their cores says it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index
from ..kernels.base.state import CUT, MeshTree
from ..kernels.inside import ball as kernel
from ..kernels.inside import ball_begin, deepest
from ..kernels.inside.ball_state import CELL, FULL, PIECE, POINT, SEARCH, Ball
from ..kernels.inside.solids import HALF
from ..models.hierarchy import Hierarchy
from ..models.model import Model
from .slices import slices_until

_CELLS = 64
"""Cells that there is room for at first."""

_MOST_CELLS = 4096
"""Cells that are looked into where a solid has holes. Next to a hole a point is at once as deep as
it is far from the faces: no cell there is bounded better, however small it is."""

_SEEDS = 32
"""Points that a search may begin with."""


def tree_of(core: Hierarchy) -> MeshTree:
    """The hierarchy of all triangles; a box serves as the rectangle that it lies in."""
    return MeshTree(*core.tree)


def _memory(models: tuple[Model, ...], cell: np.dtype) -> Ball:
    descent = 1 + max(each._hierarchy.depth for each in models) * 15
    return Ball(
        np.zeros(1, SEARCH),
        np.zeros((2, 12)),
        np.zeros((_SEEDS, 3)),
        np.zeros(1, POINT),
        np.zeros(1, POINT),
        np.zeros(1, POINT),
        np.empty(_CELLS),
        np.arange(_CELLS, dtype=np.int32),
        np.zeros(_CELLS, cell),
        np.empty(descent, np.int32),
        np.empty(descent),
    )


class BallSearch:
    """A search for the largest ball inside two solids, whose diameter is their depth.

    Args:
        a: first solid.
        b: second solid.
    """

    __slots__ = ("_ball", "_models", "_most", "_poses", "given_up")

    given_up: bool
    """Whether the search ended without bounds as close as was asked for, at a hole."""

    _CELL = CELL

    def __init__(self, a: Model, b: Model) -> None:
        self._models = a, b
        self._ball = _memory(self._models, self._CELL)
        self._most, self.given_up = math.inf, False

    @property
    def _solids(self) -> tuple[tuple, ...]:
        a, b = (model._hierarchy for model in self._models)
        return tree_of(a), tree_of(b), a.sides().region, b.sides().region

    def begin(
        self,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        depth_err: float,
        abs_err: float,
    ) -> None:
        """Start a search, at the centre of the ball that the last one found."""
        self._poses = pose_a, pose_b
        self._count_cells()
        ball_begin.begin_ball(*self._solids, pose_a, pose_b, depth_err, 0.5 * abs_err, self._ball)

    def _count_cells(self) -> None:
        insides = [model._hierarchy.sides().region.inside for model in self._models]
        self._most, self.given_up = _MOST_CELLS if HALF in insides else math.inf, False

    def add_seeds(self, points: NDArray[np.float64]) -> None:
        """Have the search begin at points (k, 3) of the world, too."""
        pose, at = self._poses[0], self._ball.at[0]
        first = int(at["seeds"])
        points = (points[: _SEEDS - first] - pose[:3, 3]) @ pose[:3, :3]
        self._ball.seeds[first : first + len(points)] = points
        at["seeds"] = first + len(points)

    def seek(self, deadline: float) -> bool:
        """Try the seeds until one is the centre of a ball, or until the deadline: then False."""
        return self._search(deadline, True)

    def search(self, deadline: float) -> bool:
        """Search until the end, or until the deadline, after one slice at least: then False."""
        return self._search(deadline, False)

    def _search(self, deadline: float, seeds_alone: bool) -> bool:
        slices = slices_until(deadline)
        while True:
            code = self._slice(seeds_alone, slices.steps)
            if code == FULL:
                self._make_room()
            elif code != CUT:
                return True
            if self._ball.at[0]["cells"] > self._most:
                self.given_up = True
                return True
            if slices.over():
                return False

    def _slice(self, seeds_alone: bool, steps: int) -> int:
        return kernel.search_ball(*self._solids, self._ball, seeds_alone, steps)

    def _make_room(self) -> None:
        old = self._ball
        count = len(old.order)
        self._ball = old._replace(
            bounds=np.resize(old.bounds, 2 * count),
            order=np.concatenate((old.order, np.arange(count, 2 * count, dtype=np.int32))),
            cells=np.concatenate((old.cells, np.zeros(count, self._CELL))),
        )

    @property
    def found(self) -> bool:
        """Whether it is certain that the models overlap."""
        return bool(self._ball.at[0]["radius"] > 0.0)

    @property
    def slack(self) -> float:
        """Metres that rounding may widen the bounds by."""
        return 64.0 * float(self._ball.at[0]["slack"])

    @property
    def points(self) -> int:
        """How many points' depths were asked for."""
        return int(self._ball.at[0]["points"])

    @property
    def bounds(self) -> tuple[float, float]:
        """Certified bounds of the depth, metres."""
        shallow, deep = self._radii()
        return 2.0 * shallow, 2.0 * deep

    def _radii(self) -> tuple[float, float]:
        at = self._ball.at[0]
        radius = float(at["radius"])
        deep = max(float(at["dropped"]), 0.0)
        if radius > 0.0:
            deep = max(deep, radius + 2.0 * float(at["slack"]))
        if at["size"]:
            deep = max(deep, float(self._ball.bounds[0]))
        return radius, deep

    def fill(self, row: NDArray[np.float64]) -> None:
        """Write into an answer (ANSWER,) where the surfaces are nearest to the ball's centre."""
        best = self._ball.best[0]
        pose = self._poses[0]
        centre = pose[:3, :3] @ best["place"] + pose[:3, 3]
        for k in range(2):
            self._write(row, k, k, self._ball.motions[k], int(best["near"][k]))
        _aim(row, centre, best["side"], [model._hierarchy.swept_radius for model in self._models])

    def _write(
        self, row: NDArray[np.float64], k: int, which: int, motion: NDArray[np.float64], t: int
    ) -> None:
        """Write the point of triangle t of a model that is nearest to the best point."""
        model, pose = self._models[which], self._poses[which]
        weights = np.empty(3)
        ball_begin.foot(tree_of(model._hierarchy), motion, self._ball.best[0]["place"], t, weights)
        _point(row, k, model, pose, weights, t)


class DeepestSearch(BallSearch):
    """A search for the deepest point of a surface in a solid.

    Args:
        a: first model.
        b: second model; one of the two is a solid.
    """

    __slots__ = ("_solid",)

    _CELL = PIECE

    def __init__(self, a: Model, b: Model) -> None:
        super().__init__(a, b)
        self._solid = 0 if a.is_solid else 1

    @property
    def _pair(self) -> tuple[Hierarchy, Hierarchy]:
        """The hierarchies of the solid and the surface."""
        solid, surface = self._models[self._solid], self._models[1 - self._solid]
        return solid._hierarchy, surface._hierarchy

    def begin(
        self,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        depth_err: float,
        abs_err: float,
    ) -> None:
        """Start a search."""
        self._poses = pose_a, pose_b
        self._count_cells()
        solid, surface = self._pair
        self._ball.motions[1] = np.eye(4, 3).ravel()
        deepest.begin_deepest(
            tree_of(solid), solid.sides().region, tree_of(surface), surface.sides().region,
            self._poses[self._solid], self._poses[1 - self._solid], depth_err, abs_err, self._ball,
        )  # fmt: skip

    def add_seeds(self, points: NDArray[np.float64]) -> None:
        """Nothing: points beside a surface are not on it."""

    def seek(self, deadline: float) -> bool:
        """Nothing, as there are no seeds."""
        return True

    def _slice(self, seeds_alone: bool, steps: int) -> int:
        solid, surface = self._pair
        return deepest.search_deepest(
            tree_of(solid), solid.sides().region, tree_of(surface), self._ball, steps
        )

    @property
    def bounds(self) -> tuple[float, float]:
        """Certified bounds of the depth, metres; a swept surface reaches deeper by its radius."""
        shallow, deep = self._radii()
        return shallow, deep + self._pair[1].swept_radius

    def fill(self, row: NDArray[np.float64]) -> None:
        """Write into an answer (ANSWER,) the deepest point, and the solid's nearest to it."""
        near, motions = self._ball.best[0]["near"], self._ball.motions
        self._write(row, self._solid, self._solid, motions[0], int(near[0]))
        self._write(row, 1 - self._solid, 1 - self._solid, motions[1], int(near[1]))
        at = (index.RADIUS_A, index.RADIUS_B)[self._solid]
        row[index.RADIUS_A : index.RADIUS_B + 1] = 0.0
        row[at] = -self._pair[0].swept_radius


def _point(
    row: NDArray[np.float64], k: int, model: Model, pose: NDArray[np.float64],
    weights: NDArray[np.float64], triangle: int,
) -> None:  # fmt: skip
    """Write the point of a triangle, in tree order, into an answer as that of model k."""
    core = model._hierarchy
    face = core.numbers[triangle]
    local = weights @ core.vertices[core.faces[face]]
    at = (index.POINT_A, index.POINT_B)[k]
    row[at : at + 3] = pose[:3, :3] @ local + pose[:3, 3]
    at = (index.FEATURE_A, index.FEATURE_B)[k]
    row[at : at + 3], row[at + 3] = weights, face


def _aim(
    row: NDArray[np.float64], centre: NDArray[np.float64], sides: NDArray[np.int64],
    radii: list[float],
) -> None:  # fmt: skip
    """Write how far the surfaces are from the cores' points, along the way from a's to b's.

    A swept surface is nearest to a point on the far side of it, seen from the core's point, or on
    the near side where the point is inside the core.
    """
    points = row[index.POINT_A : index.POINT_A + 3], row[index.POINT_B : index.POINT_B + 3]
    for k in range(2):
        away = float((centre - points[k]) @ (points[1 - k] - points[k]))
        sign = -1.0 if (away < 0.0) != (sides[k] > 0) else 1.0
        row[(index.RADIUS_A, index.RADIUS_B)[k]] = sign * radii[k]
