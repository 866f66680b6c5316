"""How far two models overlap whose triangles are swept by balls, or deviate."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index
from ..kernels.base.rounding import DOUBLE_EPS
from ..models.hierarchy import Hierarchy
from .result import STATUSES, Status

_ROUNDING = 64.0 * DOUBLE_EPS
"""Share of all coordinates and radii that a distance of points in the world errs by, with reserve:
MARGIN_A, MARGIN_B and MARGIN_T for the points, two roundings for each coordinate in the world."""


def overlap(
    models: Sequence[Hierarchy],
    poses: Sequence[NDArray[np.float64]],
    row: NDArray[np.float64],
    deeper: int,
) -> None:
    """Replace the bounds in an answer about two cores by those of the models, which overlap or may.

    Around the nearest points of the cores, d apart, the models hold balls of their radii r and s.
    Where these meet, both models hold a ball with diameter r + s - d, or the smaller of the two: so
    the signed distance is at most minus that. A vertex of the core that is swept by s, deep inside
    the other core, is the centre of a ball of s. Of a surface, which holds no ball, the deepest
    point counts: r - d.

    What the balls around the models have in common bounds the depth from below. For spheres,
    capsules and swept triangles, which are convex, the diameter above does: no point is deeper than
    r less its distance from the core. A deviation changes how deep a point lies in either model by
    as much, and so a diameter by twice that.

    Args:
        models: the hierarchies of two, of which one at least is swept or deviates.
        poses: two (4, 4), model to world, metres.
        row: (ANSWER,) what the search for the cores' signed distance found; changed.
        deeper: which model the deepest vertex is of, where the upper bound is negative.
    """
    a, b = models
    radii, deviation = a.swept_radius + b.swept_radius, 2.0 * max(a.deviation, b.deviation)
    lower, upper = row[index.LOWER], row[index.UPPER]
    sizes = sum(
        float(np.abs(pose[:3, 3]).sum() + np.abs(model.centre).sum() + model.radius)
        for model, pose in zip(models, poses, strict=True)
    )
    slack = _ROUNDING * sizes
    if radii == 0.0:
        lower, upper = lower - deviation, upper + deviation
    else:
        shallow = _shallowest(models, row, deeper, slack)
        if shallow > 0.0:
            upper = deviation - shallow
        lower = -_deepest(models, poses, shallow, slack, deviation)
    row[index.LOWER], row[index.UPPER] = lower, upper
    if STATUSES[int(row[index.STATUS])] is not Status.OUT_OF_TIME:
        exact = upper < 0.0 and upper - lower <= 4.0 * slack + 2.0 * deviation
        row[index.STATUS] = STATUSES.index(Status.EXACT if exact else Status.INTERSECTING)


def _smaller_ball(models: Sequence[Hierarchy]) -> float:
    """Diameter, metres, of the ball that both models hold where a ball of either is in the other.

    Infinity for a solid and a surface, of which the deepest point counts.
    """
    solids = all(model.is_solid for model in models)
    return 2.0 * min(model.swept_radius for model in models) if solids else math.inf


def _shallowest(
    models: Sequence[Hierarchy], row: NDArray[np.float64], deeper: int, slack: float
) -> float:
    """The least that two swept models overlap by, metres; 0 where they may not."""
    radii = models[0].swept_radius + models[1].swept_radius
    if row[index.UPPER] >= 0.0:
        way = row[index.POINT_B : index.POINT_B + 3] - row[index.POINT_A : index.POINT_A + 3]
        return max(min(radii - math.sqrt(way @ way) - slack, _smaller_ball(models)), 0.0)
    depth = models[1 - deeper].swept_radius - row[index.UPPER]
    if _smaller_ball(models) == math.inf:
        return depth
    return 2.0 * min(models[deeper].swept_radius, depth)


def _deepest(
    models: Sequence[Hierarchy],
    poses: Sequence[NDArray[np.float64]],
    shallow: float,
    slack: float,
    deviation: float,
) -> float:
    """The most that two models may overlap by, metres."""
    centres = [p[:3, :3] @ m.centre + p[:3, 3] for m, p in zip(models, poses, strict=True)]
    apart = float(np.linalg.norm(centres[1] - centres[0]))
    a, b = (model.radius for model in models)
    deepest = max(a + b - apart + slack, 0.0)
    if all(model.is_solid for model in models):
        deepest = min(deepest, 2.0 * min(a, b))
    if all(len(model.faces) == 1 for model in models):
        deepest = min(deepest, shallow + 2.0 * slack + deviation)
    return deepest
