"""What a search for a ball finds out about one of two solids, by the kinds of their trees.

The functions work on solid k of two. For trees of the same type (`_alike`), the implementation
selects the tree at run time. For trees of different types (`_unlike`), it has two calls of
`_alike`, each with one tree passed twice.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel, shared
from ..base.trees import MeshTree, RevolutionTree, SurfaceTree
from .ball_caps import plane
from .ball_cells import radius_limit
from .ball_point import continue_depth, measure_depth
from .ball_tangents import tangent

_MOST = 0.5
"""Share of the largest ball's radius. A plane is useless if it lies above the nearest point of the
surface by more than this."""


def plane_of_solid(
    tree_a, tree_b, region_a, region_b, k, behind, point, centre, half, spare, state, row
):  # fmt: skip
    """Find a plane of solid k for a cell, seen from `point`, as `plane` does. A stub.

    If `behind`, the plane is seen from a point behind `point`. It is so far behind that, if the
    solid is too thin there for a larger ball, its opposite face is nearer than the face at `point`.
    """


def continue_depth_of_solid(tree_a, tree_b, region_a, region_b, k, state, steps):
    """Continue to find the trial point's depth in solid k; return the steps left. A stub."""


def tangent_of_solid(tree_a, tree_b, k, state, centre, half, row):
    """Find a row for the cell around the trial point, as `tangent` does. A stub."""


@kernel
def _go_behind(point, k, behind, state):
    """Move the probe to the point `behind` metres beyond `point`, away from solid k's surface."""
    probe = state.probe[0]
    for i in range(3):
        probe.place[i] = point.place[i] + behind * point.way[k, i]
    probe.clear[k] = point.clear[k] - behind * (1.0 + 1e-12) - 4.0 * state.at[0].slack
    probe.side[k] = point.side[k] if probe.clear[k] > 0.0 else 0
    probe.near[k] = point.near[k]


@shared
def _plane_alike(
    tree_a, tree_b, region_a, region_b, k, behind, point, centre, half, spare, state, row
):  # fmt: skip
    at = state.at[0]
    limit, steps = radius_limit(at), 0
    if k == 0:
        tree, region = tree_a, region_a
    else:
        tree, region = tree_b, region_b
    most = _MOST * at.radius
    if not at.radius > 0.0:
        most = 0.5 * np.sqrt(half[0] * half[0] + half[1] * half[1] + half[2] * half[2])
    if at.cells > 0:
        # A plane higher than this cannot prune the cell, even with the other solid's best plane.
        trial = state.trial[0]
        rise = 2.0 * limit - trial.depth[0] - trial.depth[1]
        most = min(most, max(rise, 2.0 * spare))
    most = max(most, spare)
    motion = state.motions[k]
    if behind:
        back = limit - at.swept[k] - 0.5 * point.away[k]
        if point.side[k] <= 0 or not back > 0.0:
            return False, steps
        _go_behind(point, k, back, state)
        point = state.probe[0]
        steps += measure_depth(tree, region, motion, k, at, point, state.stack, state.reached)
    found, cost = plane(
        tree, region, motion, k, at, point, centre, half, spare, most, row, state.stack
    )
    return found, steps + cost


@inlined
def _plane_unlike(
    tree_a, tree_b, region_a, region_b, k, behind, point, centre, half, spare, state, row
):  # fmt: skip
    if k == 0:
        return _plane_alike(
            tree_a, tree_a, region_a, region_a, k, behind, point, centre, half, spare, state, row
        )
    return _plane_alike(
        tree_b, tree_b, region_b, region_b, k, behind, point, centre, half, spare, state, row
    )


@inlined
def _continue_depth_alike(tree_a, tree_b, region_a, region_b, k, state, steps):
    if k == 0:
        tree, region = tree_a, region_a
    else:
        tree, region = tree_b, region_b
    return continue_depth(
        tree, region, state.motions[k], k, state.at[0], state.trial[0], state.stack,
        state.reached, steps,
    )  # fmt: skip


@inlined
def _continue_depth_unlike(tree_a, tree_b, region_a, region_b, k, state, steps):
    if k == 0:
        return _continue_depth_alike(tree_a, tree_a, region_a, region_a, k, state, steps)
    return _continue_depth_alike(tree_b, tree_b, region_b, region_b, k, state, steps)


@inlined
def _tangent_alike(tree_a, tree_b, k, state, centre, half, row):
    tree = tree_a if k == 0 else tree_b
    return tangent(tree, state.motions[k], k, state.at[0], state.trial[0], centre, half, row)


@inlined
def _tangent_unlike(tree_a, tree_b, k, state, centre, half, row):
    if k == 0:
        return _tangent_alike(tree_a, tree_a, k, state, centre, half, row)
    return _tangent_alike(tree_b, tree_b, k, state, centre, half, row)


for _kind in (MeshTree, SurfaceTree, RevolutionTree):
    implements(plane_of_solid, _kind, _kind)(_plane_alike)
    implements(continue_depth_of_solid, _kind, _kind)(_continue_depth_alike)
    implements(tangent_of_solid, _kind, _kind)(_tangent_alike)
for _kind in (SurfaceTree, RevolutionTree):
    implements(plane_of_solid, _kind, MeshTree)(_plane_unlike)
    implements(continue_depth_of_solid, _kind, MeshTree)(_continue_depth_unlike)
    implements(tangent_of_solid, _kind, MeshTree)(_tangent_unlike)
