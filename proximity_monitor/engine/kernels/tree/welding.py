"""Welding: vertices with equal coordinates, and triangles that are drawn more than once.

An STL file gives each triangle corners of its own. By coordinates, not by index, they are the same
mesh as any other. And copies of a triangle are all equally near, so a search for the nearest needs
only one of them.
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
    """For each vertex the first one with the same coordinates, (n,) int32.

    Args:
        bits: (n, 3) int64; the coordinates bit by bit, none of them a negative zero.
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
    """The vertices of a triangle in ascending order, the second one of a segment's ends twice."""
    a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
    low, high = min(min(a, b), c), max(max(a, b), c)
    middle = max(min(a, b), min(max(a, b), c))
    return low, high if middle == low else middle, high


@allocating_entry
def first_drawn(faces):
    """For each triangle the first one that has the same vertices, in any order, (m,) int32.

    Args:
        faces: (m, 3) int32; vertices of equal coordinates have one number.
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
    """The volumes of a hierarchy, without those that hold nothing but twins, as `nodes`.

    A twin lies on another triangle, which stands elsewhere. Its volume becomes like that of an
    unused lane, which no search reaches; the structure stays, for the two may come apart.

    Args:
        nodes: (float32, flat) all the volumes.
        children: (int32, k × 16) the structure.
        faces: (m, 3) int32 in tree order, vertices of equal place named alike.
        twins: (n, 2) int32, in tree order: a triangle that may be a twin, and on which other one.
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
