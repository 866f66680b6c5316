"""Every kind of model against every kind: upper bounds of the distance in mm, row to column.

python kinds.py
"""

from __future__ import annotations

import numpy as np

from proximity_monitor import engine
from proximity_monitor.engine import shapes


def one_of_each() -> dict[str, engine.Model]:
    """Return a small model of each kind, by the kind's name."""
    profile = [[[0, 0], [0.03, 0]], [[0.03, 0], [0.05, 0.04], [0.02, 0.1]], [[0.02, 0.1], [0, 0.1]]]
    u = np.linspace(-0.05, 0.05, 4)
    x, y = np.meshgrid(u, u, indexing="ij")
    bowl = np.stack((x, y, 8.0 * (x * x + y * y)), axis=2)
    bent = [[0.0, 0.0, 0.0], [0.1, 0.05, 0.0], [0.1, 0.1, 0.1]]
    return {
        "mesh": shapes.box((0.1, 0.08, 0.06)),
        "surface": engine.ParametricSurface([engine.Patch(bowl)]),
        "revolution": engine.SolidOfRevolution([engine.Curve(each) for each in profile]),
        "rounded": shapes.capsule(0.02, 0.1),
        "curve": engine.ParametricSurface([engine.Curve(bent)]),
        "polyline": engine.polyline(bent),
        "points": engine.points(bent),
    }


def main() -> None:
    """Print the matrix."""
    kinds = one_of_each()
    here, there = np.eye(4), np.eye(4)
    there[:3, 3] = [0.3, 0.1, 0.05]
    print(" " * 11 + "".join(f"{name:>11}" for name in kinds))
    for name, a in kinds.items():
        row = []
        for b in kinds.values():
            answer = engine.signed_distance(a, here, b, there)
            assert answer.lower <= answer.upper
            row.append(f"{1000.0 * answer.upper:11.4f}")
        print(f"{name:11}" + "".join(row))


if __name__ == "__main__":
    main()
