"""Write two STL files in millimetres to try things on: a ring, and a pin that fits into it.

    python two_parts.py [FOLDER]

The ring's bore has a radius of 10.05 mm, the pin one of 10 mm. Both stand on the plane z = 0; the
ring is 10 mm high, the pin 30 mm. Both are prisms of 64 sides whose corners lie at the same angles.
"""

from __future__ import annotations

import itertools
import sys
from pathlib import Path

import numpy as np

SIDES = 64


def circle(radius: float, z: float) -> np.ndarray:
    """Return the corners (SIDES, 3) of a polygon about z."""
    turn = np.arange(SIDES) * 2.0 * np.pi / SIDES
    return np.stack((radius * np.cos(turn), radius * np.sin(turn), np.full(SIDES, z)), axis=1)


def band(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return triangles (2 SIDES, 3, 3) between two polygons, facing outward if b is above a."""
    a_next, b_next = np.roll(a, -1, axis=0), np.roll(b, -1, axis=0)
    return np.concatenate((np.stack((a, a_next, b_next), axis=1), np.stack((a, b_next, b), axis=1)))


def lathe(*polygons: np.ndarray) -> np.ndarray:
    """Return the triangles of the bands between successive polygons."""
    return np.concatenate([band(a, b) for a, b in itertools.pairwise(polygons)])


def ring(inner: float, outer: float, height: float) -> np.ndarray:
    """Return the triangles of a ring that stands on its origin."""
    low, high = circle(outer, 0.0), circle(outer, height)
    top, bottom = circle(inner, height), circle(inner, 0.0)
    return lathe(low, high, top, bottom, low)


def pin(radius: float, length: float) -> np.ndarray:
    """Return the triangles of a pin that stands on its origin."""
    low, high = circle(radius, 0.0), circle(radius, length)
    return lathe(circle(0.0, 0.0), low, high, circle(0.0, length))


def write_stl(path: Path, triangles: np.ndarray) -> None:
    """Write a binary STL file; triangles (m, 3, 3)."""
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    facets = np.zeros(len(triangles), record)
    facets["corners"] = triangles
    path.write_bytes(bytes(80) + np.uint32(len(facets)).tobytes() + facets.tobytes())
    print(f"{path.name}: {len(facets)} triangles")


def main() -> None:
    """Write both files."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    write_stl(folder / "ring.stl", ring(10.05, 20.0, 10.0))
    write_stl(folder / "pin.stl", pin(10.0, 30.0))


if __name__ == "__main__":
    main()
