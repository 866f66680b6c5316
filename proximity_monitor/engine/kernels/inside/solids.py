"""What signed distances need of a mesh beyond its hierarchy: its inside, its parts and volumes."""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import allocating, allocating_entry, kernel
from ..base.precise import two_sum
from ..base.vectors import cross, dot

Region = namedtuple("Region", "inside samples ball box rim rim_tree moments")
"""A mesh as the kernels of signed distances see it, besides its tree.

inside, one of the values below; samples (int32, k), one vertex of every connected part: it is the
first corner of a triangle, and the sample is 3 times that triangle's number in tree order; ball
(4,), centre and radius of a sphere around the mesh, metres. The rest is for the inside HALF: box
(2, 3), the mesh's lowest and highest coordinates, metres; rim, the total length of its open edges,
metres; rim_tree, the hierarchy of these edges; and moments (k, MOMENTS) of every lane (angles.py).
"""

NOWHERE, WHOLE, HALF = 0, 1, 2
"""Where a mesh has an inside. NOWHERE: it is a mere surface. WHOLE: where its winding number, an
integer, is not 0. HALF: where its winding number exceeds one half in magnitude, within its ball and
its box; the mesh has holes."""


@allocating
def _sorted_by(key, count, order):
    """Return `order` sorted by key[order], stable; keys are 0 to count - 1 (counting sort)."""
    starts = np.zeros(count + 1, np.int32)
    for i in order:
        starts[key[i] + 1] += 1
    for k in range(count):
        starts[k + 1] += starts[k]
    result = np.empty_like(order)
    for i in order:
        result[starts[key[i]]] = i
        starts[key[i]] += 1
    return result


@allocating_entry
def unpaired_edges(faces, vertices):
    """Count the edges that faces do not traverse equally often in both directions.

    Args:
        faces: (m, 3) int32; vertices at the same place have the same number. Faces that repeat a
            vertex are skipped.
        vertices: (n, 3) metres.

    Returns:
        The number of faces used; the number of edges of an odd number of faces; the number of other
        edges that are traversed more often one way; (2, 2) the vertices of the first edge of either
        kind; and the total length of all these edges, metres, each counted as often as one
        direction outnumbers the other.
    """
    count = len(vertices)
    low, high = np.empty(3 * len(faces), np.int32), np.empty(3 * len(faces), np.int32)
    forth = np.empty(3 * len(faces), np.bool_)
    n = 0
    for t in range(len(faces)):
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        if a == b or b == c or c == a:
            continue
        for i, j in ((a, b), (b, c), (c, a)):
            low[n], high[n], forth[n] = min(i, j), max(i, j), i < j
            n += 1
    order = _sorted_by(low, count, _sorted_by(high, count, np.arange(n, dtype=np.int32)))
    odd, unlike, rim = 0, 0, 0.0
    firsts = np.zeros((2, 2), np.int32)
    start = 0
    while start < n:
        i, j = low[order[start]], high[order[start]]
        end, balance = start, 0
        while end < n and low[order[end]] == i and high[order[end]] == j:
            balance += 1 if forth[order[end]] else -1
            end += 1
        if (end - start) % 2 == 1:
            if odd == 0:
                firsts[0, 0], firsts[0, 1] = i, j
            odd += 1
        elif balance != 0:
            if unlike == 0:
                firsts[1, 0], firsts[1, 1] = i, j
            unlike += 1
        if balance != 0:
            squared = 0.0
            for axis in range(3):
                squared += (vertices[j, axis] - vertices[i, axis]) ** 2
            rim += abs(balance) * np.sqrt(squared)
        start = end
    return n // 3, odd, unlike, firsts, rim


@kernel
def _root(parent, i):
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@allocating_entry
def connected_parts(faces, count):
    """Find the connected parts of a mesh.

    Args:
        faces: (m, 3) int32, in tree order; vertices at the same place have the same number.
        count: the number of vertices.

    Returns:
        part (m,) int32 of each triangle, numbered from 0; samples (k,) int32 as in Region, one per
        part.
    """
    m = faces.shape[0]
    parent = np.arange(count)
    for t in range(m):
        a = _root(parent, faces[t, 0])
        parent[_root(parent, faces[t, 1])] = a
        parent[_root(parent, faces[t, 2])] = a
    number = np.full(count, -1, np.int32)
    part = np.empty(m, np.int32)
    samples = np.empty(m, np.int32)
    parts = 0
    for t in range(m):
        root = _root(parent, faces[t, 0])
        if number[root] < 0:
            number[root] = parts
            samples[parts] = 3 * t
            parts += 1
        part[t] = number[root]
    return part, samples[:parts].copy()


@kernel
def _edge(triangles, t, corner, origin, unit):
    """Return the vector from the first corner of triangle `origin` to a corner of t, in units."""
    return (
        (triangles[t, 3 * corner] - triangles[origin, 0]) / unit,
        (triangles[t, 3 * corner + 1] - triangles[origin, 1]) / unit,
        (triangles[t, 3 * corner + 2] - triangles[origin, 2]) / unit,
    )


@allocating_entry
def part_volumes(triangles, unit, part, samples):
    """Return six times each part's enclosed volume, and the sum of its terms' magnitudes, (k, 2).

    The volumes are in cubes of `unit` metres; `unit` is a power of two. `triangles` is (m, 9)
    metres; `part` and `samples` come from `connected_parts`. Each determinant errs by less than 8 u
    of its terms (Shewchuk 1997, section 4.3), and the differences in it by 3 u. The rounding errors
    of the sum are accumulated and added (compensated summation).
    """
    found, lost = np.zeros((samples.shape[0], 2)), np.zeros(samples.shape[0])
    for t in range(triangles.shape[0]):
        k = part[t]
        origin = samples[k] // 3  # a corner of the part: from afar its volume would be noise
        a = _edge(triangles, t, 0, origin, unit)
        b = _edge(triangles, t, 1, origin, unit)
        c = _edge(triangles, t, 2, origin, unit)
        found[k, 0], low = two_sum(found[k, 0], dot(a, cross(b, c)))
        lost[k] += low
        for i in range(3):
            j, h = (i + 1) % 3, (i + 2) % 3
            found[k, 1] += abs(a[i]) * (abs(b[j] * c[h]) + abs(b[h] * c[j]))
    for k in range(len(lost)):
        found[k, 0] += lost[k]
    return found
