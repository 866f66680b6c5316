"""Bands: which places of a part are nearer than stop or warn, of the triangles that are shown.

A clearance changes by no more than the way along the part. So if a triangle has its middle at c and
its farthest corner at r from there, the clearance of each of its points is that of c to r. A
triangle that may reach into two bands is divided until it is small or the time is over. Then it has
the band of its middle, and the page says how far that is from its other points.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from proximity_monitor import engine
from proximity_monitor.display.geometry import rotate
from proximity_monitor.display.received import Part
from proximity_monitor.scene import Thresholds

BUDGET_S = 0.3
"""Seconds for the bands of one part."""

FINEST = 0.01
"""Triangles are not divided below this share of the part's size."""

BEYOND = 1.01
"""Distances are asked for so much farther than they matter, so that what is farther is above."""

MOST = 40_000
"""Triangles of a part at most; beyond that none is divided."""

BELOW_STOP, BELOW_WARN, ABOVE, UNKNOWN = range(4)

_MODELS: WeakKeyDictionary[Part, engine.Model] = WeakKeyDictionary()


class Other(NamedTuple):
    """A part that another one shall keep away from."""

    model: engine.Model
    pose: np.ndarray
    """(4, 4) to the frame of the part whose bands are wanted, metres."""
    limits: Thresholds


def model_of(part: Part, point: bool) -> engine.Model:
    """Return what is shown of a body as a model; `point` says that it is a single point."""
    found = _MODELS.get(part)
    if found is None:
        if point:
            found = engine.shapes.points(np.zeros((1, 3)))
        else:
            vertices, index = np.unique(part.corners, axis=0, return_inverse=True)
            found = engine.shapes.triangles(vertices, index.reshape(-1, 3))
        _MODELS[part] = found
    return found


def matrix(pose: np.ndarray) -> np.ndarray:
    """Return a pose (7,) as a matrix (4, 4)."""
    made = np.eye(4)
    made[:3, :3] = rotate(pose[3:], np.eye(3)).T
    made[:3, 3] = pose[:3]
    return made


class Bands(NamedTuple):
    """Triangles and their bands."""

    corners: np.ndarray
    """(m, 3, 3) metres, in the part's frame; together they are the triangles that were given."""
    band: np.ndarray
    """(m,)"""
    sampled_m: float
    """The farthest that any point is from the one whose band it got; 0: every band is certain."""


def bands(corners: np.ndarray, others: Sequence[Other], budget_s: float = BUDGET_S) -> Bands:
    """Return the bands of a part.

    Args:
        corners: (n, 3, 3) of its triangles in its own frame, metres.
        others: what it shall keep away from.
        budget_s: seconds, after what is made once for each model, or compiled, is there.
    """
    for other in others:
        engine.closest_points(other.model, other.pose, np.zeros((1, 3)), signed=True)
    ends = time.monotonic() + budget_s
    size = float(np.ptp(corners.reshape(-1, 3), axis=0).max()) if len(corners) else 0.0
    done, of_done, sampled_m = [], [], 0.0
    while True:
        middle, radius = _ball(corners)
        certain, band = _judged(middle, radius, others, ends)
        final = certain | (radius <= FINEST * size)
        over = time.monotonic() >= ends
        if over or len(corners) + sum(map(len, done)) > MOST:
            final[:] = True
        sampled_m = max(sampled_m, float(radius[final & ~certain].max(initial=0.0)))
        done.append(corners[final])
        of_done.append(band[final])
        corners = _divided(corners[~final])
        if not len(corners):
            return Bands(np.concatenate(done), np.concatenate(of_done), sampled_m)


def _ball(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the middles (n, 3) of triangles, and radii (n,) of balls around them that hold all.

    A triangle lies in any ball that holds its corners, wherever rounding puts the middle.
    """
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1, initial=0.0)
    return middle, radius * (1.0 + 1e-12)


def _judged(
    middle: np.ndarray, radius: np.ndarray, others: Sequence[Other], ends: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return of which balls (n,) all points have one band, and the band (n,) of each middle.

    What is not known is certain, too: there is no time to know more.
    """
    worst = np.full(len(middle), ABOVE)
    best, band = worst.copy(), worst.copy()
    known = np.ones(len(middle), bool)
    for other in others:
        warn, stop = max(other.limits.warn, other.limits.stop), other.limits.stop
        found = engine.closest_points(
            other.model,
            other.pose,
            middle,
            max_distance=BEYOND * (warn + float(radius.max(initial=0.0))) + 1e-9,
            budget_s=max(ends - time.monotonic(), 0.0),
            signed=True,
        )
        known &= found.done
        worst = np.minimum(worst, _band(found.lower - radius, warn, stop))
        best = np.minimum(best, _band(found.upper + radius, warn, stop))
        band = np.minimum(band, _band(found.lower, warn, stop))
    return (worst == best) | ~known, np.where(known, band, UNKNOWN)


def _band(clearance: np.ndarray, warn: float, stop: float) -> np.ndarray:
    """Return the band of each clearance (n,)."""
    return np.where(clearance <= stop, BELOW_STOP, np.where(clearance <= warn, BELOW_WARN, ABOVE))


def _divided(corners: np.ndarray) -> np.ndarray:
    """Return each triangle (n, 3, 3) as four, (4n, 3, 3)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    ab, bc, ca = (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0
    four = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(each, axis=1) for each in four])
