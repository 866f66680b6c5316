"""Meshes against meshes: the stubs of `search/stubs.py` for triangles, and the entries."""

from __future__ import annotations

import numpy as np
from numba import float32

from ..base.jit import entry, implements, inlined, kernel, specialised
from ..base.lanes import not_above
from ..base.memory import on_stack, table_on_stack
from ..base.motion import slack_of_bounds
from ..base.rounding import MARGIN_A, MARGIN_B, MARGIN_T, POINT_FLOOR
from ..base.state import BreadthFirst, DepthFirst, Priority, Waiting
from ..base.trees import MESHES, BoxTree, MeshTree
from ..bounds.gaps import BATCH, CORNERS, gaps, gather, shift
from ..elements.direction import begin_along, end_along, gap_along, gap_between
from ..elements.primitives import collect, corners, measure_triangles, mixed, nearest_lane
from ..search import stubs
from ..search.search import answer_queries
from ..tree.layout import LARGEST, first_of, last_of
from . import mesh_approach, mesh_sample, swept  # noqa: F401 - each implements stubs for two meshes

_LOCAL = CORNERS - 3 * BATCH
_FILTER_STEPS, _EXACT_STEPS = 5, 4
"""Costs of filtering a batch of triangle pairs and of one exact test, in steps, so that a slice of
steps is a slice of time."""


@implements(stubs.slacks, MESHES, MESHES)
@kernel
def _slacks(tree_a, tree_b, apart, error):
    size_a, size_b = tree_a.scale[2], tree_b.scale[2]
    points = MARGIN_A * size_a + MARGIN_B * size_b + MARGIN_T * apart + POINT_FLOOR
    return points, slack_of_bounds(size_a, size_b, apart, error)


implements(stubs.measure, MESHES, MESHES)(measure_triangles)


@implements(stubs.resolve, MESHES, MESHES)
@inlined
def _resolve(tree_a, tree_b, state, n, steps, scratch):
    pairs, gathered = table_on_stack(BATCH, 2, 0), on_stack(CORNERS, 0.0)
    local, found = on_stack(_LOCAL, np.float32(0.0)), scratch.found
    taken, n = take_batch(tree_a, tree_b, state, n, pairs, gathered)
    if taken == 0:
        return n, steps
    # The pair with the smallest lower bound comes first: it often lowers the distance enough to
    # dismiss the others.
    progress = state.progress[0]
    tested = 0
    scale = min(tree_a.scale[1], tree_b.scale[1])
    for k in range(taken, BATCH):
        gather(tree_a.triangles, pairs[0, 0], tree_b.triangles, pairs[0, 1], k, gathered)
    shift(gathered, state.motions[0], scale, local)
    gaps(local, float32(progress.slack * scale * (1.0 + 1e-6)), found)
    remaining = (1 << taken) - 1
    # With a tolerance or a clearance, the limit is below the distance. The first pair measured may
    # lie between the two: if it is nearer than all found so far, it lowers the limit of a
    # tolerance, and its direction serves to measure its neighbours along.
    nearest = max(progress.limit, progress.distance)
    while True:
        reach = np.float32(min(nearest * scale * (1.0 + 1e-6), 3e38))
        remaining &= not_above(found, 0, reach)
        if not remaining:
            break
        k = nearest_lane(found, remaining)
        remaining &= ~(1 << k)
        ta, tb = pairs[k, 0], pairs[k, 1]
        if tested > 0:  # the search direction may have changed since the pairs were gathered
            gap = gap_along(progress, tree_a.triangles, ta, tree_b.triangles, tb)
            if gap >= progress.limit:
                continue
        distance = measure_triangles(tree_a, tree_b, state, ta, tb, np.float64(found[k]))
        tested += 1
        nearest = progress.limit
        if state.collected.shape[0] > 0 and distance - progress.slack < progress.limit:
            collect(state, ta, tb, distance)
    return n, steps - min(steps, _FILTER_STEPS + _EXACT_STEPS * tested)


@implements(stubs.witness, MESHES)
@kernel
def _witness(tree, element, weights):
    return mixed(corners(tree.triangles, element), weights)


@implements(stubs.parameters, MESHES)
@inlined
def _parameters(tree, element, weights):
    return (weights[0], weights[1], weights[2])


@inlined
def take_batch(tree_a, tree_b, state, n, pairs, gathered):
    """Gather the triangle pairs that still matter, from the last of n waiting pairs of leaves.

    Returns how many pairs of triangles were taken, and how many pairs of leaves still wait.
    """
    progress, a, b = state.progress[0], tree_a.triangles, tree_b.triangles
    waiting = state.waiting
    limit = progress.limit
    taken = np.int64(0)  # a literal would have `gather` compiled twice
    while n > 0 and taken <= BATCH - LARGEST * LARGEST:
        n -= 1
        if waiting.bounds[n] >= limit:
            continue
        leaf_a = np.int64(tree_a.children[waiting.lanes[n, 0]])
        leaf_b = np.int64(tree_b.children[waiting.lanes[n, 1]])
        # Where the triangles begin and end along the search direction, each measured once.
        first_a, last_a = first_of(leaf_a), last_of(leaf_a)
        first_b, last_b = first_of(leaf_b), last_of(leaf_b)
        progress.primitive_tests += (last_a - first_a + 1) * (last_b - first_b + 1)
        end, other_end = end_along(progress, a, first_a), end_along(progress, a, last_a)
        begin, other_begin = begin_along(progress, b, first_b), begin_along(progress, b, last_b)
        if gap_between(progress, max(end, other_end), min(begin, other_begin)) >= limit:
            continue
        for ta in range(first_a, last_a + 1):
            ends = end if ta == first_a else other_end
            for tb in range(first_b, last_b + 1):
                begins = begin if tb == first_b else other_begin
                if gap_between(progress, ends, begins) < limit:
                    pairs[taken, 0], pairs[taken, 1] = ta, tb
                    gather(a, ta, b, tb, taken, gathered)
                    taken += 1
    return taken, n


def _entry(name, tree, order):
    kinds = {"KIND_A": tree, "KIND_B": tree, "ORDER": order, "WAITING": Waiting}
    return entry(specialised(answer_queries, name, __name__=__name__, **kinds))


search = _entry("search", MeshTree, DepthFirst)
search_nearest_first = _entry("search_nearest_first", MeshTree, Priority)
search_by_levels = _entry("search_by_levels", MeshTree, BreadthFirst)
search_boxes = _entry("search_boxes", BoxTree, DepthFirst)
search_boxes_nearest_first = _entry("search_boxes_nearest_first", BoxTree, Priority)
search_boxes_by_levels = _entry("search_boxes_by_levels", BoxTree, BreadthFirst)
