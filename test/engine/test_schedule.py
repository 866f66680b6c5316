"""Queries about many pairs: which are searched, which are left alone, and what is reported."""

from __future__ import annotations

import itertools
from time import perf_counter

import numpy as np
import pytest
from engine_bodies import SMALL, pose, sphere, torus

from proximity_monitor import engine
from proximity_monitor.engine.assembly.answers import Answers
from proximity_monitor.engine.assembly.schedule import Schedule
from proximity_monitor.engine.kernels.base import state as index

COUNT = 12
STATUS = tuple(engine.Status)
OUT_OF_TIME = STATUS.index(engine.Status.OUT_OF_TIME)


class Watched:
    """All pairs of a crowd of bodies, and their schedule."""

    def __init__(self, seed=0):
        self.rng = np.random.default_rng(seed)
        meshes = list(SMALL.values())
        models = [meshes[i % len(meshes)] for i in range(COUNT)]
        self.pairs = np.array(list(itertools.combinations(range(COUNT), 2)))
        self.assembly = engine.Assembly(models)
        self.answers = Answers(models, [str(i) for i in range(COUNT)])
        self.rows = self.answers.add(self.pairs, np.zeros(len(self.pairs), bool))
        self.schedule = Schedule(self.answers, self.assembly)
        self.schedule.begin(self.rows)
        self.known, self.silent = np.ones(COUNT, bool), np.zeros(COUNT, bool)
        self.move()

    def move(self):
        self.poses = np.array([pose(self.rng, 4.0) for _ in range(COUNT)])
        self.answers.move(np.arange(COUNT), self.poses)

    def update(self, distances=True):
        self.schedule.update(self.rows, self.known, self.silent, distances)

    def search(self, budget_s=60.0):
        """Search all open entries once. Return the entries that were searched, in their order."""
        queries = self.schedule.queries(self.schedule.order())
        return self.schedule.search_together(queries, budget_s, 1, perf_counter)

    def search_all(self):
        while len(self.search()):
            pass

    def exact(self):
        return self.assembly.distances(self.poses, self.pairs)

    def report(self):
        return self.schedule.report(perf_counter())


@pytest.fixture
def watched():
    return Watched()


def test_what_is_searched_has_the_assemblys_answer_and_is_not_searched_again(watched):
    found = watched.exact()
    watched.update()
    watched.search_all()
    states, left = watched.report()
    assert left == 0
    assert np.array_equal(states["bodies"], watched.pairs)
    assert np.allclose(states["lower"], found.lower, rtol=0.0, atol=1e-12)
    assert np.allclose(states["upper"], found.upper, rtol=0.0, atol=1e-12)
    assert {STATUS[code] for code in states["status"]} <= {
        engine.Status.EXACT,
        engine.Status.INTERSECTING,
    }
    assert not states["age_s"].any()
    watched.update()
    assert not len(watched.schedule.order()), "the bodies stand still"


def test_pairs_beyond_their_range_are_neither_searched_nor_reported(watched):
    watched.schedule.records["range"] = 1.0
    watched.update()
    watched.search_all()
    found = watched.exact()
    states, left = watched.report()
    assert left == 0
    assert states["at"].tolist() == np.flatnonzero(found.upper <= 1.0).tolist()


def test_open_sides_of_levels_come_first_then_the_nearest_and_stale_ones_last(watched):
    watched.update()
    states, _ = watched.report()
    lower, upper = states["lower"], states["upper"]
    level = float(np.median(upper))
    watched.schedule.records["levels"][watched.rows] = level
    watched.silent[3] = True
    watched.update()
    urgent = (lower <= level) & (level < upper)
    stale = (watched.pairs == 3).any(axis=1)
    got = watched.schedule.order()
    rank = [(bool(stale[k]), not urgent[k], float(lower[k])) for k in got]
    assert rank == sorted(rank)
    assert sorted(got.tolist()) == list(range(len(lower)))
    assert 0 < urgent.sum() < len(urgent)


