"""The solution manifold of a search: what may hold the minimum, as ranges of triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernels.elements.swept import lower_of, reach_of, upper_of
from ..kernels.tree.layout import first_of, last_of
from ..models.hierarchy import Hierarchy
from ..models.model import Model
from .result import Manifold
from .run import Search


def manifold_of(a: Model, b: Model, search: Search) -> Manifold:
    """Every pair whose lower bound is not above the upper bound of a search that collected.

    Those are the pairs of triangles whose distance was found, the pairs of volumes left alone, and
    where the search was cut those not yet looked into.
    """
    progress = search.progress
    slack = progress["slack"]
    reach = reach_of.py_func(progress["distance"] + progress["upper_slack"], *search.offsets)
    rows = search.collected(reach)
    tested = rows[:, 0] >= 0.0
    triangles = rows[tested, :2].astype(np.int32)
    distances = rows[tested, 2]
    lanes, bounds = search.pending()
    near = bounds <= reach
    lanes = np.concatenate((~rows[~tested, :2].astype(np.int32), lanes[near]))
    ranges = [
        np.concatenate((_one(triangles[:, side]), _under(model._hierarchy, lanes[:, side])))
        for side, model in enumerate((a, b))
    ]
    lower = np.concatenate((distances - slack, rows[~tested, 2], bounds[near]))
    upper = np.concatenate((distances, _apart(a, b, search, ranges, len(triangles)))) + slack
    return Manifold(
        np.maximum(lower_of.py_func(lower, *search.offsets), 0.0),
        upper_of.py_func(upper, *search.offsets),
        *ranges,
        a._hierarchy.numbers,
        b._hierarchy.numbers,
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


def _apart(
    a: Model, b: Model, search: Search, ranges: list[NDArray[np.int32]], first: int
) -> NDArray[np.float64]:
    """Distances of the first vertices of the pairs from `first` on, metres.

    No two points of a pair need be as near, but the nearest are. They err by no more than the
    distances of triangles (MARGIN_A).
    """
    p, q = (
        model._hierarchy.tree.triangles[each[first:, 0], :3]
        for model, each in zip((a, b), ranges, strict=True)
    )
    motion = search.state.motions[0]
    moved = q @ motion[:9].reshape(3, 3).T + motion[9:]
    return np.sqrt(((p - moved) ** 2).sum(axis=1))
