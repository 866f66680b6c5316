"""The C++ libraries behind one interface, so that they and this engine are timed alike.

What is timed is one call from Python that answers one query. Models, transforms, collision
objects and the objects that take the answers are made before. The peers' nearest points are asked
for, because this engine always gives them; fetching coal's into Python is left out, in its favour.

Settings, each tried against its alternatives on four scenes:

- Both use their `OBBRSS` hierarchy with one triangle a leaf; distance queries descend by its
  rectangle swept spheres alone, nearer child first. python-fcl offers no other, coal's `OBB`
  needs five times as long.
- coal's `ComputeDistance` looks the algorithm up once, and is 3 % faster than `coal.distance`.
- Signed distances and nearest points change 2 % at most. The order of the two models changes
  nothing, but in the cave the smaller model first saves a seventh: all scenes have it first.
- Neither has a relative error between meshes: python-fcl offers none, and coal 3.0 copies
  `rel_err` before it has the request, so 0.5 gives the answer of 0 in the time of 0. Hence both
  are compared by their exact query alone.
- Neither remembers anything from one query to the next, neither starts threads.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib import import_module, metadata
from importlib.util import find_spec
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from proximity_monitor.study.shapes import Mesh

Poses = NDArray[np.float64]
Queries = list[Callable[[], float]]


class Fcl:
    """python-fcl."""

    name, package = "fcl", "python-fcl"

    def __init__(self, library: ModuleType) -> None:
        self._library = library

    def build(self, mesh: Mesh) -> Any:
        """A model with its hierarchy."""
        vertices, faces = mesh
        model = self._library.BVHModel()
        model.beginModel(len(faces), len(vertices))
        model.addSubModel(vertices, faces)
        model.endModel()
        return model

    def queries(self, a: Any, poses_a: Poses, b: Any, poses_b: Poses) -> Queries:
        """A function for each pose that returns the distance and keeps the nearest points."""
        library = self._library
        request = library.DistanceRequest(enable_nearest_points=True)

        def at(model: Any, pose: Poses) -> Any:
            return library.CollisionObject(model, library.Transform(pose[:3, :3], pose[:3, 3]))

        return [
            partial(library.distance, at(a, p), at(b, q), request, library.DistanceResult())
            for p, q in zip(poses_a, poses_b, strict=True)
        ]


class Coal:
    """coal, which was hpp-fcl."""

    name, package = "coal", "coal"

    def __init__(self, library: ModuleType) -> None:
        self._library = library

    def build(self, mesh: Mesh) -> Any:
        """A model with its hierarchy."""
        vertices, faces = mesh
        model = self._library.BVHModelOBBRSS()
        model.beginModel(len(faces), len(vertices))
        model.addVertices(vertices)
        model.addTriangles(faces.astype(np.int64))
        model.endModel()
        return model

    def queries(self, a: Any, poses_a: Poses, b: Any, poses_b: Poses) -> Queries:
        """A function for each pose that returns the distance and keeps the nearest points."""
        library = self._library
        compute = library.ComputeDistance(a, b)
        # By attribute: the constructor's own argument `abs_err` sets the relative error.
        request = library.DistanceRequest()
        request.enable_signed_distance = False

        def at(pose: Poses) -> Any:
            return library.Transform3s(pose[:3, :3].copy(), pose[:3, 3].copy())

        # An answer that was used before would be taken for an upper bound.
        return [
            partial(compute, at(p), at(q), request, library.DistanceResult())
            for p, q in zip(poses_a, poses_b, strict=True)
        ]


def installed() -> list[Fcl | Coal]:
    """The peers that can be imported here."""
    return [peer(import_module(peer.name)) for peer in (Fcl, Coal) if find_spec(peer.name)]


def version(peer: Fcl | Coal) -> str:
    """Its package and version."""
    return f"{peer.package} {metadata.version(peer.package)}"
