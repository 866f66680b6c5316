"""How deep models overlap whose only volume is swept by a ball: spheres, capsules, swept sheets.

Let d be the distance of the cores, and r and s the radii. Let a point x be at the distance a from
one core and b from the other. Its depths are r - a and s - b, and a + b is never less than d. So
the smaller depth is at most (r + s - d) / 2, and at most r and s, since no distance is negative.
Some x on the segment between the cores' nearest points attains the least of these three. So the
largest ball in both has the diameter

    min(r + s - d, 2 r, 2 s).

For a surface in a solid, the depth of its deepest point counts: min(r + s - d, r), where r is the
solid's radius and s that which sweeps the surface, 0 for most.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index
from ..kernels.base.rounding import DOUBLE_EPS
from ..kernels.base.trees import MESHES
from ..models.hierarchy import Hierarchy
from ..models.model import Model
from .ball import Depth
from .run import Search

_APART = 2.0**-35
"""If the cores meet, their nearest points are moved apart by this share of all coordinates. The way
from one to the other then gives the direction to the swept surfaces. The direction errs by rounding
as a share of this distance, and a point's distance from the surface by the square of that share."""


@dataclass(frozen=True, slots=True)
class Core:
    """The core of a model, which its ball sweeps. A search needs no more of a model than this."""

    _hierarchy: Hierarchy


class CoreSearch:
    """A search for the depth of models whose only volume is swept; methods are as in `BallSearch`.

    Args:
        a: first model.
        b: second model.
    """

    __slots__ = ("_bounds", "_fresh", "_models", "_poses", "_search", "_shapes")

    def __init__(self, a: Model, b: Model) -> None:
        self._models = a, b
        self._shapes: tuple[int, ...] = ()
        self._search: Search

    def begin(
        self,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        depth_err: float,
        abs_err: float,
    ) -> None:
        """Start a search. Tolerances are not used: the distance of the cores is found exactly."""
        shapes = tuple(model.revision for model in self._models)
        if shapes != self._shapes:
            self._shapes = shapes
            self._search = Search(*(Core(model._hierarchy.core()) for model in self._models))
        self._poses = pose_a, pose_b
        self._fresh = True
        self._bounds = 0.0, self._depth(0.0) + self._rounding(0.0)

    def seed_contact(self, row: NDArray[np.float64]) -> None:
        """Do nothing: the nearest points of the cores determine the depth."""

    def seed_part(self, body: int, triangle: int) -> None:
        """Do nothing, for the same reason."""

    def seek(self, deadline: float) -> bool:
        """Do nothing: there are no seeds."""
        return True

    def search(self, deadline: float) -> bool:
        """Search to the end, one slice at least; return False if the deadline came first."""
        code = self._search.run(*self._poses, fresh=self._fresh, deadline=deadline)
        self._fresh = False
        row = self._search.answer
        lower, upper = float(row[index.LOWER]), float(row[index.UPPER])
        self._bounds = (
            max(self._depth(upper) - self._rounding(upper), 0.0),
            max(self._depth(lower) + self._rounding(lower), 0.0),
        )
        return code == index.ENDED

    def _radii(self) -> tuple[float, float]:
        a, b = (model._hierarchy.swept_radius for model in self._models)
        return a, b

    def _depth(self, apart: float) -> float:
        """Return the depth if the cores are `apart` metres apart; negative if nothing overlaps.

        A swept surface is a volume around its core. So it may reach the core of the solid, where
        the depth is the solid's radius.
        """
        a, b = self._radii()
        solids = [model.is_solid for model in self._models]
        most = 2.0 * min(a, b) if all(solids) else (a if solids[0] else b)
        return min(a + b - apart, most)

    def _rounding(self, apart: float) -> float:
        return 8.0 * DOUBLE_EPS * (sum(self._radii()) + apart)

    @property
    def found(self) -> bool:
        """Whether it is certain that the models overlap."""
        return self._bounds[0] > 0.0

    @property
    def points(self) -> int:
        """How many points were tested: none."""
        return 0

    def depth(self) -> Depth:
        """Return what is known about the depth. Both bounds differ by rounding alone."""
        shallow, deep = self._bounds
        slack = 4.0 * float(self._search.progress["slack"])
        slack += 2.0 * self._rounding(sum(self._radii()))
        return Depth(shallow, deep, deep - shallow <= slack, True)

    def fill(self, row: NDArray[np.float64]) -> None:
        """Write the cores' nearest points into an answer (ANSWER,)."""
        found = self._search.answer
        row[index.POINT_A : index.TREE_A] = found[index.POINT_A : index.TREE_A]
        row[index.RADIUS_A], row[index.RADIUS_B] = self._radii()
        points = row[index.POINT_A : index.FEATURE_A].reshape(2, 3)
        if (points[0] == points[1]).all():
            reach = sum(self._radii()) + float(np.abs(points).max())
            points[1] += _APART * reach * self._across(found)

    def _across(self, found: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a unit vector (3,) perpendicular, or nearly so, to both cores where they meet."""
        edges = [np.zeros((1, 3))]
        for model, pose, at in zip(
            self._models, self._poses, (index.TREE_A, index.TREE_B), strict=True
        ):
            tree = model._hierarchy.tree
            if isinstance(tree, MESHES):
                corners = tree.triangles[int(found[at])].reshape(3, 3)
                edges.append((corners[1:] - corners[0]) @ pose[:3, :3].T)
        return np.linalg.svd(np.concatenate(edges))[2][-1]
