"""Where parts of elements lie: in the parameters of their patch, and in space."""

from __future__ import annotations

import numpy as np

from ..base.jit import entry, kernel
from ..base.memory import on_stack
from ..base.tables import tree_at
from ..base.trees import CONVERSION, NONE, SurfaceTree
from .edges import point_on, rectangle_of
from .sides import is_within_trim

_ROWS = 4
"""Coordinates of a control point."""

_WIDER = 1e-12
"""Boxes are widened by this share of the model's size, to cover rounding."""


@entry
def describe_parts(model, elements, low, high, rectangles, points, boxes):
    """Describe k parts of a surface's elements.

    Args:
        model: the table of a SurfaceTree.
        elements: (k,) int32, in tree order.
        low: (k, 2) where each part begins in the element's own u and v, 0 to 1.
        high: (k, 2) where each part ends.
        rectangles: (k, 4) written: low u, low v, high u, high v in its patch's own parameters.
        points: (k, 3) written: one of its points, metres; NaN if that may have been cut off.
        boxes: (k, 6) written: least x, y, z, then largest, of a box that holds the part, metres.
    """
    tree, _ = tree_at(SurfaceTree, model)
    net = on_stack(1024, 0.0)  # of degree 15 in u and v
    for k in range(len(elements)):
        element = np.int64(elements[k])
        piece = tree.pieces[element]
        middle = 0.5 * (low[k, 0] + high[k, 0]), 0.5 * (low[k, 1] + high[k, 1]), 0.0
        points[k, 0] = points[k, 1] = points[k, 2] = np.nan
        if is_within_trim(tree, element, middle):
            x, y, z = point_on(tree, element, middle[0], middle[1])
            points[k, 0], points[k, 1], points[k, 2] = x, y, z
        own = rectangles[k]
        if piece.edge == NONE:
            for axis in range(2):
                width = piece.high[axis] - piece.low[axis]
                own[axis] = piece.low[axis] + low[k, axis] * width
                own[2 + axis] = min(piece.low[axis] + high[k, axis] * width, piece.high[axis])
            _write_box(tree, piece, low[k], high[k], net, boxes[k])
            continue
        own[0], own[1], own[2], own[3] = rectangle_of(tree, piece, low[k, 0], high[k, 0])
        face = tree.pieces[piece.face]
        begin, end = on_stack(2, 0.0), on_stack(2, 0.0)
        for axis in range(2):
            width = face.high[axis] - face.low[axis]
            begin[axis] = min(max((own[axis] - face.low[axis]) / width, 0.0), 1.0)
            end[axis] = min(max((own[2 + axis] - face.low[axis]) / width, 0.0), 1.0)
        _write_box(tree, face, begin, end, net, boxes[k])


@kernel
def _write_box(tree, piece, low, high, net, box):
    """Write the box of the control points of a part of a piece."""
    p, n = np.int64(piece.degree_u), np.int64(piece.degree_v) + 1
    room = np.int64(piece.room)
    for k in range(_ROWS * room):
        net[k] = tree.nets[piece.net + k]
    for row in range(_ROWS):
        for j in range(n):
            _restrict(net, row * room + j, n, p, low[0], high[0])
        for i in range(p + 1):
            _restrict(net, row * room + i * n, 1, n - 1, low[1], high[1])
    margin = _WIDER * tree.scale[2] + tree.scale[CONVERSION]
    for axis in range(3):
        box[axis], box[3 + axis] = np.inf, -np.inf
        for k in range(np.int64(piece.points)):
            value = net[axis * room + k] / net[3 * room + k]
            box[axis] = min(box[axis], value - margin)
            box[3 + axis] = max(box[3 + axis], value + margin)


@kernel
def _restrict(net, at, step, degree, low, high):
    """Cut a Bezier polynomial to what lies between two parameters: de Casteljau, twice."""
    if high < 1.0:
        for level in range(1, degree + 1):
            for i in range(degree, level - 1, -1):
                k = at + i * step
                net[k] = (1.0 - high) * net[k - step] + high * net[k]
    if low > 0.0:
        share = min(low / high, 1.0)
        for level in range(1, degree + 1):
            for i in range(degree + 1 - level):
                k = at + i * step
                net[k] = (1.0 - share) * net[k] + share * net[k + step]


@entry
def join_boxes(boxes_a, boxes_b, order, axis, groups):
    """Number k pairs of boxes (k, 6): pairs that touch on both sides get the same number.

    Pairs that other pairs connect get the same number too: the least index of all of them.

    Args:
        boxes_a: the first box of each pair: least x, y, z, then largest, metres.
        boxes_b: the second box of each pair.
        order: (k,) int64, the pairs sorted by the least coordinate of the first box along `axis`.
        axis: 0 to 2.
        groups: (k,) int64, written.
    """
    for k in range(len(groups)):
        groups[k] = k
    for first in range(len(order)):
        i = order[first]
        own = _root(groups, i)
        for later in range(first + 1, len(order)):
            j = order[later]
            if boxes_a[j, axis] > boxes_a[i, 3 + axis]:
                break
            if groups[j] != own and _touch(boxes_a, i, j) and _touch(boxes_b, i, j):
                other = _root(groups, j)
                own, other = min(own, other), max(own, other)
                groups[other] = groups[i] = groups[j] = own
    for k in range(len(groups)):
        groups[k] = _root(groups, k)


@kernel
def _touch(boxes, i, j):
    for axis in range(3):
        if boxes[i, axis] > boxes[j, 3 + axis] or boxes[j, axis] > boxes[i, 3 + axis]:
            return False
    return True


@kernel
def _root(groups, k):
    """Return a group's first; halve the path to it (path halving, Tarjan and van Leeuwen 1984)."""
    while groups[k] != k:
        groups[k] = groups[groups[k]]
        k = groups[k]
    return k
