"""Triangles in the proofs that a pair of cells is done: parameters, and how points move with them.

See surface/certificate.py. A triangle does not bend, so its derivatives are the same everywhere.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel
from ..base.precise import accurate_cross
from ..base.rounding import DOUBLE_EPS
from ..base.trees import MeshTree
from ..base.vectors import along, dot, norm, scaled, sub
from ..elements.primitives import corners, mixed
from ..elements.triangles import point_face
from ..inside.nearest import point_outline
from ..surface.certificate import can_be_proven, find_in, put_point, put_ranges
from ..surface.form import ACROSS, APART, CORNER, ENDS, ERRORS, HALF, MIDDLE, SLOPE, SPREAD

_LARGE = 0.25
"""A weight larger than any error. One of three weights is at least that."""


@kernel
def foot_on(p, triangle):
    """Return the weights of the point of a triangle that is nearest to p."""
    return foot_beside(p, triangle, face_normal(triangle))


@kernel
def face_normal(triangle):
    """Return a normal of a triangle, of any length; 0 if it has none."""
    return accurate_cross(sub(triangle[1], triangle[0]), sub(triangle[2], triangle[0]))


@kernel
def foot_beside(p, triangle, n):
    """Return the weights of the point of a triangle nearest to p, given a normal n of the triangle.

    If the foot lies within the face, take it, although an edge beside it may be as near up to
    rounding. The way to the edge would be tilted, and the bound along it worse by the tilt times
    the size of the triangle.
    """
    if triangle[0] == triangle[1] and triangle[0] == triangle[2]:
        return (1.0, 0.0, 0.0)  # the triangle is a point
    e, f, nn = sub(triangle[1], triangle[0]), sub(triangle[2], triangle[0]), dot(n, n)
    if nn > 0.0:
        inside, v, w, _ = point_face(p, triangle[0], e, f, n, nn)
        if inside:
            return (max(1.0 - v - w, 0.0), v, w)
    _, v, w = point_outline(p, triangle[0], triangle[1], triangle[2])
    return (max(1.0 - v - w, 0.0), v, w)


@implements(can_be_proven, MeshTree)
@inlined
def _can_be_proven(tree, cells, index):
    return True


@implements(find_in, MeshTree)
@kernel
def _find_in(tree, cells, index, element, weights):
    p = mixed(corners(tree.triangles, element), weights)
    triangle, error = corners(tree.triangles, index), 4.0 * DOUBLE_EPS * tree.scale[2]
    if index != element:
        if weights[0] > 0.0 and weights[1] > 0.0 and weights[2] > 0.0:
            return False, weights, p
        weights = foot_on(p, triangle)
    weights = _on_edges(weights, triangle, p, error)
    q = mixed(triangle, weights)
    return norm(sub(q, p)) <= 2.0 * error, weights, q


@inlined
def _on_edges(weights, triangle, p, error):
    """Return the weights of a point p of a triangle, 0 where this moves p by less than `error`.

    A nearest point on an edge is known as such only if it lies on the edge to the last digit.
    """
    a, b, c = weights
    a = a if a > _LARGE or a * norm(sub(triangle[0], p)) > error else 0.0
    b = b if b > _LARGE or b * norm(sub(triangle[1], p)) > error else 0.0
    c = c if c > _LARGE or c * norm(sub(triangle[2], p)) > error else 0.0
    return scaled((a, b, c), 1.0 / (a + b + c))


@implements(put_point, MeshTree)
@kernel
def _put_point(tree, cells, index, weights, side):
    for i in range(len(side)):
        side[i] = 0.0
    side[APART] = side[APART + 1] = np.inf
    corner = corners(tree.triangles, index)
    # The parameters lead from the corner with the largest weight to the other two, that with the
    # least weight last. So a point on an edge or at a corner is at an end of those that lead away.
    first, second, third = 0, 1, 2
    if weights[second] > weights[first]:
        first, second = second, first
    if weights[third] > weights[second]:
        second, third = third, second
    if weights[second] > weights[first]:
        first, second = second, first
    e, f = sub(corner[second], corner[first]), sub(corner[third], corner[first])
    s, t = weights[second], weights[third]
    if e == f:
        f = (0.0, 0.0, 0.0)  # a segment: its two equal corners count once
        s, t = s + t, 0.0
    if norm(f) == 0.0:
        t = 0.0
    elif norm(e) == 0.0:
        e, f, s, t = f, e, t, 0.0
    side[CORNER], least, most = 1.0, 0.0, 1.0
    if s > 0.0 and t == 0.0 and norm(f) > 0.0:
        # On an edge: the second parameter leads straight across it, so movement along the edge does
        # not count there. The two span a rectangle that holds the triangle.
        beside = dot(f, e) / dot(e, e)
        f = along(f, e, -beside)
        side[CORNER], least, most = 0.0, min(beside, 0.0), max(beside, 1.0)
    for k in range(2):
        way, at = (e, s) if k == 0 else (f, t)
        if norm(way) > 0.0:
            for i in range(3):
                side[SLOPE + 3 * k + i] = way[i]
            begin, end = (least, most) if k == 0 else (0.0, 1.0)
            side[ENDS + 2 * k], side[ENDS + 2 * k + 1] = begin - at, end - at


@implements(put_ranges, MeshTree)
@kernel
def _put_ranges(tree, cells, nets, index, d, side):
    error = 20.0 * DOUBLE_EPS * tree.scale[2]
    for k in range(2):
        way = (side[SLOPE + 3 * k], side[SLOPE + 3 * k + 1], side[SLOPE + 3 * k + 2])
        if norm(way) > 0.0:
            value = dot(way, d)
            for i in range(3):
                side[ACROSS + 3 * k + i] = way[i] - value * d[i]
            side[MIDDLE + k] = value
            side[SPREAD + k], side[HALF + k], side[ERRORS + k] = error, error, 2.0
