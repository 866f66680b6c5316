"""How far apart the links of a robot are, by pinocchio and coal: no code of this package.

A link is the union of its collision shapes. coal takes a primitive as solid, but a mesh as its
triangles alone. This module itself finds what lies wholly inside a mesh that encloses a solid, by
the winding number of a point of each connected part.

pinocchio reads all meshes but COLLADA files, which trimesh reads. If a COLLADA mesh has several
lists of polygons, as the head of iCub has, coal 3.0 gives the later lists the wrong vertices.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import coal
import numpy as np
import pinocchio
import trimesh
from numpy.typing import NDArray

INSIDE = -1.0
"""Distance (m) reported for a shape that lies wholly inside a mesh; its depth is not computed."""

_MOST = 10_000_000
"""Solid angles that are computed at once, at most."""


class Mesh(NamedTuple):
    """A mesh of coal's, in its own frame."""

    vertices: NDArray[np.float64]
    """(n, 3) metres, all different."""
    faces: NDArray[np.int64]
    """(m, 3) indices of vertices."""
    closed: bool
    """Whether it encloses a solid: each edge has as many triangles on one side as on the other."""


class Truth:
    """The true distances between the links of one robot."""

    def __init__(self, urdf: Path, packages: Path, pairs: Sequence[tuple[str, str]]) -> None:
        """Read the description.

        Args:
            urdf: the description.
            packages: the folder that holds the packages.
            pairs: names of the links whose distance is asked for.

        Raises:
            ValueError, RuntimeError: pinocchio cannot use the description, or has no shape of a
                link.
        """
        self._model = pinocchio.buildModelFromUrdf(str(urdf))
        kind = pinocchio.GeometryType.COLLISION
        self._shapes = pinocchio.buildGeomFromUrdf(
            self._model, str(urdf), kind, package_dirs=[str(packages)]
        )
        self.links = [frame.name for frame in self._model.frames]
        owner: dict[str, list[int]] = {}
        for i, shape in enumerate(self._shapes.geometryObjects):
            if shape.meshPath.endswith(".dae"):
                shape.geometry = _collada(shape)
            owner.setdefault(self.links[shape.parentFrame], []).append(i)
        self._starts, both = [], []
        for a, b in pairs:
            if a not in owner or b not in owner:
                raise ValueError(f"pinocchio has no shape for {a if a not in owner else b}")
            self._starts.append(len(both))
            both += [(i, j) for i in owner[a] for j in owner[b]]
        self.triangles, meshes = 0, {}
        for i in {i for pair in both for i in pair}:
            meshes[i] = _mesh(self._shapes.geometryObjects[i].geometry)
            self.triangles += 0 if meshes[i] is None else len(meshes[i].faces)
        for i, j in both:
            self._shapes.addCollisionPair(pinocchio.CollisionPair(i, j))
        self._enclosures = _Enclosures(meshes, both)
        self._data = self._model.createData()
        self._results = self._shapes.createData()
        for request in self._results.distanceRequests:
            # With its default settings, coal's GJK stops at a distance some micrometres too large.
            request.gjk_tolerance, request.gjk_max_iterations = 1e-10, 1000

    def at(self, positions: Mapping[str, float]) -> NDArray[np.float64]:
        """Return the distance (m) of each pair; at most 0 if they touch or one is inside the other.

        Args:
            positions: of all joints by name, mimic joints included.
        """
        pinocchio.computeDistances(
            self._model, self._data, self._shapes, self._results, self._configuration(positions)
        )
        found = np.array([result.min_distance for result in self._results.distanceResults])
        placements = [placement.homogeneous for placement in self._results.oMg]
        found[self._enclosures.hold(placements, found)] = INSIDE
        return np.minimum.reduceat(found, self._starts)

    def poses(self) -> dict[str, NDArray[np.float64]]:
        """Return the poses (4, 4) of the links at the positions of the last call of `at`."""
        pinocchio.updateFramePlacements(self._model, self._data)
        return {
            frame.name: placement.homogeneous
            for frame, placement in zip(self._model.frames, self._data.oMf, strict=True)
            if frame.type == pinocchio.FrameType.BODY
        }

    def _configuration(self, positions: Mapping[str, float]) -> NDArray[np.float64]:
        q = pinocchio.neutral(self._model)
        joints = zip(self._model.names, self._model.joints, strict=True)
        next(joints)  # the first one is the universe, which is not a joint
        for name, joint in joints:
            if joint.nq == 1:
                q[joint.idx_q] = positions[name]
            elif joint.nq == 2:  # a joint without limits: a point on the unit circle
                angle = positions[name]
                q[joint.idx_q : joint.idx_q + 2] = np.cos(angle), np.sin(angle)
        return q