def test_a_decided_level_ends_the_question_where_no_number_is_wanted(watched):
    watched.schedule.records["levels"][watched.rows] = 1.0
    watched.update(distances=False)
    watched.search_all()
    found = watched.exact()
    states, _ = watched.report()
    beyond = states["lower"] > 1.0
    assert (beyond | (states["upper"] <= 1.0)).all()
    assert np.array_equal(beyond, found.lower > 1.0)
    assert (states["upper"] - states["lower"] > 1e-6).any(), "numbers would have cost more"


def test_what_the_budget_does_not_reach_keeps_its_bounds_and_is_left(watched):
    watched.update()
    before, _ = watched.report()
    reached = np.isin(before["at"], watched.search(budget_s=0.0))
    assert 0 < reached.sum() < len(watched.pairs), "every search makes some progress"
    after, left = watched.report()
    assert left >= (~reached).sum()
    assert np.array_equal(before["lower"][~reached], after["lower"][~reached])
    assert np.isinf(after["age_s"][~reached]).all()


def test_pairs_of_unknown_poses_have_no_numbers_and_ignored_ones_are_left_out(watched):
    watched.known[2], watched.silent[2] = False, True
    watched.schedule.records["ignored"][watched.rows[:5]] = True
    watched.update()
    watched.search_all()
    states, _ = watched.report()
    assert states["at"].tolist() == list(range(5, len(watched.pairs)))
    unknown = (states["bodies"] == 2).any(axis=1)
    assert np.isnan(states["lower"][unknown]).all()
    assert (states["status"][unknown] == Schedule.UNKNOWN).all()
    assert np.array_equal(states["silent"].any(axis=1), unknown)
    assert np.isfinite(states["lower"][~unknown]).all()


def test_the_smallest_bounds_of_all_moments_are_kept(watched):
    least = np.full((2, len(watched.pairs)), np.inf)
    for _ in range(3):
        watched.update()
        watched.search()
        states, _ = watched.report()
        least = np.minimum(least, (states["lower"], states["upper"]))
        assert np.array_equal(least, (states["min_lower"], states["min_upper"]))
        watched.move()


def test_a_search_that_was_cut_leaves_no_points_of_a_body_before_its_deformation():
    ball, other = sphere(2), sphere(2)
    poses = np.array([np.eye(4), np.eye(4)])
    poses[1, 0, 3] = 3.0
    models = [ball, other]
    answers = Answers(models, ["ball", "other"])
    schedule = Schedule(answers, engine.Assembly(models))
    rows = answers.add(np.array([[0, 1]]), np.zeros(1, bool))
    schedule.begin(rows)
    answers.move(np.arange(2), poses)
    known, silent = np.ones(2, bool), np.zeros(2, bool)

    def look():
        schedule.update(rows, known, silent, True)
        return schedule.queries(schedule.order())

    schedule.search_together(look(), 60.0, 1, perf_counter)
    before = ball.vertices
    ball.deform(0.7 * before)
    answers.reshape(0, 1.001 * np.linalg.norm(ball.vertices - before, axis=1).max())
    queries = look()
    # Points of both models that are far from the nearest ones.
    far = (ball.vertices[ball.vertices[:, 0].argmin()], other.vertices[0] + poses[1, :3, 3])
    upper = np.linalg.norm(far[0] - far[1])
    row = np.array(
        [0.0, upper, *far[0], *far[1], 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 1, OUT_OF_TIME, 0, 0]
    )
    schedule.commit(queries, row[None], perf_counter())
    poses[1, 1, 3] += 1e-9
    answers.move(np.arange(2), poses)
    look()
    state = schedule.report(perf_counter())[0][0]
    true = engine.distance(ball, poses[0], other, poses[1]).upper
    assert state["lower"] <= true <= state["upper"]


