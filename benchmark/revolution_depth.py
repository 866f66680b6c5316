"""How deep solids of revolution overlap, and how long that takes beside their meshes."""

from __future__ import annotations

import itertools
from time import thread_time

import numpy as np
from numpy.typing import NDArray
from surfaces import at, turned

from proximity_monitor import engine

HERE = np.eye(4)
HEADINGS = [
    "queries", "fat arcs, ms", "max", "points", "our meshes, ms", "max", "points",
    "meshes / arcs",
]  # fmt: skip


def overlapping(a: engine.Model, b: engine.Model, count: int, seed: int) -> NDArray[np.float64]:
    """Poses (count, 4, 4) of b at which it certainly overlaps a."""
    rng = np.random.default_rng(seed)
    made: list[NDArray[np.float64]] = []
    while len(made) < count:
        way = rng.normal(size=3)
        pose = at(turned(rng), way / np.linalg.norm(way) * rng.uniform(0.0, 1.0))
        if engine.signed_distance(a, HERE, b, pose, depth_err=1e3).upper < 0.0:
            made.append(pose)
    return np.array(made)


def depths(
    solids: dict[str, engine.Model], meshes: dict[str, engine.Model], precision: float, count: int
) -> tuple[list[str], int]:
    """The row of a table, and how many answers contradict each other.

    Args:
        solids: of revolution.
        meshes: of each.
        precision: metres; how far a mesh is from its solid.
        count: of poses of each pair of solids, to 1 % of the depth.
    """
    times: dict[str, list[float]] = {"arcs": [], "meshes": []}
    points: dict[str, list[int]] = {"arcs": [], "meshes": []}
    wrong = 0
    for i, (one, two) in enumerate(itertools.combinations_with_replacement(solids, 2)):
        found = []
        many = overlapping(solids[one], solids[two], count, i)
        for key, models in (("arcs", solids), ("meshes", meshes)):
            pair = engine.Pair(models[one], models[two])
            pair.signed_distance(HERE, many[0])
            found.append([])
            for pose in many:
                start = thread_time()
                answer = pair.signed_distance(HERE, pose)
                times[key].append(1e3 * (thread_time() - start))
                points[key].append(answer.primitive_tests)
                found[-1].append(answer)
        for arcs, mesh in zip(*found, strict=True):  # the largest ball is that much larger at most
            wrong += arcs.lower > mesh.upper + 4.0 * precision
            wrong += mesh.lower > arcs.upper + 4.0 * precision
    row = [str(len(times["arcs"]))]
    for key in times:
        row += [f"{np.median(times[key]):.2f}", f"{np.max(times[key]):.1f}"]
        row.append(f"{np.median(points[key]):.0f}")
    return [*row, f"{np.median(times['meshes']) / np.median(times['arcs']):.1f}"], wrong
