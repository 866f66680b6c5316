"""Solids of revolution against each other: what a search asks of their profiles, and the entry."""

from __future__ import annotations

import numpy as np

from ..base.jit import entry, implements, inlined, kernel, specialised
from ..base.motion import slack_of_bounds
from ..base.rounding import MARGIN_A, MARGIN_B, MARGIN_T, POINT_FLOOR, RESOLUTION
from ..base.state import DepthFirst, RevolutionTree, Turning
from ..elements.errors import points_err
from ..revolution.minima import keep_same, look_around, measure_again
from ..revolution.rings import begin_rings, search_rings
from ..search import stubs
from ..search.search import answer_queries
from ..surface.edges import point_on
from ..surface.pieces import parameters_of


@implements(stubs.witness, RevolutionTree)
@kernel
def _witness(tree, element, weights):
    return point_on(tree, element, weights[0], weights[1])


@implements(stubs.parameters, RevolutionTree)
@kernel
def _parameters(tree, element, weights):
    return parameters_of(tree, element, weights)


@implements(stubs.slacks, RevolutionTree, RevolutionTree)
@kernel
def _slacks(tree_a, tree_b, apart, error):
    size_a, size_b = tree_a.scale[2], tree_b.scale[2]
    points = MARGIN_A * size_a + MARGIN_B * size_b + MARGIN_T * apart + POINT_FLOOR
    points += points_err(tree_a) + points_err(tree_b)
    return points, slack_of_bounds(size_a, size_b, apart, error)


@implements(stubs.resolution, Turning)
@inlined
def _resolution(waiting, tree_a, tree_b, slack):
    return RESOLUTION * (tree_a.scale[2] + tree_b.scale[2]) + 3.0 * slack


@implements(stubs.prepare, Turning)
@kernel
def _prepare(waiting, tree_a, tree_b, state):
    begin_rings(tree_a, tree_b, state)


@implements(stubs.settle, Turning)
@kernel
def _settle(waiting, tree_a, tree_b, state):
    measure_again(tree_a, tree_b, state)


@implements(stubs.guess, RevolutionTree, RevolutionTree)
@kernel
def _guess(tree_a, tree_b, state):
    progress = state.progress[0]
    if progress.element_a == 0 and progress.element_b == 0:  # as where nothing is known
        look_around(tree_a, tree_b, state)
    else:
        measure_again(tree_a, tree_b, state)


@implements(stubs.measure, RevolutionTree, RevolutionTree)
@kernel
def _measure(tree_a, tree_b, state, a, b, bound):
    progress = state.progress[0]
    for i in range(2):
        progress.weights_a[i] = progress.weights_b[i] = 0.5
    keep_same(tree_a, tree_b, state)


@implements(stubs.compare, Turning)
@inlined
def _compare(waiting, tree_a, tree_b, state, a, b):
    pass  # elements alone are compared as those of surfaces


@implements(stubs.least_undivided, Turning)
@inlined
def _least_undivided(waiting, progress):
    first = waiting.rings[waiting.heap[0]].bound if progress.rings > 0 else np.inf
    return min(first, progress.least_cells)


search = entry(
    specialised(
        answer_queries, "search_rings", __name__=__name__, KIND_A=RevolutionTree,
        KIND_B=RevolutionTree, ORDER=DepthFirst, WAITING=Turning, advance=search_rings,
    )
)  # fmt: skip
