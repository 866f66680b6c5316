"""Make the models of the bundled scene `chess`: pawn, cup, bottle, table and light mill.

    python tools/make_chess_scene.py [FOLDER]

FOLDER defaults to the scene's own. Lengths are millimetres. The solids are in the spirit of those
of Son, Yoon, Kim and Elber 2020 (figure 7), drawn anew: each is a profile that turns about z. Every
profile is one cubic B-spline of 22 control points over the same knots, from its bottom on the axis
to its top on the axis. So any of them can be deformed into any other by its control points alone;
the scene's sixth solid goes through all five, as the paper's figure 10 does.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from proximity_monitor import engine

SCENE = Path(__file__).resolve().parents[1] / "proximity_monitor" / "scene" / "bundled" / "chess"

COUNT, DEGREE = 22, 3

PROFILES = {
    # (rho, z), millimetres. The first two points are level, and the last two: the ends are smooth.
    "pawn": [
        (0, 0), (14, 0), (29, 0), (37, 0.5), (36.5, 10), (26, 12.5), (29, 21.5), (18, 25),
        (12, 37), (9.5, 53), (21, 57.5), (21.5, 63.5), (9, 66), (20, 70.5), (27.5, 82), (25, 93),
        (18, 99), (12, 101), (9, 101.5), (6, 101.5), (3, 101.5), (0, 101.5),
    ],
    "cup": [
        (0, 2), (12, 2), (22, 0), (33, -1), (34, 4), (24, 6), (10, 8), (5, 14), (4.5, 22), (5, 32),
        (9, 37), (26, 41), (36, 55), (39, 75), (37, 97), (35.5, 101.5), (33.5, 97), (35, 76),
        (31.5, 58), (22, 48), (10, 45), (0, 45),
    ],
    "bottle": [
        (0, 6), (8, 6), (15, 1.5), (21, -0.5), (27, 0), (29, 4), (28, 11), (28, 21), (28, 32),
        (28, 43), (28, 54), (27, 63), (20, 69), (10, 75), (8.5, 88), (12.5, 94.5), (9, 101),
        (6.5, 98), (5.8, 88), (5.5, 79), (3, 76), (0, 76),
    ],
    "table": [
        (0, 0), (10, 0), (20, 0), (31, -0.5), (34, 2.5), (30, 5), (15, 7), (7, 10), (5.5, 22),
        (8, 34), (9, 44), (5, 54), (5.5, 64), (15, 68.5), (35, 70), (54, 70), (57, 75.5),
        (48, 76), (35, 76), (22, 76), (10, 76), (0, 76),
    ],
    "light_mill": [
        (0, 0), (12, 0), (22, 0), (27, 0.5), (26, 5), (12, 7), (5, 12), (4, 20), (8, 23.5),
        (8, 28), (4.5, 31), (6, 37), (20, 39), (32, 49), (35, 63), (31, 77), (20, 87), (7, 89),
        (3.5, 93), (3.2, 98), (2, 101), (0, 101),
    ],
}  # fmt: skip


def knots() -> np.ndarray:
    """Return the knots: uniform, and clamped at both ends."""
    inside = np.arange(1.0, COUNT - DEGREE)
    return np.concatenate((np.zeros(DEGREE + 1), inside, np.full(DEGREE + 1, COUNT - DEGREE)))


def solid(name: str) -> engine.SolidOfRevolution:
    """Return one of the five solids."""
    return engine.SolidOfRevolution([engine.Curve(PROFILES[name], knots())], name=name)


def main(folder: Path) -> None:
    """Write the five models."""
    models = folder / "models"
    models.mkdir(parents=True, exist_ok=True)
    for name in PROFILES:
        made = solid(name)
        engine.save_geomdl(made, models / f"{name}.json")
        print(f"{name}: {made.describe('{:g} mm'.format)}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else SCENE)
