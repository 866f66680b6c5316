"""Newton's method between a surface and a triangle, over the parameters of the surface alone.

The point of the triangle follows: it is always the one nearest to the surface's point. So there are
only two parameters, and `prepare` computes what belongs to the triangle once.
"""

from __future__ import annotations

from ..base.jit import implements, inlined, kernel
from ..base.trees import MeshTree, SurfaceTree
from ..base.vectors import dot, moved, sub, unit
from ..elements.primitives import corners, mixed
from ..surface.jets import fixed_jet, get, put
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
from .triangle_proofs import face_normal, foot_beside

_WEIGHTS, _EDGE, _TRIANGLE, _FACE = 30, 33, 37, 46
"""Offsets in `jets`: the weights of the triangle's point; the direction of the edge along which it
may move, or the triangle's normal if it lies within the face; the triangle in a's frame; and its
normal, of any length."""

_CORNER, _ON_EDGE, _WITHIN = 0.0, 1.0, 2.0
"""Where the triangle's point lies. This number follows its direction in `jets`."""


@kernel
def placed(tree, index, motion):
    """Return the corners of a triangle, moved."""
    a, b, c = corners(tree.triangles, index)
    return moved(motion, a), moved(motion, b), moved(motion, c)


@implements(begin_at, MeshTree)
@inlined
def _begin(tree, weights):
    return 0.0, 0.0


@implements(weights_at, MeshTree)
@inlined
def _weights(tree, x, first, jets):
    return get(jets, _WEIGHTS)


@implements(prepare, SurfaceTree, MeshTree)
@inlined
def _prepare(tree_a, tree_b, element_a, element_b, motion, jets):
    triangle = placed(tree_b, element_b, motion)
    for i in range(3):
        put(jets, _TRIANGLE + 3 * i, triangle[i])
    put(jets, _FACE, face_normal(triangle))


@kernel
def _nearest_of(p, jets):
    """Return the point of the triangle nearest to p; write its weights and direction to `jets`."""
    triangle = get(jets, _TRIANGLE), get(jets, _TRIANGLE + 3), get(jets, _TRIANGLE + 6)
    normal = get(jets, _FACE)
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


@implements(derivatives, SurfaceTree, MeshTree)
@kernel
def _derivatives(tree_a, tree_b, way, jets, gradient, hessian):
    """Write gradient and Hessian by the surface's parameters; the triangle's point stays nearest.

    The triangle's point follows along its edge or within its face, so movement in these directions
    does not count: the products leave out that part of each derivative.
    """
    kind, its_way = jets[_EDGE + 3], get(jets, _EDGE)
    for i in range(4):
        gradient[i] = 0.0
        for j in range(i + 1):
            hessian[i, j] = 0.0
    for i in range(2):
        one = get(jets, 3 * i)
        gradient[i] = dot(way, one)
        for j in range(i + 1):
            other = get(jets, 3 * j)
            product = dot(one, other)
            if kind == _ON_EDGE:
                product -= dot(one, its_way) * dot(other, its_way)
            elif kind == _WITHIN:
                product = dot(one, its_way) * dot(other, its_way)
            second = dot(way, get(jets, 6 + 3 * (i + j)))
            hessian[i, j] = product + second


@implements(solve, SurfaceTree, MeshTree)
@kernel
def _solve(tree_a, tree_b, x, gradient, hessian, damping, factor, step):
    """Compute Newton's step over the surface's parameters, by Cholesky's method."""
    free, other = not is_held(x, gradient, 0), not is_held(x, gradient, 1)
    a, b, c = hessian[0, 0], hessian[1, 0], hessian[1, 1]
    scale = max(abs(a) if free else 0.0, abs(c) if other else 0.0)
    for i in range(4):
        step[i] = 0.0
    if free:
        a += damping * (abs(a) + LEAST_DAMPED * scale)
        if not a > POSITIVE * scale:
            return False
        step[0] = -gradient[0] / a
    if other:
        c += damping * (abs(c) + LEAST_DAMPED * scale)
        slope = gradient[1]
        if free:
            c -= b * (b / a)
            slope += b * step[0]
        if not c > POSITIVE * scale:
            return False
        step[1] = -slope / c
        if free:
            step[0] -= (b / a) * step[1]
    return True
