"""What it costs if triangles share no vertices, or come twice: queries, builds and refits.

    python benchmark/welding.py [--quick]

Times are processor time on one thread. The copies of a scene (welded, unwelded, each triangle
twice) take turns, block by block of successive poses. Figures of the other copies are ratios to the
welded one; that of a query is the median over the blocks. Ends with status 1 if two copies give
different distances.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from time import thread_time

import numpy as np

from proximity_monitor import engine
from proximity_monitor.study.scenes import SCENES, StudyScene
from proximity_monitor.study.shapes import Mesh

_SCENES = ("cave/random", "cave/path", "tori", "spheres/0.1", "concentric/0.5")
_BLOCK = 64
_REPEATS = 5
"""How often each copy is built and refitted; the least time counts."""


def _unwelded(vertices: np.ndarray, faces: np.ndarray) -> Mesh:
    """Return the same triangles, each with three vertices of its own, as STL files hold them."""
    return vertices[faces].reshape(-1, 3), np.arange(faces.size, dtype=np.int32).reshape(-1, 3)


def _twice(vertices: np.ndarray, faces: np.ndarray) -> Mesh:
    """Return each triangle twice, so that each has a twin that is exactly as near."""
    return vertices, np.concatenate((faces, faces))


_COPIES: dict[str, Callable[[np.ndarray, np.ndarray], Mesh]] = {
    "welded": lambda vertices, faces: (vertices, faces),
    "unwelded": _unwelded,
    "drawn twice": _twice,
}


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="only a few blocks of each scene")
    blocks = 4 if parser.parse_args(arguments).quick else 24
    others = list(_COPIES)[1:]
    columns = [
        f"{name}, {what}" for name in others for what in ("query", "tests", "build", "refit")
    ]
    print("| scene | welded, µs |", " | ".join(columns), "|")
    print("| --- " * (2 + len(columns)) + "|")
    agreed = True
    for name in _SCENES:
        scene = SCENES[name]()
        models, builds, refits = _build(scene)
        times, tests, same = _query(scene, models, blocks)
        agreed = agreed and same
        row = [1e6 * float(np.median(times["welded"]))]
        for other in others:
            row += [float(np.median(times[other] / times["welded"]))]
            row += [each[other] / each["welded"] for each in (tests, builds, refits)]
        print(f"| {name} | " + " | ".join(f"{value:.2f}" for value in row) + " |")
    if not agreed:
        print("THE COPIES DISAGREE", file=sys.stderr)
    return 0 if agreed else 1


def _build(scene: StudyScene) -> tuple[dict, dict[str, float], dict[str, float]]:
    """Return models by copy and mesh, and each copy's seconds to build and to refit all models."""
    models: dict[str, dict[str, engine.TriangleMesh]] = {name: {} for name in _COPIES}
    builds, refits = dict.fromkeys(_COPIES, 0.0), dict.fromkeys(_COPIES, 0.0)
    for mesh_name, mesh in scene.meshes.items():
        for copy, change in _COPIES.items():
            vertices, faces = change(*mesh)
            build, refit = [], []
            for _ in range(_REPEATS):
                start = thread_time()
                model = engine.TriangleMesh(vertices, faces)
                built = thread_time()
                model.deform(vertices)
                build.append(built - start)
                refit.append(thread_time() - built)
            models[copy][mesh_name] = model
            builds[copy] += min(build)
            refits[copy] += min(refit)
    return models, builds, refits


def _query(
    scene: StudyScene, models: dict, blocks: int
) -> tuple[dict[str, np.ndarray], dict[str, int], bool]:
    """Return each copy's seconds a query by block, its tests, and whether all answers agree."""
    track = scene.tracks[0]
    pairs = {copy: engine.Pair(meshes[track.a], meshes[track.b]) for copy, meshes in models.items()}
    for pair in pairs.values():  # compiles
        pair.distance(track.poses_a[0], track.poses_b[0])
    last = max(len(track.poses_a) - _BLOCK, 1)
    seconds: dict[str, list[float]] = {copy: [] for copy in _COPIES}
    tests = dict.fromkeys(_COPIES, 0)
    agreed = True
    for turn, first in enumerate(np.linspace(0, last, blocks).astype(int)):
        poses = list(zip(track.poses_a[first:], track.poses_b[first:], strict=True))[:_BLOCK]
        found = {}
        order = list(_COPIES)[turn % len(_COPIES) :] + list(_COPIES)[: turn % len(_COPIES)]
        for copy in order:
            ask = pairs[copy].distance
            ask(*poses[0])
            start = thread_time()
            answers = [ask(*pose) for pose in poses]
            seconds[copy].append((thread_time() - start) / len(poses))
            tests[copy] += sum(answer.bound_tests + answer.primitive_tests for answer in answers)
            found[copy] = np.array([answer.upper for answer in answers])
        for copy in _COPIES:
            agreed = agreed and bool(np.allclose(found[copy], found["welded"], rtol=1e-12))
    return {copy: np.array(values) for copy, values in seconds.items()}, tests, agreed


if __name__ == "__main__":
    sys.exit(main())
