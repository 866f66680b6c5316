"""Bodies that get another model while they are watched, as clouds from sensors do."""

import numpy as np
import pytest
from crowds import assert_certified, exact, meshes_of, samples, text, walk

from proximity_monitor import engine
from proximity_monitor.scene.monitor import Monitor
from proximity_monitor.scene.opening import load_models

COUNT = 6


@pytest.mark.parametrize("head", ["", "range: 0.3"])
@pytest.mark.parametrize("budget_s", [0.0, 2e-4, 1.0])
def test_bounds_hold_while_models_are_replaced(load, head, budget_s):
    """The new clouds have many or few points; hints, tables and memory of the old are invalid."""
    scene = load(text(COUNT, head=head))
    models, random = meshes_of(scene), np.random.default_rng(5)
    monitor = Monitor(scene, models)
    for k, poses in enumerate(walk(COUNT, 24, spread=1.2)):
        for name in ("b1", "b2"):
            points = random.normal(0.0, 0.2, (random.choice([1, 7, 300, 20_000]), 3))
            models[name] = engine.points(points, radius=0.01 * (k % 3))
            monitor.replace_model(name, models[name])
        tick = monitor.tick(samples(poses), budget_s)
        true = exact(models, poses)
        listed = assert_certified(tick, true)
        assert all(pair in listed or at.upper > 0.3 for pair, at in true.items())
        if budget_s == 1.0:
            for pair in tick.pairs:
                # For overlapping clouds, the two searches may find different depths.
                at = true[pair.a, pair.b]
                assert pair.upper <= (at.upper if at.lower > 0.0 else max(at.upper, 0.0)) + 1e-9


def test_a_model_that_others_share_is_replaced_for_one_body_alone(load):
    scene = load(text(COUNT))
    models = load_models(scene)
    assert models["b0"] is models["b3"]
    monitor = Monitor(scene, models)
    poses = next(walk(COUNT, 1))
    monitor.tick(samples(poses), 1.0)
    for other in (engine.points([[9.0, 0.0, 0.0]]), models["b1"], models["b0"]):
        models["b3"] = other
        monitor.replace_model("b3", other)
        tick = monitor.tick(samples(poses), 1.0)
        assert_certified(tick, exact(models, poses))
        assert {i for i, p in enumerate(tick.pairs) if "b3" in (p.a, p.b)} == set(tick.searched)
    with pytest.raises(KeyError):
        monitor.replace_model("b9", models["b0"])
