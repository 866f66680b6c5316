"""Make the meshes of the bundled scene `peg`: a peg and a bored block.

    python tools/make_peg_scene.py [FOLDER]

FOLDER defaults to the scene's own. Lengths are millimetres. The bore of the block has its axis on
z, its mouth at z = 0 and its floor at z = -40. The peg has its origin at the middle of its tip and
stands up along z.

**What the facets do to the clearance.** The peg is a polygon of 64 sides inscribed in a circle of
9.95 mm, the bore one of 80 sides circumscribed about a circle of 10.00 mm. If both are on one axis
and neither is turned about it, their distance is exactly ``10.00 - 9.95 cos(d)``, where d is the
least angle from a vertex of the peg to the middle of a side of the bore. At angle 0, and again
every 360 / gcd(64, 80) = 22.5 degrees, a vertex faces the middle of a side: d = 0, and the
clearance is 0.05 mm, as in the round parts. If the peg is moved aside by e along x, the distance is
exactly 0.05 - e: the vertex at angle 0 moves straight towards the middle of its side, and no other
vertex has a shorter way to go.

Coordinates are rounded to a millionth of a thousandth of a millimetre. So every machine writes the
same files, although sines differ in the last bit between machines.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import ply
from numpy.typing import NDArray

SCENE = Path(__file__).resolve().parents[1] / "proximity_monitor" / "scene" / "bundled" / "peg"

BORE, PEG = 10.00, 9.95
BORE_FACETS, PEG_FACETS = 80, 64
DEPTH = 40.0
MOUTH_CHAMFER, TIP_CHAMFER = 1.0, 1.5
Mesh = tuple[NDArray[np.float64], NDArray[np.int64]]


def ring(facets: int, *, around: bool) -> NDArray[np.float64]:
    """Return a regular polygon (facets, 2).

    It is inscribed in the unit circle with a vertex at angle 0; or, with `around`, circumscribed
    about it with the middle of a side at angle 0.
    """
    angle = 2.0 * np.pi / facets * (np.arange(facets) + (0.5 if around else 0.0))
    reach = 1.0 / np.cos(np.pi / facets) if around else 1.0
    return reach * np.column_stack((np.cos(angle), np.sin(angle)))


def walls(profile: list[tuple[float, float]], unit: NDArray[np.float64]) -> Mesh:
    """Return rings of (radius, z) joined by triangles, outward if the profile goes up outside."""
    n = len(unit)
    vertices = np.vstack([np.column_stack((r * unit, np.full(n, z))) for r, z in profile])
    here = np.arange(n)
    after = np.roll(here, -1)
    low = np.concatenate((np.column_stack((here, after, after + n)),
                          np.column_stack((here, after + n, here + n))))  # fmt: skip
    return vertices, np.concatenate([low + n * level for level in range(len(profile) - 1)])


def peg() -> Mesh:
    """Return a pin with a chamfered tip, and a head by which it is held."""
    profile = [
        (PEG - TIP_CHAMFER, 0.0), (PEG, TIP_CHAMFER), (PEG, 55.0), (14.0, 55.0), (14.0, 65.0),
    ]  # fmt: skip
    n = PEG_FACETS
    vertices, faces = walls(profile, ring(n, around=False))
    here = np.arange(n)
    after, tip = np.roll(here, -1), len(vertices)
    head = (len(profile) - 1) * n
    caps = [
        np.column_stack((after, here, np.full(n, tip))),
        np.column_stack((here + head, after + head, np.full(n, tip + 1))),
    ]
    middle = [(0.0, 0.0, 0.0), (0.0, 0.0, profile[-1][1])]
    return np.vstack((vertices, middle)), np.concatenate((faces, *caps))


def block() -> Mesh:
    """Return a square block with a blind bore, chamfered at its mouth."""
    profile = [
        (BORE, -DEPTH), (BORE, -MOUTH_CHAMFER), (BORE + MOUTH_CHAMFER, 0.0),
    ]  # fmt: skip
    n, side, bottom = BORE_FACETS, 30.0, -55.0
    vertices, inside = walls(profile, ring(n, around=True))
    here = np.arange(n)
    after, rim = np.roll(here, -1), 2 * n
    floor = len(vertices)
    square = side * np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)], dtype=float)
    top, base = floor + 1 + np.arange(4), floor + 5 + np.arange(4)
    corners = [np.column_stack((square, np.full(4, z))) for z in (0.0, bottom)]
    faces = [
        inside[:, ::-1],  # the material is outside the bore
        np.column_stack((here, after, np.full(n, floor))),
        # The top. A triangle joins each side of the rim to the corner of the quadrant in which the
        # side ends, and each side of the square to the rim's last vertex before a new quadrant.
        # each side of the square to the rim's last vertex before a new quadrant.
        np.column_stack((after + rim, here + rim, top[((here + 1) % n) * 4 // n])),
        np.array([
            (rim + (q * n // 4 + n - 1) % n, top[(q + 3) % 4], top[q]) for q in range(4)
        ]),
        *(np.array([(base[q], base[(q + 1) % 4], top[(q + 1) % 4]),
                    (base[q], top[(q + 1) % 4], top[q])]) for q in range(4)),
        np.array([(base[0], base[2], base[1]), (base[0], base[3], base[2])]),
    ]  # fmt: skip
    vertices = np.vstack((vertices, [(0.0, 0.0, -DEPTH)], *corners))
    return vertices, np.concatenate(faces)


def main(folder: Path) -> None:
    """Write both meshes."""
    (folder / "meshes").mkdir(parents=True, exist_ok=True)
    for make in (peg, block):
        vertices, faces = make()
        file = folder / "meshes" / f"{make.__name__}.ply"
        comment = "millimetres; made by tools/make_peg_scene.py"
        ply.write(file, np.round(vertices, 9) + 0.0, faces, comment)
        print(f"{file.name}: {len(vertices)} vertices, {len(faces)} triangles")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else SCENE)
