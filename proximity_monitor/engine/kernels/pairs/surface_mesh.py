"""Surfaces against meshes: a triangle is not divided, and a surface's cell faces all of it."""

from __future__ import annotations

import numpy as np

from ..base.jit import entry, implements, inlined, kernel, specialised
from ..base.precise import accurate_cross
from ..base.state import BreadthFirst, DepthFirst, Dividing, MeshTree, Priority, SurfaceTree
from ..base.vectors import along, cross, dot, moved, norm, rotated, scaled, sub, turned_back, unit
from ..elements.primitives import corners, mixed
from ..search.search import answer_queries
from ..surface.facing import closest_in, is_long, parameters_in, vector
from ..surface.falling import ball_of, falls, is_crossed
from ..surface.halved import halved_least
from ..surface.jets import fixed_jet, get, moved_jet, put
from ..surface.newton import (
    LEAST_DAMPED,
    POSITIVE,
    begin_at,
    derivatives,
    is_held,
    prepare,
    solve,
    way_at,
    weights_at,
)
from ..surface.sides import (
    begin_on,
    divide_side,
    element_of,
    facing,
    is_left,
    is_short,
    least_of,
    margin_of,
    normal_of,
    roughness,
    whole,
)
from . import divided, mesh_in_ball, swept  # noqa: F401 - each implements stubs for these kinds
from .triangle_proofs import foot_beside, foot_on

_ROUNDS = 2
"""Projections onto a triangle and back to a cell. One onto the triangle ends them: beside a small
cell it is as large as ever, and the way to it must not be tilted along it."""

_WEIGHTS, _EDGE, _TRIANGLE, _FACE = 30, 33, 37, 46
"""Where the weights of a triangle's point stand in `jets`, and the direction in which it may move:
along an edge, or of its normal where it lies within the face. Then the triangle in a's frame, and
its normal, of any length; a last number is 0 where it is a point."""

_CORNER, _ON_EDGE, _WITHIN = 0.0, 1.0, 2.0
"""Where it lies; after its direction."""


@implements(whole, MeshTree)
@inlined
def _whole(tree, element, cells, nets, roots, used):
    return element, used


@implements(divide_side, MeshTree)
@inlined
def _divide(tree, index, cells, nets, used, most):
    return used


@implements(is_short, MeshTree)
@inlined
def _is_short(tree, cells, index, most):
    return True


@implements(roughness, MeshTree)
@inlined
def _roughness(tree, cells, index):
    return -1.0


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


@implements(is_left, MeshTree)
@inlined
def _is_left(tree, element, weights):
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


@kernel
def _placed(tree, index, motion):
    a, b, c = corners(tree.triangles, index)
    return moved(motion, a), moved(motion, b), moved(motion, c)


@inlined
def _place_in(cell, q):
    """Where a cell's parallelogram comes near to q."""
    u, v = vector(cell.along_u), vector(cell.along_v)
    return closest_in(vector(cell.centre), u, v, q)


@inlined
def _point_of(cell, place):
    """The point of a cell's parallelogram at a place."""
    p = along(vector(cell.centre), vector(cell.along_u), place[0])
    return along(p, vector(cell.along_v), place[1])


@kernel
def _across(p, way, triangle):
    """The weights of the point of a triangle nearest to the line through p along `way`.

    That is the one nearest to p when the triangle is projected along the line.
    """
    a, b, c = sub(triangle[0], p), sub(triangle[1], p), sub(triangle[2], p)
    share = 1.0 / dot(way, way)
    a = along(a, way, -share * dot(a, way))
    b = along(b, way, -share * dot(b, way))
    c = along(c, way, -share * dot(c, way))
    return foot_on((0.0, 0.0, 0.0), (a, b, c))


