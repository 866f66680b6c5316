"""Nearest points on a solid's elements: the functions that the search for balls needs of each kind.

The foot of a point is the nearest point of the solid's nearest element. The type of the tree tells
the kind of its elements; numba chooses the implementation when it compiles (see `implements`). This
file has the stubs and the implementations for triangles. A POINT holds the nearest element of solid
k in `near`, and, if the kind needs it, the place on that element in `spot`.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel
from ..base.state import FEATURE_A
from ..base.trees import MeshTree
from ..base.vectors import add, cross, dot, face_normal, scaled, sub, unit
from ..elements.primitives import corners, mixed
from .nearest import begin_nearest, nearest, point_triangle


def seek(tree, p, k, at, point, stack, reached, found, steps):
    """Continue to search for the element nearest to p; return the steps left. A stub.

    p is the place of `point` in the frame of solid k. Writes to `point` the element, its distance,
    and how much smaller the true distance may be (`POINT.loose`). If the steps do not suffice,
    `at.height` is not 0, and the next call continues from `point` and the stack.
    """


def foot_of(tree, p, k, point):
    """Return the foot of p on solid k's nearest element, metres, and its parameters. A stub."""


def normal_at(tree, k, point):
    """Return the unit normal of the nearest element at the foot, or zero. A stub."""


def facet_of(tree, k, point):
    """Return three corners of a triangle of the surface at the foot, or the foot thrice. A stub."""


def bend_at(tree, k, point, n, e, f):
    """Describe the surface at the foot as heights along n over the plane of e and f. A stub.

    n, e and f are unit vectors of the solid's frame. Returns whether there is such a height; the
    foot; the slopes along e and f; and the second derivatives along e, mixed, and along f, 1/m.
    """


def spot_of_row(tree, element, row, side):
    """Return place, unit normal and rough size of an answer's point on an element. A stub.

    The normal is zero if there is none; lengths are in metres.
    """


def middle_of(tree, element):
    """Return the same as `spot_of_row` for a point inside the element. A stub."""


def corner_of(tree, element):
    """Return the place of the element's first corner. A stub."""


@implements(seek, MeshTree)
@inlined
def _seek(tree, p, k, at, point, stack, reached, found, steps):
    away, near, top = point.away[k], point.near[k], at.height
    if top == 0:
        away, near, top = begin_nearest(tree, p, near, stack, reached)
    away, near, top, steps = nearest(
        tree, p, away, near, top, at.slack, 0.0, stack, reached, found, steps
    )
    point.away[k], point.near[k], at.height = away, near, top
    return steps


@implements(foot_of, MeshTree)
@inlined
def _foot(tree, p, k, point):
    a, b, c = corners(tree.triangles, point.near[k])
    _, v, w = point_triangle(p, a, b, c)
    weights = (max(1.0 - v - w, 0.0), v, w)
    return mixed((a, b, c), weights), weights


@implements(normal_at, MeshTree)
@inlined
def _normal(tree, k, point):
    return face_normal(corners(tree.triangles, point.near[k]))


@implements(facet_of, MeshTree)
@inlined
def _triangle(tree, k, point):
    return corners(tree.triangles, point.near[k])


@kernel
def _normal_of(a, b, c):
    """Return the unit normal of a triangle, or zero; and the triangle's size, metres."""
    n = cross(sub(b, a), sub(c, a))
    length = np.sqrt(dot(n, n))
    if not length > 0.0:
        return (0.0, 0.0, 0.0), 0.0
    return unit(n), np.sqrt(length)


@implements(spot_of_row, MeshTree)
@kernel
def _point_of_row(tree, element, row, side):
    a, b, c = corners(tree.triangles, element)
    at = FEATURE_A + 4 * side
    normal, size = _normal_of(a, b, c)
    return mixed((a, b, c), (row[at], row[at + 1], row[at + 2])), normal, size


@implements(middle_of, MeshTree)
@kernel
def _middle(tree, element):
    a, b, c = corners(tree.triangles, element)
    normal, size = _normal_of(a, b, c)
    return scaled(add(add(a, b), c), 1.0 / 3.0), normal, size


@implements(corner_of, MeshTree)
@inlined
def _corner(tree, element):
    return corners(tree.triangles, element)[0]
