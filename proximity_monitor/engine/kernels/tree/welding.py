"""Welding: vertices with equal coordinates, and triangles that are drawn more than once (twins).

In an STL file, each triangle has its own corners. Identifying corners by coordinates instead of by
index gives a connected mesh. All copies of a triangle are equally near, so a search for the nearest
needs only one of them. A twin is any copy except one.
"""

from __future__ import annotations

import numpy as np
from numba import uint64

from ..base.hashing import EMPTY_HASH, mixed, slot, slots_for
from ..base.jit import allocating_entry, kernel
from ..tree.layout import EMPTY_RADIUS, RADIUS, STRIDE, WIDTH
from .layout import EMPTY, first_of, last_of


@allocating_entry
def first_equal(bits):
    """Return for each vertex the first one with the same coordinates, (n,) int32.

    Args:
        bits: (n, 3) int64; the bits of the coordinates, none of which is a negative zero.
    """
    n = bits.shape[0]
    size = slots_for(n)
    table = np.full(size, -1, np.int32)
    first = np.empty(n, np.int32)
    for i in range(n):
        x, y, z = bits[i, 0], bits[i, 1], bits[i, 2]
        at = slot(mixed(mixed(mixed(EMPTY_HASH, x), y), z), size)
        while table[at] >= 0:
            j = table[at]
            if x == bits[j, 0] and y == bits[j, 1] and z == bits[j, 2]:
                break
            at = (at + 1) & (size - 1)
        if table[at] < 0:
            table[at] = i
        first[i] = table[at]
    return first


@kernel
def _places_of(faces, t):
    """Return the vertices of a triangle in ascending order; for a segment, its higher end twice."""
    a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
    low, high = min(min(a, b), c), max(max(a, b), c)
    middle = max(min(a, b), min(max(a, b), c))
    return low, high if middle == low else middle, high


@allocating_entry
def first_drawn(faces):
    """Return for each triangle the first one with the same vertices in any order, (m,) int32.

    Args:
        faces: (m, 3) int32; vertices of equal coordinates have the same number.
    """
    m = faces.shape[0]
    size = slots_for(m)
    table = np.full(size, -1, np.int32)
    first = np.empty(m, np.int32)
    for t in range(m):
        own = _places_of(faces, t)
        at = slot(mixed(mixed(EMPTY_HASH, own[0] << 32 | own[1]), own[2]), size)
        while table[at] >= 0 and _places_of(faces, table[at]) != own:
            at = (at + 1) & (size - 1)
        if table[at] < 0:
            table[at] = t
        first[t] = table[at]
    return first


@allocating_entry
def without_twins(nodes, children, faces, twins):
    """Return a copy of `nodes` in which volumes that hold only twins are like unused lanes.

    A twin lies on another triangle, which is elsewhere in the tree. No search reaches an unused
    lane. The structure stays, because a deformation may separate the two triangles.

    Args:
        nodes: (float32, flat) all the volumes.
        children: (int32, k × 16) the structure.
        faces: (m, 3) int32 in tree order; vertices at one place have the same number.
        twins: (n, 2) int32, in tree order: a triangle that may be a twin, and the one it lies on.
    """
    nodes = nodes.copy()
    twin = np.zeros(faces.shape[0], np.bool_)
    for i in range(twins.shape[0]):
        twin[twins[i, 0]] = _places_of(faces, twins[i, 0]) == _places_of(faces, twins[i, 1])
    count = len(children) // WIDTH
    gone = np.ones(count, np.bool_)
    for node in range(count - 1, -1, -1):  # a node stands before its children
        for lane in range(WIDTH):
            child = children[node * WIDTH + lane]
            if child == EMPTY:
                continue
            unseen = gone[child] if child >= 0 else twin[first_of(child)] and twin[last_of(child)]
            if unseen:
                nodes[uint64(node * STRIDE + lane) + RADIUS] = np.float32(EMPTY_RADIUS)
            else:
                gone[node] = False
    return nodes
