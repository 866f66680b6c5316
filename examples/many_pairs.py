"""Many bodies, and all their pairs in one call.

python many_pairs.py
"""

from __future__ import annotations

import itertools

import numpy as np

from proximity_monitor import engine
from proximity_monitor.engine import shapes


def main() -> None:
    """Turn a row of boxes, and ask which pairs are nearer than 20 mm."""
    box = shapes.box((0.1, 0.1, 0.1))
    bodies = engine.Assembly([box] * 10)
    pairs = list(itertools.combinations(range(10), 2))
    for degrees in (0, 15, 30, 45):
        turn = np.radians(degrees)
        poses = np.tile(np.eye(4), (10, 1, 1))
        poses[:, 0, 3] = 0.145 * np.arange(10)
        poses[:, :2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
        answers = bodies.distances(poses, pairs, clearance=0.02)
        near = answers.within(0.02)
        print(f"{degrees} degrees: {near.sum()} of {len(pairs)} pairs may be nearer than 20 mm")


if __name__ == "__main__":
    main()
