"""Compare exact cylinders with prisms on robots of cylinders and boxes.

    python benchmark/cylinders.py [--quick]

Each robot (of `example-robot-data`) is loaded twice: once with exact cylinders, once with a prism
for each cylinder. One call of an `Assembly` asks about all pairs of links: at random
configurations without hints, and along a motion with hints. The two kinds take turns, and the least
of three times counts. Ends with status 1 if their bounds contradict each other by more than
rounding.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from robots import configuration, descriptions, robot_alone

from proximity_monitor import engine
from proximity_monitor.scene import Scene, SceneError
from proximity_monitor.scene.description import Body, Compound, Cylinder
from proximity_monitor.scene.opening import load_models
from proximity_monitor.scene.paths import model_path

_ROBOTS = "go1", "laikago", "a1", "b1", "quadruped", "romeo_laas_small", "baxter", "z1"
_SIDES = 64
"""Sides of a prism."""
_REPEATS, _TOLERANCES = 3, (0.0, 0.01)
_ROUNDING = 1e-9
"""Metres by which the bounds of the two kinds may contradict each other."""


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="only three robots, fewer poses")
    quick = parser.parse_args(arguments).quick
    try:
        root = model_path("package://example-robot-data/package.xml", Path("/")).parent
    except SceneError as error:
        sys.exit(str(error))
    known = descriptions(root)
    print("µs per pair, exact cylinders / prisms; and the widest bounds of each\n")
    heads = "robot", "links, exact cylinders", "pairs", "random", "motion", "random, to 1 %"
    print(f"| {' | '.join(heads)} | motion, to 1 % | widest, mm |\n" + "|---" * 8 + "|")
    agreed, ratios = True, []
    for name in _ROBOTS[:3] if quick else _ROBOTS:
        exact = robot_alone(known[name], neighbours=False)
        models = load_models(exact), load_models(_with_prisms(exact))
        own = [model for model in models[0].values() if isinstance(model, engine.SolidOfRevolution)]
        row, widest = [], np.zeros(2)
        for tolerance in _TOLERANCES:
            for hinted, poses in enumerate(_poses(exact, 10 if quick else 40)):
                times, same, widths = _time(exact, models, poses, tolerance, bool(hinted))
                agreed &= same
                ratios.append(times[0] / times[1])
                row.append(f"{times[0]:.2f} / {times[1]:.2f}")
                if not tolerance:
                    widest = np.maximum(widest, widths)
        told = f"{1e3 * widest[0]:.1g} / {1e3 * widest[1]:.2g}"
        links = f"{len(exact.bodies)}, {len(own)}"
        print(f"| {name} | {links} | {len(exact.pairs)} | {' | '.join(row)} | {told} |", flush=True)
    mean = np.exp(np.log(np.reshape(ratios, (-1, 4))).mean(axis=0))
    print("\nGeometric means of the ratios:", ", ".join(f"{each:.2f}" for each in mean))
    if not agreed:
        print("THE TWO DISAGREE", file=sys.stderr)
    return 0 if agreed else 1


def _with_prisms(scene: Scene) -> Scene:
    """Return the same scene with prisms for cylinders."""

    def changed(body: Body) -> Body:
        if not isinstance(body.primitive, Compound):
            return body
        parts = [
            replace(part, shape=replace(part.shape, segments=_SIDES))
            if isinstance(part.shape, Cylinder)
            else part
            for part in body.primitive.parts
        ]
        return replace(body, primitive=Compound(tuple(parts)))

    return replace(scene, bodies=tuple(changed(body) for body in scene.bodies))


def _poses(scene: Scene, count: int) -> tuple[list[NDArray], list[NDArray]]:
    """Return poses of all bodies (n, 4, 4): at random, and along a path between two of those."""
    robot, random = scene.robots[0], np.random.default_rng(5)
    still = {body.name: body.pose for body in scene.bodies if body.pose is not None}

    def placed(positions: dict[str, float]) -> NDArray:
        at = still | robot.poses(positions)
        return np.array([at[body.name] for body in scene.bodies])

    one, other = configuration(robot, random), configuration(robot, random)
    ways = np.linspace(0.0, 1.0, 5 * count)
    along = [{k: one[k] + t * (other[k] - one[k]) for k in one} for t in ways]
    scattered = [configuration(robot, random) for _ in range(count)]
    return [placed(each) for each in scattered], [placed(each) for each in along]


def _time(
    scene: Scene,
    models: Sequence[dict[str, engine.Model]],
    poses: list[NDArray],
    tolerance: float,
    hinted: bool,
) -> tuple[list[float], bool, NDArray]:
    """Return microseconds a pair of both kinds, whether they agree, and the widest bounds (m)."""
    names = [body.name for body in scene.bodies]
    pairs = np.array([(names.index(pair.a), names.index(pair.b)) for pair in scene.pairs])
    assemblies = [engine.Assembly([each[name] for name in names]) for each in models]
    least, found, widest = [np.inf, np.inf], [[], []], np.zeros(2)
    for _ in range(_REPEATS):
        for k, assembly in enumerate(assemblies):
            answer = assembly.distances(poses[0], pairs, rel_err=tolerance)  # compiles
            began = perf_counter()
            for at in poses:
                hints = answer.hints if hinted else None
                answer = assembly.distances(at, pairs, rel_err=tolerance, hints=hints)
                found[k].append(answer)
            taken = perf_counter() - began
            least[k] = min(least[k], 1e6 * taken / (len(poses) * len(pairs)))
    same = True
    for one, other in zip(*found, strict=True):
        same &= bool((one.lower <= other.upper + _ROUNDING).all())
        same &= bool((other.lower <= one.upper + _ROUNDING).all())
        for k, each in enumerate((one, other)):
            apart = each.lower > 0.0
            widest[k] = max(widest[k], (each.upper - each.lower)[apart].max(initial=0.0))
    return least, same, widest


if __name__ == "__main__":
    sys.exit(main())
