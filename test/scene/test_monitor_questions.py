"""The monitor answers only what is asked: sides of thresholds, contact, signed distances."""

import numpy as np
import pytest
from crowds import assert_certified, exact, meshes_of, placed, samples, text, walk

from proximity_monitor import engine
from proximity_monitor.scene import Thresholds
from proximity_monitor.scene.monitor import Monitor
from proximity_monitor.scene.opening import load_models
from proximity_monitor.scene.state import PairStatus

COUNT = 8
HEAD = "thresholds: {warn: 0.5, stop: 0.1, hysteresis: 0.2}"
LEVELS = (0.1, 0.5, 0.1 + 0.2, 0.5 + 0.2)


def watch(load, **parts):
    scene = load(text(COUNT, **parts))
    models = meshes_of(scene)
    return scene, models, Monitor(scene, models)


def undecided(pair, levels):
    return [level for level in levels if pair.lower <= level < pair.upper]


@pytest.mark.parametrize("asked", ["by the scene", "by nobody who wants numbers"])
def test_every_pair_is_decided_against_its_thresholds_and_no_more(load, asked):
    numbers = asked == "by the scene"
    head = HEAD + ("\nquestion: within" if numbers else "")
    _, models, monitor = watch(load, head=head)
    inexact = 0
    for poses in walk(COUNT, 30):
        tick = monitor.tick(samples(poses), 1.0, distances=numbers)
        true = exact(models, poses)
        assert_certified(tick, true)
        assert tick.left == 0
        for pair in tick.pairs:
            # A cylinder's deviation may leave a threshold open, for the engine's answer too.
            assert set(undecided(pair, LEVELS)) <= set(undecided(true[pair.a, pair.b], LEVELS))
            inexact += pair.upper - pair.lower > 1e-3
    assert inexact > 200, "a number costs more than its side of a threshold"


def test_a_decided_pair_is_not_looked_at_again_while_its_bounds_decide(load):
    _, _, deciding = watch(load, head=HEAD + "\nquestion: within")
    _, _, measuring = watch(load, head=HEAD)
    looked = [
        sum(len(monitor.tick(samples(poses), 1.0).searched) for poses in walk(COUNT, 30))
        for monitor in (deciding, measuring)
    ]
    assert looked[0] < 0.2 * looked[1]


def test_who_wants_numbers_gets_them_at_once(load):
    """After a tick without distances, pairs that were only decided are searched."""
    _, models, monitor = watch(load, head=HEAD)
    poses = next(walk(COUNT, 1))
    monitor.tick(samples(poses), 1.0, distances=False)
    tick = monitor.tick(samples(poses), 1.0)
    assert {p.status for p in tick.pairs} <= {PairStatus.EXACT, PairStatus.INTERSECTING}
    for pair in tick.pairs:
        assert pair.upper == pytest.approx(exact(models, poses)[pair.a, pair.b].upper, abs=1e-9)


def test_contact_alone_is_decided(load):
    _, models, monitor = watch(load, head="question: collide")
    crossing = 0
    for poses in walk(COUNT, 30, spread=0.8):
        tick = monitor.tick(samples(poses), 1.0)
        true = exact(models, poses)
        assert_certified(tick, true)
        for pair in tick.pairs:
            touching = true[pair.a, pair.b].lower <= 0.0
            assert touching == (pair.lower <= 0.0)
            assert touching == (pair.status in (PairStatus.INTERSECTING, PairStatus.OVERLAPPING))
            crossing += touching
    assert crossing > 10


def test_a_distance_that_is_the_threshold_to_rounding_is_settled(load):
    """Rounding leaves its side of the threshold open. One search is made, not one per tick."""
    scene, models, monitor = watch(load, head="question: within")
    poses = next(walk(COUNT, 1))
    true = exact(models, poses)
    limits = [
        Thresholds((at := true[pair.a, pair.b]).lower / 2 + at.upper / 2, 0.0, 0.0)
        for pair in scene.pairs
    ]
    monitor.set_thresholds(limits)
    tick = monitor.tick(samples(poses), 1.0)
    assert tick.left == 0
    assert_certified(tick, true)
    assert monitor.tick(samples(poses), 1.0).searched == ()


@pytest.mark.parametrize("budget_s", [0.0, 3e-4, 1.0])
def test_solids_have_certified_signed_distances(load, budget_s):
    _, models, monitor = watch(load)
    overlapping = 0
    for poses in walk(COUNT, 25, spread=0.5):
        tick = monitor.tick(samples(poses), budget_s)
        true = exact(models, poses)
        assert_certified(tick, true)
        for pair in tick.pairs:
            at = true[pair.a, pair.b]
            if budget_s == 1.0:
                assert (pair.status is PairStatus.OVERLAPPING) == (at.upper < 0.0)
            overlapping += at.upper < 0.0
        assert tick.clearance() <= min(at.upper for at in true.values())
        if budget_s == 1.0:
            assert tick.left == 0
            for pair in monitor.tick(samples(poses), budget_s).pairs:
                upper = true[pair.a, pair.b].upper
                assert pair.upper == pytest.approx(upper, abs=1e-9, rel=0.011), "to 1 %"
    assert overlapping > 50


