"""The distance of two parts while one comes down onto the other; every number is certified.

    python clearance.py FIXED.stl MOVING.stl

The files are in millimetres. The second part starts 40 mm above the first and comes down.
"""

from __future__ import annotations

import sys

import numpy as np

from proximity_monitor import engine


def main() -> None:
    """Ask about one pair at several poses."""
    fixed, moving = (engine.load(path, unit=0.001) for path in sys.argv[1:3])
    pair = engine.Pair(fixed, moving)  # remembers its last answer, which makes the next one cheap
    here, pose = np.eye(4), np.eye(4)
    for height_mm in (40.0, 20.0, 11.0, 5.0):
        pose[2, 3] = height_mm / 1000.0
        answer = pair.signed_distance(here, pose)  # negative if solids overlap
        lower, upper = answer.lower * 1000.0, answer.upper * 1000.0
        print(f"at {height_mm:4g} mm: {lower:.6f} <= clearance <= {upper:.6f} mm")
    print(f"nearest points: {answer.point_a.round(6)} and {answer.point_b.round(6)} m")


if __name__ == "__main__":
    main()
