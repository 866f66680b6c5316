"""Computes the nearest points of swept models from the nearest points of their cores."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index


def witness_points(rows: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the nearest points of both models, world, metres, from answers (..., ANSWER).

    If the models overlap, each point is as far from its core as the radius says, even if it then
    lies inside the other model, as with two spheres. If a radius is negative, the row itself holds
    the points.
    """
    radii = rows[..., index.RADIUS_A : index.RADIUS_B + 1]
    p, q = surface_points(
        rows[..., index.POINT_A : index.POINT_A + 3],
        rows[..., index.POINT_B : index.POINT_B + 3],
        radii,
        rows[..., index.UPPER] < 0.0,
    )
    told = (radii < 0.0).any(axis=-1, keepdims=True)
    if not told.any():
        return p, q
    p = np.where(told, rows[..., index.SURFACE_A : index.SURFACE_A + 3], p)
    q = np.where(told, rows[..., index.SURFACE_B : index.SURFACE_B + 3], q)
    return p, q


def surface_points(
    p: NDArray[np.float64],
    q: NDArray[np.float64],
    radii: NDArray[np.float64],
    overlapping: NDArray[np.bool_] | bool = False,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the nearest points of swept models, from those of their cores.

    Args:
        p: (..., 3) metres; nearest point of the first core.
        q: (..., 3) metres; nearest point of the second core.
        radii: (..., 2) metres; the radii that sweep the cores.
        overlapping: (...) whether the models overlap; then the balls around p and q may meet.

    Returns:
        (..., 3) points of either model; the given arrays themselves if no model is swept. If the
        balls around p and q meet, and the models do not overlap, the two are one point of both.
    """
    if not radii.any():
        return p, q
    way = q - p
    length = np.sqrt((way * way).sum(axis=-1, keepdims=True))
    reach = np.maximum(length, radii.sum(axis=-1, keepdims=True))
    reach = np.where(np.asarray(overlapping)[..., None], length, reach)
    shares = np.divide(radii, reach, out=np.zeros_like(radii), where=reach > 0.0)
    return p + shares[..., :1] * way, q - shares[..., 1:] * way
