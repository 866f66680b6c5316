"""Bands: which places on a part's shown triangles are nearer than stop or warn to another part.

Between two points of a part, the clearance differs by at most their distance. So if a triangle has
its middle at c and its farthest corner at the distance r from c, the clearance of each of its
points is within r of that of c. A triangle that may reach into two bands is divided until it is
small or time is over. Then it gets the band of its middle, and the page says how far that is from
its other points. The triangles, and those of the other parts, may deviate from the shapes that they
show. A band is certain only if it is the same for every such deviation.
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
"""Triangles smaller than this share of the part's size are not divided."""

BEYOND = 1.01
"""Distances are searched up to this factor beyond where they matter; anything farther is above."""

MOST = 40_000
"""Maximum number of triangles of a part; beyond it no triangle is divided."""

BELOW_STOP, BELOW_WARN, ABOVE, UNKNOWN = range(4)

_MODELS: WeakKeyDictionary[Part, engine.Model] = WeakKeyDictionary()


class Other(NamedTuple):
    """A part that the part with bands is watched against."""

    model: engine.Model
    pose: np.ndarray
    """(4, 4) to the frame of the part whose bands are wanted, in metres."""
    thresholds: Thresholds
    deviation: float = 0.0
    """Metres; see `Part.deviation`. If it is finite, the model has the same one."""


def model_of(part: Part, point: bool) -> engine.Model:
    """Return what is shown of a body as a model; `point` says that the body is a single point."""
    found = _MODELS.get(part)
    if found is None:
        how = {"deviation": part.deviation if np.isfinite(part.deviation) else 0.0}
        if point:
            found = engine.shapes.points(np.zeros((1, 3)), **how)
        else:
            vertices, index = np.unique(part.corners, axis=0, return_inverse=True)
            if not part.solid:
                how["solid"] = False
            found = engine.shapes.triangles(vertices, index.reshape(-1, 3), **how)
            if part.solid and found.has_area and not found.is_solid:
                # Neighbouring patches of a curved body may not share their corners.
                found = engine.shapes.triangles(
                    vertices, index.reshape(-1, 3), solid="robust", **how
                )
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
    """(m, 3, 3) metres, in the part's frame; together they cover the given triangles."""
    band: np.ndarray
    """(m,)"""
    sampled_m: float
    """The farthest that a point of a triangle is from the middle whose band the triangle got."""
    deviation_m: float
    """The deviations of a pair's shapes, added up; 0: no band depends on it; inf: not known.
    Every band is certain if this and `sampled_m` are 0."""
    cut: bool = False
    """Whether time was over before every band was as certain as it can become."""


def bands(
    corners: np.ndarray, others: Sequence[Other], budget_s: float = BUDGET_S, deviation: float = 0.0
) -> Bands:
    """Return the bands of a part, computed within a time budget.

    Args:
        corners: (n, 3, 3) of its triangles in its own frame, metres.
        others: the parts that it is watched against.
        budget_s: seconds. Preparing each model and compiling, which happen once, do not count.
        deviation: metres; how far these triangles are at most from the body; inf: not known.
    """
    for other in others:
        engine.closest_points(other.model, other.pose, np.zeros((1, 3)), signed=True)
    ends = time.monotonic() + budget_s
    size = float(np.ptp(corners.reshape(-1, 3), axis=0).max()) if len(corners) else 0.0
    done, of_done, sampled_m, deviation_m, cut = [], [], 0.0, 0.0, False
    most_deviation = max((deviation + other.deviation for other in others), default=0.0)
    while True:
        middle, radius = _ball(corners)
        alike, certain, in_vain, band = _judged(middle, radius, others, deviation, ends)
        final = certain | (alike & in_vain) | (radius <= FINEST * size)
        over = time.monotonic() >= ends
        cut |= bool((band == UNKNOWN).any()) or (over and not final.all())
        if over or len(corners) + sum(map(len, done)) > MOST:
            final[:] = True
        sampled_m = max(sampled_m, float(radius[final & ~alike].max(initial=0.0)))
        if (final & ~certain).any():
            deviation_m = most_deviation
        done.append(corners[final])
        of_done.append(band[final])
        corners = _divided(corners[~final])
        if not len(corners):
            return Bands(np.concatenate(done), np.concatenate(of_done), sampled_m, deviation_m, cut)


def _ball(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the middles (n, 3) of triangles, and the radii (n,) of balls about them.

    Each ball holds its triangle's corners, wherever rounding puts the middle, so it holds the
    triangle.
    """
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1, initial=0.0)
    return middle, radius * (1.0 + 1e-12)


def _judged(
    middle: np.ndarray, radius: np.ndarray, others: Sequence[Other], deviation: float, ends: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return three flags for each ball (n,), and the band (n,) of each middle.

    The flags say: all points of the ball have one band; they have it however the shapes are off;
    even the band of the middle depends on how the shapes are off, so dividing would be in vain. If
    time was over, the band is not known, and the first two flags are set.
    """
    # The nearest and the farthest band of the drawn balls, of the shapes, and of the middles alone.
    drawn, shapes, middles = (np.full((2, len(middle)), ABOVE) for _ in range(3))
    band = drawn[0].copy()
    known = np.ones(len(middle), bool)
    for other in others:
        warn, stop = max(other.thresholds.warn, other.thresholds.stop), other.thresholds.stop
        widened = other.model.deviation
        reach = (
            float(radius.max(initial=0.0))
            + widened
            + (deviation if np.isfinite(deviation) else 0.0)
        )
        found = engine.closest_points(
            other.model,
            other.pose,
            middle,
            max_distance=BEYOND * (warn + reach) + 1e-9,
            budget_s=max(ends - time.monotonic(), 0.0),
            signed=True,
        )
        known &= found.done
        # Bounds for the triangles as they are shown: the engine has widened them by the deviation.
        lower, upper = found.lower + widened, found.upper - widened
        band = np.minimum(band, _band(np.minimum(lower, upper), warn, stop))
        more = deviation if np.isfinite(other.deviation) else np.inf
        for found_bands, low, high, by in (
            (drawn, lower, upper, radius),
            (shapes, found.lower, found.upper, radius + more),
            (middles, found.lower, found.upper, more),
        ):
            outer = np.stack((_band(low - by, warn, stop), _band(high + by, warn, stop)))
            np.minimum(found_bands, outer, out=found_bands)
    alike, certain, settled = (low == high for low, high in (drawn, shapes, middles))
    return alike | ~known, certain | ~known, ~settled, np.where(known, band, UNKNOWN)


def _band(clearance: np.ndarray, warn: float, stop: float) -> np.ndarray:
    """Return the band of each clearance (n,)."""
    return np.where(clearance <= stop, BELOW_STOP, np.where(clearance <= warn, BELOW_WARN, ABOVE))


def _divided(corners: np.ndarray) -> np.ndarray:
    """Return each triangle (n, 3, 3) as four, (4n, 3, 3)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    ab, bc, ca = (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0
    four = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(each, axis=1) for each in four])
