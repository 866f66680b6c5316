"""The monitor of moving bodies, against FCL's distances, with a clock that the test sets."""

import dataclasses
import math

import fcl
import numpy as np
import pytest
from crowds import meshes_of

from proximity_monitor import engine
from proximity_monitor.scene import Thresholds
from proximity_monitor.scene.monitor import Monitor, simulate
from proximity_monitor.scene.opening import load_models
from proximity_monitor.scene.state import PairStatus, PoseSample

SCENE = """
version: 1
frame: world
unit: m
thresholds: {warn: 0.5, stop: 0.1, hysteresis: 0.05}
bodies:
  - {name: table, primitive: {box: {size: [3, 3, 0.1]}}, pose: {position: [0, 0, 0]}}
  - {name: ball, primitive: {sphere: {radius: 0.4, subdivisions: 2}}, moving: true}
  - {name: rod, primitive: {cylinder: {radius: 0.1, height: 1.5, segments: 24}}, moving: true}
  - {name: die, primitive: {box: {size: [0.4, 0.4, 0.4]}}, moving: true}
pairs: all
"""
MOVING = ("ball", "rod", "die")


class Clock:
    """A clock that advances only when the test sets it, and by `step` at each reading."""

    def __init__(self, step=0.0):
        self.now = 0.0
        self.step = step

    def __call__(self):
        self.now += self.step
        return self.now


@pytest.fixture
def scene(load):
    return load(SCENE)


@pytest.fixture
def models(scene):
    return meshes_of(scene)


def pose(x, y, z, turn=0.0):
    made = np.eye(4)
    made[:2, :2] = [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]
    made[:3, 3] = x, y, z
    return made


APART = {"ball": pose(0, 0, 2), "rod": pose(2, 0, 2), "die": pose(0, 2.5, 3)}


def samples(poses, stale=()):
    return {name: PoseSample(each, name in stale) for name, each in poses.items()}


