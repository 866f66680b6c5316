"""Pairs with a range: near pairs are listed, the others are certainly far, at any budget."""

import numpy as np
import pytest
from crowds import assert_certified, exact, samples, text, walk

from proximity_monitor.scene import Thresholds
from proximity_monitor.scene import watch as watched_pairs
from proximity_monitor.scene.alerts import Alerts, Level
from proximity_monitor.scene.monitor import Monitor
from proximity_monitor.scene.opening import load_models
from proximity_monitor.scene.state import PairStatus

COUNT = 12
PAIRS = COUNT * (COUNT - 1) // 2
ENOUGH_S = 60.0
"""A budget that no tick uses up: a tick takes milliseconds, on a busy machine 0.1 s."""


def watch(load, **parts):
    scene = load(text(COUNT, **parts))
    models = load_models(scene)
    return scene, models, Monitor(scene, models)


@pytest.mark.parametrize("budget_s", [0.0, 2e-4, ENOUGH_S])
@pytest.mark.parametrize("reach", [0.01, 0.4])
def test_what_is_not_listed_is_farther_than_its_range(load, budget_s, reach):
    _, models, monitor = watch(load, head=f"range: {reach}")
    listed_ever = 0
    for poses in walk(COUNT, 25):
        tick = monitor.tick(samples(poses), budget_s)
        true = exact(models, poses)
        listed = assert_certified(tick, true)
        for pair, at in true.items():
            assert pair in listed or at.upper > reach
        assert len(tick.pairs) + tick.far == PAIRS
        assert tick.unsure == 0
        assert tick.clearance() <= min(at.upper for at in true.values())
        if budget_s == ENOUGH_S:
            assert listed == {pair for pair, at in true.items() if at.lower <= reach}
            assert tick.left == 0
        listed_ever += len(listed)
    assert 0 < listed_ever < 25 * PAIRS


def test_pairs_of_their_own_range_and_pairs_of_none(load):
    pairs = """
  watch:
    - {between: [all, all]}
    - {between: [b0, b1], range: 100}
    - {between: [b2, all], range: 1.0}
  exclude: [[b3, b4]]"""
    scene, models, monitor = watch(load, head="range: 0.1", pairs=pairs)
    ranges = {(pair.a, pair.b): pair.range for pair in scene.pairs}
    assert ("b3", "b4") not in ranges
    for poses in walk(COUNT, 15, seed=2):
        true = exact(models, poses)
        listed = assert_certified(monitor.tick(samples(poses), ENOUGH_S), true)
        assert listed == {pair for pair, reach in ranges.items() if true[pair].lower <= reach}


def test_a_listed_pair_knows_its_place_among_all(load):
    scene, _, monitor = watch(load, head="range: 0.4")
    for poses in walk(COUNT, 5, seed=3):
        tick = monitor.tick(samples(poses), ENOUGH_S)
        places = [pair.index for pair in tick.pairs]
        assert places == sorted(places)
        for pair in tick.pairs:
            assert (scene.pairs[pair.index].a, scene.pairs[pair.index].b) == (pair.a, pair.b)


def test_what_is_far_is_not_searched(load):
    _, models, monitor = watch(load, head="range: 0.01")
    for poses in walk(COUNT, 10, spread=6.0):
        tick = monitor.tick(samples(poses), ENOUGH_S)
        balls = {
            (i, j)
            for i, a in enumerate(models)
            for j, b in enumerate(models)
            if i < j and _gap(models[a], poses[a], models[b], poses[b]) <= 0.011
        }
        assert len(tick.searched) <= len(balls)


def _gap(a, pose_a, b, pose_b):
    centres = (pose[:3, :3] @ m.centre + pose[:3, 3] for m, pose in ((a, pose_a), (b, pose_b)))
    return np.linalg.norm(np.subtract(*centres)) - a.radius - b.radius


