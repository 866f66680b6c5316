"""The nearest points of a solid's elements: what the search for balls asks of each kind of them.

A tree says by its type which kind they are of; numba chooses when it compiles (see `implements`).
Here are the stubs, and those of triangles. A POINT says of solid k which element is nearest, and
`spot` where on it, if its kind needs that.
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
    """Go on to find the element nearest to p, `point` in the frame of solid k; returns steps left.

    Writes the element, its distance, and by how much less the distance may be (`POINT.loose`).
    Where the steps do not suffice, `at.height` is not 0, and the descent goes on with what `point`
    and the stack hold.
    """


def foot_of(tree, p, k, point):
    """The point of solid k's nearest element that is nearest to p, metres, and its parameters."""


def normal_at(tree, k, point):
    """The element's unit normal there, or zero."""


def facet_of(tree, k, point):
    """Three corners of a triangle, or a point thrice, of the surface there."""


def bend_at(tree, k, point, n, e, f):
    """The surface there as heights along n over the plane of e and f, unit vectors of its frame.

    Returns whether there is such a height; the place; the slopes along e and f; and the second
    derivatives along e, along both, and along f, 1/m.
    """


def spot_of_row(tree, element, row, side):
    """The point of an element that an answer tells of: its place, unit normal, and about its size.

    The normal is zero where there is none; sizes are metres.
    """


def middle_of(tree, element):
    """The same of a point inside the element."""


def corner_of(tree, element):
    """The place of the element's first corner."""


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
    """The unit normal of a triangle, or zero; and how large it is, metres."""
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
