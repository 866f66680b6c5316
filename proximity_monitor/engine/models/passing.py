"""At which parameters a Bezier piece passes a place, for messages about profiles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .bezier import bernstein

Reals = NDArray[np.float64]

_COUNT = 65
"""How many points are looked at in a range of the parameter."""
_CLOSER = 12
"""How often the range is narrowed. It becomes a sixteenth each time, so then it is a point."""
_COARSE = 2e-5
"""How far from the piece the place may be, as a share of the piece's largest coordinate."""


def passes(piece: Reals, place: Reals, often: int) -> list[float]:
    """Return the parameters at which a piece passes a place, ascending.

    Args:
        piece: (degree + 1, 3) homogeneous control points: rho w, z w and w.
        place: (2,) rho and z, metres.
        often: how many parameters to return, 1 or 2. If the piece passes only once, as at a cusp,
            both are equal.
    """
    low, high = 0.0, 1.0
    for _ in range(_CLOSER):
        t = np.linspace(low, high, _COUNT)
        rows = bernstein(len(piece) - 1, t, 1.0 - t) @ piece
        points = rows[:, :2] / rows[:, 2:]
        far = np.linalg.norm(points - place, axis=1)
        padded = np.concatenate(([np.inf], far, [np.inf]))
        nearest = np.flatnonzero((far < padded[:-2]) & (far <= padded[2:]))
        if often == 2:
            step = np.linalg.norm(np.diff(points, axis=0), axis=1)
            reach = np.maximum(np.append(step, 0.0), np.insert(step, 0, 0.0))
            near = nearest[far[nearest] <= reach[nearest] + _COARSE * np.abs(points).max()]
            if len(near) > 1:
                first, second = near[np.argsort(far[near], kind="stable")[:2]]
                middle = 0.5 * (t[first] + t[second])
                ranges = (low, middle), (middle, high)
                return [_nearest(piece, place, *each) for each in ranges]
        best = int(far.argmin())
        low, high = t[max(best - 2, 0)], t[min(best + 2, _COUNT - 1)]
    return [0.5 * (low + high)] * often


def _nearest(piece: Reals, place: Reals, low: float, high: float) -> float:
    """Return the parameter from `low` to `high` at which a piece is nearest to a place."""
    for _ in range(_CLOSER):
        t = np.linspace(low, high, _COUNT)
        rows = bernstein(len(piece) - 1, t, 1.0 - t) @ piece
        best = int(np.linalg.norm(rows[:, :2] / rows[:, 2:] - place, axis=1).argmin())
        low, high = t[max(best - 2, 0)], t[min(best + 2, _COUNT - 1)]
    return float(0.5 * (low + high))
