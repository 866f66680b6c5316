"""Surfaces against surfaces: how their cells face each other, and the entries."""

from __future__ import annotations

import numpy as np

from ..base.jit import entry, implements, inlined, kernel, specialised
from ..base.state import (
    BreadthFirst,
    DepthFirst,
    Dividing,
    Priority,
    RevolutionTree,
    SurfaceTree,
)
from ..base.vectors import scaled
from ..elements.direction import gap_between
from ..search import stubs
from ..search.search import answer_queries
from ..surface import jets  # noqa: F401 - it implements what Newton's method asks of surfaces
from ..surface.edges import point_on
from ..surface.empty_ball import find_ball, is_in_ball
from ..surface.facing import parallelograms, parameters_in, vector
from ..surface.pieces import parameters_of
from ..surface.sides import facing
from . import divided, swept  # noqa: F401 - each implements stubs for these kinds
from .beyond_plane import REST, end_along

PART_STEPS = 8
"""Steps that finding out whether a plane is between two surfaces takes as long as."""


@implements(facing, SurfaceTree, SurfaceTree)
@kernel
def _facing(tree_a, tree_b, cells_a, cells_b, a, b, motion):
    one, other = cells_a[a], cells_b[b]
    way, place_a, place_b = parallelograms(one, other, motion)
    return way, parameters_in(one, place_a), parameters_in(other, place_b)


@implements(stubs.witness, SurfaceTree)
@implements(stubs.witness, RevolutionTree)
@kernel
def _witness(tree, element, weights):
    return point_on(tree, element, weights[0], weights[1])


@implements(stubs.parameters, SurfaceTree)
@implements(stubs.parameters, RevolutionTree)
@kernel
def _parameters(tree, element, weights):
    return parameters_of(tree, element, weights)


@implements(divided.begin_below, SurfaceTree, SurfaceTree)
@inlined
def _begin_elsewhere(tree_a, tree_b, state, fresh):
    return False


@implements(stubs.open_whole, Dividing, SurfaceTree, SurfaceTree)
@inlined
def _open_as_all(waiting, tree_a, tree_b, state, a, b, bound, scratch):
    return False, 0


@implements(stubs.look_ahead, Dividing, SurfaceTree, SurfaceTree)
@inlined
def _look_ahead(waiting, tree_a, tree_b, state):
    progress = state.progress[0]
    if progress.futile > 0 or not progress.slack < progress.distance < progress.laid:
        return 0
    return _part(tree_a, tree_b, state)


@kernel
def _part(tree_a, tree_b, state):
    """See whether two surfaces are apart along the way between the nearest points known, entirely.

    Nothing is open then. Returns the steps that this took.
    """
    progress = state.progress[0]
    progress.laid = 0.0  # once is enough
    most = progress.distance - progress.limit
    n, wa = vector(progress.normal_a), progress.weights_a
    end = end_along(tree_a, n, progress.element_a, wa[0], wa[1], most)
    if not end < np.inf:
        progress.futile = REST
        return PART_STEPS
    n, wb = scaled(vector(progress.normal_b), -1.0), progress.weights_b
    begin = -end_along(tree_b, n, progress.element_b, wb[0], wb[1], most)
    if gap_between(progress, end, begin) >= progress.limit:
        progress.open = progress.waiting = 0
    else:
        progress.futile = REST
    return PART_STEPS


@implements(find_ball, SurfaceTree, SurfaceTree)
@inlined
def _find_none(tree_a, tree_b, state):
    return 0


@implements(is_in_ball, SurfaceTree, SurfaceTree)
@inlined
def _is_in_none(tree_a, tree_b, state, a, b):
    return False


def _entry(name, order):
    kinds = {"KIND_A": SurfaceTree, "KIND_B": SurfaceTree, "ORDER": order, "WAITING": Dividing}
    return entry(specialised(answer_queries, name, __name__=__name__, **kinds))


search = _entry("search_surfaces", DepthFirst)
search_nearest_first = _entry("search_surfaces_nearest_first", Priority)
search_by_levels = _entry("search_surfaces_by_levels", BreadthFirst)
