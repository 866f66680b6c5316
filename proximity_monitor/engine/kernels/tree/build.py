"""Building the structure of a hierarchy, top down (Larsen et al. 1999, section 4.1).

A lowest node is one whose lanes are all leaves. A twin is a triangle that is drawn more than once,
except for the first copy (see welding.py).
"""

from __future__ import annotations

import numpy as np

from ..base.jit import allocating, allocating_entry, kernel
from ..tree.layout import WIDTH
from .layout import EMPTY, leaf


@kernel
def _lanes(n, most):
    """Return how many lanes n leaves need if one lane can hold `most` leaves."""
    return (n + most - 1) // most


@kernel
def split(centroids, order, low, high, most):
    """Reorder order[low:high] around the mean along the widest axis; return the split position.

    The split is moved from the mean to the nearest multiple of a node's width that leaves neither
    side empty, so that the lowest nodes are full. If the two parts would then need one lane more
    than necessary, it is moved to a multiple of `most`, which is what a lane can hold. So the nodes
    above are full as well, except the topmost. Opening a node takes equally long whatever it holds.
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
    """Reorder order[low:high] so that the smallest (position - low) come first (quickselect)."""
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
def _partition(centroids, order, low, apart, high, starts, ends):
    """Cut order[low:high] into the ranges of one node's lanes; return how many ranges there are.

    The largest range is cut repeatedly until none exceeds what a lane can hold. This capacity is
    the least power of the width with which all lanes together hold the leaves, so that the levels
    below can be full. Leaves from `apart` on get a lane of their own. A range that fits into the
    lanes that are left is split into single leaves, which come last.
    """
    starts[0], ends[0] = low, apart
    lanes = WIDTH if apart == high else WIDTH - 1
    most = WIDTH
    while most * lanes < apart - low:
        most *= WIDTH
    used = 1
    while used < lanes:
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
    if apart < high:
        starts[used], ends[used] = apart, high
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
    # Ranges of several leaves come first: if lane 0 holds a leaf, all lanes do.
    first = 0
    for k in range(used):
        if ends[k] - starts[k] > 1:
            starts[first], starts[k] = starts[k], starts[first]
            ends[first], ends[k] = ends[k], ends[first]
            first += 1
    return used


@kernel
def _centroids(triangles, leaves, centroids):
    """Write three times the mean of the centres of each leaf's triangles to `centroids` (n, 3)."""
    for k in range(len(leaves)):
        for axis in range(3):
            total, count = 0.0, 0
            for t in leaves[k]:
                if t >= 0:
                    total += triangles[t, axis] + triangles[t, 3 + axis] + triangles[t, 6 + axis]
                    count += 1
            centroids[k, axis] = total / count


@allocating
def _in_order(leaves, order, children, m):
    """Order the triangles by their leaves, and write the leaves to `children` by their triangles.

    Returns the caller's indices of the m triangles in tree order.
    """
    triangles, first = np.empty(m, np.int64), np.empty(len(leaves), np.int32)
    n = 0
    for k in range(len(leaves)):
        first[k] = n
        for t in leaves[order[k]]:
            if t >= 0:
                triangles[n] = t
                n += 1
    for lane in range(len(children)):
        child = children[lane]
        if child < 0 and child != EMPTY:
            k = ~child
            after = first[k + 1] if k + 1 < len(leaves) else m
            children[lane] = leaf(first[k], after - first[k])
    return triangles


@allocating_entry
def build_tree(triangles, leaves, distinct):
    """Build the structure of a hierarchy over `triangles` (m, 9), metres.

    `leaves` (n, 2) are the triangles of each leaf, -1 for no second one. Leaves from `distinct` on
    are of twins. They are kept apart from the others, below one lane of the topmost node.

    Returns children (int32, k × 16), the caller's indices (m,) of the triangles in tree order, and
    how many levels lie below node 0, which holds the whole model as lane 0.
    """
    n = leaves.shape[0]
    capacity = 2 * _lanes(n, WIDTH) + 2
    children = np.full(capacity * WIDTH, EMPTY, np.int32)
    levels = np.zeros(capacity, np.int32)
    order, centroids = np.empty(n, np.int64), np.empty((n, 3))
    for k in range(n):
        order[k] = k
    _centroids(triangles, leaves, centroids)
    starts, ends = np.empty(WIDTH, np.int64), np.empty(WIDTH, np.int64)
    lows, highs = np.empty(capacity, np.int64), np.empty(capacity, np.int64)
    lows[0], highs[0] = 0, n
    count, depth = 1, 0
    node = 0
    while node < count:
        starts[0], ends[0], used = lows[node], highs[node], 1
        if node > 0:
            low, high = lows[node], highs[node]
            apart = distinct if low == 0 and high == n else high
            used = _partition(centroids, order, low, apart, high, starts, ends)
        for lane in range(used):
            at = node * WIDTH + lane
            if ends[lane] - starts[lane] == 1:
                children[at] = ~starts[lane]  # the leaf's index in `order`; see `_in_order`
                continue
            children[at] = count
            levels[count] = levels[node] + 1
            depth = max(depth, levels[count])
            lows[count], highs[count] = starts[lane], ends[lane]
            count += 1
        node += 1
    children = children[: count * WIDTH].copy()
    return children, _in_order(leaves, order, children, triangles.shape[0]), depth
