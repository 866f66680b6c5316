"""Triangles with a swept radius and a deviation, from which the shapes of scenes are made."""

from __future__ import annotations

import math
from typing import NamedTuple, TypedDict

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.rounding import DOUBLE_EPS
from .checks import checked_length
from .hierarchy import Solid
from .mesh import TriangleMesh
from .model import Model

RESERVE = 1.0 + 1e-9
"""Factor on the deviation of a tessellation; it covers the rounding of the corners."""


class How(TypedDict, total=False):
    """The options that all shapes take; see `TriangleMesh`."""

    deviation: float
    """Metres; added to the deviation of the shape itself."""
    volume: str
    solid: Solid


class Facets(NamedTuple):
    """The data of a mesh."""

    vertices: NDArray[np.float64]
    """(n, 3) metres."""
    faces: NDArray[np.int32]
    """(m, 3) indices of vertices."""
    radius: float = 0.0
    """Metres; radius of the ball that sweeps the triangles."""
    deviation: float = 0.0
    """Metres; how far the surface may be from that of the shape."""

    def model(self, name: str, how: How) -> Model:
        """Return the mesh; a deviation in `how` is added to that of the facets."""
        more = checked_length(how.get("deviation", 0.0), name, "deviation")
        given = how | {"deviation": self.deviation + more}
        return TriangleMesh(self.vertices, self.faces, radius=self.radius, name=name, **given)


def icosphere(radius: float, subdivisions: int) -> Facets:
    """Return a subdivided icosahedron for a ball of a radius, metres, around the origin.

    Its corners are as far outside of the ball as its faces are inside.
    """
    vertices, faces = _icosahedron()
    for _ in range(subdivisions):
        ends = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        edges, middles = np.unique(ends, axis=0, return_inverse=True)
        ab, bc, ca = (middles.reshape(-1, 3) + len(vertices)).T
        a, b, c = faces.T
        corners = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        faces = np.concatenate([np.stack(each, axis=1) for each in corners])
        between = vertices[edges].sum(axis=1)
        between /= np.linalg.norm(between, axis=1, keepdims=True)
        vertices = np.concatenate((vertices, between))
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    # The point of a face nearest to the centre is its circumcentre, because all corners are equally
    # far from the centre.
    inside = (np.einsum("ij,ij->i", normals, a) / np.linalg.norm(normals, axis=1)).min()
    larger = 2.0 * radius / (1.0 + float(inside))
    return Facets(vertices * larger, faces, deviation=deviation_of(larger, radius))


def deviation_of(larger: float, radius: float) -> float:
    """Return how far corners at `larger` from an axis or a centre are off, rounding included."""
    return (larger - radius) * RESERVE + 8.0 * DOUBLE_EPS * larger


def _icosahedron() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the twelve corners, of length 1, and the twenty faces."""
    golden = 0.5 * (1.0 + math.sqrt(5.0))
    signs = [(x, y) for x in (-1.0, 1.0) for y in (-golden, golden)]
    corners = np.array([np.roll((0.0, *each), k) for k in range(3) for each in signs])
    apart = np.linalg.norm(corners[:, None] - corners, axis=2)
    near = np.isclose(apart, 2.0)  # the length of an edge
    faces = [
        (i, j, k) if np.linalg.det(corners[[i, j, k]]) > 0.0 else (i, k, j)
        for i in range(12) for j in range(i) for k in range(j)
        if near[i, j] and near[j, k] and near[k, i]
    ]  # fmt: skip
    return corners / np.linalg.norm(corners[0]), np.array(faces)
