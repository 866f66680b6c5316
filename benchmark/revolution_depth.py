"""Measure how deep solids of revolution overlap, and how long that takes beside their meshes."""

from __future__ import annotations

import itertools
from time import thread_time

import numpy as np
from numpy.typing import NDArray
from surface_scenes import at, turned

from proximity_monitor import engine

HERE = np.eye(4)
HEADINGS = [
    "queries", "fat arcs, ms", "max", "points", "our meshes, ms", "max", "points",
    "meshes / arcs",
]  # fmt: skip
FITTED = ["too wide by, m", "queries", "ms", "max", "bounds", "not to 1 %"]


def overlapping(a: engine.Model, b: engine.Model, count: int, seed: int) -> NDArray[np.float64]:
    """Return poses (count, 4, 4) of b at which it certainly overlaps a."""
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
    """Time the depth of all pairs of solids and of their meshes, to 1 % of the depth.

    Args:
        solids: of revolution, by name.
        meshes: a mesh of each solid, by the same name.
        precision: metres; how far a mesh may be from its solid.
        count: how many poses of each pair are asked about.

    Returns:
        The row of a table, and how many answers contradict each other.
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
        for arcs, mesh in zip(*found, strict=True):  # how much larger a ball can be in a mesh
            wrong += arcs.lower > mesh.upper + 4.0 * precision
            wrong += mesh.lower > arcs.upper + 4.0 * precision
    row = [str(len(times["arcs"]))]
    for key in times:
        row += [f"{np.median(times[key]):.2f}", f"{np.max(times[key]):.1f}"]
        row.append(f"{np.median(points[key]):.0f}")
    return [*row, f"{np.median(times['meshes']) / np.median(times['arcs']):.1f}"], wrong


def fits(count: int) -> tuple[list[list[str]], int]:
    """Return the rows of a table of press fits, and how many answers contradict each other.

    A shaft is 1 m long, and its radius exceeds that of the bore, 0.6 m, by `wide`. It is off the
    bore's axis and tilted by up to half of `wide`. Each pair is asked about in both orders, to 1 %
    of the depth.
    """
    corners = np.array([[0.6, -0.5], [0.8, -0.5], [0.8, 0.5], [0.6, 0.5], [0.6, -0.5]])
    bore = engine.SolidOfRevolution([engine.Curve(corners[i : i + 2]) for i in range(4)])
    rows, wrong = [], 0
    for wide in (1e-2, 1e-3, 1e-4):
        shaft, rng = engine.shapes.cylinder(0.6 + wide, 1.0), np.random.default_rng(4)
        engine.signed_distance(shaft, HERE, bore, HERE)
        times, bounds, loose = [], [], 0
        for _ in range(count):
            off, angle = rng.uniform(-0.35 * wide, 0.35 * wide, 2), rng.uniform(0.0, 0.5 * wide)
            turn = np.eye(3)
            turn[0, 0] = turn[2, 2] = np.cos(angle)
            turn[0, 2], turn[2, 0] = np.sin(angle), -np.sin(angle)
            pose = at(turn, (*off, rng.uniform(-0.3, 0.3)))
            found = []
            for a, pose_a, b, pose_b in ((shaft, pose, bore, HERE), (bore, HERE, shaft, pose)):
                start = thread_time()
                found.append(engine.signed_distance(a, pose_a, b, pose_b))
                times.append(1e3 * (thread_time() - start))
            bounds += [each.bound_tests for each in found]
            loose += sum(each.upper - each.lower > -0.0101 * each.upper for each in found)
            wrong += found[0].lower > found[1].upper or found[1].lower > found[0].upper
        rows.append([
            f"{wide:g}", str(len(times)), f"{np.median(times):.2f}", f"{np.max(times):.1f}",
            f"{np.median(bounds):.0f}", str(loose),
        ])  # fmt: skip
    return rows, wrong