class _Enclosures:
    """Finds the pairs in which one shape lies wholly inside the mesh of the other."""

    def __init__(self, meshes: Mapping[int, Mesh | None], pairs: Sequence[tuple[int, int]]) -> None:
        self._meshes = meshes
        self._boxes = {
            i: (mesh.vertices.min(axis=0), mesh.vertices.max(axis=0))
            for i, mesh in meshes.items()
            if mesh is not None and mesh.closed
        }
        # A point of each connected part of a mesh; the centre of a primitive.
        self._points = {
            i: np.zeros((1, 3)) if mesh is None else _one_of_each(mesh)
            for i, mesh in meshes.items()
        }
        self._asked = [
            (k, outer, inner)
            for k, pair in enumerate(pairs)
            for outer, inner in (pair, pair[::-1])
            if outer in self._boxes
        ]

    def hold(self, placements: Sequence[NDArray[np.float64]], apart: NDArray) -> list[int]:
        """Return the pairs with one shape inside the other; `apart` (k,) are surface distances."""
        found = []
        for k, outer, inner in self._asked:
            if not apart[k] > 0.0:
                continue
            pose, other = placements[outer], placements[inner]
            points = self._points[inner] @ other[:3, :3].T + other[:3, 3]
            points = (points - pose[:3, 3]) @ pose[:3, :3]
            low, high = self._boxes[outer]
            points = points[((points > low) & (points < high)).all(axis=1)]
            if len(points) and _inside(points, self._meshes[outer]):
                found.append(k)
        return found


def _collada(shape: pinocchio.GeometryObject) -> coal.BVHModelOBBRSS:
    """Return the mesh of a COLLADA file, as trimesh reads it.

    Raises:
        ValueError: it does not cover the same box as pinocchio's mesh.
    """
    read = trimesh.load(shape.meshPath, force="mesh", process=False)
    vertices = np.asarray(read.vertices) * shape.meshScale
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(read.faces), len(vertices))
    model.addVertices(vertices)
    model.addTriangles(np.asarray(read.faces, np.int64))
    model.endModel()
    theirs = np.asarray(shape.geometry.vertices())
    for bound in (np.min, np.max):
        if not np.allclose(bound(vertices, axis=0), bound(theirs, axis=0), atol=1e-6):
            raise ValueError(f"{shape.meshPath}: trimesh and pinocchio do not agree on its size")
    return model


def _mesh(shape: object) -> Mesh | None:
    """Return the triangles of one of coal's shapes, or None for a primitive."""
    if not hasattr(shape, "num_tris"):
        return None
    triangles = map(shape.tri_indices, range(shape.num_tris))
    faces = np.array([(t[0], t[1], t[2]) for t in triangles], np.int64)
    vertices, places = np.unique(np.asarray(shape.vertices()), axis=0, return_inverse=True)
    faces = places.ravel()[faces]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    edges = np.concatenate((faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]))
    there, back = (np.unique(e, axis=0, return_counts=True) for e in (edges, edges[:, ::-1]))
    closed = len(there[0]) == len(back[0]) and (there[0] == back[0]).all()
    return Mesh(vertices, faces, bool(closed and (there[1] == back[1]).all()))


def _one_of_each(mesh: Mesh) -> NDArray[np.float64]:
    """Return a vertex of each connected part."""
    label = np.arange(len(mesh.vertices))
    while True:
        lowest = label[mesh.faces].min(axis=1)
        before = label.copy()
        for corner in range(3):
            np.minimum.at(label, mesh.faces[:, corner], lowest)
        label = label[label]
        if (label == before).all():
            return mesh.vertices[np.unique(label[mesh.faces])]


def _inside(points: NDArray[np.float64], mesh: Mesh) -> bool:
    """Return whether any point (k, 3) is inside a closed mesh: its winding number is not 0."""
    many = max(1, _MOST // len(mesh.faces))
    for start in range(0, len(points), many):
        a, b, c = (
            mesh.vertices[mesh.faces[:, corner]] - points[start : start + many, None]
            for corner in range(3)
        )
        la, lb, lc = (np.sqrt((x * x).sum(axis=-1)) for x in (a, b, c))
        volume = (a * np.cross(b, c)).sum(axis=-1)
        under = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
        turns = np.arctan2(volume, under).sum(axis=-1) / (2.0 * np.pi)
        if (np.abs(turns) > 0.5).any():
            return True
    return False
