"""Where a body gets away from another, and how fast the two close in.

The speed is that of the closest points, taken as parts of their bodies: each body's velocity at its
point follows from its last two poses and their stamps, and the part of the difference that lies
along the line of the two points is how fast they approach. For the exact closest points that is the
rate of the distance itself; for bounds it is the rate of the upper one. Nothing but the last two
poses enters, so it is there at the second pose and does not lag; noise of the poses is not
filtered.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from proximity_monitor.scene.state import PairState, PairStatus


class Course(NamedTuple):
    """A body's last two poses, (4, 4) model to world in metres, and the time from one to the other.

    A body that is fixed has `seconds` = inf.
    """

    before: np.ndarray
    after: np.ndarray
    seconds: float

    @property
    def fixed(self) -> bool:
        """Whether the body never moves."""
        return math.isinf(self.seconds)

    def velocity_at(self, point: np.ndarray) -> np.ndarray:
        """Return the mean velocity (3,), m/s, of the body's part that is now at `point` (3,)."""
        own = self.after[:3, :3].T @ (point - self.after[:3, 3])
        return (point - (self.before[:3, :3] @ own + self.before[:3, 3])) / self.seconds


@dataclass(frozen=True, slots=True)
class Approach:
    """The motion of a pair, as its alert tells it."""

    body: str
    """The body that is to get away: the moving one; A where both move."""
    escape: np.ndarray | None
    """Unit vector (3,) in the world: from the other body's closest point to this body's, or, for
    overlapping solids, the way out along which the faces next to the largest ball in both get past
    each other. None where the points coincide."""
    closing: float
    """m/s at which the closest points approach, negative where they part; NaN where the poses do
    not tell it."""

    def seconds_to(self, distance: float) -> float:
        """Return the time until `distance` metres are closed at this speed; NaN unless closing."""
        return max(distance, 0.0) / self.closing if self.closing > 0.0 else math.nan


Courses = Callable[[str], Course | None]
"""A body's course by its name; None as long as there are no two poses with different stamps."""


def approach(pair: PairState, courses: Courses) -> Approach:
    """Return how the bodies of a pair move against each other at its closest points.

    Args:
        pair: the state of this tick; without numbers where a pose is unknown.
        courses: of the poses of this tick.
    """
    a, b = courses(pair.a), courses(pair.b)
    body = pair.b if a is not None and a.fixed else pair.a
    if pair.status is PairStatus.UNKNOWN:
        return Approach(body, None, math.nan)
    between = pair.point_b - pair.point_a
    length = float(np.sqrt(between @ between))
    if not 0.0 < length < math.inf:
        return Approach(body, None, math.nan)
    line = between / length  # from A to B
    if pair.upper < 0.0:
        # Each point is where one body ends inside the other, so B parts from A against it.
        line = -line
    closing = math.nan
    if a is not None and b is not None:
        closing = float(line @ (a.velocity_at(pair.point_a) - b.velocity_at(pair.point_b)))
    return Approach(body, line if body == pair.b else -line, closing)