def test_thresholds_beyond_the_range_widen_it(load):
    """An operator may raise a threshold at run time; no alert is missed because of the range."""
    scene, models, monitor = watch(load, head="range: 0.01")
    monitor.set_thresholds([Thresholds(0.5, 0.1, 0.25)] * PAIRS)
    for poses in walk(COUNT, 10, seed=4):
        true = exact(models, poses)
        listed = assert_certified(monitor.tick(samples(poses), ENOUGH_S), true)
        assert listed == {pair for pair, at in true.items() if at.lower <= 0.75}
    with pytest.raises(ValueError, match=f"3 thresholds for {PAIRS} pairs"):
        monitor.set_thresholds([Thresholds(0.5, 0.1, 0.25)] * 3)
    assert len(scene.pairs) == PAIRS


def test_a_silent_body_is_never_far(load):
    """Its present place is unknown, so all its pairs are listed, near or not."""
    _, models, monitor = watch(load, head="range: 0.01")
    poses = next(walk(COUNT, 1, spread=20.0))
    assert len(monitor.tick(samples(poses), ENOUGH_S).pairs) == 0

    tick = monitor.tick(samples(poses, stale=("b5",)), ENOUGH_S)
    assert {frozenset((p.a, p.b)) for p in tick.pairs} == {
        frozenset(("b5", f"b{i}")) for i in range(COUNT) if i != 5
    }
    assert all(pair.silent == ("b5",) for pair in tick.pairs)
    assert_certified(tick, exact(models, poses))
    assert tick.searched == ()
    assert tick.clearance() == 0.0

    del poses["b5"]
    tick = monitor.tick(samples(poses), ENOUGH_S)
    assert len(tick.pairs) == COUNT - 1
    assert {pair.status for pair in tick.pairs} == {PairStatus.UNKNOWN}
    assert tick.far == PAIRS - (COUNT - 1)
    assert tick.clearance() == 0.0


def test_of_very_many_silent_bodies_not_every_pair_is_listed(load, monkeypatch):
    monkeypatch.setattr(watched_pairs, "LISTED_SILENT", 20)
    _, _, monitor = watch(load, head="range: 0.01")
    tick = monitor.tick({}, ENOUGH_S)
    assert len(tick.pairs) == 20
    assert tick.unsure == PAIRS - 20
    assert tick.far == 0
    assert tick.clearance() == 0.0


def test_pairs_that_are_ignored_are_not_counted_among_the_unsure(load, monkeypatch):
    monkeypatch.setattr(watched_pairs, "LISTED_SILENT", 20)
    _, _, monitor = watch(load, head="range: 0.01")
    monitor.ignore([0, PAIRS - 2, PAIRS - 1])  # one that would be listed, and two that would not
    tick = monitor.tick({}, ENOUGH_S)
    # A reader that gets fewer than 20 pairs relies on these being all.
    assert (len(tick.pairs), tick.far, tick.unsure) == (20, 0, PAIRS - 23)
    monitor.ignore([])
    tick = monitor.tick({}, ENOUGH_S)
    assert (len(tick.pairs), tick.far, tick.unsure) == (20, 0, PAIRS - 20)


def test_the_silence_of_bodies_costs_no_more_than_their_pairs(load, monkeypatch):
    pairs = """
  watch:
    - {between: [b0, b1], range: 0.1}
    - {between: [b4, b9], range: 0.1}"""
    scene, _, monitor = watch(load, pairs=pairs)
    looked_up, kind = [], scene.pairs.kind

    def counted(a, b):
        looked_up.append(len(a))
        return kind(a, b)

    monkeypatch.setattr(scene.pairs, "kind", counted)
    tick = monitor.tick({}, ENOUGH_S)
    assert [(pair.a, pair.b) for pair in tick.pairs] == [("b0", "b1"), ("b4", "b9")]
    assert sum(looked_up) < COUNT


