"""Measure how often surfaces' control points can move, and a STEP assembly can be watched."""

from __future__ import annotations

from collections.abc import Callable
from time import thread_time

import numpy as np
from surface_scenes import teapot

from proximity_monitor import engine, motion
from proximity_monitor.scene import bundled, load_scene
from proximity_monitor.scene.monitor import Monitor
from proximity_monitor.scene.opening import load_models
from proximity_monitor.scene.state import PoseSample
from proximity_monitor.study.surfaces import wavy

Row = dict[str, str | float]

_SWELL = 0.05
"""How far control points move to either side, as a share of the model's radius."""


def deform(count: int) -> list[Row]:
    """Refit a net and a teapot while a wave runs through them, and ask for a point's distance."""
    rows = []
    for model in (engine.ParametricSurface([wavy(1, 10)], name="wavy net"), teapot()):
        rest, here = model.control_points.copy(), np.eye(4)
        probe = engine.points([model.centre + np.array([0.0, 0.0, 1.5 * model.radius])])
        pair = engine.Pair(model, probe)
        moves, asks = [], []
        for k in range(10 * count + 1):
            phases = 0.3 * k + 2.0 * np.pi * rest[:, :1] / model.radius
            moved = rest + _SWELL * model.radius * np.sin(phases) * (0.0, 0.3, 1.0)
            moves.append(_took(model.deform, moved))
            asks.append(_took(pair.distance, here, here))
        what = f"{model.name}, {len(rest)} control points"
        # The first calls compile.
        rows += [_row("deform", f"{what}: refit", moves[1:])]
        both = np.add(moves, asks)[1:]
        rows += [_row("deform", f"{what}: refit and exact distance to a point", both)]
    return rows


def step(count: int) -> list[Row]:
    """Open the gearbox and watch it under its own budget, all in processor time of one thread."""
    name = bundled("gearbox")
    Monitor(scene := load_scene(name), load_models(scene))  # compiles, and loads OCCT
    start = thread_time()
    scene = load_scene(name)
    models = load_models(scene)
    monitor = Monitor(scene, models, clock=thread_time)
    moves = motion.from_scene(scene, models)
    names = [body.name for body in scene.bodies if body.moving]

    def tick(k: int, budget_s: float):
        poses = moves.poses(k / scene.rate_hz)
        return monitor.tick({each: PoseSample(poses[each]) for each in names}, budget_s)

    first = tick(0, np.inf)
    opened = thread_time() - start
    took, unsearched, undecided = [], [], []
    for k in range(1, 10 * count + 1):
        start = thread_time()
        made = tick(k, scene.budget_s)
        took.append(thread_time() - start)
        unsearched.append(len(made.pairs) - len(made.searched))
        levels = [scene.pairs[pair.index].thresholds for pair in made.pairs]
        undecided.append(
            sum(
                pair.lower <= level < pair.upper
                for pair, each in zip(made.pairs, levels, strict=True)
                for level in (each.warn, each.stop)
            )
        )
    whole = [_took(tick, k, np.inf) for k in range(10 * count + 1, 12 * count + 1)]
    faces = sum(len(getattr(models[body.name], "nets", ())) for body in scene.bodies)
    what = f"{faces} faces in {len(scene.bodies)} parts"
    watched = (
        f"{len(first.pairs)} pairs, budget {1e3 * scene.budget_s:g} ms at {scene.rate_hz:g} Hz"
    )
    rest = f"in the median {np.median(unsearched):.0f} have bounds that motion has widened, and "
    rest += f"at most {max(undecided)} thresholds lie between bounds"
    return [
        _row("step", f"{what}: from reading to the first answers", [opened]),
        _row("step", f"a tick of {watched}; {rest}", took),
        _row("step", "a tick without a budget, in which all are searched", whole),
    ]


RATES: dict[str, Callable[[int], list[Row]]] = {"deform": deform, "step": step}


def _took(ask: Callable, *arguments: object) -> float:
    """Return the processor time of one call in this thread, seconds."""
    start = thread_time()
    ask(*arguments)
    return thread_time() - start


def _row(scene: str, what: str, took: list[float]) -> Row:
    median, most = 1e3 * float(np.median(took)), 1e3 * float(np.max(took))
    return {"scene": scene, "what": what, "ms": median, "max_ms": most, "rate": 1e3 / median}


def table(rows: list[Row]) -> str:
    """Return the rows as a Markdown table."""
    lines = ["| scene | what | ms | max | a second |\n| --- | --- | --- | --- | --- |\n"]
    for row in rows:
        figures = f"{row['ms']:.3f} | {row['max_ms']:.2f} | {row['rate']:.3g}"
        lines.append(f"| {row['scene']} | {row['what']} | {figures} |\n")
    return "".join(lines)