@kernel
def _facing(cell, triangle):
    """The way from a near point of a cell's parallelogram to one of a triangle, in one frame.

    Returns also the place of the first and the weights of the other. The way must not be tilted
    along a triangle, which beside a small cell is as large as ever, nor along a cell that is far
    longer than wide: a line along it takes the cell's place.
    """
    p, u, v = vector(cell.centre), vector(cell.along_u), vector(cell.along_v)
    uu, vv = dot(u, u), dot(v, v)
    long = is_long(uu, vv)
    line = u if uu > vv else v
    place = (0.0, 0.0)
    for _ in range(_ROUNDS):
        weights = _across(p, line, triangle) if long else foot_on(p, triangle)
        place = _place_in(cell, mixed(triangle, weights))
        p = _point_of(cell, place)
    if not long:
        weights = foot_on(p, triangle)
        return sub(mixed(triangle, weights), p), place, weights
    weights = _across(p, line, triangle)
    way = sub(mixed(triangle, weights), p)
    at = place[0] if uu > vv else place[1]
    last = at + dot(way, line) / dot(line, line)
    if -1.0 <= last <= 1.0:
        place = (last, place[1]) if uu > vv else (place[0], last)
        for _ in range(2):  # the second time what rounding has left
            way = along(way, line, -dot(way, line) / dot(line, line))
        return way, place, weights
    last = min(max(last, -1.0), 1.0)
    p = along(p, line, last - at)
    place = (last, place[1]) if uu > vv else (place[0], last)
    weights = foot_on(p, triangle)
    return sub(mixed(triangle, weights), p), place, weights


@implements(facing, SurfaceTree, MeshTree)
@kernel
def _facing_triangle(tree_a, tree_b, cells_a, cells_b, a, b, motion):
    way, place, weights = _facing(cells_a[a], _placed(tree_b, b, motion))
    return way, parameters_in(cells_a[a], place), weights


@implements(facing, MeshTree, SurfaceTree)
@kernel
def _facing_cell(tree_a, tree_b, cells_a, cells_b, a, b, motion):
    triangle = corners(tree_a.triangles, a)
    # In b's frame: the motion's matrix is a rotation, up to what no direction depends on.
    back = _back(motion, triangle[0]), _back(motion, triangle[1]), _back(motion, triangle[2])
    way, place, weights = _facing(cells_b[b], back)
    return rotated(motion, scaled(way, -1.0)), weights, parameters_in(cells_b[b], place)


@kernel
def _back(motion, p):
    """A point of a's frame in b's."""
    return turned_back(motion, (p[0] - motion[9], p[1] - motion[10], p[2] - motion[11]))


@implements(begin_at, MeshTree)
@inlined
def _begin(tree, weights):
    return 0.0, 0.0


@implements(weights_at, MeshTree)
@inlined
def _weights(tree, x, first, jets):
    return get(jets, _WEIGHTS)


@inlined
def _prepare(triangle, jets):
    """Write a triangle to `jets`."""
    for i in range(3):
        put(jets, _TRIANGLE + 3 * i, triangle[i])
    put(jets, _FACE, accurate_cross(sub(triangle[1], triangle[0]), sub(triangle[2], triangle[0])))
    is_point = triangle[0] == triangle[1] and triangle[0] == triangle[2]
    jets[_FACE + 3] = 0.0 if is_point else 1.0


@implements(prepare, SurfaceTree, MeshTree)
@inlined
def _prepare_b(tree_a, tree_b, element_a, element_b, motion, jets):
    _prepare(_placed(tree_b, element_b, motion), jets)


@implements(prepare, MeshTree, SurfaceTree)
@inlined
def _prepare_a(tree_a, tree_b, element_a, element_b, motion, jets):
    _prepare(corners(tree_a.triangles, element_a), jets)


@kernel
def _nearest_of(p, jets):
    """The point of the triangle nearest to p; its weights and how it may move into `jets`."""
    triangle = get(jets, _TRIANGLE), get(jets, _TRIANGLE + 3), get(jets, _TRIANGLE + 6)
    normal = get(jets, _FACE)
    weights = (1.0, 0.0, 0.0)
    if jets[_FACE + 3] != 0.0:
        weights = foot_beside(p, triangle, normal)
    put(jets, _WEIGHTS, weights)
    first = last = 0
    count = 0
    for i in range(3):
        if weights[i] > 0.0:
            first = i if count == 0 else first
            last = i
            count += 1
    way, kind = (0.0, 0.0, 0.0), _CORNER
    if count == 2:
        way, kind = unit(sub(triangle[last], triangle[first])), _ON_EDGE
    elif count == 3:
        way = unit(normal)
        kind = _WITHIN
    put(jets, _EDGE, way)
    jets[_EDGE + 3] = kind
    return mixed(triangle, weights)


