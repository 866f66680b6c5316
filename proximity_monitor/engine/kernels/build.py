"""Building the hierarchy of wide nodes, top down (Larsen et al. 1999, section 4.1)."""

from __future__ import annotations

import numpy as np

from .jit import allocating_entry, kernel
from .record import close_node, fit_lane
from .volumes import STRIDE, WIDTH

EMPTY = -(2**31)
"""Child of an unused lane. A used lane holds a node (>= 0) or ~triangle (< 0)."""


@kernel
def _lanes(n, most):
    """How many lanes n triangles need, of which one can hold `most`."""
    return (n + most - 1) // most


@kernel
def split(centroids, order, low, high, most):
    """Reorder order[low:high] around the mean of the widest axis; returns the split position.

    Where the mean leaves a side empty (all centroids equal) the middle does. Ranges of more than
    a node's width are cut at a multiple of it, so that the lowest nodes are full; and at one of
    `most`, what a lane can hold, where other parts would need a lane more: then the nodes above are
    full as well, but for the topmost. Opening a node takes as long whatever it holds.
    """
    lx = ly = lz = np.inf
    hx = hy = hz = -np.inf
    for i in range(low, high):
        t = order[i]
        lx, hx = min(lx, centroids[t, 0]), max(hx, centroids[t, 0])
        ly, hy = min(ly, centroids[t, 1]), max(hy, centroids[t, 1])
        lz, hz = min(lz, centroids[t, 2]), max(hz, centroids[t, 2])
    axis = 0
    if hy - ly > hx - lx:
        axis = 1
    if hz - lz > max(hx - lx, hy - ly):
        axis = 2
    mean = 0.0
    for i in range(low, high):
        mean += centroids[order[i], axis] / (high - low)
    i, j = low, high - 1
    while i <= j:
        if centroids[order[i], axis] <= mean:
            i += 1
        else:
            order[i], order[j] = order[j], order[i]
            j -= 1
    n = high - low
    middle = i - low
    wanted = min(max((middle + WIDTH // 2) // WIDTH, 1), (n - 1) // WIDTH) * WIDTH
    if _lanes(wanted, most) + _lanes(n - wanted, most) > _lanes(n, most):
        wanted = min(max((middle + most // 2) // most, 1), (n - 1) // most) * most
    if wanted != middle:
        _select(centroids, order, low, high, low + wanted, axis)
    return low + wanted


@kernel
def _select(centroids, order, low, high, position, axis):
    """Quickselect: the smallest (position - low) of order[low:high] come first."""
    high -= 1
    while low < high:
        pivot = centroids[order[(low + high) // 2], axis]
        i, j = low, high
        while i <= j:
            while centroids[order[i], axis] < pivot:
                i += 1
            while centroids[order[j], axis] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if position <= j:
            high = j
        elif position >= i:
            low = i
        else:
            return


@kernel
def _partition(centroids, order, low, high, starts, ends):
    """Cut order[low:high] into the ranges of one node's lanes; returns how many there are.

    The largest range is cut again until none exceeds what a lane can hold: all of them together,
    no more than they have to, so that the levels below can be full.
    A range that fits into the lanes that are left is opened into single triangles; they stand last.
    """
    starts[0], ends[0] = low, high
    most = WIDTH
    while most * WIDTH < high - low:
        most *= WIDTH
    used = 1
    while used < WIDTH:
        largest = 0
        for k in range(1, used):
            if ends[k] - starts[k] > ends[largest] - starts[largest]:
                largest = k
        if ends[largest] - starts[largest] <= most:
            break
        middle = split(centroids, order, starts[largest], ends[largest], most)
        starts[used], ends[used] = middle, ends[largest]
        ends[largest] = middle
        used += 1
    k = 0
    while k < used:
        n = ends[k] - starts[k]
        if n > 1 and used + n - 1 <= WIDTH:
            for i in range(1, n):
                starts[used], ends[used] = starts[k] + i, starts[k] + i + 1
                used += 1
            ends[k] = starts[k] + 1
        k += 1
    # Ranges of several triangles come first: where lane 0 holds a triangle, all lanes do.
    first = 0
    for k in range(used):
        if ends[k] - starts[k] > 1:
            starts[first], starts[k] = starts[k], starts[first]
            ends[first], ends[k] = ends[k], ends[first]
            first += 1
    return used


@kernel
def _gather(triangles, order, low, high, unit, points):
    """Corners of the triangles order[low:high], in node units, into `points`; returns how many."""
    n = 0
    for i in range(low, high):
        t = order[i]
        for corner in range(3):
            for axis in range(3):
                points[n, axis] = triangles[t, 3 * corner + axis] / unit
            n += 1
    return n


@allocating_entry
def build_tree(triangles, unit, volume):
    """Build the hierarchy over `triangles` (m, 9), metres, with node units of `unit` metres.

    `volume` is one of the codes in fit.py.

    Returns nodes (float32, flat), centres (k, 4) with each node's reach in node units, children
    (int32, k × 16), sizes (float32, k × 16), order (m,) of the triangles from tree order to the
    caller's, and how many levels lie below node 0, which holds the whole model as lane 0.
    """
    m = triangles.shape[0]
    capacity = 2 * ((m + WIDTH - 1) // WIDTH) + 2
    nodes = np.zeros(capacity * STRIDE, np.float32)
    centres = np.zeros((capacity, 4))
    children = np.full(capacity * WIDTH, EMPTY, np.int32)
    sizes = np.zeros(capacity * WIDTH, np.float32)
    levels = np.zeros(capacity, np.int32)
    order = np.arange(m)
    centroids = np.empty((m, 3))
    for t in range(m):
        for axis in range(3):
            centroids[t, axis] = (
                triangles[t, axis] + triangles[t, 3 + axis] + triangles[t, 6 + axis]
            )
    points, local = np.empty((3 * m, 3)), np.empty((3 * m, 3))
    starts, ends = np.empty(WIDTH, np.int64), np.empty(WIDTH, np.int64)
    lows, highs = np.empty(capacity, np.int64), np.empty(capacity, np.int64)
    lows[0], highs[0] = 0, m
    # A literal 0 would have the helpers compiled twice.
    count, node, depth = 1, np.int64(0), 0
    while node < count:
        low, high = lows[node], highs[node]
        n = _gather(triangles, order, low, high, unit, points)
        for axis in range(3):
            smallest, largest = np.inf, -np.inf
            for i in range(n):
                smallest, largest = min(smallest, points[i, axis]), max(largest, points[i, axis])
            centres[node, axis] = 0.5 * (smallest + largest)
        if node == 0:
            starts[0], ends[0] = low, high
            used = 1
        else:
            used = _partition(centroids, order, low, high, starts, ends)
        for lane in range(used):
            n = _gather(triangles, order, starts[lane], ends[lane], unit, points)
            single = ends[lane] - starts[lane] == 1
            fit_lane(points, n, single, volume, local, nodes, centres[node], node, lane, sizes)
            if single:
                children[node * WIDTH + lane] = ~starts[lane]
            else:
                children[node * WIDTH + lane] = count
                levels[count] = levels[node] + 1
                depth = max(depth, levels[count])
                lows[count], highs[count] = starts[lane], ends[lane]
                count += 1
        close_node(nodes, node, used, centres)
        node += 1
    return (
        nodes[: count * STRIDE].copy(),
        centres[:count].copy(),
        children[: count * WIDTH].copy(),
        sizes[: count * WIDTH].copy(),
        order,
        depth,
    )
