"""What a tick says: the state of every watched pair, in metres and world coordinates."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np


class PairStatus(enum.Enum):
    """What the numbers of a pair are."""

    EXACT = "exact"
    WITHIN_TOLERANCE = "within tolerance"
    BOUNDED = "bounded"
    """Certified, and wider than was asked for: there was no time for more."""
    INTERSECTING = "intersecting"
    UNKNOWN = "unknown pose"
    """A body of the pair has no pose yet: there are no numbers."""


class PoseSample(NamedTuple):
    """The last good pose of a moving body."""

    pose: np.ndarray
    """(4, 4) model to world."""
    stale: bool = False
    """True when it is too old to be relied on; it still is the best that is known."""


@dataclass(frozen=True, slots=True)
class PairState:
    """One watched pair at the end of a tick. Lengths in metres, points in the world frame."""

    a: str
    b: str
    lower: float
    """Certified for the poses of this tick: lower <= true distance <= upper. NaN if unknown."""
    upper: float
    point_a: np.ndarray
    """(3,) on A; `upper` is the distance of the two points (plus rounding, where carried)."""
    point_b: np.ndarray
    status: PairStatus
    age_s: float
    """Seconds since the numbers were an answer to the present poses: 0 while they are; else inf if
    the pair was never searched."""
    silent: tuple[str, ...]
    """The bodies of the pair whose pose is stale or was never given."""
    session_min: float
    """The smallest `upper` of the session: surely reached; inf before the first."""
    session_min_lower: float
    """The smallest `lower` of the session: the pair never was certified to be nearer at a tick."""

    @property
    def stale(self) -> bool:
        """Whether a body's pose is stale or unknown, so that nothing is certain about now."""
        return bool(self.silent)


@dataclass(frozen=True, slots=True)
class Tick:
    """All watched pairs at the end of one tick, in the scene's order."""

    pairs: tuple[PairState, ...]
    elapsed_s: float
    budget_s: float
    looked_at: tuple[int, ...]
    """Indices of the pairs that were searched, in the order of the search."""
    left: int
    """Pairs that wanted a search and got none, or whose search ran out of time."""

    def clearance(self) -> float:
        """Return the smallest lower bound, in metres; 0 if any pair has a stale or unknown pose.

        Nothing is certain about such a pair, and 0 is the bound that always holds: whoever compares
        the number with a threshold never takes silence for room. Without pairs it is inf.
        """
        return min((0.0 if p.stale else p.lower for p in self.pairs), default=float("inf"))
