"""What a closed mesh's questions need beyond its hierarchy: its parts, and one owner a vertex."""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from .jit import entry, kernel

Solid = namedtuple("Solid", "owned samples ball")
"""A closed mesh as the kernels see it, beside its Tree.

owned (uint8, m) which corners of a triangle, in tree order, are first of their vertex: bits 0 to 2;
samples (int32, k) one vertex of every connected part, as 3 triangle + corner in tree order; ball
(4,) centre and radius of a sphere around it, metres.
"""


@kernel
def _root(parent, i):
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@entry
def parts_and_owners(faces, count):
    """Connected parts of a mesh, and which triangle owns which vertex.

    Args:
        faces: (m, 3) int32; corners in tree order, vertices of equal place merged.
        count: how many vertices there are.

    Returns:
        part (m,) int32 of each triangle, numbered from 0; owned (m,) uint8 as in Solid; samples
        (k,) int32 as in Solid, one a part.
    """
    m = faces.shape[0]
    parent = np.arange(count)
    for t in range(m):
        a = _root(parent, faces[t, 0])
        parent[_root(parent, faces[t, 1])] = a
        parent[_root(parent, faces[t, 2])] = a
    seen = np.zeros(count, np.bool_)
    number = np.full(count, -1, np.int32)
    part, owned = np.empty(m, np.int32), np.zeros(m, np.uint8)
    samples = np.empty(m, np.int32)
    parts = 0
    for t in range(m):
        root = _root(parent, faces[t, 0])
        if number[root] < 0:
            number[root] = parts
            samples[parts] = 3 * t
            parts += 1
        part[t] = number[root]
        for corner in range(3):
            if not seen[faces[t, corner]]:
                seen[faces[t, corner]] = True
                owned[t] |= 1 << corner
    return part, owned, samples[:parts].copy()
