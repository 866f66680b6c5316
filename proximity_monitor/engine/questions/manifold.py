"""The solution manifold of a search: all pairs that may hold the minimum, as triangle ranges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..kernels.elements.swept import lower_of, reach_of, upper_of
from ..kernels.tree.layout import first_of, last_of
from ..models.hierarchy import Hierarchy
from .result import Manifold
from .run import Search, least


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
    motion: NDArray[np.float64]
    """(12,) from b to a."""
    progress: np.void
    """How far the search was, as PROGRESS."""

    def manifold(self) -> Manifold:
        """Every pair whose lower bound is not above the upper bound of the search.

        Those are the pairs of triangles whose distance was found, the pairs of volumes that were
        left alone, and, if the search was cut, those that it did not reach.
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
        ranges = [
            np.concatenate((_one(triangles[:, side]), _under(mesh, lanes[:, side])))
            for side, mesh in enumerate(self.hierarchies)
        ]
        lower = np.concatenate((distances - slack, rows[~tested, 2], bounds[near]))
        upper = np.concatenate((distances, self._apart(ranges, len(triangles)))) + slack
        return Manifold(
            np.maximum(lower_of.py_func(lower, *offsets), 0.0),
            upper_of.py_func(upper, *offsets),
            *ranges,
            *(mesh.numbers for mesh in self.hierarchies),
        )

    def _apart(self, ranges: list[NDArray[np.int32]], first: int) -> NDArray[np.float64]:
        """Distances of the first vertices of the pairs from `first` on, metres.

        The nearest points of a pair are no farther apart, so this bounds their distance from above.
        It errs by no more than the distances of triangles (MARGIN_A).
        """
        p, q = (
            mesh.tree.triangles[each[first:, 0], :3]
            for mesh, each in zip(self.hierarchies, ranges, strict=True)
        )
        moved = q @ self.motion[:9].reshape(3, 3).T + self.motion[9:]
        return np.sqrt(((p - moved) ** 2).sum(axis=1))


def candidates(search: Search) -> Candidates:
    """Take from a collecting search all that it knows at this moment."""
    a, b = search.models
    return Candidates(
        (a._hierarchy, b._hierarchy),
        search.collected(),
        search.pending(),
        search.state.motions[0].copy(),
        search.progress_now(),
    )


def _one(triangles: NDArray[np.int32]) -> NDArray[np.int32]:
    """Ranges of one triangle each."""
    return np.stack((triangles, triangles + np.int32(1)), axis=1)


def _under(mesh: Hierarchy, lanes: NDArray[np.int32]) -> NDArray[np.int32]:
    """Ranges of the triangles under volumes."""
    children = mesh.tree.children[lanes]
    leaves = children < 0
    own = np.stack((first_of.py_func(children), last_of.py_func(children) + 1), axis=1)
    return np.where(leaves[:, None], own, mesh.ranges()[np.where(leaves, 0, children)])
