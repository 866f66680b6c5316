"""Which triangles share a leaf: neighbours across a long edge that are nearly coplanar.

Each triangle chooses the free neighbour across its longest edge. Two that chose each other share a
leaf; the others choose again. Triangles are neighbours if the places of an edge's ends are equal,
whatever their vertex indices.
"""

from __future__ import annotations

import numpy as np

from ..base.hashing import EMPTY_HASH, mixed, slot, slots_for
from ..base.jit import allocating, allocating_entry, kernel
from .layout import LARGEST

_FLAT = 0.9
"""Least cosine of the angle between the planes of two triangles that share a leaf. The volumes of
more curved pairs are so thick that pairing does not pay."""

_ROUNDS = 16
"""Most rounds in which the free triangles choose."""


@allocating
def _neighbours(faces, drawn):
    """Return for each edge of `faces` (m, 3) the neighbouring triangle's edge (3 m,), -1 if none.

    Edge 3 t + i leads from corner i of triangle t to the next corner. If more than two triangles
    share an edge, they become neighbours two by two. Twins (triangles t with `drawn[t] != t`) have
    no neighbours.
    """
    count = 3 * faces.shape[0]
    size = slots_for(count)
    slots = np.full(size, -1, np.int32)  # edges, by the hash of their vertices
    keys = np.empty(count, np.int64)
    across = np.full(count, -1, np.int32)
    for edge in range(count):
        t, i = edge // 3, edge % 3
        p, q = np.int64(faces[t, i]), np.int64(faces[t, (i + 1) % 3])
        if p == q or drawn[t] != t:
            continue
        key = min(p, q) << 32 | max(p, q)
        keys[edge] = key
        at = slot(mixed(EMPTY_HASH, key), size)
        while slots[at] >= 0 and keys[slots[at]] != key:
            at = (at + 1) & (size - 1)
        other = slots[at]
        if other >= 0 and across[other] < 0 and other // 3 != t:
            across[other], across[edge] = edge, other
        else:
            # This edge waits for the next one with the same ends.
            slots[at] = edge
    return across


@kernel
def _normal(triangles, t, inverse):
    """Return the normal of a triangle; its length is twice the area, in squared node units."""
    ex = (triangles[t, 3] - triangles[t, 0]) * inverse
    ey = (triangles[t, 4] - triangles[t, 1]) * inverse
    ez = (triangles[t, 5] - triangles[t, 2]) * inverse
    fx = (triangles[t, 6] - triangles[t, 0]) * inverse
    fy = (triangles[t, 7] - triangles[t, 1]) * inverse
    fz = (triangles[t, 8] - triangles[t, 2]) * inverse
    return ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx


@allocating
def _lengths(triangles, across, inverse):
    """Return the squared lengths (3 m,) of the edges, node units; 0 if no leaf may reach across."""
    lengths = np.zeros(len(across))
    for edge in range(len(across)):
        if across[edge] < 0:
            continue
        t, i, s = edge // 3, edge % 3, across[edge] // 3
        a, b = _normal(triangles, t, inverse), _normal(triangles, s, inverse)
        ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
        aa = a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
        bb = b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
        # Either triangle may be turned over. The comparison is false for a needle without a normal.
        if ab * ab > _FLAT * _FLAT * aa * bb:
            for axis in range(3):
                d = triangles[t, 3 * ((i + 1) % 3) + axis] - triangles[t, 3 * i + axis]
                lengths[edge] += (d * inverse) ** 2
    return lengths


@allocating_entry
def pair_up(triangles, faces, drawn, unit):
    """Return the leaves over `triangles` (m, 9), metres.

    `faces` (m, 3) gives vertices at one place the same number, `drawn` (m,) is as `first_drawn`
    returns it, and `unit` is the node unit, metres. Returns the triangles of each leaf (k, 2), -1
    for no second one; and how many leaves come before those of twins. A twin has a leaf of its own.
    """
    m = faces.shape[0]
    across = _neighbours(faces, drawn)
    lengths = _lengths(triangles, across, 1.0 / unit)
    mate, chosen = np.full(m, -1, np.int32), np.full(m, -1, np.int32)
    free = np.empty(m, np.int32)
    for t in range(m):
        free[t] = t
    left = m
    for _ in range(_ROUNDS):
        for k in range(left):
            t = free[k]
            chosen[t] = -1
            longest, number = 0.0, -1
            for edge in range(3 * t, 3 * t + 3):
                length = lengths[edge]
                if length == 0.0 or length < longest or mate[across[edge] // 3] >= 0:
                    continue
                # Among edges of equal length, both sides prefer the same one, so that choices do
                # not form a cycle.
                first = min(edge, across[edge])
                if length > longest or first > number:
                    longest, number, chosen[t] = length, first, across[edge] // 3
        # A triangle that chose none has no free neighbour left, so it drops out.
        before, n = left, 0
        for k in range(before):
            t = free[k]
            s = chosen[t]
            if s >= 0 and chosen[s] == t:
                mate[t] = s
            elif s >= 0:
                free[n] = t
                n += 1
        if n == left or n == 0:
            break
        left = n
    leaves = np.full((m, LARGEST), -1, np.int32)
    k = 0
    for t in range(m):
        if drawn[t] == t and (mate[t] < 0 or mate[t] > t):
            leaves[k, 0], leaves[k, 1] = t, mate[t]
            k += 1
    distinct = k
    for t in range(m):
        if drawn[t] != t:
            leaves[k, 0] = t
            k += 1
    return leaves[:k].copy(), distinct
