"""Pairs of different kinds in one call: runs of one kind take turns, and none waits long."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from engine_bodies import pose, sphere, torus

from proximity_monitor import engine
from proximity_monitor.engine import shapes
from proximity_monitor.engine.assembly.runs import Runs
from proximity_monitor.engine.questions import slices
from proximity_monitor.engine.questions.setup import entry_for

STATUS = tuple(engine.Status)


def mixed(count):
    """Return models of two kinds alternately, and all their pairs in random order."""
    kinds = [torus(12), shapes.cylinder(0.3, 1.0)]
    models = [kinds[k % 2] for k in range(count)]
    pairs = np.array(list(itertools.combinations(range(count), 2)), np.int32)
    return models, np.random.default_rng(count).permutation(pairs)


@pytest.mark.parametrize("every", [1, 3])
def test_each_pair_has_its_own_entry_once_and_not_much_later(every):
    models, pairs = mixed(20)
    runs = Runs(models)
    order, planned = runs.plan(pairs, every, [])
    assert sorted(order) == list(range(len(pairs)))
    assert order[0] == 0, "the most urgent pair goes first"
    turn = np.argsort(order)
    assert all(turn <= np.maximum(15, 2 * np.arange(len(pairs))))
    asked = []
    for first, own in enumerate(planned):
        for entry, begin, end in own:
            places = range(begin, end, every)
            assert {place % every for place in places} == {first}
            asked += places
            for a, b in pairs[order[list(places)]]:
                assert entry is entry_for(models[a]._hierarchy, models[b]._hierarchy)
    assert sorted(asked) == list(range(len(pairs)))
    unsorted = [entry_for(models[a]._hierarchy, models[b]._hierarchy) for a, b in pairs]
    changes = 1 + sum(one is not other for one, other in itertools.pairwise(unsorted))
    assert sum(map(len, planned)) < changes / 4 * every
    again = runs.plan(pairs, every, [7, 150])[0]
    assert set(again[:2]) == {7, 150}, "what was begun goes on first"


def test_models_of_one_kind_have_one_entry():
    models = [torus(12)] * 5
    assert Runs(models).only is entry_for(*(model._hierarchy for model in models[:2]))
    assert Runs([*models, shapes.cylinder(0.3, 1.0)]).only is None


def test_no_pairs_of_mixed_models_have_no_answers():
    models, _ = mixed(4)
    poses = np.tile(np.eye(4), (4, 1, 1))
    assert len(engine.Assembly(models).distances(poses, np.empty((0, 2), int), threads=2)) == 0


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("signed", [False, True])
def test_answers_stand_where_they_were_asked_for(threads, signed):
    models, pairs = mixed(9)
    rng = np.random.default_rng(3)
    poses = np.array([pose(rng, 2.0) for _ in models])
    asked = rng.choice([0.0, 0.1], len(pairs))
    assembly = engine.Assembly(models)
    found = assembly.distances(poses, pairs, rel_err=asked, signed=signed, threads=threads)
    again = assembly.distances(
        poses, pairs, rel_err=asked, signed=signed, hints=found.hints, threads=threads
    )
    ask = engine.signed_distance if signed else engine.distance
    for k, (a, b) in enumerate(pairs):
        one = ask(models[a], poses[a], models[b], poses[b])
        for each in (found, again):
            assert each.lower[k] <= one.upper + 1e-12
            assert one.lower <= each.upper[k] + 1e-12
            if asked[k] == 0.0 and one.lower > 0.0:
                assert each.upper[k] == pytest.approx(one.upper, abs=1e-9)
                assert np.allclose(each.points_a[k] - each.points_b[k], one.point_a - one.point_b)


def test_what_was_cut_goes_on_before_pairs_of_other_kinds(monkeypatch):
    monkeypatch.setattr(slices, "_FEW", 32)  # the first slice goes as far as the second pair
    models = [sphere(4, 1.0), sphere(4, 1.01), shapes.cylinder(0.5, 1.0), torus(12)]
    poses = np.tile(np.eye(4), (4, 1, 1))
    poses[2:, 0, 3] = 5.0, 9.0
    assembly = engine.Assembly(models)
    pairs, rel_err = [[0, 3], [0, 2], [0, 1]], np.array([1.0, 0.0, 0.0])  # the first ends at once
    found = assembly.distances(poses, pairs, rel_err=rel_err, budget_s=0.0)
    assert answered(found).tolist() == [True, False, False]
    assert found.searched.tolist() == [True, False, True], "by kind"
    again = assembly.distances(poses, pairs[1:], budget_s=0.0)
    assert again.searched.tolist() == [False, True]
    assert again.bound_tests[1] > found.bound_tests[2], "it went on"


@pytest.mark.parametrize("threads", [1, 2])
def test_asking_about_what_is_left_comes_to_an_end(threads):
    models = [sphere(3, 1.0), shapes.cylinder(0.5, 1.0), sphere(3, 1.02), shapes.cylinder(0.6, 1.2)]
    poses = np.tile(np.eye(4), (4, 1, 1))
    left = np.array(list(itertools.combinations(range(4), 2)))
    assembly = engine.Assembly(models)
    whole = assembly.distances(poses, left)
    upper = {tuple(pair): d for pair, d in zip(left, whole.upper, strict=True)}
    calls = 0
    while len(left):
        found = assembly.distances(poses, left, budget_s=0.0, threads=threads)
        done = answered(found)
        for pair, d in zip(left[done], found.upper[done], strict=True):
            assert d == pytest.approx(upper[tuple(pair)], abs=1e-9)
        left, calls = left[~done], calls + 1
        assert calls <= whole.bound_tests.sum()
    assert calls > 4, "searches were cut"


def answered(found):
    return np.array([STATUS[code] is not engine.Status.OUT_OF_TIME for code in found.status])
