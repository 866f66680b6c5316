"""How far two models overlap whose triangles are swept by balls, or deviate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .kernels import state as index
from .mesh import TriangleMesh
from .result import STATUSES, Status
from .tolerances import DOUBLE_EPS

_ROUNDING = 64.0 * DOUBLE_EPS
"""Share of all coordinates and radii that a distance of points in the world errs by, with reserve:
MARGIN_A, MARGIN_B and MARGIN_T for the points, two roundings for each coordinate in the world."""


def overlap(
    models: Sequence[TriangleMesh],
    poses: Sequence[NDArray[np.float64]],
    row: NDArray[np.float64],
) -> None:
    """Replace the bounds in an answer about two cores that are not apart by those of the models.

    Around the nearest points of the cores, d apart, the models hold balls of both radii, r and s.
    Where these meet, both hold a ball with diameter r + s - d, or the smaller of them: so the signed
    distance is no more than minus that. What the balls around the models have in common bounds it
    from below; for spheres, capsules and swept triangles, which are convex, the same diameter does,
    because no point is deeper than r less its distance from the core. A deviation changes the depth
    of a point in either model by as much, and so the diameter by twice that.
    """
    a, b = models
    if a.swept_radius + b.swept_radius + a.deviation + b.deviation == 0.0:
        return
    points = row[index.POINT_A : index.POINT_B + 3].reshape(2, 3)
    way = points[1] - points[0]
    d = float(np.sqrt(way @ way))
    centres = [p[:3, :3] @ m.centre + p[:3, 3] for m, p in zip(models, poses, strict=True)]
    between = float(np.linalg.norm(centres[1] - centres[0]))
    reach = a.radius + b.radius
    sizes = sum(float(np.abs(p[:3, 3]).sum() + np.abs(m.centre).sum() + m.radius)
                for m, p in zip(models, poses, strict=True))  # fmt: skip
    slack = _ROUNDING * sizes
    least = 2.0 * min(a.swept_radius, b.swept_radius)
    radii, deviation = a.swept_radius + b.swept_radius, 2.0 * max(a.deviation, b.deviation)
    deepest = min(reach - between + slack, 2.0 * min(a.radius, b.radius))
    upper = row[index.UPPER]
    if upper < 0.0:  # a vertex of one core lies inside the other
        upper += deviation
    elif d + slack < radii:
        upper = deviation - min(radii - d - slack, least)
    if len(a.faces) == len(b.faces) == 1:
        deepest = min(deepest, max(min(radii - d + slack, least), 0.0) + deviation)
    row[index.LOWER], row[index.UPPER] = -max(deepest, 0.0), upper
    status = STATUSES[int(row[index.STATUS])]
    if status is not Status.OUT_OF_TIME:
        exact = upper < 0.0 and upper + deepest <= 4.0 * (slack + deviation)
        row[index.STATUS] = STATUSES.index(Status.EXACT if exact else Status.INTERSECTING)
