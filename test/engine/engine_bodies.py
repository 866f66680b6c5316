"""Meshes and poses for the engine's tests."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import get_args

import fcl
import numpy as np
import trimesh
from numba import njit

from proximity_monitor import engine
from proximity_monitor.engine.kernels.base.linking import ROOT
from proximity_monitor.engine.models import tree
from proximity_monitor.engine.questions import run

IDENTITY = np.eye(4)


def from_trimesh(mesh: trimesh.Trimesh, name: str) -> engine.TriangleMesh:
    """Return the engine's model of a trimesh mesh."""
    return engine.TriangleMesh(mesh.vertices, mesh.faces, name=name)


def sphere(subdivisions: int = 2, radius: float = 1.0) -> engine.TriangleMesh:
    """Return an icosphere of 20 * 4**subdivisions triangles."""
    return from_trimesh(trimesh.creation.icosphere(subdivisions, radius), "sphere")


def torus(sections: int = 24) -> engine.TriangleMesh:
    """Return a torus around z with radii 1 and 0.3."""
    mesh = trimesh.creation.torus(1.0, 0.3, major_sections=sections, minor_sections=sections // 2)
    return from_trimesh(mesh, "torus")


def box(size: tuple[float, float, float] = (1.0, 1.4, 0.6)) -> engine.TriangleMesh:
    """Return a box around the origin."""
    return from_trimesh(trimesh.creation.box(size), "box")


def soup(seed: int, count: int = 60, size: float = 0.3) -> engine.TriangleMesh:
    """Return unconnected triangles of many sizes and shapes."""
    rng = np.random.default_rng(seed)
    sizes = size * rng.uniform(0.1, 1.0, (count, 1, 1))
    corners = rng.normal(size=(count, 1, 3)) + sizes * rng.normal(size=(count, 3, 3))
    return engine.TriangleMesh(
        corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), name="soup"
    )


def leaf_triangles(child: int) -> range:
    """Return the triangles, in tree order, of a lane's child that is a leaf."""
    first, second = divmod(~child, 2)
    return range(first, first + second + 1)


def rotation(rng: np.random.Generator) -> np.ndarray:
    """Return a random rotation (3, 3)."""
    w, x, y, z = (q := rng.normal(size=4)) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def pose(rng: np.random.Generator, spread: float = 0.0) -> np.ndarray:
    """Return a pose with a random rotation and a translation of about `spread`."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation(rng)
    matrix[:3, 3] = spread * rng.normal(size=3)
    return matrix


def translation(x: float, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    """Return a pose without rotation."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def plate(cells: int) -> engine.TriangleMesh:
    """Return a square of side 1 in z = 0, cut into triangles."""
    x, y = np.meshgrid(np.linspace(0.0, 1.0, cells + 1), np.linspace(0.0, 1.0, cells + 1))
    corner = np.arange((cells + 1) ** 2).reshape(cells + 1, -1)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    faces = np.stack((a, b, c, a, c, d), axis=-1).reshape(-1, 3)
    vertices = np.column_stack((x.ravel(), y.ravel(), np.zeros(x.size)))
    return engine.TriangleMesh(vertices, faces, name="plate")


SMALL = {
    "sphere": sphere(1),
    "torus": torus(8),
    "box": box(),
    "soup": soup(1, 40),
    "splinters": soup(2, 60, 0.05),
    "points": engine.points(np.random.default_rng(3).normal(size=(30, 3))),
    "polyline": engine.polyline(np.random.default_rng(4).normal(size=(20, 3))),
}
"""Bodies of every sort with few triangles, small enough for brute force."""

VOLUMES = tuple(tree.VOLUMES)
"""Every kind of bounding volume."""

ORDERS: tuple[str, ...] = get_args(run.Order)
"""Every order of a search."""


def covering(first: Iterable, second: Iterable, third: Sequence) -> list[tuple]:
    """Return triples that contain every pair of values from any two of the three iterables.

    There are len(first) * len(second) triples, the fewest possible. Neither `first` nor `second`
    may be shorter than `third`. Along each row the values of `third` repeat in turn, and each row
    starts one value further on, as in a Latin square.
    """
    second = list(second)
    made = [(a, b, third[(i + j) % len(third)])
            for i, a in enumerate(first) for j, b in enumerate(second)]  # fmt: skip
    for i, j in ((0, 1), (0, 2), (1, 2)):
        pairs = {(row[i], row[j]) for row in made}
        assert len(pairs) == len({p for p, _ in pairs}) * len({q for _, q in pairs})
    return made


def of(mesh: engine.TriangleMesh, volume: str) -> engine.TriangleMesh:
    """Return the same mesh in a hierarchy with another kind of bounding volume."""
    return engine.TriangleMesh(mesh.vertices, mesh.faces, name=mesh.name, volume=volume)


class Fcl:
    """Two meshes as FCL models."""

    def __init__(self, a: engine.TriangleMesh, b: engine.TriangleMesh) -> None:
        self._objects = [fcl.CollisionObject(self._model(mesh)) for mesh in (a, b)]

    @staticmethod
    def _model(mesh: engine.TriangleMesh) -> fcl.BVHModel:
        model = fcl.BVHModel()
        model.beginModel(len(mesh.vertices), len(mesh.faces))
        model.addSubModel(mesh.vertices, mesh.faces)
        model.endModel()
        return model

    def _place(self, *poses: np.ndarray) -> None:
        for body, matrix in zip(self._objects, poses, strict=True):
            body.setTransform(fcl.Transform(matrix[:3, :3], matrix[:3, 3]))

    def collide(self, pose_a: np.ndarray, pose_b: np.ndarray) -> bool:
        """Return whether the surfaces touch or cross."""
        self._place(pose_a, pose_b)
        return fcl.collide(*self._objects) > 0

    def distance(self, pose_a: np.ndarray, pose_b: np.ndarray) -> float:
        """Return the minimum distance; 0 if the surfaces touch or cross."""
        if self.collide(pose_a, pose_b):
            return 0.0
        return fcl.distance(*self._objects)


def from_python(kernel):
    """Return a function through which Python can call a kernel for compiled callers only."""

    @njit(pipeline_class=ROOT)
    def call(*arguments):
        return kernel(*arguments)

    return call


def sampled(curves, count):
    """Return points along a profile, equally many on each span."""
    found = []
    for curve in curves:
        (along, _) = curve.nets[0].spans
        t = np.linspace(along.low, along.high, count)[:-1].T.ravel()
        found.append(curve.nets[0].derivatives(t, 0.0 * t, 0)[:, 0, 0, :2])
    return np.concatenate([*found, curves[-1].nets[0].points[-1:, :2]])
