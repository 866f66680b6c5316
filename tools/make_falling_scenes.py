"""Make the meshes of the bundled scenes `falling-tori` and `rings`.

    python tools/make_falling_scenes.py [FOLDER]

The shapes are those of the benchmark's scenes (study/shapes.py), which follow Larsen et al. 1999,
section 7.2: a lumpy torus of 3,240 triangles and a warped one of 1,332, in metres; and a ring of
256 triangles, in millimetres, here of 50 mm to the middle of its tube. FOLDER holds the scenes'
folders, and defaults to the package's own.

Coordinates are rounded to a thousandth of a millimetre. So every machine writes the same files,
although sines differ in the last bit between machines.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import ply

from proximity_monitor.study import shapes

SCENES = Path(__file__).resolve().parents[1] / "proximity_monitor" / "scene" / "bundled"
RING_RADIUS = 50.0


def main() -> None:
    """Write the three meshes."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else SCENES
    vertices, faces = shapes.ring()
    ring = RING_RADIUS * vertices, faces
    for name, mesh, unit, decimals in (
        ("falling-tori/meshes/lumpy.ply", shapes.lumpy_torus(), "metres", 6),
        ("falling-tori/meshes/warped.ply", shapes.warped_torus(), "metres", 6),
        ("rings/meshes/ring.ply", ring, "millimetres", 3),
    ):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        ply.write(path, np.round(mesh[0], decimals) + 0.0, mesh[1], unit, index="ushort")
        print(f"{name}: {len(mesh[0])} vertices, {len(mesh[1])} triangles")


if __name__ == "__main__":
    main()
