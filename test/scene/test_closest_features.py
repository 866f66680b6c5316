"""The features of the closest points are as correct as the points, searched or carried."""

import dataclasses

import numpy as np
import pytest
from crowds import samples, text, walk

from proximity_monitor.scene.monitor import Monitor
from proximity_monitor.scene.opening import load_models
from proximity_monitor.scene.state import as_arrays


@pytest.mark.parametrize("solid", ["", ", solid: false"])
@pytest.mark.parametrize("budget_s", [0.0, 1.0])
def test_the_points_lie_where_their_features_say(load, budget_s, solid):
    scene = load(text(6, body=solid))
    models = load_models(scene)
    monitor = Monitor(scene, models)
    corners_seen = set()
    for k, poses in enumerate(walk(6, 12, spread=0.8)):
        tick = monitor.tick(samples(poses), budget_s if k % 3 else 0.0)
        assert len(tick.pairs) == 15
        for pair in tick.pairs:
            named = ((pair.a, pair.point_a), (pair.b, pair.point_b))
            for (name, point), feature in zip(named, pair.features, strict=True):
                weights = feature.parameters
                assert weights.min() >= 0.0
                own = weights @ models[name].vertices[models[name].faces[feature.index]]
                at = poses[name][:3, :3] @ own + poses[name][:3, 3]
                np.testing.assert_allclose(at, point, rtol=0.0, atol=1e-12)
            corners_seen.add(pair.elements)
    assert (len(corners_seen) > 1) == (budget_s > 0.0), "without a search it is any corner"


def test_packed_pairs_keep_their_features_and_those_without_have_none(load):
    scene = load(text(3))
    tick = Monitor(scene, load_models(scene)).tick(samples(next(walk(3, 1))), 1.0)
    for packed in (as_arrays(tick.pairs), as_arrays(tuple(tick.pairs))):
        assert [pair.elements for pair in packed] == [pair.elements for pair in tick.pairs]
        assert np.array_equal(packed.parameters, tick.pairs.parameters)
        assert all(len(pair.features) == 2 for pair in packed)
    bare = as_arrays(
        [dataclasses.replace(p, kinds=(), elements=(-1, -1), parameters=None) for p in tick.pairs]
    )
    assert {pair.features for pair in bare} == {()}
