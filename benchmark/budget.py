"""By how much questions overrun their time budget, on the bench scenes and on curved models.

    python benchmark/budget.py [--scene NAME ...] [--quick] [--busy] [--repeats N]

Only calls that took nearly all of their budget, or more, count. Each call is timed twice. The
thread's processor time excludes what other programs take. The clock, by which the engine keeps its
budget, includes it. With --busy, as many processes as there are processors compute at the same
time. Other programs also evict data from the processor's caches, which lengthens both times: with
--repeats N every call is made N times, and the median of its times counts.
"""

from __future__ import annotations

import argparse
import gc
import multiprocessing
import os
import sys
from collections.abc import Callable, Iterator
from time import perf_counter, thread_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from proximity_monitor import engine
from proximity_monitor.scene import bundled, load_model, load_scene
from proximity_monitor.study.scenes import SCENES, StudyScene, Track, identities, random_rotations
from proximity_monitor.study.surfaces import SURFACES

BUDGETS_US = (20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000)
CHOSEN = ("concentric/0.5", "engine/crankshaft-block", "cave/random", "tori")
ORDERS = ("depth_first", "priority", "breadth_first")
_CALLS, _QUICK = 40, 6
_NEARLY = 0.9
"""A call counts as ended by its budget if it took more than this share of it."""
_BATCH, _POINTS = 64, 4096

Ask = Callable[[int, float], Any]
"""Asks a question at the poses of a step, within a budget in seconds."""


def _chess() -> StudyScene:
    """Return two solids of revolution at random poses, bounding spheres overlapping or close."""
    scene = load_scene(bundled("chess"))
    bodies = {body.name: body for body in scene.bodies}
    a, b = models = [load_model(bodies[name], scene.unit) for name in ("pawn", "cup")]
    random = np.random.default_rng(0)
    poses = random_rotations(random, _CALLS)
    way = random.normal(size=(_CALLS, 3))
    way *= random.uniform(0.6, 1.2, (_CALLS, 1)) / np.linalg.norm(way, axis=1, keepdims=True)
    poses[:, :3, 3] = (a.radius + b.radius) * way + b.centre - poses[:, :3, :3] @ a.centre
    track = Track("pawn", "cup", poses, identities(_CALLS))
    return StudyScene({}, [track], surfaces=dict(zip(("pawn", "cup"), models, strict=True)))


CURVED: dict[str, Callable[[], StudyScene]] = {
    "nets": SURFACES["nets/random"],
    "chess": _chess,
}


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--scene", nargs="+", default=[], help="scenes or families (default: some)")
    parser.add_argument("--question", nargs="+", default=[], help="how the questions' names begin")
    parser.add_argument("--quick", action="store_true", help="fewer calls")
    parser.add_argument("--busy", action="store_true", help="measure while other processes compute")
    parser.add_argument(
        "--repeats", type=int, default=1, help="runs of each call, whose median counts (default: 1)"
    )
    options = parser.parse_args(arguments)
    known = SCENES | CURVED
    wanted = options.scene or (*CHOSEN, *CURVED)
    scenes = [name for name in known if name.startswith(tuple(wanted))]
    others = [
        multiprocessing.Process(target=_compute, daemon=True)
        for _ in range((os.cpu_count() or 1) if options.busy else 0)
    ]
    for each in others:
        each.start()
    late: dict[str, list[tuple[str, int, NDArray[np.float64]]]] = {}
    for name in scenes:
        scene = known[name]()
        for question, ask in _questions(scene):
            if options.question and not question.startswith(tuple(options.question)):
                continue
            for budget in BUDGETS_US:
                calls = _QUICK if options.quick else _CALLS
                found = np.median(
                    [
                        _measure(scene, ask, 1e-6 * budget, calls, k == 0)
                        for k in range(options.repeats)
                    ],
                    axis=0,
                )
                late.setdefault(question, []).append((name, budget, found))
        print(f"{name} is done", file=sys.stderr)
    for each in others:
        each.terminate()
    _print(late)
    return 0


def _compute() -> None:
    """Keep a processor busy until the process is terminated."""
    while True:
        np.linalg.inv(np.eye(64) + 1.0)


