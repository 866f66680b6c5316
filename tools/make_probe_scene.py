"""Make the bundled scene `probe`: a carved pebble, and the path of a probe's tip over it.

    python tools/make_probe_scene.py [FOLDER]

FOLDER defaults to the scene's own. Lengths are millimetres. The pebble is star-shaped about its
origin: in the direction (x, y, z) of length 1 its surface is at
``40 + 6 (x^3 - 3 x y^2) + 4 z (x^2 - y^2)``: waves of three and of two periods round its axis,
which vanish smoothly at the poles. The tip goes three times up and down while it goes round twice.
Each time it comes as near as 0.3 mm to the smooth shape, which is 0.31 mm to the mesh, because the
mesh's facets lie a little inside the smooth shape.

Coordinates are rounded to a millionth of a millimetre. So every machine writes the same files,
although sines differ in the last bit between machines.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
import ply
from numpy.typing import NDArray

from proximity_monitor.study import shapes

SCENE = Path(__file__).resolve().parents[1] / "proximity_monitor" / "scene" / "bundled" / "probe"

AROUND, BANDS = 120, 85
PERIOD_S, KEYS = 24.0, 480
NEAREST, FARTHEST = 0.3, 15.0


def height(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return distances (n,) of the surface from the origin along unit vectors (n, 3)."""
    x, y, z = direction.T
    return 40.0 + 6.0 * (x**3 - 3.0 * x * y**2) + 4.0 * z * (x**2 - y**2)


def path() -> NDArray[np.float64]:
    """Return the keys (n, 4): t and position; the last repeats the first position."""
    share = np.linspace(0.0, 1.0, KEYS + 1)
    azimuth = 4.0 * np.pi * share
    z = 0.7 * np.sin(6.0 * np.pi * share)
    across = np.sqrt(1.0 - z**2)
    direction = np.column_stack((across * np.cos(azimuth), across * np.sin(azimuth), z))
    above = NEAREST + (FARTHEST - NEAREST) * (0.5 + 0.5 * np.cos(6.0 * np.pi * share))
    return np.column_stack((PERIOD_S * share, (height(direction) + above)[:, None] * direction))


def main(folder: Path) -> None:
    """Write the mesh and the path."""
    (folder / "meshes").mkdir(parents=True, exist_ok=True)
    unit, faces = shapes.sphere(1.0, AROUND, BANDS)
    vertices = np.round(height(unit)[:, None] * unit, 6) + 0.0
    file = folder / "meshes" / "pebble.ply"
    ply.write(file, vertices, faces, "millimetres; made by tools/make_probe_scene.py",
              real="float", index="ushort")  # fmt: skip
    print(f"{file.name}: {len(vertices)} vertices, {len(faces)} triangles")
    with (folder / "path.csv").open("w", newline="") as table:
        writer = csv.writer(table, lineterminator="\n")
        writer.writerow(("t", "x", "y", "z", "qx", "qy", "qz", "qw"))
        for row in np.round(path(), 6) + 0.0:
            writer.writerow((*(f"{value:.6f}" for value in row), 0, 0, 0, 1))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else SCENE)
