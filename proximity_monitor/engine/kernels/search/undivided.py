"""The stubs for elements that are measured as a whole, such as triangles: nothing is divided."""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined
from ..base.state import ENDED, Waiting
from . import stubs


@implements(stubs.resolution, Waiting)
@inlined
def _resolution(waiting, tree_a, tree_b, slack):
    return 0.0


@implements(stubs.prepare, Waiting)
@inlined
def _prepare(waiting, tree_a, tree_b, state):
    pass


@implements(stubs.settle, Waiting)
@inlined
def _settle(waiting, tree_a, tree_b, state):
    pass


@implements(stubs.compare, Waiting)
@inlined
def _compare(waiting, tree_a, tree_b, state, a, b):
    pass


@implements(stubs.divide, Waiting)
@inlined
def _divide(waiting, tree_a, tree_b, state, steps):
    return ENDED, steps


@implements(stubs.look_ahead, Waiting)
@inlined
def _look_ahead(waiting, tree_a, tree_b, state):
    return 0


@implements(stubs.open_whole, Waiting)
@inlined
def _open_whole(waiting, tree_a, tree_b, state, a, b, bound, scratch):
    return False, 0


@implements(stubs.least_undivided, Waiting)
@inlined
def _least_undivided(waiting, progress):
    return np.inf
