"""Fitting the volumes of a hierarchy, when it is built and whenever its vertices have moved."""

from __future__ import annotations

import numpy as np

from ..base.jit import allocating, allocating_entry, kernel
from ..tree.layout import STRIDE, WIDTH
from .axes import axes_of_leaf, axes_of_points
from .layout import EMPTY, first_of, last_of
from .promise import find_promises
from .ranges import node_ranges
from .record import close_node, fit_lane, put_centre


@allocating
def _begins(ranges, m):
    """Mark where ranges of m triangles begin or end (m + 1,)."""
    begins = np.zeros(m + 1, np.bool_)
    for node in range(len(ranges)):
        begins[ranges[node, 0]] = begins[ranges[node, 1]] = True
    return begins


@allocating
def _vertices_in_order(triangles, faces, begins, inverse, points, starts):
    """Write the vertices in tree order, node units, to `points`, and where each triangle's begin.

    The latter go to starts (m + 1,). Between two marks in `begins`, a vertex is written once,
    however many triangles share it. This leaves a third of the points to fit to.
    """
    m = triangles.shape[0]
    vertices = 0
    for t in range(m):
        vertices = max(vertices, max(faces[t, 0], max(faces[t, 1], faces[t, 2])) + 1)
    written_in = np.full(vertices, -1, np.int32)
    block, n = 0, 0
    for t in range(m):
        starts[t] = n
        if begins[t]:
            block = t
        for corner in range(3):
            vertex = faces[t, corner]
            if written_in[vertex] != block:
                written_in[vertex] = block
                for axis in range(3):
                    points[n, axis] = triangles[t, 3 * corner + axis] * inverse
                n += 1
    starts[m] = n


@kernel
def _stranger(faces, t, s):
    """Return the last corner of triangle t that s does not have, and how many such corners t has.

    Returns -1 and 0 if there is none.
    """
    found, count = -1, 0
    for i in range(3):
        vertex = faces[t, i]
        if vertex != faces[s, 0] and vertex != faces[s, 1] and vertex != faces[s, 2]:
            found = i
            count += 1
    return found, count


@kernel
def _put_corner(triangles, t, corner, inverse, points, n):
    for axis in range(3):
        points[n, axis] = triangles[t, 3 * corner + axis] * inverse


@kernel
def _outline(triangles, faces, child, inverse, points):
    """Write the corners of a leaf, node units, in the order of its outline; return how many.

    There are six, in any order, if the leaf's two triangles no longer share an edge.
    """
    t, s = first_of(child), last_of(child)
    i, _ = _stranger(faces, t, s)
    j, strangers = _stranger(faces, s, t)
    i = max(i, 0)
    _put_corner(triangles, t, i, inverse, points, 0)
    _put_corner(triangles, t, (i + 1) % 3, inverse, points, 1)
    if strangers == 0:
        _put_corner(triangles, t, (i + 2) % 3, inverse, points, 2)
        return 3
    _put_corner(triangles, s, j, inverse, points, 2)
    _put_corner(triangles, t, (i + 2) % 3, inverse, points, 3)
    if strangers == 1:
        return 4
    _put_corner(triangles, s, (j + 1) % 3, inverse, points, 4)
    _put_corner(triangles, s, (j + 2) % 3, inverse, points, 5)
    return 6


@allocating_entry
def fit_tree(triangles, faces, children, unit, volume):
    """Fit the volumes over `triangles` (m, 9), metres, in tree order.

    `faces` (m, 3) numbers the corners: those of equal number are at one place. `children` (k × 16,)
    is the structure, `unit` is the node unit, metres, and `volume` is one of the codes in fit.py.

    Returns nodes (float32, flat), centres (k, 4) with each node's reach in node units, and sizes
    (float32, k × 16, 2).
    """
    m = triangles.shape[0]
    inverse = 1.0 / unit  # a power of two, like the unit
    count = len(children) // WIDTH
    nodes = np.zeros(count * STRIDE, np.float32)
    centres = np.zeros((count, 4))
    sizes = np.zeros((count * WIDTH, 2), np.float32)
    ranges = node_ranges(children)
    points, local = np.empty((3 * m, 3)), np.empty((3 * m + 1, 3))
    starts = np.empty(m + 1, np.int64)
    _vertices_in_order(triangles, faces, _begins(ranges, m), inverse, points, starts)
    corners = np.empty((6, 3))
    for node in range(count):
        held = points[starts[ranges[node, 0]] : starts[ranges[node, 1]]]
        centre = centres[node]
        put_centre(held, centre)
        used = 0
        for lane in range(WIDTH):
            child = children[node * WIDTH + lane]
            if child >= 0:
                held = points[starts[ranges[child, 0]] : starts[ranges[child, 1]]]
                n = len(held)
                own = axes_of_points(held, n)
            elif child != EMPTY:
                held = corners
                n = _outline(triangles, faces, child, inverse, corners)
                own = axes_of_leaf(corners, n) if n <= 4 else axes_of_points(corners, n)
            else:
                break
            fit_lane(held, n, own, volume, local, nodes, centre, node, lane, sizes)
            used += 1
        close_node(nodes, node, used, centres)
    find_promises(nodes, centres, children, sizes)
    return nodes, centres, sizes
