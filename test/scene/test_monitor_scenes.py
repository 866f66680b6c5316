"""Every bundled scene that moves: at every tick and any budget, the bounds hold the truth.

The truth is the engine's exact answer for every pair, asked one by one; test_monitor.py compares
with FCL.
"""

import functools

import numpy as np
import pytest

from proximity_monitor import engine, motion
from proximity_monitor.scene import SceneError, bundled, load_scene
from proximity_monitor.scene.monitor import Monitor
from proximity_monitor.scene.opening import load_models
from proximity_monitor.scene.paths import bundled_names
from proximity_monitor.scene.state import PoseSample

TICKS = 3
SLOW = {"gearbox": (0.37, 2), "interlocked-rings": (0.1, 3)}
"""For each slow scene: where in its motion to start (a share of the period), and how many ticks.
Any other scene takes less than a second."""
BUDGETS = (0.0, 1e-4, 1e-3, 0.1)


class Recording:
    """A few ticks of a scene, from within its motion, and the exact answers to them."""

    def __init__(self, name):
        self.scene = load_scene(bundled(name))
        self.models = load_models(self.scene)
        moves = motion.from_scene(self.scene, self.models)
        share, ticks = SLOW.get(name, (0.37, TICKS))
        start = share * (moves.period_s or 1.0)
        self.ticks = [self._at(moves, start + k / self.scene.rate_hz) for k in range(ticks)]

    def _at(self, moves, t):
        poses = {body.name: body.pose for body in self.scene.bodies if not body.moving}
        poses |= moves.poses(t)
        for robot in self.scene.robots:
            poses |= robot.poses(moves.joints(t))
        vertices = {name: np.array(each) for name, each in moves.control_points(t).items()}
        for name, each in vertices.items():
            self.models[name].deform(each)
        return poses, vertices, [self._exact(pair, poses) for pair in self.scene.pairs]

    def _exact(self, pair, poses):
        return engine.signed_distance(
            self.models[pair.a], poses[pair.a], self.models[pair.b], poses[pair.b]
        )


@functools.cache
def recorded(name):
    try:
        return Recording(name)
    except SceneError as error:
        if "pip install" not in str(error):
            raise
        return None


def marked(name):
    """Return the scene as a parameter, marked as long if its exact answers take long."""
    return pytest.param(name, marks=[pytest.mark.long] if name in SLOW else [])


@pytest.mark.parametrize("budget_s", BUDGETS)
@pytest.mark.parametrize("name", [marked(name) for name in bundled_names()])
def test_the_interval_contains_the_distance_at_every_tick(name, budget_s):
    recording = recorded(name)
    if recording is None:
        pytest.skip("needs a package that the scene names")
    scene = recording.scene
    monitor = Monitor(scene, recording.models)
    moving = [body.name for body in scene.bodies if body.moving]
    compared = 0
    for poses, vertices, exact in recording.ticks:
        for body, each in vertices.items():
            monitor.deform(body, each)
        tick = monitor.tick({n: PoseSample(poses[n]) for n in moving}, budget_s)
        for pair in tick.pairs:
            true = exact[pair.index]
            assert pair.lower <= true.upper
            assert true.lower <= pair.upper
            compared += 1
        listed = {pair.index for pair in tick.pairs}
        for i, pair in enumerate(scene.pairs):
            assert i in listed or exact[i].upper > pair.range
        assert len(tick.pairs) + tick.far == len(scene.pairs)
    assert compared > 0
