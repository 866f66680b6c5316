"""A mesh cut into patches: each pair of them gives two bodies one contact point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from proximity_monitor.engine import TriangleMesh
from proximity_monitor.motion.dynamics.mass import welded

MOST = 16
"""Patches of a mesh. Bodies that touch at several places do so with several pairs of patches; more
patches see places that are closer together, and cost as many more tests of bounding volumes."""


@dataclass(frozen=True, eq=False)
class Patches:
    """The patches of one mesh, and which triangles meet at a vertex.

    Attributes:
        meshes: the patches, each with the vertices that it uses alone.
        faces: of each patch the faces of the whole that it consists of.
        spheres: (p, 4) metres, model frame; centre and radius of a sphere around each patch.
        boxes: (p, 6) metres, model frame; least and greatest corner of each patch.
        corners: (m, 3, 3) metres, model frame; the corners of the whole's triangles.
        places: (m, 3) number of each corner, equal where the coordinates are.
        first: (n + 1,) where the triangles of a place begin in `around`.
        around: the triangles that meet at each place.
    """

    meshes: list[TriangleMesh]
    faces: list[NDArray[np.int64]]
    spheres: NDArray[np.float64]
    boxes: NDArray[np.float64]
    corners: NDArray[np.float64]
    places: NDArray[np.int64]
    first: NDArray[np.int64]
    around: NDArray[np.int64]


def cut(mesh: TriangleMesh) -> Patches:
    """Cut a mesh into at most MOST patches of about as many triangles each."""
    corners = mesh.vertices[mesh.faces]
    centres = corners.mean(axis=1)
    parts = [np.arange(len(mesh.faces))]
    while 2 * len(parts) <= MOST and any(len(part) > 1 for part in parts):
        parts = [half for part in parts for half in _halves(part, centres)]
    meshes = []
    for i, part in enumerate(parts):
        used, faces = np.unique(mesh.faces[part], return_inverse=True)
        name = f"{mesh.name}, patch {i}"
        meshes.append(TriangleMesh(mesh.vertices[used], faces.reshape(-1, 3), name=name))
    places = welded(mesh.vertices, mesh.faces)
    first = np.concatenate(([0], np.cumsum(np.bincount(places.reshape(-1)))))
    return Patches(
        meshes,
        parts,
        np.array([[*each.centre, each.radius] for each in meshes]),
        np.array([[*e.vertices.min(axis=0), *e.vertices.max(axis=0)] for e in meshes]),
        corners,
        places,
        first,
        np.argsort(places.reshape(-1), kind="stable") // 3,
    )


def _halves(part: NDArray[np.int64], centres: NDArray[np.float64]) -> list[NDArray[np.int64]]:
    """Split triangles at the median along the axis on which their centres spread most."""
    if len(part) == 1:
        return [part]
    axis = np.argmax(np.ptp(centres[part], axis=0))
    order = part[np.argsort(centres[part, axis], kind="stable")]
    return [order[: len(order) // 2], order[len(order) // 2 :]]
