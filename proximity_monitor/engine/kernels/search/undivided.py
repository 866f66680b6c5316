"""Elements that are measured as a whole, as triangles are: nothing is left to divide."""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined
from ..base.memory import on_stack
from ..base.state import ENDED, Waiting
from ..tree.layout import WIDTH
from . import stubs

_RENEWAL, _QUERY = 200 * WIDTH, 32
"""Bound tests of searches with a tolerance until the nearest points are renewed; and steps of each
point query for that.

Such a search finds none that are nearer by less than is tolerated. What it begins with is too far
then by more and more, and with it the limit, so that it opens more volumes: half as many again
along a path. To bring the points nearer takes some 30 openings.
"""


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
    progress = state.progress[0]
    follows = state.far.shape[0] > 0
    if follows and progress.rel_err + progress.abs_err > 0.0 and progress.spent >= _RENEWAL:
        progress.spent = 0
        stubs.approach(tree_a, tree_b, state, _QUERY, on_stack(WIDTH, np.float32(0.0)))


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