def random_walks(seed, steps):
    """Return poses of smooth walks, in which bodies pass, touch and cross each other."""
    random = np.random.default_rng(seed)
    rates = {name: random.uniform(0.2, 2.0, 6) for name in MOVING}
    phases = {name: random.uniform(0.0, 6.0, 6) for name in MOVING}
    recorded = []
    for i in range(steps):
        poses = {}
        for name in MOVING:
            wave = np.sin(rates[name] * i * 0.05 + phases[name])
            x, y, z, w = np.append(wave[3:], 0.7) / np.linalg.norm(np.append(wave[3:], 0.7))
            made = pose(*(wave[:3] * 1.2 + [0.0, 0.0, 0.8]))
            made[:3, :3] = [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
            poses[name] = made
        recorded.append(poses)
    return recorded


def fcl_distance(a, pose_a, b, pose_b):
    objects = []
    for model, at in ((a, pose_a), (b, pose_b)):
        mesh = fcl.BVHModel()
        mesh.beginModel(len(model.vertices), len(model.faces))
        mesh.addSubModel(model.vertices, model.faces)
        mesh.endModel()
        objects.append(fcl.CollisionObject(mesh, fcl.Transform(at[:3, :3], at[:3, 3])))
    if fcl.collide(*objects):
        return 0.0
    return fcl.distance(*objects)


@pytest.mark.parametrize("budget_s", [0.0, 1e-4, 1e-3, 0.1])
def test_every_interval_contains_the_distance_at_every_tick(load, budget_s):
    scene = load(SCENE.replace(", primitive", ", solid: false, primitive"))
    models = meshes_of(scene)
    recorded = random_walks(seed=7, steps=60)
    ticks = simulate(scene, models, recorded, budget_s)
    fixed = {"table": np.eye(4)}
    touched = 0
    for tick, moving in zip(ticks, recorded, strict=True):
        poses = fixed | moving
        for pair in tick.pairs:
            true = fcl_distance(models[pair.a], poses[pair.a], models[pair.b], poses[pair.b])
            assert pair.lower <= true + 1e-9
            assert true <= pair.upper + 1e-9
            between = np.linalg.norm(pair.point_b - pair.point_a)
            assert pair.upper == pytest.approx(between, abs=1e-9) or true == 0.0
            touched += true == 0.0
    assert touched, "the walk must cross bodies, or it shows less than it says"
    if budget_s == 0.1:
        assert {p.status for t in ticks for p in t.pairs} == {
            PairStatus.EXACT,
            PairStatus.INTERSECTING,
        }
    if budget_s == 0.0:
        assert all(t.searched == () and t.left == len(t.pairs) for t in ticks)


def test_an_ample_budget_gives_the_engines_own_answers(scene, models):
    tick = Monitor(scene, models).tick(samples(APART), budget_s=60.0)
    poses = {"table": np.eye(4), **APART}
    for pair in tick.pairs:
        own = engine.signed_distance(models[pair.a], poses[pair.a], models[pair.b], poses[pair.b])
        assert (pair.lower, pair.upper) == (own.lower, own.upper)
        assert pair.point_a.tolist() == own.point_a.tolist()
        assert pair.point_b.tolist() == own.point_b.tolist()
        assert (pair.status, pair.age_s, pair.silent) == (PairStatus.EXACT, 0.0, ())
    assert tick.left == 0
    assert tick.clearance() == min(pair.lower for pair in tick.pairs)


def test_nothing_is_searched_while_nothing_moves(scene, models):
    monitor = Monitor(scene, models)
    first = monitor.tick(samples(APART), budget_s=60.0)
    again = monitor.tick(samples({n: p.copy() for n, p in APART.items()}), budget_s=60.0)
    assert len(first.searched) == len(first.pairs)
    assert again.searched == ()
    assert [(p.lower, p.upper, p.status) for p in again.pairs] == [
        (p.lower, p.upper, p.status) for p in first.pairs
    ]


def test_only_pairs_of_a_body_that_moved_are_searched_again(scene, models):
    monitor = Monitor(scene, models)
    monitor.tick(samples(APART), budget_s=60.0)
    tick = monitor.tick(samples(APART | {"die": pose(0, 2.4, 3)}), budget_s=60.0)
    assert {i for i, pair in enumerate(tick.pairs) if "die" in (pair.a, pair.b)} == set(
        tick.searched
    )


def test_bodies_that_are_carried_together_are_not_searched_again(scene, models):
    monitor = Monitor(scene, models)
    before = monitor.tick(samples(APART), budget_s=60.0)
    carried = {name: pose(0.3, -0.2, 0.1, 0.4) @ each for name, each in APART.items()}
    tick = monitor.tick(samples(carried), budget_s=60.0)
    among = [i for i, pair in enumerate(tick.pairs) if "table" not in (pair.a, pair.b)]
    assert not set(among) & set(tick.searched)
    for i in among:
        assert tick.pairs[i].status is PairStatus.EXACT
        assert tick.pairs[i].lower == pytest.approx(before.pairs[i].lower, abs=1e-12)
        assert tick.pairs[i].lower <= before.pairs[i].lower


def test_bounds_that_straddle_a_threshold_come_first_then_the_nearest(scene, models):
    monitor = Monitor(scene, models)
    monitor.tick(samples(APART), budget_s=60.0)
    steps = {"ball": pose(0.05, 0, 0), "rod": pose(0, 0.05, 0), "die": pose(0, 0, 0.05)}
    moved = {name: each @ steps[name] for name, each in APART.items()}
    bounds = monitor.tick(samples(moved), budget_s=0.0).pairs
    far = [0.9 * pair.lower for pair in bounds]
    unsure = 4  # a pair that is not the nearest
    assert bounds[unsure].lower > min(pair.lower for pair in bounds)
    far[unsure] = (bounds[unsure].lower + bounds[unsure].upper) / 2.0
    monitor.set_thresholds([Thresholds(level, 0.0, 0.0) for level in far])

    order = monitor.tick(samples(moved), budget_s=60.0).searched
    assert order[0] == unsure
    rest = [bounds[i].lower for i in order[1:]]
    assert rest == sorted(rest)
    assert len(order) == len(bounds)


def test_of_equally_near_pairs_the_one_not_looked_at_for_longest_comes_first(load):
    clock, surfaces = Clock(), load(SCENE.replace(", primitive", ", solid: false, primitive"))
    monitor = Monitor(surfaces, load_models(surfaces), clock=clock)
    # Every surface crosses every other: all lower bounds are 0, and all bounds straddle 0.
    monitor.set_thresholds([Thresholds(0.0, 0.0, 0.0)] * 6)
    poses = {name: pose(0.15 * i, 0, 0) for i, name in enumerate(MOVING)}
    looked = {}
    for turn, movers in enumerate(((), ("ball",), ("rod",), MOVING)):
        clock.now += 10.0
        poses |= {name: poses[name] @ pose(0.001, 0.002, 0, 0.1 * turn) for name in movers}
        order = monitor.tick(samples(poses), budget_s=60.0).searched
        if turn < 3:
            looked |= dict.fromkeys(order, turn)
    assert sorted(order) == list(range(6))
    assert [looked[i] for i in order] == [0, 1, 1, 2, 2, 2]


def test_no_search_begins_when_the_time_is_gone(scene, models):
    clock = Clock(step=0.1)  # each reading of the clock takes this long
    tick = Monitor(scene, models, clock=clock).tick(samples(APART), budget_s=0.05)
    assert tick.searched == ()
    assert tick.left == len(tick.pairs) == 6
    assert all(pair.status is PairStatus.BOUNDED for pair in tick.pairs)
    assert all(pair.age_s == math.inf for pair in tick.pairs)
    assert any(pair.lower > 0.0 for pair in tick.pairs), "far pairs have bounds all the same"


def test_an_interrupted_search_goes_on_while_its_bodies_stand_still(load):
    scene = load(SCENE.replace("subdivisions: 2", "subdivisions: 5"))
    monitor = Monitor(scene, meshes_of(scene))
    ball_in_table = APART | {"ball": pose(0, 0, 0.4501)}
    reached = math.inf
    for _ in range(10_000):
        state = next(
            p
            for p in monitor.tick(samples(ball_in_table), budget_s=4e-4).pairs
            if {p.a, p.b} == {"table", "ball"}
        )
        width = state.upper - state.lower
        assert width <= reached, "bounds never get worse while nothing moves"
        reached = width
        if state.status is PairStatus.EXACT:
            break
    assert state.status is PairStatus.EXACT


def test_the_age_of_an_answer_grows_until_the_pair_is_looked_at_again(scene, models):
    clock = Clock()
    monitor = Monitor(scene, models, clock=clock)
    monitor.tick(samples(APART), budget_s=60.0)
    clock.now += 2.0
    assert {p.age_s for p in monitor.tick(samples(APART), budget_s=0.0).pairs} == {0.0}
    moved = {name: each @ pose(0.05, 0, 0, 0.1) for name, each in APART.items()}
    clock.now += 1.0  # 1 s since the answer last held for the poses; 3 s since the search
    assert {p.age_s for p in monitor.tick(samples(moved), budget_s=0.0).pairs} == {1.0}


def test_a_tolerance_that_the_bounds_meet_saves_the_search(scene, models):
    monitor = Monitor(scene, models)
    monitor.tick(samples(APART), budget_s=60.0)
    monitor.set_tolerance(abs_err=0.1)
    tick = monitor.tick(samples(APART | {"die": pose(0, 2.46, 3)}), budget_s=60.0)
    assert tick.searched == ()
    assert {p.status for p in tick.pairs} == {PairStatus.WITHIN_TOLERANCE}
    monitor.set_tolerance(rel_err=0.0, abs_err=0.0)
    exact = monitor.tick(samples(APART | {"die": pose(0, 2.46, 3)}), budget_s=60.0)
    assert {p.status for p in exact.pairs} == {PairStatus.EXACT}


def test_a_body_without_a_pose_gives_no_numbers(scene, models):
    tick = Monitor(scene, models).tick(samples({"ball": pose(0, 0, 2)}), budget_s=60.0)
    for pair in tick.pairs:
        missing = tuple(name for name in (pair.a, pair.b) if name in ("rod", "die"))
        assert pair.silent == missing
        if missing:
            assert pair.status is PairStatus.UNKNOWN
            assert math.isnan(pair.lower)
            assert math.isnan(pair.upper)
            assert np.isnan(pair.point_a).all()
            assert pair.session_min == math.inf
    assert tick.clearance() == 0.0
    for pairs in (tuple(tick.pairs), tuple(reversed(tick.pairs))):  # the pairs may be any sequence
        assert dataclasses.replace(tick, pairs=pairs).clearance() == 0.0


def test_a_stale_body_keeps_its_numbers_and_is_never_room(scene, models):
    monitor = Monitor(scene, models)
    monitor.tick(samples(APART), budget_s=60.0)
    tick = monitor.tick(samples(APART, stale=("die",)), budget_s=60.0)
    for pair in tick.pairs:
        assert pair.stale == ("die" in (pair.a, pair.b))
        assert pair.status is PairStatus.EXACT
    assert tick.clearance() == 0.0


def test_the_sessions_minima_are_of_times_when_the_poses_were_good(scene, models):
    monitor = Monitor(scene, models)

    def least(tick):
        (state,) = [p for p in tick.pairs if (p.a, p.b) == ("table", "ball")]
        return state.lower, state.session_min, state.session_min_lower

    near = APART | {"ball": pose(0, 0, 1)}
    reached, *_ = least(monitor.tick(samples(near), budget_s=60.0))
    _, upper, lower = least(monitor.tick(samples(APART), budget_s=60.0))
    assert (upper, lower) == pytest.approx((reached, reached), abs=1e-12)
    nearer = APART | {"ball": pose(0, 0, 0.6)}
    _, upper, _ = least(monitor.tick(samples(nearer, stale=("ball",)), budget_s=60.0))
    assert upper == pytest.approx(reached, abs=1e-12)
    monitor.reset_minima()
    now, upper, _ = least(monitor.tick(samples(APART), budget_s=60.0))
    assert upper == pytest.approx(now, abs=1e-12)


@pytest.mark.parametrize("bad", [np.full((4, 4), np.nan), 2.0 * np.eye(4), np.eye(3)])
def test_a_bad_pose_is_refused_by_name_and_changes_nothing(scene, models, bad):
    monitor = Monitor(scene, models)
    before = monitor.tick(samples(APART), budget_s=60.0)
    with pytest.raises(ValueError, match="rod"):
        monitor.tick(samples(APART | {"ball": pose(0, 0, 0.5), "rod": bad}), budget_s=60.0)
    after = monitor.tick(samples(APART), budget_s=0.0)
    assert [p.lower for p in after.pairs] == [p.lower for p in before.pairs]
    assert {p.status for p in after.pairs} == {PairStatus.EXACT}
