"""Put the C++ libraries behind one interface, so that they and this engine are timed alike.

The timed unit is one call from Python that answers one query. Models, transforms, collision
objects and the objects that take the answers are made before. The peers are asked for nearest
points, because this engine always gives them. Fetching coal's points into Python is not timed,
which favours coal.

Each setting was tried against its alternatives on four scenes:

- Both use their `OBBRSS` hierarchy with one triangle a leaf. Distance queries descend by its
  rectangle swept spheres alone, nearer child first. python-fcl offers no other hierarchy; coal's
  `OBB` needs five times as long.
- coal's `ComputeDistance` looks the algorithm up once, and is 3 % faster than `coal.distance`.
- Signed distances and nearest points change the time by at most 2 %. The order of the two models
  matters in the cave alone, where the smaller model first saves a seventh; all scenes do so.
- Neither has a relative error between meshes. python-fcl offers none. coal 3.0 copies `rel_err`
  before the request is set, so that 0.5 gives the answer of 0 in the time of 0. Hence only their
  exact queries are compared.
- Neither remembers anything from one query to the next, and neither starts threads.
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
        """Return a model with its hierarchy."""
        vertices, faces = mesh
        model = self._library.BVHModel()
        model.beginModel(len(faces), len(vertices))
        model.addSubModel(vertices, faces)
        model.endModel()
        return model

    def queries(self, a: Any, poses_a: Poses, b: Any, poses_b: Poses) -> Queries:
        """Return a function for each pose: it gives the distance, and keeps the nearest points."""
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
        """Return a model with its hierarchy."""
        vertices, faces = mesh
        model = self._library.BVHModelOBBRSS()
        model.beginModel(len(faces), len(vertices))
        model.addVertices(vertices)
        model.addTriangles(faces.astype(np.int64))
        model.endModel()
        return model

    def queries(self, a: Any, poses_a: Poses, b: Any, poses_b: Poses) -> Queries:
        """Return a function for each pose: it gives the distance, and keeps the nearest points."""
        library = self._library
        compute = library.ComputeDistance(a, b)
        # Set as an attribute: the constructor's argument `abs_err` sets the relative error.
        request = library.DistanceRequest()
        request.enable_signed_distance = False

        def at(pose: Poses) -> Any:
            return library.Transform3s(pose[:3, :3].copy(), pose[:3, 3].copy())

        # A fresh result for each query: coal would take the distance in a used one for an upper
        # bound.
        return [
            partial(compute, at(p), at(q), request, library.DistanceResult())
            for p, q in zip(poses_a, poses_b, strict=True)
        ]


def installed() -> list[Fcl | Coal]:
    """Return the peers that can be imported here."""
    return [peer(import_module(peer.name)) for peer in (Fcl, Coal) if find_spec(peer.name)]


def version(peer: Fcl | Coal) -> str:
    """Return the peer's package and version."""
    return f"{peer.package} {metadata.version(peer.package)}"