def test_points_that_stay_the_nearest_do_not_drift_however_often_searches_are_cut():
    """Float32 rotations are orthogonal to 1e-7: turning a vector there and back shortens it."""
    ball, other = sphere(2), sphere(2)
    models = [ball, other]
    answers = Answers(models, ["ball", "other"])
    schedule = Schedule(answers, engine.Assembly(models))
    rows = answers.add(np.array([[0, 1]]), np.zeros(1, bool))
    schedule.begin(rows)
    schedule.records["abs_err"] = 1.0
    known, silent = np.ones(2, bool), np.zeros(2, bool)
    poses = np.array([np.eye(4), np.eye(4)])
    poses[1, 0, 3] = 2.01
    poses[:, :3, :3] *= 1.0 - 4e-7

    def look(shift):
        poses[1, 1, 3] = shift
        answers.move(np.arange(2), poses)
        schedule.update(rows, known, silent, True)
        return engine.distance(ball, poses[0], other, poses[1])

    exact = look(0.0)
    schedule.commit(schedule.queries(np.zeros(1, np.int64)), exact.row[None], perf_counter())
    far = exact.row.copy()
    far[[index.LOWER, index.UPPER, index.STATUS]] = 0.0, 50.0, OUT_OF_TIME
    for k in range(300):
        true = look(1e-9 * (k + 1)).upper
        schedule.commit(schedule.queries(np.zeros(1, np.int64)), far[None], perf_counter())
        state = schedule.report(perf_counter())[0][0]
        assert state["lower"] <= true <= state["upper"]


def test_as_many_answers_as_queries_and_bodies_as_bodies_are_asked_for(watched):
    watched.update()
    with pytest.raises(ValueError, match="0 answers, expected 66"):
        watched.schedule.commit(
            watched.schedule.queries(watched.schedule.order()),
            np.empty((0, index.ANSWER)),
            perf_counter(),
        )
    few = engine.Assembly([SMALL["torus"]])
    with pytest.raises(ValueError, match="has 1 bodies, but the answers are about 12"):
        Schedule(watched.answers, few)


def test_a_level_inside_of_what_a_tolerance_left_is_decided_when_only_that_is_asked(watched):
    watched.schedule.records["rel_err"] = 0.5
    watched.update()
    watched.search_all()
    states, _ = watched.report()
    wide = states["upper"] - states["lower"] > 1e-3
    assert wide.any()
    watched.schedule.records["levels"][:, 0] = (states["lower"] + states["upper"]) / 2.0
    watched.update(distances=False)
    watched.search_all()
    states, left = watched.report()
    level = watched.schedule.records["levels"][:, 0]
    assert left == 0 and ((states["lower"] > level) | (states["upper"] <= level))[wide].all()


def test_of_models_that_met_the_surfaces_tell_first_and_how_deep_comes_last():
    """The depth takes a hundred times as long as the search that a threshold needs."""
    ball = sphere(2)
    answers = Answers([ball, ball, ball], ["a", "b", "c"])
    schedule = Schedule(answers, engine.Assembly([ball, ball, ball]))
    rows = answers.add(np.array([[0, 1], [0, 2]]), np.ones(2, bool))
    schedule.begin(rows)
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[1, 0, 3], poses[2, 1, 3] = 1.8, 2.5
    known, silent = np.ones(3, bool), np.zeros(3, bool)
    together, inside = Schedule.TOGETHER, Schedule.INSIDE
    for step in range(3):
        poses[1:, 2, 3] = 0.3 * step
        answers.move(np.arange(3), poses)
        schedule.update(rows, known, silent, True)
        first = schedule.queries(schedule.order())
        assert sorted(first.at.tolist()) == [0, 1] and first.how.tolist() == [together] * 2
        schedule.search_together(first, 60.0, 1, perf_counter)
        then = schedule.queries(schedule.order())
        assert (then.at.tolist(), then.how.tolist()) == ([0], [inside])
        states, left = schedule.report(perf_counter())
        overlapping = dict(zip(states["at"].tolist(), states["upper"].tolist(), strict=True))
        assert overlapping[0] < 1e-12 < overlapping[1] and left == 1
        found = engine.signed_distance(ball, poses[0], ball, poses[1])
        schedule.commit(then, found.row[None], perf_counter())
        assert len(schedule.order()) == 0


