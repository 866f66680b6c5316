"""Closest points of a 40,000-triangle sphere: this engine and fcpw side by side, on one thread.

    python benchmark/points.py [--points N]

Measures the processor time, of all threads, of one call for a block of points. Each library gets
arrays in its preferred layout (fcpw: float32, column-major). fcpw's list for the answers is made
before. fcpw builds its tree by the surface area heuristic, the fastest of its five; `vectorize`
changes nothing in the published wheels.
"""

from __future__ import annotations

import argparse
import os
import sys
from importlib import metadata
from time import process_time

import numpy as np

from proximity_monitor import engine
from proximity_monitor.study import shapes

_BLOCK = 10_000
_SINGLE = 1e-5
"""By how much the distances may differ: fcpw computes with six digits."""


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "--points", type=int, default=200_000, help="number of points (%(default)s)"
    )
    count = parser.parse_args(arguments).points
    # Must come before fcpw counts the processors: it would share a block among them.
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    try:
        import fcpw
    except ImportError:
        sys.exit("no other library to compare with: pip install fcpw")

    vertices, faces = shapes.sphere(1.0)
    points = np.random.default_rng(8).uniform(-2.0, 2.0, (count, 3)).astype(np.float32)
    mesh = engine.TriangleMesh(vertices, faces)
    scene = fcpw.scene_3D()
    scene.set_object_count(1)
    scene.set_object_vertices(np.asfortranarray(vertices, np.float32), 0)
    scene.set_object_triangles(np.asfortranarray(faces), 0)
    scene.build(fcpw.aggregate_type.bvh_surface_area, vectorize=True)
    pose = np.eye(4)
    engine.closest_points(mesh, pose, points[:1])  # compiles

    seconds: dict[str, list[float]] = {"ours": [], "fcpw": []}
    worst = 0.0
    for turn, start in enumerate(range(0, count, _BLOCK)):
        block = points[start : start + _BLOCK]
        double = block.astype(np.float64)
        columns, radii = np.asfortranarray(block), np.full(len(block), np.inf, np.float32)
        found = fcpw.interaction_3D_list()
        for name in ("ours", "fcpw") if turn % 2 else ("fcpw", "ours"):
            began = process_time()
            if name == "ours":
                nearest = engine.closest_points(mesh, pose, double)
            else:
                scene.find_closest_points(columns, radii, found)
            seconds[name].append((process_time() - began) / len(block))
        theirs = np.array([interaction.d for interaction in found])
        worst = max(worst, float(np.abs(theirs - nearest.upper).max()))

    ours, fcpw_s = (float(np.median(seconds[name])) for name in ("ours", "fcpw"))
    print(f"fcpw {metadata.version('fcpw')}, {count} points\n")
    print("| ours, points/s | fcpw, points/s | ratio | largest difference |")
    print("| --- | --- | --- | --- |")
    print(f"| {1.0 / ours:.0f} | {1.0 / fcpw_s:.0f} | {fcpw_s / ours:.2f} | {worst:.1e} |")
    if not worst < _SINGLE:
        print("THE ENGINES DISAGREE", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
