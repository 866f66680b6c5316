"""The solution manifold of a search: all pairs that may hold the minimum, as ranges of elements."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..kernels.elements.swept import lower_of, reach_of, upper_of
from ..models.hierarchy import Hierarchy
from .regions import Ranges, Regions, groups_of, regions_of
from .result import Manifold
from .run import Cells, Search, least


@dataclass(frozen=True, slots=True)
class Candidates:
    """The pairs that may hold the minimum, as a search keeps them; `manifold` makes the answer.

    Making a manifold of many pairs takes longer than a short budget lasts. So a search hands over
    its rows as they are, and nothing writes to them any more.
    """

    hierarchies: tuple[Hierarchy, Hierarchy]
    """As the search saw them: a model may be refitted later."""
    blocks: tuple[NDArray[np.float64], ...]
    """Rows of `State.collected`."""
    pending: tuple[NDArray[np.int32], NDArray[np.float64]]
    """Pairs of volumes that the search did not look into: lanes (k, 2), bounds (k,) in metres."""
    cells: Cells | None
    """Pairs of parts of elements; None where none are divided."""
    motion: NDArray[np.float64]
    """(12,) from b to a."""
    progress: np.void
    """How far the search was, as PROGRESS."""
    made: list[Regions] = field(default_factory=list)
    """Of both models, once they were needed."""

    def manifold(self) -> Manifold:
        """Every pair whose lower bound is not above the upper bound of the search.

        Those are the pairs of triangles whose distance was found, the pairs of parts of surfaces
        and of volumes that were left alone, and, if the search was cut, those that it did not
        reach.
        """
        progress = self.progress
        slack, offsets = progress["slack"], (progress["radii"], progress["deviations"])
        reach = reach_of.py_func(progress["distance"] + progress["upper_slack"], *offsets)
        rows = np.concatenate([each[least(each, slack) <= reach] for each in self.blocks])
        tested = rows[:, 0] >= 0.0
        triangles = rows[tested, :2].astype(np.int32)
        distances = rows[tested, 2]
        lanes, bounds = self.pending
        near = bounds <= reach
        lanes = np.concatenate((~rows[~tested, :2].astype(np.int32), lanes[near]))
        lower = [distances - slack, rows[~tested, 2], bounds[near]]
        sides = self._sides()
        ranges = [
            [side.own(triangles[:, k]), side.under(lanes[:, k])] for k, side in enumerate(sides)
        ]
        if self.cells is not None:
            pairs = self.cells.pairs
            pairs = pairs[pairs["bound"] <= reach]
            lower.append(pairs["bound"])
            for side, own, which in zip(sides, ranges, "ab", strict=True):
                own.append(side.own(pairs[which]))
        of_a, of_b = (np.concatenate(own) for own in ranges)
        upper = np.concatenate((distances, self._apart(of_a, of_b, len(triangles)))) + slack
        return Manifold(
            np.maximum(lower_of.py_func(np.concatenate(lower), *offsets), 0.0),
            upper_of.py_func(upper, *offsets),
            of_a,
            of_b,
            *(side.elements for side in sides),
            *(side.rectangles for side in sides),
        )

    def solution_set(self, manifold: Manifold) -> tuple[Manifold, ...]:
        """The groups of its pairs that are certainly apart, those of the least bounds first."""
        if not len(manifold):
            return ()
        groups = groups_of(self._sides(), (manifold.ranges_a, manifold.ranges_b))
        groups.sort(key=lambda own: manifold.lower[own].min())
        return tuple(manifold.subset(own) for own in groups)

    def _sides(self) -> tuple[Regions, Regions]:
        if not self.made:
            cells = (None, None) if self.cells is None else self.cells.sides
            self.made.extend(map(regions_of, self.hierarchies, cells))
        a, b = self.made
        return a, b

    def _apart(self, of_a: Ranges, of_b: Ranges, first: int) -> NDArray[np.float64]:
        """Distances of a point of either region of the pairs from `first` on, metres.

        The nearest points of a pair are no farther apart, so this bounds their distance from above;
        it is infinite where no point is known. It errs by no more than the distances of elements.
        """
        a, b = self._sides()
        p, q = a.points(of_a[first:]), b.points(of_b[first:])
        moved = q @ self.motion[:9].reshape(3, 3).T + self.motion[9:]
        apart = np.sqrt(((p - moved) ** 2).sum(axis=1))
        return np.where(np.isnan(apart), np.inf, apart)


def candidates(search: Search) -> Candidates:
    """Take from a collecting search all that it knows at this moment."""
    a, b = search.models
    return Candidates(
        (a._hierarchy, b._hierarchy),
        search.collected(),
        search.pending(),
        search.divided(),
        search.state.motions[0].copy(),
        search.progress_now(),
    )
