"""Scenes for assembly.py, made in memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from proximity_monitor import engine
from proximity_monitor.scene import UNITS, Body, Scene, Thresholds, WatchedPair
from proximity_monitor.scene.watch import UNWATCHED, PairSettings, WatchedPairs
from proximity_monitor.study import shapes
from proximity_monitor.study.scenes import random_rotations, rotation_poses

RANGE = 0.030
"""Metres. A pair farther apart than this is certified to be so, and not listed."""

_THRESHOLDS = Thresholds(warn=0.010, stop=0.002, hysteresis=0.002)
_SPACING = 0.18
"""Metres between lattice places. With bodies 0.13 m across, it sets how dense the crowd is."""


class Crowd:
    """Bodies of 1,000 triangles that drift about their places in a lattice, and turn.

    Attributes:
        scene: watches all pairs, up to RANGE.
        mesh: the model of every body: a warped torus.
        models: the model of each body, by the body's name.
    """

    def __init__(self, count: int) -> None:
        self.mesh = engine.TriangleMesh(
            *shapes.torus(25, 20, lambda u, v: (0.045, 0.018 + 0 * v, 0.012 * np.sin(2 * u)))
        )
        names = [f"part_{i}" for i in range(count)]
        self.models = dict.fromkeys(names, self.mesh)
        limits = PairSettings(thresholds=_THRESHOLDS, range=RANGE)
        pairs = WatchedPairs(names, [True] * count, [limits], 0, np.empty((0, 3)))
        self.scene = _scene([_body(name) for name in names], pairs)
        random = np.random.default_rng(4)
        side = int(np.ceil(count ** (1.0 / 3.0)))
        lattice = np.stack(np.meshgrid(*3 * [np.arange(side)], indexing="ij"), axis=-1)
        self._places = _SPACING * lattice.reshape(-1, 3)[:count]
        self._swing = random.uniform(0.02, 0.08, (count, 3))
        self._rate = random.uniform(0.5, 3.0, (count, 3))
        self._phase = random.uniform(0.0, 6.3, (count, 3))
        self._axis = random_rotations(random, count)[:, :3, 0]
        self._turning = random.uniform(-2.0, 2.0, count)

    def poses(self, t: float) -> NDArray[np.float64]:
        """Return poses (count, 4, 4) at t seconds: up to 0.24 m/s along each axis, and 2 rad/s."""
        poses = rotation_poses(self._axis, self._turning * t)
        poses[:, :3, 3] = self._places + self._swing * np.sin(self._rate * t + self._phase)
        return poses


Poses = Callable[[float], NDArray[np.float64]]


def nested_pair() -> tuple[Scene, dict[str, engine.TriangleMesh], Poses]:
    """Return a sphere inside another, 40,000 triangles each, about 10 mm apart all around.

    The inner sphere wavers by tenths of a millimetre and turns at 0.1 rad/s. Thousands of triangle
    pairs are nearly as near as the nearest one, so that an exact answer takes some 25 ms.
    """
    inner, outer = shapes.sphere(0.100), shapes.sphere(0.110)
    return _pair(inner, outer, np.array([2e-4, 2e-4, 2e-4]), np.zeros(3), 0.1)


def close_pair() -> tuple[Scene, dict[str, engine.TriangleMesh], Poses]:
    """Return two spheres of 40,000 triangles each, side by side, 0.1 to 1.9 mm apart."""
    ball = shapes.sphere(0.100)
    return _pair(ball, ball, np.array([9e-4, 2e-3, 2e-3]), np.array([0.201, 0.0, 0.0]), 0.5)


def _pair(
    moving: shapes.Mesh,
    fixed: shapes.Mesh,
    swing: NDArray[np.float64],
    place: NDArray[np.float64],
    turning: float,
) -> tuple[Scene, dict[str, engine.TriangleMesh], Poses]:
    surfaces = (engine.TriangleMesh(*each, solid=False) for each in (fixed, moving))
    models = dict(zip(("fixed", "moving"), surfaces, strict=True))
    limits, exceptions = PairSettings(thresholds=_THRESHOLDS), np.array([[0, 1, 0]])
    pairs = WatchedPairs(list(models), [False, True], [limits], UNWATCHED, exceptions)

    def poses(t: float) -> NDArray[np.float64]:
        pose = rotation_poses(np.array([0.6, 0.0, 0.8]), np.array([turning * t]))[0]
        pose[:3, 3] = place + swing * np.sin(np.array([2.0, 3.1, 4.7]) * t)
        return pose

    return _scene([_body("fixed", np.eye(4)), _body("moving")], pairs), models, poses


def _body(name: str, pose: NDArray[np.float64] | None = None) -> Body:
    topic = f"bodies/{name}/pose" if pose is None else None
    grey = (0.7, 0.7, 0.7, 1.0)
    return Body(name, model=None, primitive=None, scale=1.0, pose=pose, topic=topic, colour=grey)


def _scene(bodies: Sequence[Body], pairs: Sequence[WatchedPair]) -> Scene:
    return Scene(
        path=Path("made"),
        frame="world",
        unit=UNITS["m"],
        rate_hz=30.0,
        budget_s=0.020,
        bodies=tuple(bodies),
        pairs=pairs,
        motion=None,
        thresholds=_THRESHOLDS,
    )
