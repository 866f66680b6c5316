"""Time solids of revolution that move, and that deform as well: how long a frame takes."""

from __future__ import annotations

import itertools
import math
from time import thread_time

import numpy as np
from numpy.typing import NDArray
from revolution_page import table

from proximity_monitor import engine

HERE = np.eye(4)


def motion(count: int) -> NDArray[np.float64]:
    """Return poses that circle and go to and fro, by 1/1000 of the size and of a turn a frame."""
    made = np.tile(np.eye(4), (count, 1, 1))
    for k in range(count):
        a, b = 2.0 * math.pi * k / 1000.0, 2.0 * math.pi * k / 1414.0
        made[k, :3, :3] = [
            [math.cos(a), -math.sin(a) * math.cos(b), math.sin(a) * math.sin(b)],
            [math.sin(a), math.cos(a) * math.cos(b), -math.cos(a) * math.sin(b)],
            [0.0, math.sin(b), math.cos(b)],
        ]
        far = 1.6 + 0.6 * math.sin(k / 700.0)
        made[k, :3, 3] = far * math.cos(k / 900.0), far * math.sin(k / 900.0), 0.3
    return made


def _copy(solid: engine.SolidOfRevolution) -> engine.SolidOfRevolution:
    return engine.SolidOfRevolution(
        [engine.Curve(net.points[:, :2], net.knots_u) for net in solid.profile.nets]
    )


def morphing(made: dict, precisions: tuple, frames: int) -> tuple[str, dict]:
    """Time a sixth solid that morphs through the five, against each of them; ms a frame."""
    shapes = [solid.control_points for solid in made.values()]
    path, found = motion(frames), {}
    for precision in precisions:
        found[precision] = []
        for other in made.values():
            moving = _copy(made["pawn"])
            pair = engine.Pair(moving, other)
            deform = ask = 0.0
            for k in range(frames):
                share, at_shape = (k % 50) / 50.0, k // 50
                one, next_one = shapes[at_shape % 5], shapes[(at_shape + 1) % 5]
                start = thread_time()
                moving.deform((1.0 - share) * one + share * next_one)
                middle = thread_time()
                pair.distance(HERE, path[k], abs_err=precision)
                ask += thread_time() - middle
                deform += middle - start
            found[precision].append((1e3 * deform / frames, 1e3 * ask / frames))
    rows = [
        [name.replace("_", " "), *(f"{deform:.2f} + {ask:.3f}" for deform, ask in times)]
        for name, *times in zip(made, *found.values(), strict=True)
    ]
    return table(["against", *(f"{precision:g} m" for precision in precisions)], rows), found


def deforming(made: dict, frames: int) -> str:
    """Time all ten pairs of five solids, each of which changes its shape at each frame."""
    shapes = {name: solid.control_points for name, solid in made.items()}
    moving = [_copy(solid) for solid in made.values()]
    ring = [*shapes.values()]
    deform, ask = [], []
    pairs = [engine.Pair(a, b) for a, b in itertools.combinations(moving, 2)]
    apart = motion(1)[0]
    for k in range(frames):
        share = (k % 50) / 50.0
        start = thread_time()
        for i, solid in enumerate(moving):
            one, other = ring[(i + k // 50) % 5], ring[(i + k // 50 + 1) % 5]
            solid.deform((1.0 - share) * one + share * other)
        middle = thread_time()
        for pair in pairs:
            pair.distance(HERE, apart, abs_err=1e-5)
        ask.append(1e3 * (thread_time() - middle))
        deform.append(1e3 * (middle - start))
    row = [f"{np.median(deform):.2f}", f"{np.median(ask):.3f}",
           f"{1e3 / (np.median(deform) + np.median(ask)):.0f}"]  # fmt: skip
    return table(["five solids deform, ms", "ten pairs, ms", "frames a second"], [row])
