"""Writing a node: its lanes, each a volume rounded to float32, and its reach."""

from __future__ import annotations

import numpy as np
from numba import uint64

from ..base.jit import kernel
from ..tree.layout import (
    CENTRE_X,
    CENTRE_Y,
    CENTRE_Z,
    EMPTY_RADIUS,
    EXTENT,
    HALF_U,
    HALF_V,
    RADIUS,
    STRIDE,
    U_X,
    V_X,
    WIDTH,
    read_vector,
)
from .boxfit import box_extents
from .fit import OBB, core, enclosing_radius


@kernel
def fit_lane(points, n, axes, volume, local, nodes, centre, node, lane, sizes):
    """Fit a volume to points[:n] and write it, rounded to float32, into a lane of a node."""
    c, u, v, a, b = core(points, n, axes, volume, local)
    base = uint64(node * STRIDE + lane)
    put(nodes, base, (c[0] - centre[0], c[1] - centre[1], c[2] - centre[2]))
    put(nodes, base + U_X, u)
    put(nodes, base + V_X, v)
    nodes[base + HALF_U] = np.float32(a)
    nodes[base + HALF_V] = np.float32(b)
    write_radius(points, n, volume, nodes, centre, node, lane, sizes)


@kernel
def put_centre(points, centre):
    """Write the middle of the box around points (n, 3) to a node's `centre`."""
    for axis in range(3):
        low, high = np.inf, -np.inf
        for i in range(len(points)):
            low, high = min(low, points[i, axis]), max(high, points[i, axis])
        centre[axis] = 0.5 * (low + high)


@kernel
def put(nodes, base, vector):
    """Write three consecutive fields of a lane, rounded to float32."""
    nodes[base + CENTRE_X] = np.float32(vector[0])
    nodes[base + CENTRE_Y] = np.float32(vector[1])
    nodes[base + CENTRE_Z] = np.float32(vector[2])


@kernel
def write_radius(points, n, volume, nodes, centre, node, lane, sizes):
    """Write the radius and size of a lane whose core is written; for a box, all three extents."""
    base = uint64(node * STRIDE + lane)
    c = (
        centre[0] + nodes[base + CENTRE_X],
        centre[1] + nodes[base + CENTRE_Y],
        centre[2] + nodes[base + CENTRE_Z],
    )
    u = read_vector(nodes, base + U_X)
    v = read_vector(nodes, base + V_X)
    a = np.float64(nodes[base + HALF_U])
    b = np.float64(nodes[base + HALF_V])
    radius = enclosing_radius(points, n, c, u, v, a, b)
    if volume is not None and volume >= OBB:
        long_u, long_v, radius = box_extents(points, n, c, u, v)
        nodes[base + HALF_U], nodes[base + HALF_V] = long_u, long_v
        a, b = np.float64(long_u), np.float64(long_v)
    nodes[base + RADIUS] = radius
    sizes[node * WIDTH + lane, EXTENT] = np.float32(np.sqrt(a * a + b * b) + radius)


@kernel
def close_node(nodes, node, used, centres):
    """Mark a node's unused lanes as empty, and write the reach of its used lanes to `centres`."""
    extent = 0.0
    for lane in range(used):
        base = uint64(node * STRIDE + lane)
        reach = 0.0
        for field in (CENTRE_X, CENTRE_Y, CENTRE_Z, RADIUS, HALF_U, HALF_V):
            reach += abs(np.float64(nodes[base + field]))
        extent = max(extent, reach)
    for lane in range(used, WIDTH):
        nodes[uint64(node * STRIDE + lane) + RADIUS] = np.float32(EMPTY_RADIUS)
    # The sum of a centre's absolute coordinates is at least its length. The factor covers the
    # rounding of the sum and of the axes' lengths.
    centres[node, 3] = extent * (1.0 + 1e-6)
