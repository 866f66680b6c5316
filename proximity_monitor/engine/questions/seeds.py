"""Points that are likely to lie inside both of two models: where a search for a ball begins."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index
from ..models.model import Model

_SHARES = (0.1, 1e-3, 1e-5)
"""How far beside a contact it is tried, as a share of the triangles' size."""


def seeds_at(
    models: Sequence[Model], poses: Sequence[NDArray[np.float64]], row: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Points (k, 3) of the world about the nearest points of two cores.

    Args:
        models: two.
        poses: two (4, 4), model to world.
        row: (ANSWER,) the answer about their distance.
    """
    p, q = row[index.POINT_A : index.POINT_A + 3], row[index.POINT_B : index.POINT_B + 3]
    radii = [model._hierarchy.swept_radius for model in models]
    way = q - p
    apart = math.sqrt(way @ way)
    if sum(radii) > 0.0 and apart > 0.0:
        # Along the way from core to core, where both depths are the same, or one core's end.
        unit = way / apart
        over = sum(radii) - apart
        at = np.array([radii[0] - 0.5 * over, radii[0] + 0.5 * over, -0.5 * over, 0.0, apart])
        at = np.append(at, [apart + 0.5 * over, 0.5 * apart])
        return p + at[:, None] * unit
    sides = []
    for k, at in enumerate((index.FEATURE_A, index.FEATURE_B)):
        sides.append(_normal(models[k], poses[k], int(row[at + 3])))
    (n, size), (m, other) = sides
    return _beside(0.5 * (p + q), (-n - m, n - m, m - n, n + m), min(size, other) or 1.0)


def seeds_beside(
    models: Sequence[Model], poses: Sequence[NDArray[np.float64]], body: int, triangle: int
) -> NDArray[np.float64]:
    """Points (k, 3) of the world about a corner of a triangle, in tree order, of one of two models.

    The corner lies inside the other model; beside it are points inside both.
    """
    model, pose = models[body], poses[body]
    core = model._hierarchy
    local = core.tree.triangles[triangle].reshape(3, 3)
    n, size = _normal(model, pose, int(core.numbers[triangle]))
    corner = pose[:3, :3] @ local[0] + pose[:3, 3]
    middle = pose[:3, :3] @ local.mean(axis=0) + pose[:3, 3]
    points = _beside(middle, (-n, n), size or 1.0)
    return np.concatenate((points, corner[None])) if size else corner[None]


def _beside(
    point: NDArray[np.float64], ways: Sequence[NDArray[np.float64]], size: float
) -> NDArray[np.float64]:
    steps = np.multiply.outer(_SHARES, np.array(ways)).reshape(-1, 3)
    return point + size * steps


def _normal(
    model: Model, pose: NDArray[np.float64], face: int
) -> tuple[NDArray[np.float64], float]:
    """The unit normal of a face in the world, or zero; and how large the face is, metres."""
    core = model._hierarchy
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = core.vertices[core.faces[face]].tolist()
    ex, ey, ez, fx, fy, fz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    n = np.array((ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx))
    length = math.sqrt(n @ n)
    if not length > 0.0:
        return np.zeros(3), 0.0
    return pose[:3, :3] @ (n / length), math.sqrt(length)