def test_the_minima_of_a_pair_survive_its_absence(load):
    _, _, monitor = watch(load, head="range: 0.5")
    near, far = next(walk(COUNT, 1)), next(walk(COUNT, 1, spread=50.0))
    first = {(p.a, p.b): p for p in monitor.tick(samples(near), ENOUGH_S).pairs}
    assert len(monitor.tick(samples(far), ENOUGH_S).pairs) < len(first)
    back = {n: pose @ _shift(0.001) for n, pose in near.items()}
    for pair in monitor.tick(samples(back), ENOUGH_S).pairs:
        if (pair.a, pair.b) in first:
            assert pair.session_min <= first[pair.a, pair.b].upper
            assert pair.session_min_lower <= first[pair.a, pair.b].lower
    monitor.tick(samples(far), ENOUGH_S)
    monitor.reset_minima()
    for pair in monitor.tick(samples(back), ENOUGH_S).pairs:
        assert pair.session_min == pair.upper


def _shift(x):
    made = np.eye(4)
    made[0, 3] = x
    return made


def test_pairs_that_are_ignored_are_neither_searched_nor_listed(load):
    _, _, monitor = watch(load)
    poses = list(walk(COUNT, 2))
    monitor.ignore([3, 7])
    tick = monitor.tick(samples(poses[0]), ENOUGH_S)
    assert {pair.index for pair in tick.pairs} == set(range(PAIRS)) - {3, 7}
    assert not {3, 7} & set(tick.searched)
    assert (tick.left, tick.far) == (0, 0)
    monitor.ignore([])
    assert set(monitor.tick(samples(poses[0]), ENOUGH_S).searched) == {3, 7}


def test_all_beyond_their_range_is_room_as_far_as_the_range(load):
    _, _, monitor = watch(load, head="range: 0.25")
    tick = monitor.tick(samples(next(walk(COUNT, 1, spread=50.0))), ENOUGH_S)
    assert (len(tick.pairs), tick.far) == (0, PAIRS)
    assert tick.clearance() == 0.25


def test_a_crowd_before_its_first_poses_costs_no_more_than_after(load):
    """The cost of a tick of 44,850 pairs follows from how many it lists, judges and reports."""
    scene = load(text(300, head="range: 0.4"))
    monitor, alerts = Monitor(scene, load_models(scene)), Alerts(scene.pairs, scene.unit)
    limits = [pair.thresholds for pair in scene.pairs]
    why = {body.name: "no pose yet" for body in scene.bodies}
    before = monitor.tick({}, ENOUGH_S)
    alerts.update(before, limits, 0.0, silent=why)
    poses = samples(next(walk(300, 1, spread=4.0)))
    listed = len(monitor.tick(poses, ENOUGH_S).pairs)
    assert len(before.pairs) <= 250 < listed, "the crowd is a dense one"
    assert before.unsure + len(before.pairs) == len(scene.pairs)
    assert len(alerts.update(monitor.tick(poses, ENOUGH_S), limits, 1.0)) <= listed + 250
    judged = []
    judge = alerts._judge
    alerts._judge = lambda *given: judged.append(given) or judge(*given)
    for k in range(2):
        alerts.update(monitor.tick({}, ENOUGH_S), limits, 2.0 + k, silent=why)
    assert len(judged) <= 250, "who is as silent as before is not judged again"


def test_a_pair_that_is_held_at_a_level_stays_listed_until_it_is_clear(load):
    """A reader of the ticks takes a pair that is not listed to be clear."""
    limits = "thresholds: {warn: 0.5, stop: 0.4, hold_s: 1.5}"
    scene, models, monitor = watch(load, head=f"range: 1\n{limits}")
    alerts, thresholds = Alerts(scene.pairs, scene.unit), [p.thresholds for p in scene.pairs]
    near, far = next(walk(COUNT, 1)), next(walk(COUNT, 1, spread=50.0))
    listed = []
    for k, poses in enumerate((near, far, far, far, far)):
        tick = monitor.tick(samples(poses), ENOUGH_S)
        alerts.update(tick, thresholds, float(k))
        monitor.keep(alerts.held)
        listed.append({pair.index for pair in tick.pairs})
        unclear = {i for i, level in alerts.levels.items() if level is not Level.CLEAR}
        assert unclear <= listed[-1]
        assert len(tick.pairs) + tick.far == PAIRS
        assert_certified(tick, exact(models, poses))
    assert listed[1] == listed[2] == listed[3], "at the last of them they are released"
    assert listed[1] < listed[0] and listed[1]
    assert not listed[4]
