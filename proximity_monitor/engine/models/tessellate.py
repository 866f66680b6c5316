"""Tessellate the surface of triangles swept by a ball, to show it or to replace it by a mesh."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .tree import weld

_ENOUGH = 60_000
"""About the most triangles for many balls."""
_MERIDIANS = (8, 12, 16, 24, 32, 48)
"""How many meridians a ball or capsule may have; it has half as many parallels."""


def tessellated(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], radius: float, tolerance: float
) -> tuple[NDArray[np.float64], NDArray[np.int32], float]:
    """Return a mesh with corners on the surface: a capsule for each edge, a ball for each point.

    Capsules and balls are closed, and overlap. Each triangle adds its two sides, moved outward by
    the radius.

    Args:
        vertices: (n, 3) metres.
        faces: (m, 3) indices of vertices; segments and points repeat some.
        radius: metres, above 0.
        tolerance: metres; how far inside the surface a face may be. It is exceeded if it would take
            too many triangles.

    Returns:
        (k, 3) vertices, metres; (l, 3) faces, outward; and a distance, metres: every point outside
        of the mesh is at least this far from the swept triangles, to rounding.
    """
    corners = np.unique(np.sort(weld(vertices)[faces], axis=1), axis=0)
    ends = corners[:, [0, 1, 1, 2, 0, 2]].reshape(-1, 2)
    edges = np.unique(ends[ends[:, 0] != ends[:, 1]], axis=0)
    alone = np.setdiff1d(corners, edges)
    spans = np.concatenate((vertices[edges], np.repeat(vertices[alone, None], 2, axis=1)))
    fits = [n for n in _MERIDIANS if 2 * n * n * len(spans) <= _ENOUGH] or _MERIDIANS[:1]
    fine = (n for n in fits if radius * (1.0 - _inside(n)) <= tolerance)
    meridians = next(fine, fits[-1])
    points, facets = _capsules(spans, radius, meridians)
    facets = weld(points)[facets]  # both halves of a ball end on the same ring
    a, b, c = facets.T
    facets = facets[(a != b) & (b != c) & (c != a)]
    proper = corners[(corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2])]
    sides = _sides(vertices[proper], radius)
    flat = np.arange(3 * len(sides)).reshape(-1, 3) + len(points)
    points = np.concatenate((points, sides.reshape(-1, 3)))
    return points, np.concatenate((facets, flat)), radius * _inside(meridians)


def _inside(meridians: int) -> float:
    """Return the smallest distance of the planes of a unit ball's facets from its centre.

    A facet between two parallels is a trapezoid, symmetric about the meridian plane through its
    middle. Its plane meets this one in the line through the middles p and q of its parallel sides.
    """
    angles = np.linspace(0.0, math.pi, meridians // 2 + 1)
    p = np.stack((np.sin(angles) * math.cos(math.pi / meridians), np.cos(angles)), axis=1)
    q = p[1:] - p[:-1]
    across = np.abs(p[:-1, 0] * q[:, 1] - p[:-1, 1] * q[:, 0])
    return float((across / np.linalg.norm(q, axis=1)).min())


def _capsules(
    spans: NDArray[np.float64], radius: float, meridians: int
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return vertices and faces of balls swept along segments (k, 2, 3), one after the other."""
    rows = meridians // 2  # of parallels; the middle one counts twice, once for each half
    angles = np.linspace(0.0, np.pi, rows + 1)[1:-1]
    angles = np.insert(angles, rows // 2, np.pi / 2)
    around = np.linspace(0.0, 2.0 * np.pi, meridians, endpoint=False)
    ring = np.stack((np.cos(around), np.sin(around), np.zeros(meridians)), axis=1)
    ball = np.sin(angles)[:, None, None] * ring + np.cos(angles)[:, None, None] * [0, 0, -1.0]
    ball = np.concatenate(([[0, 0, -1.0]], ball.reshape(-1, 3), [[0, 0, 1.0]])) * radius
    upper = np.arange(len(ball)) > rows // 2 * meridians
    below = np.arange(len(angles) - 1)[:, None] * meridians + np.arange(meridians) + 1
    beside = below - np.arange(meridians) + (np.arange(meridians) + 1) % meridians
    last = len(ball) - 1
    first_ring, last_ring = (below[0], beside[0]), (below[-1] + meridians, beside[-1] + meridians)
    quads = np.stack((below, beside, beside + meridians, below + meridians), axis=-1)
    quads = quads.reshape(-1, 4)
    facets = np.concatenate((
        np.stack((np.zeros(meridians, int), first_ring[1], first_ring[0]), axis=1),
        quads[:, [0, 1, 2]],
        quads[:, [0, 2, 3]],
        np.stack((last_ring[0], last_ring[1], np.full(meridians, last)), axis=1),
    ))  # fmt: skip
    points = [span[upper.astype(int)] + ball @ _frame(span[1] - span[0]) for span in spans]
    starts = np.arange(len(spans))[:, None, None] * len(ball)
    return np.concatenate(points), (starts + facets).reshape(-1, 3)


def _frame(way: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return three perpendicular unit rows (3, 3), the last along a direction; any if this is 0."""
    length = np.linalg.norm(way)
    if not length > 0.0:
        return np.eye(3)
    z = way / length
    x = np.cross(np.eye(3)[np.abs(z).argmin()], z)
    x /= np.linalg.norm(x)
    return np.stack((x, np.cross(z, x), z))


def _sides(triangles: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """Return both sides of triangles (k, 3, 3), moved outward; none for those without an area."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    triangles, normals = triangles[lengths > 0.0], normals[lengths > 0.0]
    offset = radius * (normals / lengths[lengths > 0.0, None])[:, None]
    return np.concatenate((triangles + offset, triangles[:, ::-1] - offset))
