"""Fitting the volumes of a hierarchy of surfaces, when it is built and after each deformation."""

from __future__ import annotations

import numpy as np
from numba import uint64

from ..base.jit import allocating_entry, kernel
from ..base.rounding import DOUBLE_EPS, SINGLE_EPS
from ..tree.layout import EXTENT, RADIUS, STRIDE, WIDTH
from .axes import axes_of_points
from .fit import RSS
from .layout import EMPTY, first_of
from .promise import find_promises
from .ranges import node_ranges
from .record import close_node, fit_lane, put_centre


@allocating_entry
def project(pieces, nets):
    """Project the control points of pieces (m,) from homogeneous coordinates into space.

    Returns the points (n, 3), metres, each coordinate rounded once; and where the points of each
    piece begin, followed by the number of all points (m + 1,).
    """
    m = len(pieces)
    starts = np.empty(m + 1, np.int64)
    starts[0] = 0
    for i in range(m):
        starts[i + 1] = starts[i] + pieces[i].points
    points = np.empty((starts[m], 3))
    for i in range(m):
        net, room = pieces[i].net, np.int64(pieces[i].room)
        for k in range(pieces[i].points):
            weight = nets[net + 3 * room + k]
            for axis in range(3):
                points[starts[i] + k, axis] = nets[net + axis * room + k] / weight
    return points, starts


@kernel
def _enlarge(points, n, nodes, node, lane, sizes):
    """Enlarge a lane so that it contains the points as they were before rounding.

    Rounding each coordinate once moved a point by at most √3 u of its largest coordinate, which is
    less than 2 u of the sum of its absolute coordinates. The radius is rounded twice here; 2 u32 is
    more than this can lose.
    """
    largest = 0.0
    for i in range(n):
        size = abs(points[i, 0]) + abs(points[i, 1]) + abs(points[i, 2])
        largest = max(largest, size)
    at = uint64(node * STRIDE + lane) + RADIUS
    more = 2.0 * DOUBLE_EPS * largest
    nodes[at] = np.float32((np.float64(nodes[at]) + more) * (1.0 + 2.0 * SINGLE_EPS))
    sizes[node * WIDTH + lane, EXTENT] += np.float32(more)


@allocating_entry
def fit_surface(points, starts, children, unit):
    """Fit the volumes over pieces in tree order; return the same as `fit_tree`.

    `points` and `starts` are the control points as `project` returns them. A piece lies in the
    convex hull of its control points, because its weights are positive, and so in every convex
    volume that contains these. `children` (k × 16,) is the structure, with one piece per leaf;
    `unit` is the node unit, metres.
    """
    inverse = 1.0 / unit  # a power of two, like the unit
    count = len(children) // WIDTH
    nodes = np.zeros(count * STRIDE, np.float32)
    centres = np.zeros((count, 4))
    sizes = np.zeros((count * WIDTH, 2), np.float32)
    ranges = node_ranges(children)
    points = points * inverse
    local = np.empty((len(points), 3))
    for node in range(count):
        centre = centres[node]
        put_centre(points[starts[ranges[node, 0]] : starts[ranges[node, 1]]], centre)
        used = 0
        for lane in range(WIDTH):
            child = children[node * WIDTH + lane]
            if child == EMPTY:
                break
            low = high = first_of(child)
            if child >= 0:
                low, high = ranges[child, 0], ranges[child, 1] - 1
            held = points[starts[low] : starts[high + 1]]
            n = len(held)
            axes = axes_of_points(held, n)
            fit_lane(held, n, axes, RSS, local, nodes, centre, node, lane, sizes)
            _enlarge(held, n, nodes, node, lane, sizes)
            used += 1
        close_node(nodes, node, used, centres)
    find_promises(nodes, centres, children, sizes)
    return nodes, centres, sizes
