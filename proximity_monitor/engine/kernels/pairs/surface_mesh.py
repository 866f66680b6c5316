"""Surfaces against meshes: no triangle is divided, and a surface's cell faces a whole triangle."""

from __future__ import annotations

import numpy as np

from ..base.jit import entry, implements, inlined, kernel, specialised
from ..base.state import BreadthFirst, DepthFirst, Dividing, Priority
from ..base.trees import MeshTree, SurfaceTree
from ..base.vectors import along, cross, dot, norm, sub
from ..elements.primitives import corners, mixed
from ..search.search import answer_queries
from ..surface.facing import closest_in, is_long, parameters_in, vector
from ..surface.falling import ball_of, falls, is_crossed
from ..surface.halved import halved_least
from ..surface.sides import (
    begin_on,
    divide_side,
    element_of,
    facing,
    is_long_in,
    is_within_trim,
    least_of,
    margin_of,
    normal_of,
    roughness,
    ways_to_divide,
    whole,
)
from . import divided, mesh_in_ball, swept  # noqa: F401 - each implements stubs for these kinds
from .triangle_newton import placed
from .triangle_proofs import face_normal, foot_beside, foot_on


@implements(whole, MeshTree)
@inlined
def _whole(tree, element, cells, nets, roots, used):
    return element, used


@implements(divide_side, MeshTree)
@inlined
def _divide(tree, index, cells, nets, used, in_u, in_v):
    return used


@implements(ways_to_divide, MeshTree)
@inlined
def _ways(tree, cells, nets, index, n):
    return False, False, -1.0


@implements(is_long_in, MeshTree)
@inlined
def _is_long_in(tree, cells, index, most):
    return False, False


@implements(roughness, MeshTree)
@inlined
def _roughness(tree, cells, index):
    return 0.0


@implements(least_of, MeshTree)
@inlined
def _least(tree, cells, nets, index, n):
    a, b, c = corners(tree.triangles, index)
    return min(min(dot(a, n), dot(b, n)), dot(c, n))


implements(halved_least, MeshTree)(_least)


@implements(margin_of, MeshTree)
@inlined
def _margin(tree, cells, index):
    return 0.0


@implements(element_of, MeshTree)
@inlined
def _element(tree, cells, index):
    return index


@implements(begin_on, MeshTree)
@inlined
def _begin_on(tree, element):
    return np.int64(element), (1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0)


@implements(is_within_trim, MeshTree)
@inlined
def _is_within_trim(tree, element, weights):
    return True


@implements(is_crossed, MeshTree)
@inlined
def _is_crossed(tree, cells, index):
    return False


@implements(ball_of, MeshTree)
@kernel
def _ball(tree, cells, nets, index):
    a, b, c = corners(tree.triangles, index)
    centre = mixed((a, b, c), (1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0))
    radius = max(norm(sub(a, centre)), max(norm(sub(b, centre)), norm(sub(c, centre))))
    return centre, radius * (1.0 + 1e-12)


@implements(falls, MeshTree)
@inlined
def _falls(tree, cells, nets, index, way, spread):
    return False


@implements(normal_of, MeshTree)
@kernel
def _normal(tree, cells, index):
    a, b, c = corners(tree.triangles, index)
    return cross(sub(b, a), sub(c, a))


@inlined
def _place_in(cell, q):
    """Return the place on a cell's parallelogram that is nearest to q."""
    u, v = vector(cell.along_u), vector(cell.along_v)
    return closest_in(vector(cell.centre), u, v, q)


@inlined
def _point_of(cell, place):
    """Return the point of a cell's parallelogram at a place."""
    p = along(vector(cell.centre), vector(cell.along_u), place[0])
    return along(p, vector(cell.along_v), place[1])


@kernel
def _across(p, way, triangle):
    """Return the weights of the point of a triangle nearest to the line through p along `way`.

    If the triangle is projected along the line, this is the point nearest to p.
    """
    a, b, c = sub(triangle[0], p), sub(triangle[1], p), sub(triangle[2], p)
    share = 1.0 / dot(way, way)
    a = along(a, way, -share * dot(a, way))
    b = along(b, way, -share * dot(b, way))
    c = along(c, way, -share * dot(c, way))
    return foot_on((0.0, 0.0, 0.0), (a, b, c))


@kernel
def _facing(cell, triangle):
    """Return the way from a near point of a cell's parallelogram to one of a triangle.

    Both are in one frame. Returns also the place of the first point and the weights of the second.
    The cell's centre is projected onto the triangle, back, and onto the triangle again. The way
    must not be tilted along the triangle, which stays large while cells get small. Nor must it be
    tilted along a cell that is far longer than wide: then a line along the cell takes its place.
    """
    p, u, v = vector(cell.centre), vector(cell.along_u), vector(cell.along_v)
    uu, vv = dot(u, u), dot(v, v)
    long = is_long(uu, vv)
    line = u if uu > vv else v
    face = face_normal(triangle)
    weights = _across(p, line, triangle) if long else foot_beside(p, triangle, face)
    place = _place_in(cell, mixed(triangle, weights))
    p = _point_of(cell, place)
    if not long:
        weights = foot_beside(p, triangle, face)
        return sub(mixed(triangle, weights), p), place, weights
    weights = _across(p, line, triangle)
    way = sub(mixed(triangle, weights), p)
    at = place[0] if uu > vv else place[1]
    last = at + dot(way, line) / dot(line, line)
    if -1.0 <= last <= 1.0:
        place = (last, place[1]) if uu > vv else (place[0], last)
        for _ in range(2):  # the second time removes what rounding has left
            way = along(way, line, -dot(way, line) / dot(line, line))
        return way, place, weights
    last = min(max(last, -1.0), 1.0)
    p = along(p, line, last - at)
    place = (last, place[1]) if uu > vv else (place[0], last)
    weights = foot_beside(p, triangle, face)
    return sub(mixed(triangle, weights), p), place, weights


@implements(facing, SurfaceTree, MeshTree)
@kernel
def _facing_triangle(tree_a, tree_b, cells_a, cells_b, a, b, motion):
    way, place, weights = _facing(cells_a[a], placed(tree_b, b, motion))
    return way, parameters_in(cells_a[a], place), weights


def _entry(name, kind_a, kind_b, order):
    kinds = {"KIND_A": kind_a, "KIND_B": kind_b, "ORDER": order, "WAITING": Dividing}
    return entry(specialised(answer_queries, name, __name__=__name__, **kinds))


search = _entry("search_surface_mesh", SurfaceTree, MeshTree, DepthFirst)
search_nearest_first = _entry("search_surface_mesh_nearest_first", SurfaceTree, MeshTree, Priority)
search_by_levels = _entry("search_surface_mesh_by_levels", SurfaceTree, MeshTree, BreadthFirst)
