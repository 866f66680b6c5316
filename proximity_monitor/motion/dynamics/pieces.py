"""A model's triangles cut into pieces: each pair of them gives two bodies one contact point.

Only a mesh that no ball sweeps and that does not deform is its own triangles. Any other model is a
single piece: itself. Its distances are its own, not those of triangles that look like it; see
`memory` for its contact points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from proximity_monitor import engine

MOST = 16
"""How many pieces a model has at most. Bodies that touch at several places do so with several pairs
of pieces. More pieces separate places that are closer together, and cost as many more tests of
bounding volumes."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """The pieces of one model, and which triangles meet at a vertex.

    A model that is a piece itself has no triangles here.

    Attributes:
        models: the pieces, each with the vertices that it uses alone.
        triangles: the faces of the whole that each piece consists of; of the model itself -1.
        spheres: (p, 4) metres, model frame; centre and radius of a sphere around each piece.
        boxes: (p, 6) metres, model frame; least and greatest corner of each piece and what it may
            deviate by.
        corners: (m, 3, 3) metres, model frame; the corners of the whole's triangles.
        places: (m, 3) number of each corner, equal where the coordinates are.
        first: (n + 1,) where the triangles of a place begin in `around`.
        around: the triangles that meet at each place.
    """

    models: list[engine.Model]
    triangles: list[NDArray[np.int64]]
    spheres: NDArray[np.float64]
    boxes: NDArray[np.float64]
    corners: NDArray[np.float64]
    places: NDArray[np.int64]
    first: NDArray[np.int64]
    around: NDArray[np.int64]


def cut(model: engine.Model, deforming: bool = False) -> Pieces:
    """Cut the triangles of a model into at most MOST pieces of about equal size, or leave it whole.

    It stays whole where it is `deforming`, or its surface is not that of triangles.
    """
    if deforming or model.display_mesh(model.radius).off > 0.0:
        return _whole(model)
    mesh = model.display_mesh(0.0)
    vertices, faces = mesh[:2]
    corners = mesh.corners()
    centres = corners.mean(axis=1)
    parts = [np.arange(len(faces))]
    while 2 * len(parts) <= MOST and any(len(part) > 1 for part in parts):
        parts = [half for part in parts for half in _halves(part, centres)]
    models, boxes = [], []
    for i, part in enumerate(parts):
        used, own = np.unique(faces[part], return_inverse=True)
        name = f"{model.name}, piece {i}"
        how = {"name": name, "deviation": model.deviation}
        models.append(engine.shapes.triangles(vertices[used], own.reshape(-1, 3), **how))
        low, high = vertices[used].min(axis=0), vertices[used].max(axis=0)
        boxes.append([*(low - model.deviation), *(high + model.deviation)])
    places = mesh.welded().astype(np.int64)
    first = np.concatenate(([0], np.cumsum(np.bincount(places.reshape(-1)))))
    return Pieces(
        models,
        parts,
        np.array([[*each.centre, each.radius] for each in models]),
        np.array(boxes),
        corners,
        places,
        first,
        np.argsort(places.reshape(-1), kind="stable") // 3,
    )


def _whole(model: engine.Model) -> Pieces:
    """The model as its only piece."""
    none = np.empty((0, 3), np.int64)
    spheres, boxes = around(model)
    corners = np.empty((0, 3, 3))
    triangles = [np.array([-1])]
    return Pieces([model], triangles, spheres, boxes, corners, none, np.zeros(1, int), none[:, 0])


def around(model: engine.Model) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The sphere (1, 4) around a model and the box (1, 6) around that."""
    low, high = model.centre - model.radius, model.centre + model.radius
    return np.array([[*model.centre, model.radius]]), np.array([[*low, *high]])


def _halves(part: NDArray[np.int64], centres: NDArray[np.float64]) -> list[NDArray[np.int64]]:
    """Split triangles at the median along the axis on which their centres spread most."""
    if len(part) == 1:
        return [part]
    axis = np.argmax(np.ptp(centres[part], axis=0))
    order = part[np.argsort(centres[part, axis], kind="stable")]
    return [order[: len(order) // 2], order[len(order) // 2 :]]
