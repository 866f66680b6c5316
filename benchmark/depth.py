"""How long the depth of overlapping solids takes, on one thread: the largest ball in both.

    python benchmark/depth.py [--quick]

Takes the processor time of one question at each pose, to 1 % of the depth unless the row says
otherwise. The shortest of three rounds counts, each without a remembered answer; the row with the
last ball as seed is timed once. `points` counts the places at which the depth in both solids was
computed. The `collide` rows ask about the same solids at the same poses.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterable
from time import process_time

import numpy as np
import trimesh
from numpy.typing import NDArray

from proximity_monitor import engine

Poses = list[tuple[NDArray, NDArray]]


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="only a tenth of the poses")
    quick = parser.parse_args(arguments).quick
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    frames, pairs = (6, 20) if quick else (60, 165)
    parts = _parts()
    _ask(parts["box"], parts["box"], [(np.eye(4), np.eye(4))])  # compiles
    print("solids, to 1 % of the depth unless stated   median ms  longest ms  points")
    fine = _mesh(trimesh.creation.icosphere(6))  # 81,920 triangles
    for overlap in (0.1, 0.01, 0.001):
        poses = _pushed(frames, overlap)
        _show(f"spheres of 82,000 triangles by {overlap:g} m", _ask(fine, fine, poses))
        _show("  with the last ball as seed", _ask(fine, fine, poses, remembered=True))
        _show("  certain that they overlap", _ask(fine, fine, poses, depth_err=1e9))
        _show("  collide", _collide(fine, fine, poses))
    for name, a, b, apart in (
        ("crossed bars", _box(4.0, 0.2, 0.2), _box(0.2, 4.0, 0.2), (0.3, 0.1, 0.05)),
        ("plates, 0.5 m of 1 m", _box(100, 100, 1), _box(100, 100, 1), (0.3, 0.2, 0.5)),
        ("a cube twice", _box(1, 1, 1), _box(1, 1, 1), (0.0, 0.0, 0.0)),
        ("torus in a sphere", parts["torus"], fine, (0.5, 0.2, 0.1)),
    ):
        _show(name, _ask(a, b, _turned(frames // 3, apart)))
    chosen = _overlapping(parts, pairs)
    for err in (0.1, 0.01, 0.001):
        found = [_ask(a, b, [poses], depth_err=err)[0] for a, b, poses in chosen]
        _show(f"{pairs} pairs of mechanical parts, to {err:.1%}", found)
    return 0


def _show(name: str, found: list[tuple[float, int]]) -> None:
    times, points = np.array(found, float).T
    print(
        f"{name:42} {1e3 * np.median(times):10.3f} {1e3 * times.max():11.3f} "
        f"{np.median(points):7.0f}"
    )


def _timed(ask: Callable[[], int]) -> tuple[float, int]:
    """Return the shortest of three processor times (s), and the count that `ask` returns."""
    best, count = np.inf, 0
    for _ in range(3):
        start = process_time()
        count = ask()
        best = min(best, process_time() - start)
    return best, count


def _ask(
    a: engine.TriangleMesh, b: engine.TriangleMesh, poses: Poses, *, depth_err: float = 0.01,
    remembered: bool = False,
) -> list[tuple[float, int]]:  # fmt: skip
    """Return for each pose the time (s) and how many points were tested."""
    found, pair = [], engine.Pair(a, b)
    for here, there in poses:

        def ask(here: NDArray = here, there: NDArray = there) -> int:
            chosen = pair if remembered else engine.Pair(a, b)
            answer = chosen.signed_distance(here, there, depth_err=depth_err)
            assert answer.upper < 0.0
            return answer.primitive_tests

        if remembered:  # timed once: asked again, it would start from its own answer
            start = process_time()
            count = ask()
            found.append((process_time() - start, count))
        else:
            found.append(_timed(ask))
    return found[1:] if remembered else found


def _collide(
    a: engine.TriangleMesh, b: engine.TriangleMesh, poses: Poses
) -> list[tuple[float, int]]:
    return [
        _timed(lambda at=at: engine.collide(a, at[0], b, at[1]).primitive_tests) for at in poses
    ]


def _overlapping(
    parts: dict[str, engine.TriangleMesh], count: int
) -> list[tuple[engine.TriangleMesh, engine.TriangleMesh, tuple[NDArray, NDArray]]]:
    """Return pairs of parts at random poses at which they overlap."""
    rng, names, found = np.random.default_rng(1), sorted(parts), []
    while len(found) < count:
        a, b = (parts[name] for name in rng.choice(names, 2))
        here, there = _pose(rng), _pose(rng)
        there[:3, 3] = 0.6 * rng.normal(size=3)
        if engine.signed_distance(a, here, b, there, depth_err=1e9).upper < 0.0:
            found.append((a, b, (here, there)))
    return found


def _pushed(count: int, overlap: float) -> Poses:
    """Return poses of two unit spheres that overlap, in a direction that turns slowly."""
    turn, poses = _pose(np.random.default_rng(3)), []
    for angle in np.linspace(0.0, 0.3, count):
        there = turn.copy()
        there[:3, 3] = (2.0 - overlap) * np.array([np.cos(angle), np.sin(angle), 0.1])
        there[:3, 3] *= (2.0 - overlap) / np.linalg.norm(there[:3, 3])
        poses.append((np.eye(4), there))
    return poses


def _turned(count: int, apart: Iterable[float]) -> Poses:
    """Return poses of two bodies at a fixed relative position, turned together at random."""
    rng, shift = np.random.default_rng(5), np.eye(4)
    shift[:3, 3] = list(apart)
    return [(here, here @ shift) for here in (_pose(rng) for _ in range(count))]


def _pose(rng: np.random.Generator) -> NDArray:
    matrix = np.eye(4)
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    matrix[:3, :3] = q * np.sign(np.diag(r))
    matrix[:3, 0] *= np.sign(np.linalg.det(matrix[:3, :3]))
    return matrix


def _mesh(mesh: trimesh.Trimesh) -> engine.TriangleMesh:
    return engine.TriangleMesh(mesh.vertices, mesh.faces)


def _box(*size: float) -> engine.TriangleMesh:
    return _mesh(trimesh.creation.box(size))


def _parts() -> dict[str, engine.TriangleMesh]:
    made = trimesh.creation
    teeth = np.tile([1.15, 1.15, 1.0, 1.0], 24)
    return {
        "gear": _ring(teeth, 0.3, 0.3),
        "washer": _ring(np.full(48, 0.9), 0.4, 0.15),
        "angle": _angle(),
        "torus": _mesh(made.torus(0.8, 0.25, major_sections=48, minor_sections=24)),
        "capsule": _mesh(made.capsule(1.0, 0.3, count=[24, 24])),
        "cylinder": _mesh(made.cylinder(0.4, 1.6, sections=40)),
        "box": _box(1.2, 0.8, 0.5),
        "sphere": _mesh(made.icosphere(3, 0.7)),
        "fine sphere": _mesh(made.icosphere(5, 0.7)),
    }


def _ring(radii: NDArray, hole: float, height: float) -> engine.TriangleMesh:
    """Return a disc whose outline has these radii, with a round hole."""
    n = len(radii)
    angle = 2.0 * np.pi * np.arange(n) / n
    around = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    flat = np.concatenate((radii[:, None] * around, hole * around))
    vertices = np.concatenate([np.c_[flat, np.full(2 * n, z)] for z in (-height / 2, height / 2)])
    i, j = np.arange(n), np.roll(np.arange(n), -1)
    quads = np.concatenate(
        [
            np.stack(corners, axis=1)
            for corners in (
                (i, j, 2 * n + j, 2 * n + i),  # outside
                (n + j, n + i, 3 * n + i, 3 * n + j),  # in the hole
                (2 * n + i, 2 * n + j, 3 * n + j, 3 * n + i),  # above
                (j, i, n + i, n + j),  # below
            )
        ]
    )
    return engine.TriangleMesh(vertices, np.concatenate((quads[:, :3], quads[:, [0, 2, 3]])))


def _angle() -> engine.TriangleMesh:
    """Return an L-shaped bracket."""
    flat = np.array([[0, 0], [1.5, 0], [1.5, 0.4], [0.4, 0.4], [0.4, 1.2], [0, 1.2]]) - (0.5, 0.4)
    vertices = np.concatenate([np.c_[flat, np.full(6, z)] for z in (-0.25, 0.25)])
    faces = []
    for i in range(6):
        j = (i + 1) % 6
        faces += [[i, j, 6 + j], [i, 6 + j, 6 + i]]
    for a, b, c in ((0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)):
        faces += [[6 + a, 6 + b, 6 + c], [c, b, a]]
    return engine.TriangleMesh(vertices, faces)


if __name__ == "__main__":
    sys.exit(main())
