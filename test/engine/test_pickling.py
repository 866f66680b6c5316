"""Pickles and copies own their memory: they hold no address of the original's memory."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys

import numpy as np
import pytest
from engine_bodies import IDENTITY, box, pose, sphere, torus, translation

from proximity_monitor import engine
from proximity_monitor.engine.assembly.answers import Answers
from proximity_monitor.engine.assembly.broad_phase import BroadPhase
from proximity_monitor.engine.assembly.schedule import Schedule
from proximity_monitor.engine.questions.run import Search

NESTED = sphere(4, 1.0), sphere(4, 1.01)
NEAR, FAR = translation(2.5), translation(9.0)
ROUTES = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda thing: pickle.loads(pickle.dumps(thing)),
}
MODELS = [torus(24), box(), sphere(3), box((0.3, 0.3, 2.0))]
PAIRS = np.array([(0, 1), (0, 2), (1, 2), (2, 3), (0, 3), (1, 3)])


class Crowd:
    """Bodies, the bounds known of their pairs, and a schedule of questions."""

    def __init__(self):
        self.poses = np.array([pose(np.random.default_rng(k), 2.0) for k in range(4)])
        self.assembly = engine.Assembly(MODELS)
        self.answers = Answers(MODELS, [str(k) for k in range(4)])
        self.answers.move(np.arange(4), self.poses)
        self.rows = self.answers.add(PAIRS, np.zeros(len(PAIRS), bool))
        self.schedule = Schedule(self.answers, self.assembly)
        self.schedule.begin(self.rows)
        self.schedule.update(self.rows, np.ones(4, bool), np.zeros(4, bool), True)


def searched(schedule):
    """Return the certified bounds after all searches that a schedule wants."""
    schedule.search_together(schedule.queries(schedule.order()), 60.0, 1, lambda: 0.0)
    return np.stack([schedule.report(0.0)[0][name] for name in ("lower", "upper")])


def memory_of(thing, models=(), seen=None):
    """Return every array that can be reached from an object without passing its models."""
    seen = {} if seen is None else seen
    if id(thing) in seen or any(thing is model for model in models):
        return []
    if hasattr(thing, "py_func"):  # a kernel: all objects share it
        return []
    seen[id(thing)] = thing
    if isinstance(thing, np.ndarray):
        return [thing] if thing.size else []
    if isinstance(thing, dict):
        parts = thing.values()
    elif isinstance(thing, tuple | list):
        parts = thing
    else:
        names = [n for kind in type(thing).__mro__ for n in getattr(kind, "__slots__", ())]
        parts = [getattr(thing, n) for n in names if n != "__weakref__" and hasattr(thing, n)]
        parts += getattr(thing, "__dict__", {}).values()
        parts += [thing.__self__] if hasattr(thing, "__self__") else []
    return [array for part in parts for array in memory_of(part, models, seen)]


def things():
    """Return one object of each class, each with something to remember."""
    pair = engine.Pair(*NESTED)
    pair.distance(NEAR, IDENTITY)
    pair.signed_distance(NEAR, IDENTITY)
    crowd = Crowd()
    crowd.assembly.distances(crowd.poses, PAIRS, threads=2)
    phase = BroadPhase()
    phase.near(crowd.answers.centres, np.full(4, 9.0), np.ones(4, bool), np.arange(4))
    search = Search(*NESTED)
    parts = [pair, search, crowd.assembly, crowd.answers, crowd.schedule, phase]
    return {type(part).__name__: part for part in parts}


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("kind", things())
def test_nothing_that_is_written_to_is_shared(kind, route):
    thing = things()[kind]
    given = MODELS if route == "copy" else []
    if kind in ("Pair", "Search") and route == "copy":
        given = NESTED
    if kind == "Schedule" and route == "copy":
        given = [*MODELS, thing._answers, thing._assembly]
    hierarchies = [each._hierarchy for each in given if hasattr(each, "_hierarchy")]
    tables = [table for each in hierarchies for table in (each.table, each.table_of_all)]
    given = [*given, *hierarchies, *tables]
    mine = memory_of(thing, given)
    another = ROUTES[route](thing)
    if kind == "Pair":
        another.distance(NEAR, IDENTITY)  # a copied pair takes memory when it is first asked
    other = memory_of(another, given)
    assert mine
    assert other or kind == "Assembly", "which has memory when it is asked"
    shared = [a for a in mine for b in other if np.shares_memory(a, b)]
    assert not shared


@pytest.mark.parametrize("route", ROUTES)
def test_copies_of_a_pair_do_not_disturb_each_other(route):
    exact = engine.distance(NESTED[0], IDENTITY, NESTED[1], IDENTITY)
    far = engine.distance(NESTED[0], FAR, NESTED[1], IDENTITY)
    first = engine.Pair(*NESTED)
    first.distance(NEAR, IDENTITY)
    second = ROUTES[route](first)
    assert (second.a is first.a) == (route == "copy")
    cut, other = engine.Status.OUT_OF_TIME, engine.Status.OUT_OF_TIME
    while engine.Status.OUT_OF_TIME in (cut, other):
        cut = (found := first.distance(IDENTITY, IDENTITY, budget_s=0.0)).status
        assert found.lower <= exact.upper
        assert exact.lower <= found.upper
        other = (found := second.distance(FAR, IDENTITY, budget_s=0.0)).status
        assert found.lower <= far.upper
        assert far.lower <= found.upper
    assert first.distance(IDENTITY, IDENTITY, budget_s=9.0).upper == pytest.approx(exact.upper)
    assert second.distance(FAR, IDENTITY, budget_s=9.0).upper == pytest.approx(far.upper)
    assert second.signed_distance(FAR, IDENTITY).upper == pytest.approx(far.upper)


@pytest.mark.parametrize("order", ["depth_first", "priority"])
def test_a_copy_begins_with_the_nearest_triangles(order):
    pair = engine.Pair(torus(48), sphere(4), coherent=False)
    here = pose(np.random.default_rng(1), 3.0)
    first = pair.distance(here, IDENTITY, order=order)
    again = copy.copy(pair).distance(here, IDENTITY, order=order)
    assert again.upper == pytest.approx(first.upper, abs=1e-14)
    assert again.bound_tests == pair.distance(here, IDENTITY, order=order).bound_tests


def test_a_deep_copy_has_models_of_its_own_and_a_copy_has_not():
    ball, other = sphere(2), sphere(2)
    pair = engine.Pair(ball, other)
    deep, shallow = copy.deepcopy(pair), copy.copy(pair)
    before = pair.distance(FAR, IDENTITY).upper
    ball.deform(ball.vertices * 0.5)
    assert deep.distance(FAR, IDENTITY).upper == pytest.approx(before)
    assert shallow.distance(FAR, IDENTITY).upper == pytest.approx(before + 0.5)


@pytest.mark.parametrize("route", ROUTES)
def test_copies_of_a_schedule_do_not_disturb_each_other(route):
    crowd = Crowd()
    alone = searched(Crowd().schedule)
    other = ROUTES[route](crowd.schedule)
    other.records["ignored"] = True
    other.update(crowd.rows[:2], np.ones(4, bool), np.zeros(4, bool), True)
    assert np.array_equal(searched(crowd.schedule), alone)
    other.records["ignored"] = False
    other.update(crowd.rows, np.ones(4, bool), np.zeros(4, bool), True)
    assert np.allclose(searched(other), alone, atol=1e-13)


def test_bodies_that_share_a_model_share_it_in_a_pickle():
    assembly = pickle.loads(pickle.dumps(engine.Assembly([MODELS[0], MODELS[1], MODELS[0]])))
    assert assembly.models[0] is assembly.models[2]
    schedule = pickle.loads(pickle.dumps(Crowd().schedule))
    assert schedule._assembly.models[0] is schedule._answers._models[0]


LOADED = """
import pickle, sys
import numpy as np
pair, assembly, schedule, broad, poses = pickle.load(sys.stdin.buffer)
here, there = poses[0], poses[1]
found = pair.distance(here, there)
signed = pair.signed_distance(here, there)
many = assembly.distances(poses, [[0, 1], [2, 3]], threads=2)
schedule.search_together(schedule.queries(schedule.order()), 60.0, 1, lambda: 0.0)
states = schedule.report(0.0)[0]
near = broad.near(poses[:, :3, 3], np.full(4, 3.0), np.ones(4, bool), np.arange(4))
answers = found.upper, signed.upper, many.upper, states["upper"], near
pickle.dump(answers, sys.stdout.buffer)
"""


def test_another_process_answers_the_same_and_compiles_nothing():
    crowd = Crowd()
    pair = engine.Pair(MODELS[0], MODELS[2])
    pair.signed_distance(IDENTITY, FAR)
    broad = BroadPhase()
    around = crowd.poses[:, :3, 3], np.full(4, 3.0), np.ones(4, bool), np.arange(4)
    expected = (
        pair.distance(crowd.poses[0], crowd.poses[1]).upper,
        pair.signed_distance(crowd.poses[0], crowd.poses[1]).upper,
        crowd.assembly.distances(crowd.poses, [[0, 1], [2, 3]]).upper,
        searched(Crowd().schedule)[1],
        broad.near(*around),
    )
    sent = pickle.dumps((pair, crowd.assembly, crowd.schedule, broad, crowd.poses))
    done = subprocess.run(
        [sys.executable, "-c", LOADED], input=sent, capture_output=True, check=False
    )
    assert done.returncode == 0, done.stderr.decode()
    assert done.stderr == b"", "nothing was compiled"
    for found, here in zip(pickle.loads(done.stdout), expected, strict=True):
        assert found == pytest.approx(here, abs=1e-13)


def test_a_mesh_of_other_kernels_is_refused():
    state = MODELS[0].__getstate__()
    assert "_table" not in state
    mesh = engine.TriangleMesh.__new__(engine.TriangleMesh)
    with pytest.raises(engine.ModelError, match=r"^torus: pickled by another version"):
        mesh.__setstate__({**state, "kernels": "0123456789abcdef"})
