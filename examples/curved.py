"""Exact curved parts: a NURBS patch, and a solid of revolution that changes its shape.

python curved.py
"""

from __future__ import annotations

import numpy as np

from proximity_monitor import engine


def main() -> None:
    """Measure, deform, measure again."""
    bottom = engine.Curve([[0.0, 0.0], [0.03, 0.0]])  # (rho, z), metres
    wall = engine.Curve([[0.03, 0.0], [0.05, 0.04], [0.02, 0.1]])  # a Bezier curve of degree 2
    top = engine.Curve([[0.02, 0.1], [0.0, 0.1]])
    vase = engine.SolidOfRevolution([bottom, wall, top])

    side = np.linspace(-0.1, 0.1, 4)
    x, y = np.meshgrid(side, side, indexing="ij")
    sheet = engine.Patch(np.stack((x, y, 5.0 * x * y), axis=2))  # bicubic

    here, above = np.eye(4), np.eye(4)
    above[:3, 3] = [0.0, 0.0, 0.15]
    pair = engine.Pair(vase, sheet)
    answer = pair.distance(here, above)
    print(f"{1000 * answer.lower:.9f} <= distance <= {1000 * answer.upper:.9f} mm")
    for name, feature in (("vase", answer.feature_a), ("sheet", answer.feature_b)):
        print(f"  on the {name}: {feature.kind} {feature.index} at {feature.parameters.round(6)}")

    taller = vase.control_points * [1.0, 1.0, 1.2]
    moved = vase.deform(taller)  # an upper bound of how far any point of the vase moved
    answer = pair.distance(here, above)
    print(f"after a change of {1000 * moved:.1f} mm: {1000 * answer.upper:.9f} mm")


if __name__ == "__main__":
    main()
