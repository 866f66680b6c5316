"""Measure one scene with all engines side by side: times, work, sizes, and agreement."""

from __future__ import annotations

import gc
from collections.abc import Callable, Sequence
from functools import partial
from time import thread_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from peers import Coal, Fcl

from proximity_monitor import engine
from proximity_monitor.engine.questions.result import Distances
from proximity_monitor.study.scenes import StudyScene, Track

REL_ERR = 0.1

Bounds = NDArray[np.float64]
"""(2, k) metres: lower and upper bounds, which are equal if an engine gives only a distance."""


class Single:
    """This engine, one call from Python for each query; each pair remembers its last answer."""

    def __init__(self, name: str, rel_err: float) -> None:
        self.name = name
        self.tests: list[tuple[int, int]] = []
        self.witness_error = 0.0
        self._rel_err = rel_err
        self._pairs: dict[int, engine.Pair] = {}

    def queries(self, a: Any, b: Any, track: Track, steps: slice) -> list[Callable[[], Any]]:
        """Return a function for each step."""
        pair = self._pairs.setdefault(id(track), engine.Pair(a, b))
        return [
            partial(pair.distance, p, q, rel_err=self._rel_err)
            for p, q in zip(track.poses_a[steps], track.poses_b[steps], strict=True)
        ]

    def bounds(self, answers: list[engine.Distance]) -> Bounds:
        """Return the answers' bounds; record their tests and the error of their witness points."""
        self.tests += [(d.bound_tests, d.primitive_tests) for d in answers]
        for d in answers:
            error = abs(float(np.linalg.norm(d.point_a - d.point_b)) - d.upper)
            self.witness_error = max(self.witness_error, error)
        return np.array([(d.lower, d.upper) for d in answers]).T


class Batch:
    """This engine, one call for all poses of a block, which share the overhead of Python."""

    def __init__(self, name: str, rel_err: float) -> None:
        self.name = name
        self._rel_err = rel_err

    def queries(self, a: Any, b: Any, track: Track, steps: slice) -> list[Callable[[], Any]]:
        """Return one function for all steps."""
        poses = {"poses_a": track.poses_a[steps], "poses_b": track.poses_b[steps]}
        return [partial(engine.distances, a=a, b=b, **poses, rel_err=self._rel_err)]

    def bounds(self, answers: list[Distances]) -> Bounds:
        """Return the answers' bounds."""
        return np.concatenate([(d.lower, d.upper) for d in answers], axis=1)


class Peer:
    """A C++ library, one call from Python for each query."""

    def __init__(self, library: Fcl | Coal) -> None:
        self.name = library.name
        self._library = library

    def queries(self, a: Any, b: Any, track: Track, steps: slice) -> list[Callable[[], Any]]:
        """Return a function for each step."""
        return self._library.queries(a, track.poses_a[steps], b, track.poses_b[steps])

    def bounds(self, answers: list[float]) -> Bounds:
        """Return the distances; any negative one (of crossing bodies) becomes 0."""
        return np.maximum((answers, answers), 0.0)


Entrant = Single | Batch | Peer


def measure(
    scene: StudyScene,
    libraries: Sequence[Fcl | Coal],
    quick: bool,
    advance: Callable[[float], None],
) -> dict[str, float]:
    """Time a scene; return the columns by name, times in microseconds a query.

    The engines take turns, block by block of successive steps, and each block begins with another
    engine. So a disturbance of the machine affects all of them.

    Args:
        scene: the models and poses to ask about.
        libraries: the peers to compare with.
        quick: take a few blocks only, spread over the steps.
        advance: called after each block with the block's share of the work.
    """
    models, row = _build(scene, libraries)
    exact, rough = Single("ours", 0.0), Single("ours_10", REL_ERR)
    batches = Batch("batch", 0.0), Batch("batch_10", REL_ERR)
    entrants: list[Entrant] = [exact, rough, *batches, *map(Peer, libraries)]
    for entrant in entrants:  # compiles, and brings the libraries into memory
        _ask(entrant, models, scene.tracks[:1], slice(0, 1))
    exact.tests, rough.tests = [], []

    starts = np.arange(0, len(scene.tracks[0].poses_a), scene.block)
    if quick:
        starts = starts[np.linspace(0, len(starts) - 1, scene.quick_blocks + 2).astype(int)[1:-1]]
    seconds: dict[str, list[NDArray[np.float64]]] = {e.name: [] for e in entrants}
    bounds: dict[str, list[Bounds]] = {e.name: [] for e in entrants}
    for turn, start in enumerate(starts):
        first = turn % len(entrants)
        for entrant in entrants[first:] + entrants[:first]:
            steps = slice(start, start + scene.block)
            took, found = _ask(entrant, models, scene.tracks, steps)
            seconds[entrant.name].append(took)
            bounds[entrant.name].append(found)
        advance(1.0 / len(starts))

    for name, blocks in seconds.items():
        row[f"{name}_median_us"] = 1e6 * float(np.median(np.concatenate(blocks)))
        row[f"{name}_mean_us"] = 1e6 * float(np.mean(np.concatenate(blocks)))
    for single, suffix in ((exact, ""), (rough, "_10")):
        tests = np.mean(single.tests, axis=0)
        row[f"bound_tests{suffix}"], row[f"primitive_tests{suffix}"] = map(float, tests)
    steps = (starts[:, None] + np.arange(scene.block)).ravel()
    row["ideal_bound_tests"] = _ideal(models["ours"], scene.tracks, steps)
    found = {name: np.concatenate(blocks, axis=1) for name, blocks in bounds.items()}
    size = max(model.radius for model in models["ours"].values())
    row["queries"] = len(exact.tests)
    row["touching"] = float(np.mean(found["ours"][0] == 0.0))
    row["disagreement"] = max(
        _disagreement(found, size), exact.witness_error / size, rough.witness_error / size
    )
    return row


