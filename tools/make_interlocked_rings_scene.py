"""Make the models of the bundled scene `interlocked-rings`: a ring, a post and a tray.

    python tools/make_interlocked_rings_scene.py [FOLDER]

FOLDER defaults to the scene's own. Lengths are millimetres. All models are solids of revolution.
The ring is an exact torus: its profile is a rational quadratic of nine control points. Post and
tray are cubic B-splines from axis to axis; the tray has a hollow profile with a rounded rim.

The script also prints the places of the twelve rings for the scene file. They form a necklace
whose neighbouring links are perpendicular: every other one is level, the others are upright.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np

from proximity_monitor import engine

BUNDLED = Path(__file__).resolve().parents[1] / "proximity_monitor" / "scene" / "bundled"
SCENE = BUNDLED / "interlocked-rings"

RING, TUBE = 50.0, 8.0
COUNT, APART, HEIGHT = 12, 65.0, 330.0
LEANING = math.radians(12.0)  # tilt of the necklace
MIDDLE = 65.0, 10.0

POST = [
    (0, 0), (30, 0), (58, 0), (70, 2), (67, 12), (42, 24), (32, 60), (29, 110), (33, 150),
    (54, 170), (63, 187), (50, 203), (22, 212), (0, 212),
]  # fmt: skip
TRAY = [
    (0, -12), (80, -12), (180, -12), (290, -12), (345, -8), (372, 12), (382, 45), (376, 58),
    (362, 50), (352, 20), (330, 2), (280, 0), (180, 0), (80, 0), (0, 0),
]  # fmt: skip


def spline(points: list, name: str) -> engine.SolidOfRevolution:
    """Return a solid whose profile is one cubic B-spline with uniform, clamped knots."""
    last = len(points) - 3
    knots = [0.0] * 3 + list(range(last + 1)) + [float(last)] * 3
    return engine.SolidOfRevolution([engine.Curve(points, knots)], name=name)


def ring() -> engine.SolidOfRevolution:
    """Return a torus about z."""
    rim = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
    points = [(RING + TUBE * x, TUBE * z) for x, z in rim]
    knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
    weights = [1, math.sqrt(0.5)] * 4 + [1]
    return engine.SolidOfRevolution([engine.Curve(points, knots, weights)], name="ring")


def places() -> list[str]:
    """Return the poses of the rings, as lines of the scene file."""
    radius = APART / (2.0 * math.sin(math.pi / COUNT))
    found = []
    lean = np.array([0.0, math.sin(0.5 * LEANING), 0.0, math.cos(0.5 * LEANING)])
    c, s = math.cos(LEANING), math.sin(LEANING)
    for k in range(COUNT):
        angle = 2.0 * math.pi * k / COUNT
        x, y = radius * math.cos(angle), radius * math.sin(angle)
        # Every other ring is level; the others stand in the plane of the circle's tangent and z.
        turn = [0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle)]
        own = [0.0, 0.0, 0.0, 1.0] if k % 2 == 0 else [0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)]
        q = product(lean, product(np.array(turn), np.array(own)))
        position = [MIDDLE[0] + c * x, MIDDLE[1] + y, HEIGHT - s * x]
        numbers = ", ".join(f"{each:.1f}" for each in position)
        turned = ", ".join(f"{each:.8f}" for each in q)
        found.append(f"ring_{k + 1}: {{position: [{numbers}], quaternion: [{turned}]}}")
    return found


def product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the product of two quaternions x, y, z, w."""
    vector = p[3] * q[:3] + q[3] * p[:3] + np.cross(p[:3], q[:3])
    return np.append(vector, p[3] * q[3] - p[:3] @ q[:3])


def main(folder: Path) -> None:
    """Write the three models, and print the rings' places."""
    models = folder / "models"
    models.mkdir(parents=True, exist_ok=True)
    for made in (ring(), spline(POST, "post"), spline(TRAY, "tray")):
        engine.save_geomdl(made, models / f"{made.name}.json")
        print(f"{made.name}: {made.describe('{:g} mm'.format)}")
    print(*places(), sep="\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else SCENE)
