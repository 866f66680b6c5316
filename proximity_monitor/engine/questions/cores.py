"""How deep models overlap that are nothing but swept: spheres, capsules, swept sheets.

Let d be the distance of the cores, and r and s the radii. A point x that is a from one core and b
from the other has the depths r - a and s - b, and a + b is never less than d: so the smaller of
both is at most (r + s - d) / 2, and at most r and s, as no distance is negative. On the segment
between the cores' nearest points there is an x that attains the least of these three. So the
largest ball in both has the diameter

    min(r + s - d, 2 r, 2 s).

Of a surface, which is swept by s (0 for most), the deepest point counts: min(r + s - d, r).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index
from ..kernels.base.rounding import DOUBLE_EPS
from ..models.hierarchy import Hierarchy
from ..models.mesh import TriangleMesh
from ..models.model import Model
from .run import Search


def core_of(model: Model) -> TriangleMesh:
    """What a model's balls sweep, as a model whose hierarchy shares the volumes."""
    swept = model._hierarchy
    scale = swept.tree.scale.copy()
    scale[[index.SWEPT, index.DEVIATION]] = 0.0
    tree = swept.tree._replace(scale=scale)
    distinct = tree if swept.distinct is swept.tree else swept.distinct._replace(scale=scale)
    kept = {"tree": tree, "distinct": distinct, "swept_radius": 0.0, "deviation": 0.0}
    core = TriangleMesh.__new__(TriangleMesh)
    core.name, core._hierarchy = model.name, Hierarchy.__new__(Hierarchy)
    core._hierarchy.__setstate__(swept.__getstate__() | kept)
    return core


class CoreSearch:
    """A search for the depth of models that are nothing but swept; else as `BallSearch`.

    Args:
        a: first model.
        b: second model.
    """

    given_up = False

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
        """Start a search; the distance of the cores is found to the end."""
        shapes = tuple(model.revision for model in self._models)
        if shapes != self._shapes:
            self._shapes = shapes
            self._search = Search(*map(core_of, self._models))
        self._poses = pose_a, pose_b
        self._fresh = True
        self._bounds = 0.0, self._depth(0.0) + self._rounding(0.0)

    def seed_contact(self, row: NDArray[np.float64]) -> None:
        """Do nothing: the cores' nearest points say it all."""

    def seed_part(self, body: int, triangle: int) -> None:
        """Do nothing, either."""

    def seek(self, deadline: float) -> bool:
        """Do nothing."""
        return True

    def search(self, deadline: float) -> bool:
        """Search until the end, or until the deadline, after one slice at least: then False."""
        code = self._search.run(
            *self._poses, fresh=self._fresh, deadline=None if deadline == math.inf else deadline
        )
        self._fresh = False
        row = self._search.answers[0]
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
        """How deep models overlap whose cores are so far apart, metres; negative where they do not.

        A swept surface is all that is near its core, so it reaches a solid's core, if it can.
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
    def slack(self) -> float:
        """Metres that rounding may widen the bounds by."""
        return 4.0 * float(self._search.progress["slack"]) + 2.0 * self._rounding(
            sum(self._radii())
        )

    @property
    def points(self) -> int:
        """No points' depths were asked for."""
        return 0

    @property
    def bounds(self) -> tuple[float, float]:
        """Certified bounds of the depth, metres."""
        return self._bounds

    def fill(self, row: NDArray[np.float64]) -> None:
        """Write the cores' nearest points into an answer (ANSWER,)."""
        found = self._search.answers[0]
        row[index.POINT_A : index.TREE_A] = found[index.POINT_A : index.TREE_A]
        row[index.RADIUS_A], row[index.RADIUS_B] = self._radii()
