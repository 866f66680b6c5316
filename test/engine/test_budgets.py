"""Yes-or-no queries under a budget are undecided if time ends before the answer is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from engine_bodies import IDENTITY, pose, soup, sphere, translation
from engine_surfaces import torus_patches

from proximity_monitor import engine
from proximity_monitor.engine.questions import slices, touching

NESTED = sphere(3, 1.0), sphere(3, 1.03)
"""Two shells at much the same distance everywhere, which is the hardest case for a search."""
TANGLED = soup(1, 400, 3.0), soup(2, 400, 3.0)


def until_complete(ask, is_complete):
    """Return the answers of queries without time, repeated until one is complete."""
    answers = [ask()]
    while not is_complete(answers[-1]):
        answers.append(ask())
        assert len(answers) < 100_000
    return answers


@pytest.mark.parametrize("share", [0.0, 0.9, 1.0 - 1e-6, 1.0 + 1e-6, 1.1])
def test_within_is_undecided_until_it_is_known(share):
    exact = engine.distance(NESTED[0], IDENTITY, NESTED[1], IDENTITY)
    clearance = share * exact.upper
    pair = engine.Pair(*NESTED)
    answers = until_complete(
        lambda: pair.within(IDENTITY, IDENTITY, clearance, budget_s=0.0), lambda each: each.decided
    )
    for answer in answers:
        assert answer.lower <= exact.upper
        assert exact.lower <= answer.upper
        assert answer.within or answer.lower > clearance
    assert all(answer.within for answer in answers[:-1]), "nothing excludes it yet"
    assert answers[-1].within == (share > 1.0)
    if share == 1.0 - 1e-6:
        assert len(answers) > 3
    assert engine.within(NESTED[0], IDENTITY, NESTED[1], IDENTITY, clearance).decided


def test_collide_is_undecided_until_it_is_known():
    pair = engine.Pair(*NESTED)
    answers = until_complete(
        lambda: pair.collide(IDENTITY, IDENTITY, budget_s=0.0), lambda each: each.decided
    )
    assert len(answers) > 3
    for answer in answers[:-1]:
        assert answer.colliding
        assert not answer.complete
        assert len(answer.contacts) == len(answer.points) == len(answer.normals) == 0
    assert not answers[-1].colliding
    assert answers[-1].complete


def test_contacts_that_were_found_in_time_are_given_and_said_to_be_incomplete():
    a, b = TANGLED
    whole = engine.collide(a, IDENTITY, b, IDENTITY, all_contacts=True)
    every = {tuple(pair) for pair in whole.contacts.tolist()}
    pair = engine.Pair(a, b)
    answers = until_complete(
        lambda: pair.collide(IDENTITY, IDENTITY, all_contacts=True, budget_s=0.0),
        lambda each: each.complete,
    )
    some = [*answers[:: max(len(answers) // 8, 1)], answers[-1]]
    assert sum(0 < len(answer.contacts) < len(every) for answer in some) > 3
    before = set()
    for answer in some:
        found = {tuple(pair) for pair in answer.contacts.tolist()}
        assert before <= found <= every
        assert answer.decided == bool(found)
        assert answer.colliding
        before = found
    assert before == every
    assert whole.complete


def test_another_question_does_not_go_on_with_the_last_one():
    exact = engine.distance(NESTED[0], IDENTITY, NESTED[1], IDENTITY)
    pair = engine.Pair(*NESTED)
    for _ in range(3):
        assert not pair.collide(IDENTITY, IDENTITY, budget_s=0.0).decided
        assert not pair.within(IDENTITY, IDENTITY, 0.9 * exact.upper, budget_s=0.0).decided
        assert pair.within(IDENTITY, IDENTITY, 1.5 * exact.upper, budget_s=0.0).decided
        found = pair.distance(IDENTITY, IDENTITY, budget_s=0.0)
        assert found.lower <= exact.upper <= found.upper * (1.0 + 1e-12)
    assert not pair.collide(IDENTITY, IDENTITY, budget_s=10.0).colliding


@pytest.mark.parametrize("order", ["depth_first", "priority", "breadth_first"])
def test_a_manifold_is_that_of_its_answer_whenever_it_is_read(order):
    """With a budget of 0, each query runs one slice of a fixed number of steps."""
    options = {"order": order, "manifold": True, "budget_s": 0.0}
    pairs = [engine.Pair(sphere(3), sphere(3, 1.02)) for _ in range(2)]
    for _ in range(20):
        late, soon = (pair.distance(IDENTITY, IDENTITY, **options) for pair in pairs)
        expected = soon.manifold
    pairs[0].distance(IDENTITY, IDENTITY, order=order, manifold=True)
    pairs[0].distance(translation(0.5), IDENTITY, order=order, manifold=True)
    pairs[0].a.deform(2.0 * pairs[0].a.vertices)
    assert len(expected) > 20
    for name in ("lower", "upper", "ranges_a", "ranges_b"):
        assert np.array_equal(getattr(late.manifold, name), getattr(expected, name)), name


def test_contacts_are_those_of_their_answer_whenever_they_are_read():
    pairs = [engine.Pair(soup(1, 400, 3.0), soup(2, 400, 3.0)) for _ in range(2)]
    here = pose(np.random.default_rng(3), 0.3)
    late, soon = (pair.collide(here, IDENTITY, all_contacts=True) for pair in pairs)
    expected = soon.contacts, soon.points, soon.normals
    here[:3, 3] += 1.0
    pairs[0].collide(here, IDENTITY, all_contacts=True)
    pairs[0].a.deform(2.0 * pairs[0].a.vertices)
    assert len(expected[0]) > 20
    for found, wanted in zip((late.contacts, late.points, late.normals), expected, strict=True):
        assert np.array_equal(found, wanted)


@pytest.mark.parametrize("value", [-1e-9, -math.inf, math.nan])
@pytest.mark.parametrize("ask", [engine.collide, engine.within])
def test_budgets_that_make_no_sense(ask, value):
    more = (0.1,) if ask is engine.within else ()
    with pytest.raises(ValueError, match="budget_s"):
        ask(NESTED[0], IDENTITY, NESTED[1], IDENTITY, *more, budget_s=value)


class Clock:
    """A clock that advances with each step. A pace, seconds per step, applies from a given time."""

    def __init__(self, *paces):
        self.now = 0.0
        self._paces = paces

    def work(self, steps):
        for _ in range(steps):
            self.now += next(pace for begin, pace in reversed(self._paces) if self.now >= begin)


@pytest.mark.parametrize("budget_s", [3e-5, 1e-4, 1e-3, 1e-2])
@pytest.mark.parametrize("slower", [1.0, 3.0])
def test_slices_end_with_the_budget(budget_s, slower, monkeypatch):
    clock = Clock((0.0, 1e-7), (0.7 * budget_s, slower * 1e-7))
    monkeypatch.setattr(slices, "perf_counter", lambda: clock.now)
    work, looks = slices.Slices(budget_s), 0
    while True:
        clock.work(work.steps)
        looks += 1
        if work.over():
            break
    assert 0.6 * budget_s - 1e-5 <= clock.now <= budget_s + 1e-6
    assert looks < 40


@pytest.mark.parametrize("instant", [0.0, 1e-9])
def test_a_slice_that_was_over_at_once_makes_no_long_one(instant, monkeypatch):
    clock = Clock((0.0, 1e-7))
    monkeypatch.setattr(slices, "perf_counter", lambda: clock.now)
    work = slices.Slices(1e-3)
    for _ in range(3):
        clock.work(work.steps)
        assert not work.over()
    before = work.steps
    clock.now += instant  # its steps found nothing to do
    assert not work.over()
    clock.work(work.steps)
    assert work.steps <= 2 * before
    assert clock.now < 1e-3, "the next slice overruns, though its steps take as long as all others"


def test_a_share_of_a_budget_is_kept_for_the_end_of_a_call():
    """The share is a fiftieth, at most 100 µs. A budget of 0 ends at once."""
    assert slices.deadline_of(1.0, None) is None
    assert slices.deadline_of(1.0, 0.0) == 1.0
    assert slices.deadline_of(1.0, math.inf) == math.inf
    assert slices.deadline_of(1.0, 1e-3) == pytest.approx(1.0 + 0.98e-3, abs=1e-12)
    assert slices.deadline_of(1.0, 1.0) == pytest.approx(2.0 - 1e-4, abs=1e-12)


def test_contacts_begin_little_by_little_where_no_time_is_left(monkeypatch):
    done = []

    def watch(owner, name):
        work = getattr(owner, name)
        monkeypatch.setattr(owner, name, lambda *given: done.append(name) or work(*given))

    for owner, name in (
        (touching.Search, "divided"), (touching, "_of_leaves"), (touching, "_elements_of"),
        (touching, "table"), (touching.Search, "run_queries"),
    ):  # fmt: skip
        watch(owner, name)
    ring, at = engine.ParametricSurface(torus_patches()), np.eye(4)
    at[:3, 3] = 1.0, 0.0, 0.1
    pair, complete, calls = engine.Pair(ring, ring), False, []
    while not complete:
        done.clear()
        found = pair.collide(np.eye(4), at, all_contacts=True, budget_s=0.0)
        complete = found.complete
        calls.append(tuple(done))
    parts = "divided", "_of_leaves", "_elements_of", "table", "run_queries"
    assert set(calls) == {(), *((part,) for part in parts)}
