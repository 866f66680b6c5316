"""Surfaces against surfaces: how their cells face each other, and the entries."""

from __future__ import annotations

from ..base.jit import entry, implements, inlined, kernel, specialised
from ..base.state import BreadthFirst, DepthFirst, Dividing, Priority
from ..base.trees import RevolutionTree, SurfaceTree
from ..search import stubs
from ..search.search import answer_queries
from ..surface import jets  # noqa: F401 - it implements what Newton's method asks of surfaces
from ..surface.edges import point_on
from ..surface.empty_ball import find_ball, is_in_ball
from ..surface.facing import parallelograms, parameters_in
from ..surface.pieces import parameters_of
from ..surface.sides import facing
from . import divided, swept  # noqa: F401 - each implements stubs for these kinds


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
def _look_at_none(waiting, tree_a, tree_b, state):
    return 0


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