def _build(
    scene: StudyScene, libraries: Sequence[Fcl | Coal]
) -> tuple[dict[str, dict[str, Any]], dict[str, float]]:
    """Return models by engine and mesh, and a row of what they cost: seconds (best of 3), bytes.

    The time covers everything from arrays of vertices and faces to a model that can be asked.
    """
    builders = {"ours": lambda mesh: engine.TriangleMesh(*mesh)}
    builders |= {library.name: library.build for library in libraries}
    models: dict[str, dict[str, Any]] = {name: {} for name in builders}
    row = {"triangles": float(sum(len(faces) for _, faces in scene.meshes.values()))}
    for mesh_name, mesh in scene.meshes.items():
        for name, build in builders.items():
            seconds = []
            for _ in range(3):
                start = thread_time()
                models[name][mesh_name] = build(mesh)
                seconds.append(thread_time() - start)
            row[f"{name}_build_s"] = row.get(f"{name}_build_s", 0.0) + min(seconds)
    ours = models["ours"].values()
    row["bytes_per_triangle"] = sum(map(_bytes, ours)) / row["triangles"]
    return models, row


def _bytes(mesh: engine.TriangleMesh) -> int:
    """Return the size of all arrays of a mesh's hierarchy."""
    hierarchy = mesh._hierarchy
    values = [getattr(hierarchy, name) for name in hierarchy.__slots__]
    return sum(v.nbytes for v in (*values, *hierarchy.tree) if isinstance(v, np.ndarray))


def _ideal(
    models: dict[str, engine.TriangleMesh], tracks: list[Track], steps: NDArray[np.int64]
) -> float:
    """Return the mean bound tests of exact searches that are given the distance beforehand."""
    tests = []
    for track in tracks:
        pair = engine.Pair(models[track.a], models[track.b])
        for i in steps[steps < len(track.poses_a)]:
            tests.append(pair.ideal(track.poses_a[i], track.poses_b[i]).bound_tests)
    return float(np.mean(tests))


def _ask(
    entrant: Entrant, models: dict[str, dict[str, Any]], tracks: list[Track], steps: slice
) -> tuple[NDArray[np.float64], Bounds]:
    """Return the seconds of each query of a block (processor time of this thread), and bounds."""
    own = models.get(entrant.name, models["ours"])
    queries = [q for t in tracks for q in entrant.queries(own[t.a], own[t.b], t, steps)]
    seconds, answers = np.empty(len(queries)), []
    gc.disable()
    for i, query in enumerate(queries):
        start = thread_time()
        answer = query()
        seconds[i] = thread_time() - start
        answers.append(answer)
    gc.enable()
    bounds = entrant.bounds(answers)
    share = bounds.shape[1] // len(queries)  # poses that one call answered
    return np.repeat(seconds / share, share), bounds


def _disagreement(bounds: dict[str, Bounds], size: float) -> float:
    """Return how far any two answers contradict each other, as a share of the query's scale.

    The scale of a query is the larger body's radius plus the distance.
    """
    exact = bounds["ours"]
    errors = []
    for name, (lower, upper) in bounds.items():
        if name.endswith("_10"):
            errors += [lower - exact[1], exact[0] - upper, upper - (1.0 + REL_ERR) * exact[1]]
        else:
            errors += [np.abs(lower - exact[0]), np.abs(upper - exact[1])]
    return float((np.array(errors) / (size + exact[1])).max())
