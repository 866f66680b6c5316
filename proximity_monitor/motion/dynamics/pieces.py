"""A model's triangles cut into pieces: each pair of pieces gives two bodies one contact.

Only a model of triangles that no ball sweeps and that does not deform is cut. Any other model is
searched whole: it is its own single piece. So its distances are those of its true surface, not of
triangles that approximate it. See `memory` for its contacts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from proximity_monitor import engine

MOST = 16
"""The most pieces of a model. Bodies that touch at several places do so with several pairs of
pieces. More pieces separate places that are closer together, but cost proportionally more tests of
bounding volumes."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """The pieces of one model, and the triangles that meet at each vertex.

    A model that is searched whole has no triangles here.

    Attributes:
        models: the pieces, each with only the vertices that it uses.
        triangles: the faces of the model that each piece has; -1 for a model searched whole.
        spheres: (p, 4) metres, model frame; centre and radius of a sphere around each piece.
        boxes: (p, 6) metres, model frame; least and greatest corner of a box around each piece,
            its deviation included.
        corners: (m, 3, 3) metres, model frame; the corners of the model's triangles.
        places: (m, 3) the place of each corner: a number, equal for equal coordinates.
        first: (n + 1,) where the triangles of each place begin in `around`.
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

    It stays whole if it is `deforming`, or if its surface does not consist of triangles.
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
    """Return the model as its only piece."""
    none = np.empty((0, 3), np.int64)
    spheres, boxes = around(model)
    corners = np.empty((0, 3, 3))
    triangles = [np.array([-1])]
    return Pieces([model], triangles, spheres, boxes, corners, none, np.zeros(1, int), none[:, 0])


def around(model: engine.Model) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the sphere (1, 4) around a model, and the box (1, 6) around the sphere."""
    low, high = model.centre - model.radius, model.centre + model.radius
    return np.array([[*model.centre, model.radius]]), np.array([[*low, *high]])


def _halves(part: NDArray[np.int64], centres: NDArray[np.float64]) -> list[NDArray[np.int64]]:
    """Split triangles at the median along the axis on which their centres spread most."""
    if len(part) == 1:
        return [part]
    axis = np.argmax(np.ptp(centres[part], axis=0))
    order = part[np.argsort(centres[part, axis], kind="stable")]
    return [order[: len(order) // 2], order[len(order) // 2 :]]
