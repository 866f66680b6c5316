"""Threads, and searches that last longer than a tick."""

import numpy as np
import pytest
from crowds import assert_certified, exact, placed, samples, text, walk

from proximity_monitor.engine.assembly import long_searches
from proximity_monitor.scene.monitor import Monitor, simulate
from proximity_monitor.scene.opening import load_models
from proximity_monitor.scene.state import PairStatus

COUNT = 8


def both(load, threads=(1, 3), **parts):
    """Yield the ticks of one walk for each number of threads, and the exact distances.

    There is time for every search.
    """
    scene = load(text(COUNT, **parts))
    models = load_models(scene)
    recorded = list(walk(COUNT, 8, spread=1.2))
    runs = [simulate(scene, models, recorded, 10.0, threads=each) for each in threads]
    assert all(tick.left == 0 for ticks in runs for tick in ticks)
    true = [exact(models, poses) for poses in recorded]
    return zip(*runs, true, strict=True)


@pytest.mark.parametrize("head", ["", "range: 0.5"])
@pytest.mark.parametrize("body", ["", ", solid: false"])
def test_the_distances_do_not_depend_on_the_number_of_threads(load, head, body):
    """Only rounding may differ: of equally near triangles, another may be met first.

    The bounds of a depth may differ within its tolerance, as they depend on what earlier searches
    found in their time.
    """
    for one, three, true in both(load, head=head, body=body):
        assert_certified(one, true)
        assert_certified(three, true)
        for p, q in zip(one.pairs, three.pairs, strict=True):
            assert (p.index, p.status) == (q.index, q.status)
            if p.status is not PairStatus.OVERLAPPING:
                assert (p.lower, p.upper) == pytest.approx((q.lower, q.upper), abs=1e-12)


@pytest.mark.parametrize("body", ["", ", solid: false"])
def test_what_is_decided_does_not_depend_on_the_number_of_threads(load, body):
    head = "question: within\nthresholds: {warn: 0.4, stop: 0.1, hysteresis: 0.1}"
    for one, three, _ in both(load, head=head, body=body):
        for p, q in zip(one.pairs, three.pairs, strict=True):
            for level in (0.1, 0.4, 0.1 + 0.1, 0.4 + 0.1):
                assert (p.lower > level) == (q.lower > level)


@pytest.mark.parametrize("budget_s", [0.0, 2e-4])
def test_threads_under_a_budget_are_certified_too(load, budget_s):
    scene = load(text(COUNT))
    models = load_models(scene)
    recorded = list(walk(COUNT, 15, spread=1.2))
    for tick, poses in zip(
        simulate(scene, models, recorded, budget_s, threads=2), recorded, strict=True
    ):
        assert_certified(tick, exact(models, poses))


def test_no_thread_is_no_way_to_search(load):
    scene = load(text(2))
    with pytest.raises(ValueError, match="threads = 0"):
        Monitor(scene, load_models(scene), threads=0)


def nested(load):
    """Return two balls, one in the other, of 20,480 triangles that are all equally near."""
    ball = "primitive: {sphere: {radius: %g, subdivisions: 5}}, moving: true, solid: false"
    scene = load(
        "version: 1\nunit: m\nbodies:\n"
        f"  - {{name: outer, {ball % 1.1}}}\n  - {{name: inner, {ball % 1.0}}}\n"
        "  - {name: b0, primitive: {sphere: {radius: 0.1, subdivisions: 0}}, moving: true}\n"
    )
    return scene, load_models(scene)


def test_a_long_search_goes_on_across_ticks_and_others_have_their_turn(load):
    scene, models = nested(load)
    monitor = Monitor(scene, models)
    poses = {"outer": np.eye(4), "inner": np.eye(4)}
    turns = 0
    for k in range(5000):
        away = placed([4.0 + 1e-3 * k, 0.3, 0.2], [0, 0, 0, 1])  # this body moves all the time
        tick = monitor.tick(samples(poses | {"b0": away}), 2e-3)
        long, *others = tick.pairs
        assert (long.a, long.b) == ("outer", "inner")
        if long.status is PairStatus.EXACT:
            break
        turns += {pair.status for pair in others} == {PairStatus.EXACT}
    assert long.status is PairStatus.EXACT
    assert turns > 1, "the others had to wait until the long search ended"
    still = monitor.tick(samples(poses | {"b0": away}), 2e-3)
    assert 0 not in still.searched


def test_no_more_is_kept_than_has_room(load, monkeypatch):
    monkeypatch.setattr(long_searches, "KEPT", 2)
    scene = load(text(COUNT))
    models = load_models(scene)
    monitor = Monitor(scene, models)
    poses = next(walk(COUNT, 1, spread=0.1))
    tick = monitor.tick(samples(poses), 10.0)
    assert len(tick.searched) > 2
    assert len(monitor._schedule._long._kept) == 2
    assert_certified(tick, exact(models, poses))
