"""The solution manifold of a search: all pairs that may hold the minimum, as ranges of elements."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..kernels.elements.swept import lower_of, reach_of, upper_of
from ..models.hierarchy import Hierarchy
from .regions import Ranges, Regions, groups_of, regions_of
from .run import Divided, Search, least


@dataclass(frozen=True, slots=True, eq=False)
class Manifold:
    """Every pair of parts of two models that may hold their minimum distance: none is missing.

    A part is one triangle; a rectangle of parameters of a patch, or an interval of those of a
    curve; or all elements under a volume that the search did not open because the budget was over
    or the tolerance did not require it (Johnson and Cohen 1997, section 3.1.3). So rectangles are
    no larger than the tolerances demand, and many cover a continuum (section 3.1.2, figure 9).

    Attributes:
        lower: (k,) metres; certified lower bound of each pair's distance.
        upper: (k,) metres; certified upper bound of it. Infinite if no point of a part is known
            that trimming loops leave.
        ranges_a: (k, 2) int32; each pair's part of a: first, and one after the last, among
            `faces_a`.
        ranges_b: (k, 2) int32; the same of b.
        faces_a: (m,) int32; a's faces by index, those of one part side by side. For a surface, its
            patches and curves.
        faces_b: (n,) int32; the same of b.
        rectangles_a: (m, 2, 2); for a surface, the lowest u and v and the highest of each row, in
            the parameters of its patch. For a curve, v is 0. If trimming loops cross a rectangle,
            only what they leave belongs to the part. None for a mesh.
        rectangles_b: (n, 2, 2) or None; the same of b.
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    ranges_a: NDArray[np.int32]
    ranges_b: NDArray[np.int32]
    faces_a: NDArray[np.int32]
    faces_b: NDArray[np.int32]
    rectangles_a: NDArray[np.float64] | None = None
    rectangles_b: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        """How many pairs there are."""
        return len(self.lower)

    def faces(self, i: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Return the faces of a and the faces of b that make up pair i."""
        (first_a, last_a), (first_b, last_b) = self.ranges_a[i], self.ranges_b[i]
        return self.faces_a[first_a:last_a], self.faces_b[first_b:last_b]

    def extents(self) -> tuple[dict[int, NDArray[np.float64]], dict[int, NDArray[np.float64]]]:
        """Find how far all parts reach in the parameters of each patch or curve of a, and of b.

        Returns:
            For either model, by the patch: (2, 2), the lowest u and v and the highest. Empty for a
            mesh.
        """
        return (
            _extents(self.ranges_a, self.faces_a, self.rectangles_a),
            _extents(self.ranges_b, self.faces_b, self.rectangles_b),
        )

    def subset(self, pairs: NDArray[np.int64]) -> Manifold:
        """Return a manifold of some of the pairs, by their positions."""
        return replace(
            self,
            lower=self.lower[pairs],
            upper=self.upper[pairs],
            ranges_a=self.ranges_a[pairs],
            ranges_b=self.ranges_b[pairs],
        )


def _extents(
    ranges: NDArray[np.int32], faces: NDArray[np.int32], rectangles: NDArray[np.float64] | None
) -> dict[int, NDArray[np.float64]]:
    """Return what `Manifold.extents` returns for one model."""
    if rectangles is None or not len(ranges):
        return {}
    # A row belongs to some part if more ranges have begun than ended there.
    begun = np.bincount(ranges[:, 0], minlength=len(faces) + 1)
    rows = np.flatnonzero(np.cumsum(begun - np.bincount(ranges[:, 1], minlength=len(begun)))[:-1])
    own = faces[rows]
    return {
        int(face): np.stack(
            (
                rectangles[rows[own == face], 0].min(axis=0),
                rectangles[rows[own == face], 1].max(axis=0),
            )
        )
        for face in np.unique(own)
    }


@dataclass(frozen=True, slots=True)
class Candidates:
    """The pairs that may hold the minimum, as a search keeps them; `manifold` makes the answer.

    Making a manifold of many pairs takes longer than a short budget lasts. So a search hands over
    its rows as they are, and nothing writes to them any more.
    """

    hierarchies: tuple[Hierarchy, Hierarchy]
    """The hierarchies as the search saw them: a model may be refitted later."""
    blocks: tuple[NDArray[np.float64], ...]
    """Rows of `State.collected`."""
    pending: tuple[NDArray[np.int32], NDArray[np.float64]]
    """Pairs of volumes that the search did not open: lanes (k, 2), bounds (k,) in metres."""
    divided: Divided | None
    """Pairs of parts of elements; None if no elements are divided."""
    motion: NDArray[np.float64]
    """(12,) from b to a."""
    progress: np.void
    """The state of the search, as PROGRESS."""
    made: list[Regions] = field(default_factory=list)
    """The regions of both models; empty until they are needed."""

    def manifold(self) -> Manifold:
        """Make the manifold: every pair whose lower bound is not above the search's upper bound.

        These are pairs of triangles whose distance was found, pairs of parts of surfaces and of
        volumes that the search left alone, and, if it was cut, those that it did not reach.
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
        if self.divided is not None:
            cells = self.divided.cells()
            near = cells.bounds <= reach
            lower.append(cells.bounds[near])
            for side, own, parts in zip(sides, ranges, cells.pairs[near].T, strict=True):
                own.append(side.own(parts))
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
        """Split a manifold into groups that are certainly apart, in the order of their bounds."""
        if not len(manifold):
            return ()
        groups = groups_of(self._sides(), (manifold.ranges_a, manifold.ranges_b))
        groups.sort(key=lambda own: manifold.lower[own].min())
        return tuple(manifold.subset(own) for own in groups)

    def _sides(self) -> tuple[Regions, Regions]:
        if not self.made:
            cells = (None, None) if self.divided is None else self.divided.cells().sides
            self.made.extend(map(regions_of, self.hierarchies, cells))
        a, b = self.made
        return a, b

    def _apart(self, of_a: Ranges, of_b: Ranges, first: int) -> NDArray[np.float64]:
        """Return the distance of one point of either region, for the pairs from `first` on, metres.

        It bounds the distance of a pair from above. It is infinite if no point of a region is
        known. It errs by no more than the distances of elements.
        """
        a, b = self._sides()
        p, q = a.points(of_a[first:]), b.points(of_b[first:])
        moved = q @ self.motion[:9].reshape(3, 3).T + self.motion[9:]
        apart = np.sqrt(((p - moved) ** 2).sum(axis=1))
        return np.where(np.isnan(apart), np.inf, apart)


def candidates(search: Search) -> Candidates:
    """Take from a search that collects all that it knows at this moment."""
    a, b = search.models
    return Candidates(
        (a._hierarchy, b._hierarchy),
        search.collected(),
        search.pending(),
        search.divided(),
        search.motions[0].copy(),
        search.progress_now(),
    )
