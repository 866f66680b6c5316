"""Solids in double precision for the scripts that make bundled scenes.

Every helper returns a `manifold3d.Manifold` with outward normals. Vertices are computed here in
float64 and handed over as they are, so that a radius written in a script is the radius in the mesh.
"""

from __future__ import annotations

import os
from collections.abc import Iterable

import manifold3d
import numpy as np
import ply
from manifold3d import Manifold, Mesh64


def ring(radius: float, facets: int, *, around: bool = False, centre=(0.0, 0.0)) -> np.ndarray:
    """Return a regular polygon (facets, 2), counter-clockwise.

    It is inscribed in the circle with a vertex at angle 0; or, with `around`, circumscribed about
    it with the middle of a side at angle 0. `facets` must be a multiple of four, so that the
    polygon is symmetric about both axes.
    """
    if facets % 4:
        raise ValueError(f"facets = {facets}: must be a multiple of four")
    step = 2.0 * np.pi / facets
    angle = step * (np.arange(facets) + (0.5 if around else 0.0))
    reach = radius / np.cos(0.5 * step) if around else radius
    return np.asarray(centre) + reach * np.column_stack((np.cos(angle), np.sin(angle)))


def solid(vertices: np.ndarray, faces: np.ndarray) -> Manifold:
    """Return the solid bounded by a closed mesh, (n, 3) float64 and (m, 3) integer."""
    made = Manifold(
        Mesh64(
            np.ascontiguousarray(vertices, dtype=np.float64),
            np.ascontiguousarray(faces, dtype=np.uint64),
        )
    )
    if made.status() != manifold3d.Error.NoError or made.volume() <= 0.0:
        raise ValueError(f"not a solid: {made.status()}, volume {made.volume():g}")
    return made


def prism(outline: np.ndarray, low: float, high: float) -> Manifold:
    """Return a simple counter-clockwise polygon (n, 2) in (x, y), extruded from z = low to high."""
    n = len(outline)
    cap = np.asarray(manifold3d.triangulate([np.asarray(outline)]))
    here = np.arange(n)
    after = np.roll(here, -1)
    sides = np.vstack(
        (np.column_stack((here, after, after + n)), np.column_stack((here, after + n, here + n)))
    )
    vertices = np.vstack([np.column_stack((outline, np.full(n, z))) for z in (low, high)])
    return solid(vertices, np.vstack((cap[:, ::-1], cap + n, sides)))


def revolve(profile, facets: int, *, around: bool = False) -> Manifold:
    """Return a closed profile (n, 2) of (radius > 0 or 0, z), turned about z into `facets` sides.

    Points of radius zero become poles. `around` is as in `ring`.
    """
    profile = np.asarray(profile, dtype=np.float64)
    r, z = profile.T
    if np.sum(r * np.roll(z, -1) - np.roll(r, -1) * z) < 0.0:
        profile = profile[::-1]
    unit = ring(1.0, facets, around=around)
    index, vertices = [], []
    for radius, height in profile:
        start = len(vertices)
        if radius == 0.0:
            vertices.append((0.0, 0.0, height))
            index.append(np.full(facets, start))
        else:
            vertices.extend((radius * x, radius * y, height) for x, y in unit)
            index.append(start + np.arange(facets))
    faces: list[tuple[int, int, int]] = []
    for lower, upper in zip(index, [*index[1:], index[0]], strict=True):
        for a, b, c, d in zip(lower, np.roll(lower, -1), np.roll(upper, -1), upper, strict=True):
            faces.extend(t for t in ((a, b, c), (a, c, d)) if len(set(t)) == 3)
    return solid(np.array(vertices), np.array(faces))


def box(low, high) -> Manifold:
    """Return an axis-aligned box between two corners (3,)."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    return prism(np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]), z0, z1)


def along_x(made: Manifold) -> Manifold:
    """Turn (x, y, z) into (z, x, y): a prism drawn in (y, z) of the result then runs along x."""
    return made.transform(np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0]]))


def along_y(made: Manifold) -> Manifold:
    """Turn (x, y, z) into (y, z, x): a prism drawn in (z, x) of the result then runs along y."""
    return made.transform(np.array([[0.0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0]]))


def union(parts: Iterable[Manifold]) -> Manifold:
    """Return the union of solids."""
    return Manifold.batch_boolean(list(parts), manifold3d.OpType.Add)


def write_ply(path: str | os.PathLike[str], made: Manifold, comment: str) -> tuple[int, int]:
    """Write a binary little-endian PLY with double coordinates and shared vertices.

    Coordinates are double, because float32 has steps of 0.00002 mm at 200 mm, a tenth of a per cent
    of a running clearance. Vertices are shared, so that a reader finds the mesh closed without
    welding.

    Returns:
        The numbers of vertices and of triangles.
    """
    vertices, faces = _in_order(made)
    ply.write(path, vertices, faces, comment)
    return len(vertices), len(faces)


def _in_order(made: Manifold) -> tuple[np.ndarray, np.ndarray]:
    """Return sorted vertices and triangles, independent of the order of boolean operations."""
    mesh = made.to_mesh64()
    vertices = np.asarray(mesh.vert_properties)[:, :3] + 0.0  # turns -0.0 into 0.0
    order = np.lexsort(vertices.T[::-1])
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    faces = rank[np.asarray(mesh.tri_verts, dtype=np.int64)]
    first = np.argmin(faces, axis=1)[:, None]
    faces = np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1)
    return vertices[order], faces[np.lexsort(faces.T[::-1])]