def _questions(scene: StudyScene) -> Iterator[tuple[str, Ask]]:
    """Yield the name and the call of every question that takes a budget."""
    models: dict[str, engine.Model] = {**scene.surfaces}
    models |= {name: engine.TriangleMesh(*mesh) for name, mesh in scene.meshes.items()}
    track = scene.tracks[0]
    a, b = models[track.a], models[track.b]
    pa, pb = track.poses_a, track.poses_b
    reach = [engine.distance(a, pa[k], b, pb[k]).upper for k in _steps(scene, _CALLS)]
    # A mesh computes `not_solid` once, on first access: no question is to be charged for it.
    assert all(model.not_solid is not None for model in models.values())
    pair = engine.Pair(a, b)
    for order in ORDERS:
        yield (
            f"distance, {order}",
            lambda k, s, order=order: pair.distance(pa[k], pb[k], budget_s=s, order=order),
        )
    yield "manifold", lambda k, s: pair.distance(pa[k], pb[k], budget_s=s, manifold=True)
    yield "new pair", lambda k, s: engine.distance(a, pa[k], b, pb[k], budget_s=s)
    close = 0.999 * float(np.median(reach))
    yield "within", lambda k, s: pair.within(pa[k], pb[k], close, budget_s=s)
    yield "collide", lambda k, s: pair.collide(pa[k], pb[k], budget_s=s)
    # Pushed into each other, so that there are contacts.
    inner = [_pushed(a, pa[k], b, pb[k]) for k in _steps(scene, _CALLS)]
    inside = dict(zip(_steps(scene, _CALLS), inner, strict=True))
    yield (
        "all contacts",
        lambda k, s: pair.collide(inside[k], pb[k], all_contacts=True, budget_s=s),
    )
    yield "signed", lambda k, s: pair.signed_distance(pa[k], pb[k], budget_s=s)
    yield "signed, inside", lambda k, s: pair.signed_distance(inside[k], pb[k], budget_s=s)
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (_POINTS, 3)) * a.radius
    around = {k: points + pa[k, :3, 3] for k in _steps(scene, _CALLS)}
    yield (
        "closest points",
        lambda k, s: engine.closest_points(a, pa[k], around[k], budget_s=s),
    )
    if a.is_solid:
        yield (
            "points, signed",
            lambda k, s: engine.closest_points(a, pa[k], around[k], signed=True, budget_s=s),
        )

    def part(k: int) -> slice:
        first = min(k, max(len(pa) - _BATCH, 0))
        return slice(first, first + _BATCH)

    yield (
        "distances",
        lambda k, s: engine.distances(a, pa[part(k)], b, pb[part(k)], budget_s=s),
    )
    names = list(models)
    assembly = engine.Assembly([models[name] for name in names])
    pairs = np.array([[names.index(t.a), names.index(t.b)] for t in scene.tracks])
    pairs = np.tile(pairs, (-(-_BATCH // len(pairs)), 1))[:_BATCH]

    poses = {}  # made beforehand: the question is not charged for it
    for k in _steps(scene, _CALLS):
        where = {t.a: t.poses_a[k] for t in scene.tracks}
        where |= {t.b: t.poses_b[k] for t in scene.tracks}
        poses[k] = np.array([where[name] for name in names])
    if len(names) > 1:
        yield "Assembly", lambda k, s: assembly.distances(poses[k], pairs, budget_s=s)
        yield (
            "Assembly, signed",
            lambda k, s: assembly.distances(poses[k], pairs, signed=True, budget_s=s),
        )


def _pushed(
    a: engine.Model, pose_a: NDArray[np.float64], b: engine.Model,
    pose_b: NDArray[np.float64],
) -> NDArray[np.float64]:  # fmt: skip
    """Return the pose of a, moved so that its surface crosses that of b."""
    found = engine.distance(a, pose_a, b, pose_b)
    moved = pose_a.copy()
    way = found.point_b - found.point_a
    moved[:3, 3] += way + 0.01 * a.radius * (way / max(float(np.linalg.norm(way)), 1e-12))
    return moved


def _steps(scene: StudyScene, calls: int) -> list[int]:
    """Return `calls` steps, spread evenly over all steps of the scene."""
    return np.linspace(0, len(scene.tracks[0].poses_a) - 1, calls).astype(int).tolist()


def _measure(
    scene: StudyScene, ask: Ask, budget_s: float, calls: int, compiles: bool
) -> NDArray[np.float64]:
    """Return by how many seconds calls overran, (k, 2): processor time, and time by the clock.

    Each step is asked about three times in a row, so that a search that was cut short resumes.
    """
    steps = _steps(scene, _CALLS)[:: _CALLS // calls]
    for step in steps if compiles else ():
        ask(step, 10.0)  # compiles; another pose may need another kernel
    found = []
    gc.disable()
    for step in steps:
        for _ in range(3):
            began, start = thread_time(), perf_counter()
            ask(step, budget_s)
            took = thread_time() - began, perf_counter() - start
            found.append(took)
        gc.collect(0)
    gc.enable()
    return np.array(found) - budget_s


def _print(late: dict[str, list[tuple[str, int, NDArray[np.float64]]]]) -> None:
    """Print a table, microseconds, of the calls that their budget ended; each column is of these.

    The last column names the scene and the budget whose 99 % of processor time is largest.
    """
    print(
        "| overrun of the calls that the budget ended, µs | calls | median | 99 % | most "
        "| clock: 99 % | most | worst 99 % |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for question, found in late.items():
        ended = [
            (name, budget, 1e6 * each[each[:, 1] > (_NEARLY - 1.0) * 1e-6 * budget])
            for name, budget, each in found
        ]
        ended = [each for each in ended if len(each[2])]
        if not ended:
            print(f"| {question} | 0 | | | | | | |")
            continue
        over = np.concatenate([each for _, _, each in ended])
        middle, most, all_ = np.percentile(over[:, 0], (50, 99, 100))
        clock, longest = np.percentile(over[:, 1], (99, 100))
        worst, scene, budget = max(
            (float(np.percentile(each[:, 0], 99)), name, budget) for name, budget, each in ended
        )
        print(
            f"| {question} | {len(over)} | {middle:.0f} | {most:.0f} | {all_:.0f} | {clock:.0f} | "
            f"{longest:.0f} | {scene}, {budget} µs: {worst:.0f} |"
        )


if __name__ == "__main__":
    sys.exit(main())
