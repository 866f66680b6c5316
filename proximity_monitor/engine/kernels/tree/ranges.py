"""Which triangles are under each node: a range in tree order."""

from __future__ import annotations

import numpy as np

from ..base.jit import allocating_entry
from ..tree.layout import WIDTH
from .layout import EMPTY, first_of, last_of


@allocating_entry
def node_ranges(children):
    """Return the first triangle under each node and the one after the last (int32, k × 2)."""
    k = children.shape[0] // WIDTH
    ranges = np.empty((k, 2), np.int32)
    for node in range(k - 1, -1, -1):  # a node stands before its children
        low, high = np.int32(2**31 - 1), np.int32(0)
        for lane in range(node * WIDTH, (node + 1) * WIDTH):
            child = children[lane]
            if child >= 0:
                low, high = min(low, ranges[child, 0]), max(high, ranges[child, 1])
            elif child != EMPTY:
                low, high = min(low, first_of(child)), max(high, last_of(child) + 1)
        ranges[node, 0], ranges[node, 1] = low, high
    return ranges
