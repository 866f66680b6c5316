"""Tolerances, budgets and resuming: every stop leaves certified bounds."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from engine_bodies import IDENTITY, ORDERS, box, pose, soup, sphere, torus

from proximity_monitor import engine
from proximity_monitor.engine import Status

A, B = sphere(3), torus(24)
NESTED = sphere(4, 1.0), sphere(4, 1.01)
"""Two shells whose distance is nearly the same everywhere: the hardest question there is."""


def separated(seed, count=20):
    """Yield pairs of poses at which A and B are apart, with the exact answer."""
    rng = np.random.default_rng(seed)
    while count:
        pose_a, pose_b = pose(rng, 2.0), pose(rng, 2.0)
        exact = engine.distance(A, pose_a, B, pose_b)
        if exact.status is Status.EXACT:
            count -= 1
            yield pose_a, pose_b, exact


def finished(pair, pose_a, pose_b, **options):
    """Ask until the search is over. Return all answers."""
    answers = [pair.distance(pose_a, pose_b, **options)]
    while answers[-1].status is Status.OUT_OF_TIME:
        answers.append(pair.distance(pose_a, pose_b, **options))
        assert len(answers) < 200_000
    return answers


@pytest.mark.parametrize("rel_err", [1e-6, 0.01, 0.3, 10.0])
def test_relative_tolerance(rel_err):
    for pose_a, pose_b, exact in separated(1):
        found = engine.distance(A, pose_a, B, pose_b, rel_err=rel_err)
        assert found.lower <= exact.upper
        assert exact.lower <= found.upper
        assert found.upper <= (1.0 + rel_err) * exact.upper + 1e-14
        assert found.upper <= (1.0 + rel_err) * found.lower + 1e-14
        assert found.status in (Status.WITHIN_TOLERANCE, Status.EXACT)
        assert found.bound_tests <= exact.bound_tests


@pytest.mark.parametrize("abs_err", [1e-6, 0.01, 0.3, math.inf])
def test_absolute_tolerance(abs_err):
    for pose_a, pose_b, exact in separated(2):
        found = engine.distance(A, pose_a, B, pose_b, abs_err=abs_err)
        assert found.lower <= exact.upper
        assert exact.lower <= found.upper
        assert found.upper <= exact.upper + abs_err + 1e-14
        assert found.upper <= found.lower + abs_err + 1e-14
        assert found.status in (Status.WITHIN_TOLERANCE, Status.EXACT)


def test_whichever_tolerance_is_reached_first_stops_the_search():
    for pose_a, pose_b, _ in separated(3):
        relative = engine.distance(A, pose_a, B, pose_b, rel_err=0.2)
        absolute = engine.distance(A, pose_a, B, pose_b, abs_err=0.2)
        both = engine.distance(A, pose_a, B, pose_b, rel_err=0.2, abs_err=0.2)
        assert both.upper <= max(both.lower * 1.2, both.lower + 0.2) + 1e-14
        # A further tolerance that is reached much later does not change the search.
        early = engine.distance(A, pose_a, B, pose_b, rel_err=0.2, abs_err=1e-9)
        late = engine.distance(A, pose_a, B, pose_b, rel_err=1e-9, abs_err=0.2)
        assert early.bound_tests == relative.bound_tests
        assert late.bound_tests == absolute.bound_tests


def test_a_tolerance_saves_work_and_says_that_it_did():
    exact = engine.distance(NESTED[0], IDENTITY, NESTED[1], IDENTITY)
    loose = engine.distance(NESTED[0], IDENTITY, NESTED[1], IDENTITY, rel_err=0.5)
    assert exact.status is Status.EXACT
    assert loose.status is Status.WITHIN_TOLERANCE
    assert loose.bound_tests < exact.bound_tests


def test_no_budget_at_all_gives_certified_bounds():
    a, b = NESTED
    for pose_b in (pose(np.random.default_rng(seed)) for seed in range(4)):
        exact = engine.distance(a, IDENTITY, b, pose_b)
        found = engine.distance(a, IDENTITY, b, pose_b, budget_s=0.0)
        assert found.status is Status.OUT_OF_TIME
        assert found.lower <= exact.lower
        assert exact.upper <= found.upper < math.inf
        gap = np.linalg.norm(found.point_a - found.point_b)
        assert found.upper == pytest.approx(gap, abs=1e-13)


def test_a_large_budget_gives_the_exact_answer():
    for pose_a, pose_b, exact in separated(5, count=5):
        found = engine.distance(A, pose_a, B, pose_b, budget_s=3600.0)
        assert found.status is Status.EXACT
        assert (found.lower, found.upper) == (exact.lower, exact.upper)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("tolerance", [{}, {"rel_err": 0.05}, {"abs_err": 1e-4}])
def test_many_small_budgets_reach_the_same_answer_step_by_step(tolerance, order):
    options = {"order": order, **tolerance}
    whole = engine.distance(NESTED[0], IDENTITY, NESTED[1], IDENTITY, **options)
    answers = finished(engine.Pair(*NESTED), IDENTITY, IDENTITY, budget_s=2e-4, **options)
    assert len(answers) > 2
    for before, after in pairwise(answers):
        assert before.lower <= after.lower <= after.upper <= before.upper
        assert before.bound_tests <= after.bound_tests
        assert before.primitive_tests <= after.primitive_tests
    last = answers[-1]
    assert (last.lower, last.upper, last.status) == (whole.lower, whole.upper, whole.status)
    for answer in answers:
        assert answer.lower <= whole.upper
        assert whole.lower <= answer.upper


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("budget_s", [0.0, 1e-9, 1e-6])
def test_budgets_that_are_over_before_a_search_begins_end_it_all_the_same(budget_s, order):
    whole = engine.distance(NESTED[0], IDENTITY, NESTED[1], IDENTITY, order=order)
    pair, answers = engine.Pair(*NESTED), []
    while not answers or answers[-1].status is Status.OUT_OF_TIME:
        answers.append(pair.distance(IDENTITY, IDENTITY, budget_s=budget_s, order=order))
        assert len(answers) <= whole.bound_tests
    assert (answers[-1].lower, answers[-1].upper) == (whole.lower, whole.upper)


def test_a_finished_search_is_asked_again():
    pair = engine.Pair(A, B)
    pose_a, pose_b, exact = next(separated(6))
    for _ in range(3):
        again = finished(pair, pose_a, pose_b, budget_s=1.0)[-1]
        assert again.status is Status.EXACT
        assert again.upper == pytest.approx(exact.upper, abs=1e-14)
        assert again.lower <= exact.upper


@pytest.mark.parametrize(
    "interruption", ["pose", "tolerance", "order", "within", "collide", "no budget"]
)
def test_another_question_does_not_spoil_a_search_that_was_cut(interruption):
    exact = engine.distance(NESTED[0], IDENTITY, NESTED[1], IDENTITY)
    elsewhere = pose(np.random.default_rng(7), 3.0)
    expected = engine.distance(NESTED[0], elsewhere, NESTED[1], IDENTITY)
    pair = engine.Pair(*NESTED)
    assert pair.distance(IDENTITY, IDENTITY, budget_s=0.0).status is Status.OUT_OF_TIME
    if interruption == "pose":
        found = finished(pair, elsewhere, IDENTITY, budget_s=1.0)[-1]
        assert found.upper == pytest.approx(expected.upper, abs=1e-13)
    elif interruption == "tolerance":
        found = pair.distance(IDENTITY, IDENTITY, rel_err=0.5, budget_s=1.0)
        assert found.lower <= exact.upper <= found.upper * (1.0 + 1e-12)
    elif interruption == "order":
        found = pair.distance(IDENTITY, IDENTITY, order="priority", budget_s=0.0)
        assert found.lower <= exact.lower
    elif interruption == "within":
        assert pair.within(elsewhere, IDENTITY, expected.upper * 1.001).within
    elif interruption == "collide":
        assert not pair.collide(elsewhere, IDENTITY).colliding
    else:
        found = pair.distance(elsewhere, IDENTITY)
        assert found.upper == pytest.approx(expected.upper, abs=1e-13)
    found = finished(pair, IDENTITY, IDENTITY, budget_s=1.0)[-1]
    assert found.status is Status.EXACT
    assert found.upper == pytest.approx(exact.upper, rel=1e-12)


def test_a_pose_that_is_changed_in_place_is_another_question():
    pair, here = engine.Pair(A, B), pose(np.random.default_rng(8), 3.0)
    pair.distance(here, IDENTITY, budget_s=0.0)
    here[:3, 3] += 1.0
    expected = engine.distance(A, here, B, IDENTITY)
    found = finished(pair, here, IDENTITY, budget_s=1.0)[-1]
    assert found.upper == pytest.approx(expected.upper, abs=1e-13)


def test_a_bad_pose_leaves_a_pair_usable():
    pair = engine.Pair(A, B)
    pose_a, pose_b, exact = next(separated(9))
    for budget in (None, 0.0, 1.0):
        with pytest.raises(ValueError, match="pose_a"):
            pair.distance(2.0 * np.eye(4), pose_b, budget_s=budget)
        with pytest.raises(ValueError, match="pose_b"):
            pair.distance(pose_a, np.full((4, 4), np.nan), budget_s=budget)
        found = finished(pair, pose_a, pose_b, budget_s=1.0)[-1]
        assert found.upper == pytest.approx(exact.upper, abs=1e-13)


def test_a_remembered_pair_answers_like_a_new_one():
    """The path has small steps, large jumps, crossings and standstills."""
    meshes = (A, B), (box(), soup(3)), (soup(4), B)
    rng = np.random.default_rng(10)
    for a, b in meshes:
        pair = engine.Pair(a, b)
        here = pose(rng, 2.0)
        for step in range(60):
            if step % 10 == 0:
                here = pose(rng, 2.0)
            elif step % 10 < 8:
                here[:3, 3] += 0.05 * rng.normal(size=3)
            fresh = engine.distance(a, here, b, IDENTITY)
            found = pair.distance(here, IDENTITY)
            size = 1e-14 * (a.radius + b.radius + float(np.abs(here[:3, 3]).sum()))
            assert found.status is fresh.status
            assert found.upper == pytest.approx(fresh.upper, abs=size)
            assert found.lower == pytest.approx(fresh.lower, abs=size)


def test_coherence_saves_work():
    pair = engine.Pair(*NESTED)
    here = IDENTITY.copy()
    here[0, 3] = 2.5
    first = pair.distance(here, IDENTITY)
    here[0, 3] = 2.501
    second = pair.distance(here, IDENTITY)
    fresh = engine.distance(NESTED[0], here, NESTED[1], IDENTITY)
    assert second.primitive_tests <= fresh.primitive_tests
    assert second.upper == pytest.approx(fresh.upper, abs=1e-14)
    assert first.upper < second.upper


@pytest.mark.parametrize("name", ["rel_err", "abs_err", "budget_s"])
@pytest.mark.parametrize("value", [-1e-9, -math.inf, math.nan])
def test_tolerances_and_budgets_that_make_no_sense(name, value):
    with pytest.raises(ValueError, match=name):
        engine.distance(A, IDENTITY, B, IDENTITY, **{name: value})


def test_an_order_that_there_is_not():
    with pytest.raises(ValueError, match="order = 'random'"):
        engine.distance(A, IDENTITY, B, IDENTITY, order="random")