@implements(way_at, SurfaceTree, MeshTree)
@kernel
def _way_to_triangle(tree_a, tree_b, element_a, element_b, motion, x, jets):
    p = fixed_jet(tree_a, element_a, x[0], x[1], jets)
    return sub(_nearest_of(p, jets), p)


@implements(way_at, MeshTree, SurfaceTree)
@kernel
def _way_from_triangle(tree_a, tree_b, element_a, element_b, motion, x, jets):
    q = moved_jet(tree_b, element_b, motion, x[2], x[3], jets)
    return sub(q, _nearest_of(q, jets))


@kernel
def _half_derivatives(way, jets, at, first, gradient, hessian):
    """Those by the surface's own parameters, while the triangle's point stays nearest.

    As that follows, what it can do along its edge or in its face does not count: the part of a
    derivative in that direction is left out of the products.
    """
    kind, its_way = jets[_EDGE + 3], get(jets, _EDGE)
    for i in range(4):
        gradient[i] = 0.0
        for j in range(i + 1):
            hessian[i, j] = 0.0
    for i in range(2):
        one = get(jets, at + 3 * i)
        gradient[first + i] = dot(way, one)
        for j in range(i + 1):
            other = get(jets, at + 3 * j)
            product = dot(one, other)
            if kind == _ON_EDGE:
                product -= dot(one, its_way) * dot(other, its_way)
            elif kind == _WITHIN:
                product = dot(one, its_way) * dot(other, its_way)
            second = dot(way, get(jets, at + 6 + 3 * (i + j)))
            hessian[first + i, first + j] = product + second


@inlined
def _solve_two(x, gradient, hessian, damping, first, step):
    """Newton's step over two parameters, by the steps of Cholesky's method; see `solve`."""
    last = first + 1
    free, other = not is_held(x, gradient, first), not is_held(x, gradient, last)
    a, b, c = hessian[first, first], hessian[last, first], hessian[last, last]
    scale = max(abs(a) if free else 0.0, abs(c) if other else 0.0)
    for i in range(4):
        step[i] = 0.0
    if free:
        a += damping * (abs(a) + LEAST_DAMPED * scale)
        if not a > POSITIVE * scale:
            return False
        step[first] = -gradient[first] / a
    if other:
        c += damping * (abs(c) + LEAST_DAMPED * scale)
        slope = gradient[last]
        if free:
            c -= b * (b / a)
            slope += b * step[first]
        if not c > POSITIVE * scale:
            return False
        step[last] = -slope / c
        if free:
            step[first] -= (b / a) * step[last]
    return True


@implements(solve, SurfaceTree, MeshTree)
@kernel
def _solve_for_a(tree_a, tree_b, x, gradient, hessian, damping, factor, step):
    return _solve_two(x, gradient, hessian, damping, 0, step)


@implements(solve, MeshTree, SurfaceTree)
@kernel
def _solve_for_b(tree_a, tree_b, x, gradient, hessian, damping, factor, step):
    return _solve_two(x, gradient, hessian, damping, 2, step)


@implements(derivatives, SurfaceTree, MeshTree)
@kernel
def _derivatives_of_a(tree_a, tree_b, way, jets, gradient, hessian):
    _half_derivatives(way, jets, 0, 0, gradient, hessian)


@implements(derivatives, MeshTree, SurfaceTree)
@kernel
def _derivatives_of_b(tree_a, tree_b, way, jets, gradient, hessian):
    _half_derivatives(way, jets, 15, 2, gradient, hessian)


def _entry(name, kind_a, kind_b, order):
    kinds = {"KIND_A": kind_a, "KIND_B": kind_b, "ORDER": order, "WAITING": Dividing}
    return entry(specialised(answer_queries, name, __name__=__name__, **kinds))


search = _entry("search_surface_mesh", SurfaceTree, MeshTree, DepthFirst)
search_nearest_first = _entry("search_surface_mesh_nearest_first", SurfaceTree, MeshTree, Priority)
search_by_levels = _entry("search_surface_mesh_by_levels", SurfaceTree, MeshTree, BreadthFirst)
search_turned = _entry("search_mesh_surface", MeshTree, SurfaceTree, DepthFirst)
search_turned_nearest_first = _entry(
    "search_mesh_surface_nearest_first", MeshTree, SurfaceTree, Priority
)
search_turned_by_levels = _entry(
    "search_mesh_surface_by_levels", MeshTree, SurfaceTree, BreadthFirst
)
