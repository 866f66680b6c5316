"""Computes the direction in which one body gets away from another, and their closing speed.

The closing speed is the speed at which the closest points, each fixed to its body, approach. A
body's velocity at its point follows from its last two poses and their stamps. The closing speed is
the component of the relative velocity along the line between the points. For exact closest points
it is the rate of the distance itself, for bounds the rate of the upper bound. Because it uses only
the last two poses, it is known at the second pose and does not lag; noise in the poses is not
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
    """A body's last two poses, (4, 4) model to world in metres, and the time between them.

    A fixed body has `seconds` = inf.
    """

    before: np.ndarray
    after: np.ndarray
    seconds: float

    @property
    def fixed(self) -> bool:
        """Whether the body never moves."""
        return math.isinf(self.seconds)

    def velocity_at(self, point: np.ndarray) -> np.ndarray:
        """Return the mean velocity (3,), m/s, of the body point that is now at `point` (3,)."""
        own = self.after[:3, :3].T @ (point - self.after[:3, 3])
        return (point - (self.before[:3, :3] @ own + self.before[:3, 3])) / self.seconds


@dataclass(frozen=True, slots=True)
class RelativeMotion:
    """The relative motion of a pair, for its alert."""

    body: str
    """The body that should get away: the moving one, or A if both move."""
    escape: np.ndarray | None
    """Unit vector (3,) in the world, from the other body's closest point to this body's. For
    overlapping solids it points out of the other body: the faces next to the largest ball inside
    both pass each other along it. None if the points coincide or are unknown."""
    closing: float
    """m/s at which the closest points approach; negative if they part, NaN if it is not known."""

    def seconds_to(self, distance: float) -> float:
        """Return the seconds until the bodies close `distance` metres; NaN unless they approach."""
        return max(distance, 0.0) / self.closing if self.closing > 0.0 else math.nan


Courses = Callable[[str], Course | None]
"""Returns a body's course by name; None until it has two poses with different stamps."""


def relative_motion(pair: PairState, courses: Courses) -> RelativeMotion:
    """Return how the bodies of a pair move against each other at its closest points.

    Args:
        pair: the state of this tick; it has no numbers if a pose is unknown.
        courses: the bodies' courses up to the poses of this tick.
    """
    a, b = courses(pair.a), courses(pair.b)
    body = pair.b if a is not None and a.fixed else pair.a
    if pair.status is PairStatus.UNKNOWN:
        return RelativeMotion(body, None, math.nan)
    between = pair.point_b - pair.point_a
    length = float(np.sqrt(between @ between))
    if not 0.0 < length < math.inf:
        return RelativeMotion(body, None, math.nan)
    line = between / length  # unit vector from A to B
    if pair.upper < 0.0:
        # Each point is on one body's surface inside the other body, so B leaves A against the line.
        line = -line
    closing = math.nan
    if a is not None and b is not None:
        closing = float(line @ (a.velocity_at(pair.point_a) - b.velocity_at(pair.point_b)))
    return RelativeMotion(body, line if body == pair.b else -line, closing)
