"""Signed distances asked again: resuming, coherence, and events that must not disturb them."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import trimesh
from engine_bodies import IDENTITY, box, from_trimesh, pose, sphere, torus, translation

from proximity_monitor import engine
from proximity_monitor.engine import Status
from proximity_monitor.engine.kernels.base.state import CUT
from proximity_monitor.engine.questions import ball, pair, parts, run, signed
from proximity_monitor.engine.questions.ball import BallSearch
from proximity_monitor.engine.questions.slices import Slices, deadline_of

BALL, SMALL, RING = sphere(4), sphere(4, 0.5), torus(48)
BARS = (
    from_trimesh(trimesh.creation.box((4.0, 0.2, 0.2)).subdivide().subdivide(), "long"),
    from_trimesh(trimesh.creation.box((0.2, 4.0, 0.2)).subdivide().subdivide(), "across"),
)
CROWD = from_trimesh(
    trimesh.util.concatenate(
        [
            trimesh.creation.icosphere(1, 0.1).apply_translation((x, y, 1.4))
            for x in np.linspace(-1.0, 1.0, 8)
            for y in np.linspace(-1.0, 1.0, 8)
        ]
    ),
    "crowd",
)
QUESTIONS = {
    "concentric": (BALL, SMALL, IDENTITY),
    "overlapping": (BALL, BALL, translation(1.0, 0.2, 0.1)),
    "as good as touching": (BALL, BALL, translation(1.99, 0.01, 0.0)),
    "apart": (BALL, RING, translation(2.6, 0.1, 1.0)),
    "shells": (sphere(4, 1.0), sphere(4, 1.01), IDENTITY),
    "bars": (*BARS, translation(0.0, 0.01, 0.05)),
    "crossed bars": (box((4.0, 0.2, 0.2)), box((0.2, 4.0, 0.2)), translation(0.0, 0.0, 0.05)),
    "many parts": (CROWD, BALL, translation(0.05, 0.0, 0.2)),
}


def finished(pair, pose_a, pose_b, budget_s=5e-5, **options):
    """Ask until the search is over. Return all answers."""
    answers = [pair.signed_distance(pose_a, pose_b, budget_s=0.0, **options)]
    while answers[-1].status is Status.OUT_OF_TIME:
        answers.append(pair.signed_distance(pose_a, pose_b, budget_s=budget_s, **options))
        assert len(answers) < 200_000
    return answers


def agree(found, whole, **options):
    """Check that two answers hold the same number, as closely as was asked for."""
    assert max(found.lower, whole.lower) <= min(found.upper, whole.upper) + 1e-13
    assert (
        found.upper - found.lower
        <= max(
            0.01 * abs(found.lower) if found.upper < 0.0 else 0.0,
            options.get("rel_err", 0.0) * abs(found.lower),
            options.get("abs_err", 0.0),
        )
        + 1e-12
    )
    assert (found.upper < 0.0, found.lower > 0.0) == (whole.upper < 0.0, whole.lower > 0.0)


def check_progress(answers):
    """Check that the bounds of answers to one question never become weaker."""
    for before, after in pairwise(answers):
        assert before.lower <= after.lower <= after.upper <= before.upper


@pytest.mark.parametrize("tolerance", [{}, {"rel_err": 0.05}, {"abs_err": 1e-3}])
@pytest.mark.parametrize("name", QUESTIONS)
def test_many_small_budgets_reach_the_same_answer_step_by_step(name, tolerance):
    a, b, here = QUESTIONS[name]
    whole = engine.signed_distance(a, here, b, IDENTITY, **tolerance)
    answers = finished(engine.Pair(a, b), here, IDENTITY, **tolerance)
    assert len(answers) > 1 or name in ("apart", "bars", "crossed bars")
    check_progress(answers)
    for answer in answers:
        assert answer.lower <= whole.upper
        assert whole.lower <= answer.upper
    for before, after in pairwise(answers):
        assert before.bound_tests <= after.bound_tests
    agree(answers[-1], whole, **tolerance)
    # A cut search tests waiting pairs of triangles before more have come together, and looks for a
    # ball from other points. Before it finds a ball, it has to look at the surfaces.
    apart = engine.distance(a, here, b, IDENTITY, **tolerance)
    assert answers[-1].bound_tests <= 2.0 * (whole.bound_tests + apart.bound_tests)


@pytest.mark.parametrize("name", QUESTIONS)
def test_budgets_that_are_over_before_a_search_begins_end_it_all_the_same(name):
    a, b, here = QUESTIONS[name]
    whole = engine.signed_distance(a, here, b, IDENTITY)
    answers = finished(engine.Pair(a, b), here, IDENTITY, budget_s=0.0)
    # There are some calls for each stage; then each call makes many tests.
    assert len(answers) <= 12 + (whole.bound_tests + whole.primitive_tests) / 10
    agree(answers[-1], whole)


@pytest.mark.parametrize("name", QUESTIONS)
def test_a_longer_search_knows_no_less(name):
    """Budgets are as inexact as the clock, so the answers are sorted by how far searches came."""
    a, b, here = QUESTIONS[name]
    answers = [
        engine.signed_distance(a, here, b, IDENTITY, budget_s=budget)
        for budget in (*np.geomspace(1e-5, 1e-2, 12), 10.0)
    ]
    check_progress(
        sorted(answers, key=lambda found: (found.upper < 0.0, found.bound_tests, -found.upper))
    )
    for found in answers:
        apart = float(np.linalg.norm(found.point_a - found.point_b))
        assert found.upper < 0.0 or apart <= found.upper + 1e-12


def test_a_finished_search_is_asked_again():
    pair = engine.Pair(BALL, SMALL)
    first = finished(pair, translation(0.1), IDENTITY)[-1]
    again = pair.signed_distance(translation(0.1), IDENTITY, budget_s=0.0)
    assert first.status is again.status is Status.WITHIN_TOLERANCE
    assert (first.lower, first.upper) == (again.lower, again.upper)
    assert first.primitive_tests == again.primitive_tests


@pytest.mark.parametrize(
    "interruption", ["pose", "tolerance", "distance", "within", "collide", "no budget", "bad pose"]
)
def test_another_question_does_not_spoil_a_search_that_was_cut(interruption):
    elsewhere = translation(0.3, 0.2)
    exact = engine.signed_distance(BALL, IDENTITY, RING, IDENTITY)
    expected = engine.signed_distance(BALL, elsewhere, RING, IDENTITY)
    pair = engine.Pair(BALL, RING)
    cut = pair.signed_distance(IDENTITY, IDENTITY, budget_s=0.0)
    assert cut.status is Status.OUT_OF_TIME
    if interruption == "pose":
        agree(finished(pair, elsewhere, IDENTITY)[-1], expected)
    elif interruption == "tolerance":
        found = finished(pair, IDENTITY, IDENTITY, rel_err=0.5)[-1]
        assert found.lower <= exact.upper
    elif interruption == "distance":
        assert pair.distance(elsewhere, IDENTITY).lower == 0.0
    elif interruption == "within":
        assert pair.within(elsewhere, IDENTITY, 0.1).within
    elif interruption == "collide":
        assert pair.collide(elsewhere, IDENTITY).colliding
    elif interruption == "bad pose":
        with pytest.raises(ValueError, match="pose_b"):
            pair.signed_distance(IDENTITY, 2.0 * IDENTITY, budget_s=1.0)
    else:
        agree(pair.signed_distance(elsewhere, IDENTITY), expected)
    agree(finished(pair, IDENTITY, IDENTITY)[-1], exact)


def test_a_pose_that_is_changed_in_place_is_another_question():
    pair, here = engine.Pair(BALL, SMALL), translation(0.1)
    pair.signed_distance(here, IDENTITY, budget_s=0.0)
    here[0, 3] = 0.6
    expected = engine.signed_distance(BALL, here, SMALL, IDENTITY)
    agree(finished(pair, here, IDENTITY)[-1], expected)


def walk(rng, kind, steps=40):
    """Yield poses with small steps and large jumps, through the other surface and far away."""
    here = pose(rng, 0.5)
    for step in range(steps):
        if step % 10 == 0:
            here = pose(rng, (0.3, 1.0, 2.0)[step // 10 % 3])
        elif kind == "turning":
            here = here @ pose_of_angle(rng, 0.02)
        else:
            here[:3, 3] += {"creeping": 1e-9, "slow": 0.003, "fast": 0.05}[kind] * rng.normal(
                size=3
            )
        yield here.copy()


def pose_of_angle(rng, angle):
    """Return a turn by a small angle about a random axis, with a small step."""
    matrix = np.eye(4)
    x, y, z = angle * rng.normal(size=3)
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    u, _, v = np.linalg.svd(np.eye(3) + skew)
    matrix[:3, :3] = u @ v
    matrix[:3, 3] = 0.1 * angle * rng.normal(size=3)
    return matrix


MODELS = (BALL, SMALL), (BALL, RING), (RING, box()), (CROWD, BALL), (RING, RING)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["creeping", "slow", "fast", "turning"])
@pytest.mark.parametrize("which", range(len(MODELS)))
def test_what_is_remembered_changes_no_answer(which, kind):
    a, b = MODELS[which]
    pair, rng = engine.Pair(a, b), np.random.default_rng(which)
    for here in walk(rng, kind):
        fresh = engine.signed_distance(a, here, b, IDENTITY)
        found = pair.signed_distance(here, IDENTITY)
        agree(found, fresh)


def test_what_was_found_far_from_the_origin_is_remembered_as_roughly_as_it_is_known():
    """Coordinates are rounded by 1e-8 far away, and are exact again on return."""
    pair, far = engine.Pair(BALL, SMALL), translation(1e8, 1e8)
    for x in (0.45, 0.5, 0.55):
        pair.signed_distance(far @ translation(x), far)
        fresh = engine.signed_distance(BALL, translation(x), SMALL, IDENTITY)
        found = pair.signed_distance(translation(x), IDENTITY)
        agree(found, fresh)


@pytest.mark.parametrize("gap", [0.0, 1e-15, 3e-15, 1e-14, 2e-14, 3e-14, 1e-13])
def test_the_last_balls_centre_may_be_as_good_as_on_the_surface(gap):
    a, b = box((1.0, 1.0, 1.0)), box((0.5, 0.5, 0.5))
    pair = engine.Pair(a, b)
    for x in (0.75 + gap, 0.75 - gap, 0.75 + 2.0 * gap):
        assert pair.signed_distance(IDENTITY, translation(0.7)).upper < 0.0
        here = translation(x)
        fresh = engine.signed_distance(a, IDENTITY, b, here)
        found = pair.signed_distance(IDENTITY, here)
        assert found.lower == pytest.approx(fresh.lower, abs=1e-12)
        assert found.upper == pytest.approx(fresh.upper, abs=1e-12)


def test_small_steps_need_a_fraction_of_the_tests():
    for a, b, start in ((BALL, BALL, 1.0), (BALL, RING, 0.3), (RING, RING, 0.2)):
        pair, here = engine.Pair(a, b), translation(start, 0.2, 0.1)
        pair.signed_distance(here, IDENTITY)
        tests = np.zeros(2)
        for _ in range(10):
            here[:3, 3] += (5e-4, -3e-4, 4e-4)
            found = pair.signed_distance(here, IDENTITY)
            fresh = engine.signed_distance(a, here, b, IDENTITY)
            agree(found, fresh)
            tests += found.primitive_tests, fresh.primitive_tests
        # For two balls, the largest ball is centred halfway: a fresh search finds it as soon.
        assert tests[0] < tests[1] or (a is b is BALL and tests[0] <= 2 * 10)


def test_the_sides_of_parts_that_stay_clear_are_not_tested_again():
    pair, here = engine.Pair(CROWD, BALL), translation(0.0, 0.0, 0.1)
    fresh = engine.signed_distance(CROWD, here, BALL, IDENTITY)
    pair.signed_distance(here, IDENTITY)
    for _ in range(5):
        here[2, 3] += 1e-3
        found = pair.signed_distance(here, IDENTITY)
        assert found.lower > 0.0
        assert found.primitive_tests < fresh.primitive_tests - 60


def test_a_refit_forgets_what_was_found_on_the_old_surface():
    model = sphere(3)
    pair = engine.Pair(model, SMALL)
    assert pair.signed_distance(IDENTITY, IDENTITY, budget_s=10.0).upper < -0.4
    for size in (3.0, 1.0, 0.3):
        model.deform(size * sphere(3).vertices)
        expected = engine.signed_distance(
            engine.TriangleMesh(model.vertices, model.faces), IDENTITY, SMALL, IDENTITY
        )
        for budget in (None, 10.0):
            found = pair.signed_distance(IDENTITY, IDENTITY, budget_s=budget)
            agree(found, expected)


@pytest.mark.parametrize("name", ["rel_err", "abs_err", "depth_err", "budget_s"])
@pytest.mark.parametrize("value", [-1e-9, math.nan])
def test_tolerances_and_budgets_that_make_no_sense(name, value):
    with pytest.raises(ValueError, match=name):
        engine.Pair(BALL, SMALL).signed_distance(IDENTITY, IDENTITY, **{name: value})


def test_a_point_equally_far_from_everything_does_not_hold_up_a_search():
    """The nearest of many triangles takes thousands of steps to find, in many slices."""
    whole, sliced = BallSearch(BALL, SMALL), BallSearch(BALL, SMALL)
    count = 0
    for _ in range(2):  # the second time, from the centre of the ball that was found
        for each in (whole, sliced):
            each.begin(IDENTITY, IDENTITY, 0.01, 0.0)
        assert whole.search(math.inf)
        while sliced._slice(False, 64) == CUT:
            count += 1
        assert sliced.depth() == whole.depth()
        assert sliced.points == whole.points
    assert count > 64, "a slice of 64 steps took far more"


def test_a_question_whose_time_is_over_does_one_thing_more(monkeypatch):
    begun = []

    def watched(module):
        return lambda end: begun.append(module) or Slices(end)

    for module in (ball, parts, run):
        monkeypatch.setattr(module, "slices_until", watched(module))
    for a, b, there in QUESTIONS.values():
        pair = engine.Pair(a, b)
        for _ in range(2):  # the second time, the last ball's centre is tried first
            status = Status.OUT_OF_TIME
            while status is Status.OUT_OF_TIME:
                begun.clear()
                status = pair.signed_distance(IDENTITY, there, budget_s=0.0).status
                # A look at one point, for a ball's centre, bounds no distance: `run` may follow.
                assert begun in ([], [ball], [parts], [run], [ball, run])


def test_the_surfaces_are_not_compared_again_while_the_depth_is_searched(monkeypatch):
    a, b, there = QUESTIONS["concentric"]
    pair, asked = engine.Pair(a, b), []
    pair.signed_distance(IDENTITY, there, depth_err=1e-4, budget_s=0.0)
    compare = engine.Pair.distance

    def compare_and_count(pair, *given, **how):
        asked.append(how)
        return compare(pair, *given, **how)

    monkeypatch.setattr(engine.Pair, "distance", compare_and_count)
    answers = finished(pair, IDENTITY, there, budget_s=0.0, depth_err=1e-4)
    in_depth = sum(each.upper < 0.0 for each in answers)
    assert in_depth > 2
    assert len(asked) <= len(answers) - in_depth


@pytest.mark.parametrize("name", ["overlapping", "as good as touching", "bars", "crossed bars"])
def test_the_middle_of_both_tells_that_they_overlap_without_a_look_at_their_surfaces(name):
    a, b, there = QUESTIONS[name]
    found = engine.signed_distance(a, there, b, IDENTITY, depth_err=1e9)
    assert found.upper < 0.0
    assert found.bound_tests == found.primitive_tests == 1


def test_a_middle_that_is_as_near_to_all_of_a_surface_is_left_soon():
    """All triangles of both spheres are about equally near to the common centre."""
    a, b, there = QUESTIONS["concentric"]
    answers = finished(engine.Pair(a, b), there, IDENTITY, budget_s=0.0, depth_err=1e9)
    assert answers[-1].upper < 0.0
    assert len(answers) < 50


@pytest.mark.parametrize("name", ["overlapping", "as good as touching", "bars"])
def test_overlap_is_certain_before_any_space_is_searched(name):
    a, b, there = QUESTIONS[name]
    pair = engine.Pair(a, b)
    found = pair.signed_distance(IDENTITY, there, depth_err=1e9)
    assert found.upper < 0.0
    surfaces = engine.distance(a, IDENTITY, b, there)
    assert found.bound_tests - surfaces.bound_tests <= 12, "one for each point beside the contact"
    assert not pair._signed._depth._ball.at[0]["begun"]


def test_a_ball_at_the_rim_of_the_overlap_misleads_no_search():
    """The bodies slide along each other: the last ball's centre is in both, but a poor start.

    Formerly, a search that began there took twice as many points as a fresh one.
    """
    fine, there = sphere(6), pose(np.random.default_rng(1))
    pair = engine.Pair(fine, fine)
    for angle in 0.06 * np.arange(5):
        way = np.array([math.cos(angle), math.sin(angle), 0.1])
        there[:3, 3] = 1.99 / np.linalg.norm(way) * way
        again = pair.signed_distance(IDENTITY, there)
        anew = engine.signed_distance(fine, IDENTITY, fine, there)
        assert again.primitive_tests <= anew.primitive_tests + 10, angle
        agree(again, anew)


def test_time_is_kept_for_the_answer(monkeypatch):
    given, seek = [], BallSearch.seek

    def watched(self, deadline):
        given.append(deadline)
        return seek(self, deadline)

    monkeypatch.setattr(BallSearch, "seek", watched)
    monkeypatch.setattr(pair, "perf_counter", lambda: 0.0)
    engine.Pair(BALL, SMALL).signed_distance(IDENTITY, IDENTITY, budget_s=1e-3)
    assert deadline_of(0.0, 1e-3) - given[0] == pytest.approx(signed.HAND_OVER_S)