def room_and_body(load, room, body):
    """Return a scene of a 9 m box and a small body, each with its key `solid`."""
    room = (
        f"bodies:\n  - {{name: room, primitive: {{box: {{size: [9, 9, 9]}}}}, moving: true{room}}}"
    )
    return load(text(1, body=body).replace("bodies:", room))


@pytest.mark.parametrize(
    "solid, depth",
    [
        (("", ""), 0.5),
        ((", solid: true", ", solid: false"), 4.2),
        ((", solid: robust", ", solid: true"), 0.5),
    ],
)
def test_a_part_that_jumps_wholly_inside_another_is_never_clear(load, solid, depth):
    """The surfaces are far from each other again, so only the sign shows the overlap.

    Solids overlap by the largest ball in the smaller one; a surface, by its deepest point.
    """
    scene = room_and_body(load, *solid)
    models = load_models(scene)
    there = placed([20.0, 0.0, 0.0], [0, 0, 0, 1])
    for budget_s in (0.0, 1e-6, 1e-4, 1.0):
        monitor = Monitor(scene, models)
        (before,) = monitor.tick(samples({"room": np.eye(4), "b0": there}), 1.0).pairs
        assert before.lower > 10.0
        inside = samples({"room": np.eye(4), "b0": np.eye(4)})
        (pair,) = monitor.tick(inside, budget_s).pairs
        assert pair.lower <= -depth
        if budget_s == 1.0:
            assert pair.status is PairStatus.OVERLAPPING
        (later,) = monitor.tick(inside, 1.0).pairs
        assert later.upper <= -depth


@pytest.mark.parametrize("body", ["", ", solid: false"])
def test_a_body_may_lie_inside_a_surface(load, body):
    """The distance is between the surfaces, as no part of the outer is inside the other."""
    scene = room_and_body(load, ", solid: false", body)
    monitor = Monitor(scene, load_models(scene))
    (pair,) = monitor.tick(samples({"room": np.eye(4), "b0": np.eye(4)}), 1.0).pairs
    assert pair.status is PairStatus.EXACT
    assert pair.lower > 4.0


def test_signed_searches_are_for_solids_that_may_overlap_alone(load, monkeypatch):
    asked = []
    signed = engine.Pair.signed_distance

    def counted(pair, *arguments, **options):
        asked.append(pair)
        return signed(pair, *arguments, **options)

    solids, surfaces = (watch(load, body=body)[2] for body in ("", ", solid: false"))
    monkeypatch.setattr(engine.Pair, "signed_distance", counted)
    for poses in walk(COUNT, 5, spread=1.0):
        surfaces.tick(samples(poses), 1.0)
    assert asked == []
    apart, was = 0, 0
    for poses in walk(COUNT, 20, spread=1.0, step=0.3):
        before = len(asked)
        tick = solids.tick(samples(poses), 1.0)
        overlapping = sum(pair.lower <= 0.0 for pair in tick.pairs)
        # A pair that overlapped at the last tick may have come apart.
        assert len(set(asked[before:])) <= overlapping + was
        apart += len(tick.pairs) - overlapping
        was = overlapping
    assert apart > 300
    assert len(asked) > 20


def test_a_solid_that_is_none_is_refused_with_its_place_in_the_file(load):
    scene = load(text(2, body=", solid: true"))
    models = load_models(scene)
    models["b1"] = engine.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    expected = r"\.yaml:6: bodies\[1\]\.solid: true, but body 'b1' is not a solid: not watertight"
    with pytest.raises(engine.ModelError, match=expected):
        Monitor(scene, models)


def test_a_depth_that_comes_with_its_sign_is_an_answer_for_the_present_poses(load):
    """A ball's depth in a box follows from the distance of its centre, so nothing is left open."""
    scene = load("""
version: 1
unit: m
pairs: all
thresholds: {warn: 0.1, stop: 0.02, hysteresis: 0.01}
bodies:
  - {name: table, primitive: {box: {size: [2, 2, 0.1]}}, pose: {position: [0, 0, -0.05]}}
  - {name: ball, primitive: {sphere: {radius: 0.1}}, moving: true}
""")
    monitor = Monitor(scene, load_models(scene))
    for height in (0.5, 0.05, 0.05, 0.05):
        pose = np.eye(4)
        pose[2, 3] = height
        tick = monitor.tick(samples({"ball": pose}), 1.0)
        (pair,) = tick.pairs
        assert tick.left == 0 and pair.age_s == 0.0
    assert pair.status is PairStatus.OVERLAPPING
    assert pair.lower == pytest.approx(-0.05, rel=0.011)
