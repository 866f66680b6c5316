"""Solids of revolution against each other: the stubs for their profiles, and the entry."""

from __future__ import annotations

import numpy as np

from ..base.jit import entry, implements, inlined, kernel, specialised
from ..base.state import DepthFirst, Turning, remembers
from ..base.trees import RevolutionTree
from ..elements.primitives import LEAP, has_leapt
from ..revolution.minima import keep_same, look_around, measure_again
from ..revolution.rings import begin_rings, search_rings
from ..search import stubs
from ..search.search import answer_queries
from . import divided

implements(stubs.slacks, RevolutionTree, RevolutionTree)(divided.slacks)
implements(stubs.resolution, Turning)(divided.resolution)


@implements(stubs.prepare, Turning)
@kernel
def _prepare(waiting, tree_a, tree_b, state):
    begin_rings(tree_a, tree_b, state)


@implements(stubs.settle, Turning)
@kernel
def _settle(waiting, tree_a, tree_b, state):
    if state.progress[0].minima == 0:  # else a minimum was looked for already
        measure_again(tree_a, tree_b, state)


@implements(stubs.guess, RevolutionTree, RevolutionTree)
@kernel
def _guess(tree_a, tree_b, state):
    if has_leapt(tree_a, tree_b, state, LEAP) or not remembers(state):  # or nothing is known of it
        look_around(tree_a, tree_b, state)
    elif state.progress[0].minima == 0:  # else a minimum was looked for already
        measure_again(tree_a, tree_b, state)


@implements(stubs.measure, RevolutionTree, RevolutionTree)
@kernel
def _measure(tree_a, tree_b, state, a, b, bound):
    progress = state.progress[0]
    if a == 0 and b == 0:  # the elements to begin with if nothing is known
        look_around(tree_a, tree_b, state)
        return
    for i in range(2):
        progress.weights_a[i] = progress.weights_b[i] = 0.5
    keep_same(tree_a, tree_b, state)


@implements(stubs.approach, RevolutionTree, RevolutionTree)
@inlined
def _approach(tree_a, tree_b, state, steps, found):
    pass  # the nearest minimum near the last one is known already


@implements(stubs.compare, Turning)
@inlined
def _compare(waiting, tree_a, tree_b, state, a, b):
    pass  # questions about two elements alone go to the entry for surfaces


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
