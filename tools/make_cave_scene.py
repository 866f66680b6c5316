"""Make the bundled scene `cave`: a wrinkled torus, a cave of stalactites, and a way through it.

    python tools/make_cave_scene.py [FOLDER]

FOLDER defaults to the scene's own. Lengths are metres. The meshes are those of the benchmark's
scene of the same name (study/shapes.py), after the torus in a cave of Larsen et al. 1999, section
7.2. But here the stalactites are longer: they are shortened only to stay 0.15 m off the corridor.
The torus is 0.214 m from its centre to its farthest point and tumbles along the corridor. So it
passes between the stalactites only because it turns the right way; the scene's comment says how
near it comes.

Coordinates are rounded to a thousandth of a millimetre. So every machine writes the same files,
although sines differ in the last bit between machines.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
import ply

from proximity_monitor.study import shapes
from proximity_monitor.study.scenes import corridor

SCENE = Path(__file__).resolve().parents[1] / "proximity_monitor" / "scene" / "bundled" / "cave"

PERIOD_S = 60.0
KEYS = 160  # between two keys the torus turns by 9 degrees and moves by 0.1 m
TURNS = 4  # a whole number, so that the loop closes
AXIS = np.array([0.6, 0.0, 0.8])
CLEAR = 0.15


def path() -> np.ndarray:
    """Return the keys (n, 8): t, position, quaternion x, y, z, w; the last pose is the first."""
    times = np.linspace(0.0, PERIOD_S, KEYS + 1)
    half = np.linspace(0.0, TURNS * np.pi, KEYS + 1)
    quaternions = np.column_stack((np.sin(half)[:, None] * AXIS, np.cos(half)))
    return np.column_stack((times, corridor(KEYS + 1), quaternions))


def main(folder: Path) -> None:
    """Write both meshes and the path."""
    (folder / "meshes").mkdir(parents=True, exist_ok=True)
    made = {"torus": shapes.wrinkled_torus(), "cave": shapes.cave(corridor(400), clear=CLEAR)}
    comment = "metres; made by tools/make_cave_scene.py"
    for name, (vertices, faces) in made.items():
        file = folder / "meshes" / f"{name}.ply"
        ply.write(file, np.round(vertices, 6) + 0.0, faces, comment, real="float", index="ushort")
        print(f"{file.name}: {len(vertices)} vertices, {len(faces)} triangles")
    with (folder / "path.csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("t", "x", "y", "z", "qx", "qy", "qz", "qw"))
        writer.writerows([f"{value:.6f}" for value in row] for row in np.round(path(), 6) + 0.0)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else SCENE)