def overlapping(count):
    """Return a schedule of rings that all cross the first, the poses, and a function `update`."""
    models = [torus(24)] * (count + 1)
    answers = Answers(models, [str(i) for i in range(count + 1)])
    schedule = Schedule(answers, engine.Assembly(models))
    pairs = np.array([[0, i + 1] for i in range(count)])
    rows = answers.add(pairs, np.ones(count, bool))
    schedule.begin(rows)
    poses = np.tile(np.eye(4), (count + 1, 1, 1))
    rng = np.random.default_rng(5)
    poses[1:] = [pose(rng, 0.2) for _ in range(count)]
    bodies = np.arange(count + 1)

    def update():
        answers.move(bodies, poses)
        schedule.update(rows, np.ones(count + 1, bool), np.zeros(count + 1, bool), True)

    return schedule, poses, update


def noted(schedule, monkeypatch):
    """Return a list that collects the clearance asked of each single search: 0 for a sign only."""
    asked = []
    search = schedule._long.search

    def note(single, count, *others):
        asked.extend(float(single(k).wanted[2]) for k in range(count))
        return search(single, count, *others)

    monkeypatch.setattr(schedule._long, "search", note)
    return asked


def widths(schedule):
    states, left = schedule.report(0.0)
    assert (states["upper"] < 0.0).all() and left == 0
    return states["upper"] - states["lower"], -states["upper"]


def test_no_depth_is_searched_before_all_signs_are_certain(monkeypatch):
    schedule, _, update = overlapping(6)
    update()
    asked = noted(schedule, monkeypatch)
    schedule.search(perf_counter() + 600.0, perf_counter)
    signs = asked.count(0.0)
    assert signs >= 6, "one that a slice cuts goes on in the next call"
    assert asked == [0.0] * signs + [np.inf] * 6
    wide, depth = widths(schedule)
    assert (wide <= 0.011 * depth).all()
    update()
    assert not len(schedule.order()), "the bodies stand still"


def test_a_depth_is_searched_no_closer_than_motion_blurs_it(monkeypatch):
    schedule, poses, update = overlapping(4)
    update()
    schedule.search(perf_counter() + 600.0, perf_counter)
    asked = noted(schedule, monkeypatch)
    poses[1:, 1, 3] += 1e-6
    update()
    assert not len(schedule.order()), "the carried bounds are close enough"
    poses[1:, 1, 3] += 0.02
    update()
    schedule.search(perf_counter() + 600.0, perf_counter)
    wide, depth = widths(schedule)
    assert (wide <= 0.021).all() and (wide > 0.011 * depth).all()
    assert len(asked) < 5, "signs were certain"
    update()
    schedule.search(perf_counter() + 600.0, perf_counter)
    wide, depth = widths(schedule)
    assert (wide <= 0.011 * depth).all(), "the bodies stand still"


def test_a_pair_whose_distance_takes_long_is_decided_against_its_levels_first(watched):
    watched.schedule.records["levels"][watched.rows] = 1.0
    watched.update()
    open_ = [k for k in watched.schedule.order() if watched.schedule._views[k]["urgent"]]
    watched.schedule.records["hard"][watched.rows] = True
    queries = watched.schedule.queries(np.array(open_))
    assert (queries.how == Schedule.ALONE).all() and (queries.wanted[:, 2] == 1.0).all()
    watched.schedule.search(perf_counter() + 600.0, perf_counter)
    states, left = watched.report()
    assert left == 0 and {STATUS[code] for code in states["status"]} <= {
        engine.Status.EXACT,
        engine.Status.INTERSECTING,
    }
