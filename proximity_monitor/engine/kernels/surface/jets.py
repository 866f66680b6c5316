"""Derivatives of surfaces, and of the squared distance of two, for the local search (newton.py)."""

from __future__ import annotations

from ..base.jit import implements, inlined, kernel
from ..base.trees import SurfaceTree
from ..base.vectors import dot, moved, rotated, scaled, sub
from .edges import jet_on
from .newton import begin_at, derivatives, prepare, way_at, weights_at

_HALF = 15
"""Numbers of one surface: its derivatives by u, v, uu, uv and vv."""


@inlined
def put(jets, at, vector):
    """Write three numbers."""
    jets[at], jets[at + 1], jets[at + 2] = vector


@inlined
def get(jets, at):
    """Read three numbers."""
    return (jets[at], jets[at + 1], jets[at + 2])


@kernel
def fixed_jet(tree, element, u, v, jets):
    """Return the point of a's surface at u, v; write its derivatives, negated, to `jets`."""
    point, du, dv, duu, duv, dvv = jet_on(tree, element, u, v)
    put(jets, 0, scaled(du, -1.0))
    put(jets, 3, scaled(dv, -1.0))
    put(jets, 6, scaled(duu, -1.0))
    put(jets, 9, scaled(duv, -1.0))
    put(jets, 12, scaled(dvv, -1.0))
    return point


@kernel
def moved_jet(tree, element, motion, u, v, jets):
    """Return the point of b's surface at u, v in a's frame; write its derivatives to `jets`."""
    point, du, dv, duu, duv, dvv = jet_on(tree, element, u, v)
    put(jets, _HALF, rotated(motion, du))
    put(jets, _HALF + 3, rotated(motion, dv))
    put(jets, _HALF + 6, rotated(motion, duu))
    put(jets, _HALF + 9, rotated(motion, duv))
    put(jets, _HALF + 12, rotated(motion, dvv))
    return moved(motion, point)


@implements(begin_at, SurfaceTree)
@inlined
def _begin(tree, weights):
    return weights[0], weights[1]


@implements(weights_at, SurfaceTree)
@inlined
def _weights(tree, x, first, jets):
    return (x[first], x[first + 1], 0.0)


@implements(prepare, SurfaceTree, SurfaceTree)
@inlined
def _prepare(tree_a, tree_b, element_a, element_b, motion, jets):
    pass


@implements(way_at, SurfaceTree, SurfaceTree)
@kernel
def _way(tree_a, tree_b, element_a, element_b, motion, x, jets):
    p = fixed_jet(tree_a, element_a, x[0], x[1], jets)
    return sub(moved_jet(tree_b, element_b, motion, x[2], x[3], jets), p)


@implements(derivatives, SurfaceTree, SurfaceTree)
@kernel
def _derivatives(tree_a, tree_b, way, jets, gradient, hessian):
    for i in range(4):
        first = get(jets, (i // 2) * _HALF + (i % 2) * 3)
        gradient[i] = dot(way, first)
        for j in range(i + 1):
            second = 0.0
            if i // 2 == j // 2:
                second = dot(way, get(jets, (i // 2) * _HALF + 6 + 3 * (i % 2 + j % 2)))
            hessian[i, j] = dot(first, get(jets, (j // 2) * _HALF + (j % 2) * 3)) + second
