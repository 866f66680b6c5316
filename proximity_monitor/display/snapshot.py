"""One pair at one tick, with everything that a picture of it needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from proximity_monitor.display.choice import PairName
from proximity_monitor.display.state import Frame, Pairs


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A pair at a tick, and the poses of all bodies then."""

    lower: float
    upper: float
    """Metres, as `lower` is; the clearance was certainly no larger."""
    stamp_s: float
    poses: np.ndarray
    """(m, 7) poses of the moving bodies at that tick; all zeros if they were dropped."""
    points: np.ndarray
    """(2, 3) the closest points at that tick."""
    status: int
    """A position in `state.STATUSES`."""
    level: int
    """A position in `state.LEVELS`."""

    @property
    def placed(self) -> bool:
        """Whether the poses of the bodies are known."""
        return not len(self.poses) or bool(self.poses[:, 3:].any())

    @classmethod
    def of(cls, frame: Frame, row: int) -> Snapshot:
        """Return the snapshot of a row of a tick; it keeps no other pair of the tick."""
        pairs = frame.pairs
        return cls(
            float(pairs.lower[row]),
            float(pairs.upper[row]),
            frame.stamp_s,
            frame.poses,
            pairs.points[row].copy(),
            int(pairs.status[row]),
            int(pairs.level[row]),
        )

    def frame(self, pair: PairName) -> Frame:
        """Return the tick with this pair alone."""
        told = Pairs(
            (pair,),
            np.array([self.lower]),
            np.array([self.upper]),
            self.points[None],
            np.array([self.status], np.int8),
            np.array([self.level], np.int8),
            np.zeros(1),
            np.array([self.stamp_s]),
            ("",),
        )
        return Frame(self.stamp_s, self.poses, told, whole=False)
