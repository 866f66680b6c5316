"""The nearest points of swept models, from the nearest points of their cores."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index


def witness_points(rows: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Nearest points of both models, world, metres; from answers of searches (..., ANSWER).

    If the models overlap, each point is as far from its core as the radius says, even if that is
    inside the other model, as with two spheres; or it is told by the row.
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
    """Nearest points of swept models, from those of their cores.

    Args:
        p: (..., 3) metres; of the first.
        q: (..., 3) metres; of the second.
        radii: (..., 2) metres; the radii that sweep them.
        overlapping: (...) whether the models overlap; then the balls around p and q may meet.

    Returns:
        (..., 3) points of either: the very arrays given where no model is swept. Where the balls
        around p and q meet, one point of both, unless the models overlap.
    """
    if not radii.any():
        return p, q
    way = q - p
    length = np.sqrt((way * way).sum(axis=-1, keepdims=True))
    reach = np.maximum(length, radii.sum(axis=-1, keepdims=True))
    reach = np.where(np.asarray(overlapping)[..., None], length, reach)
    shares = np.divide(radii, reach, out=np.zeros_like(radii), where=reach > 0.0)
    return p + shares[..., :1] * way, q - shares[..., 1:] * way
