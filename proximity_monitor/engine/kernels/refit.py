"""Fitting the volumes of a hierarchy anew after its vertices moved; its structure stays."""

from __future__ import annotations

import numpy as np

from .build import EMPTY
from .fit import RSS
from .jit import allocating, allocating_entry
from .leaves import LEAVES, fit_leaves
from .ranges import node_ranges
from .record import close_node, fit_lane
from .volumes import FIELDS, STRIDE, WIDTH


@allocating
def _begins(ranges, m):
    """Where ranges of triangles begin, and end, of m triangles (m + 1,)."""
    begins = np.zeros(m + 1, np.bool_)
    for node in range(len(ranges)):
        begins[ranges[node, 0]] = begins[ranges[node, 1]] = True
    return begins


@allocating
def _vertices_in_order(triangles, faces, begins, inverse, points, starts):
    """Vertices in tree order, node units, into `points`; starts (m + 1,) where a triangle's are.

    Between two begins of ranges a vertex is written once, however many triangles share it: a third
    of the points is left to fit to.
    """
    m = triangles.shape[0]
    written_in = np.full(faces.max() + 1, -1, np.int64)
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


@allocating_entry
def refit_tree(triangles, faces, children, unit, volume):
    """Fit the volumes over `triangles` (m, 9), metres, in tree order.

    `faces` (m, 3) says which corners are the same vertex; `unit` and `volume` are as for
    `build_tree`. Returns nodes, centres and sizes.
    """
    m = triangles.shape[0]
    inverse = 1.0 / unit  # a power of two, like the unit
    count = len(children) // WIDTH
    nodes = np.zeros(count * STRIDE, np.float32)
    centres = np.zeros((count, 4))
    sizes = np.zeros(count * WIDTH, np.float32)
    ranges = node_ranges(children)
    points, local = np.empty((3 * m, 3)), np.empty((3 * m, 3))
    starts = np.empty(m + 1, np.int64)
    _vertices_in_order(triangles, faces, _begins(ranges, m), inverse, points, starts)
    corners = np.empty((3, 3))
    many, fitted = np.zeros(9 * WIDTH), np.empty(LEAVES, np.float32)
    for node in range(count):
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for i in range(starts[ranges[node, 0]], starts[ranges[node, 1]]):
            for axis in range(3):
                low[axis] = min(low[axis], points[i, axis])
                high[axis] = max(high[axis], points[i, axis])
        used = leaves = 0
        for axis in range(3):
            centres[node, axis] = 0.5 * (low[axis] + high[axis])
        for lane in range(WIDTH):
            child = children[node * WIDTH + lane]
            if child == EMPTY:
                break
            used += 1
            if child >= 0:
                held = points[starts[ranges[child, 0]] : starts[ranges[child, 1]]]
                fit_lane(
                    held, len(held), False, volume, local, nodes, centres[node], node, lane, sizes
                )
            elif volume == RSS:
                leaves += 1
                for i in range(9):
                    many[i * WIDTH + lane] = triangles[~child, i] * inverse
            else:
                for i in range(9):
                    corners[i // 3, i % 3] = triangles[~child, i] * inverse
                fit_lane(corners, 3, True, volume, local, nodes, centres[node], node, lane, sizes)
        if leaves:
            fit_leaves(many, centres[node], fitted)
            for lane in range(used):
                if children[node * WIDTH + lane] < 0:
                    for i in range(FIELDS):
                        nodes[node * STRIDE + i * WIDTH + lane] = fitted[i * WIDTH + lane]
                    sizes[node * WIDTH + lane] = fitted[FIELDS * WIDTH + lane]
        close_node(nodes, node, used, centres)
    return nodes, centres, sizes
