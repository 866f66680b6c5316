"""Many queries in one call: `within`, `collide` and `signed_distance` at many poses and pairs."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from engine_bodies import IDENTITY, SMALL, box, pose, soup, sphere, torus, translation

from proximity_monitor import engine
from proximity_monitor.engine import Status
from proximity_monitor.engine.assembly import assembly, long_searches
from proximity_monitor.engine.kernels.base.cache import KernelCache

STATUS = tuple(Status)
OPEN = STATUS.index(Status.OUT_OF_TIME)
CAPSULES = engine.polyline([[-0.4, 0, 0], [0, 0.2, 0], [0.5, 0, 0]], radius=0.15)
HOLED = engine.TriangleMesh(torus(12).vertices, torus(12).faces[3:], solid="robust")
SOLIDS = {
    "solids": (torus(12), box((0.4, 0.6, 0.5))),
    "a solid and a surface": (sphere(2), soup(1, 20, 0.1)),
    "two surfaces": (soup(2, 20), soup(3, 20)),
    "swept": (box(), CAPSULES),
    "spheres": (engine.points([[0, 0, 0]], radius=0.5), engine.points([[0, 0, 0]], radius=0.7)),
    "holed": (HOLED, box((0.1, 0.1, 0.1))),
    "deviating": (
        engine.TriangleMesh(sphere(1).vertices, sphere(1).faces, deviation=0.05),
        box((0.2, 0.2, 0.2)),
    ),
}


def path(seed, count, spread=1.0):
    rng = np.random.default_rng(seed)
    return np.array([pose(rng, spread) for _ in range(count)])


@pytest.mark.parametrize("clearance", [0.0, 0.2, 1.0])
def test_a_clearance_decides_as_within_and_collide_do(clearance):
    a, b = torus(24), soup(3)
    poses_a, poses_b = path(1, 300), path(2, 300)
    found = engine.distances(a, poses_a, b, poses_b, clearance=clearance)
    exact = engine.distances(a, poses_a, b, poses_b)
    said = found.within(clearance)
    pair = engine.Pair(a, b)
    for k in range(300):
        assert said[k] == pair.within(poses_a[k], poses_b[k], clearance).within
        if clearance == 0.0:
            assert said[k] == pair.collide(poses_a[k], poses_b[k]).colliding
    assert said.any()
    assert not said.all()
    near = said & (exact.upper < clearance - 1e-12)
    assert (found.upper[near] <= clearance + 1e-12).all()
    assert (found.lower <= exact.upper).all()
    assert (exact.lower <= found.upper).all()
    assert found.bound_tests.sum() < 0.6 * exact.bound_tests.sum()
    many = engine.distances(a, poses_a, b, poses_b, clearance=clearance, threads=3)
    assert np.array_equal(many.lower, found.lower)


def assert_alike(lower, upper, one):
    """Check that distances agree, and depths to 1 %: a depth search starts from the last one's."""
    if one.lower > -1e-9:
        assert (lower, upper) == pytest.approx((one.lower, one.upper), abs=2e-12)
    else:
        assert max(lower, one.lower) <= min(upper, one.upper) + 1e-13
        assert (upper < 0.0) == (one.upper < 0.0)
        assert upper - lower <= 0.01 * -lower + 1.01 * (one.upper - one.lower) + 1e-12


@pytest.mark.parametrize("name", SOLIDS)
def test_signed_answers_are_those_of_single_questions(name):
    a, b = SOLIDS[name]
    poses_a, poses_b = path(3, 80, 0.5), path(4, 80, 0.5)
    found = engine.distances(a, poses_a, b, poses_b, signed=True)
    assert found.searched.all()
    overlapping = 0
    for k in range(80):
        one = engine.signed_distance(a, poses_a[k], b, poses_b[k])
        assert_alike(found.lower[k], found.upper[k], one)
        if one.lower > 0.0:
            assert STATUS[found.status[k]] is one.status
            assert np.linalg.norm(found.points_a[k] - found.points_b[k]) == pytest.approx(
                np.linalg.norm(one.point_a - one.point_b), abs=1e-12
            )
        overlapping += one.upper < 0.0
    assert overlapping > 3 or name == "two surfaces"
    many = engine.distances(a, poses_a, b, poses_b, signed=True, threads=3)
    for field in ("lower", "upper", "points_a", "points_b", "elements", "status"):
        assert np.array_equal(getattr(many, field), getattr(found, field)), field


def crowd(seed=0, count=14):
    """Return an assembly of bodies of every sort, some inside others, their poses, all pairs."""
    rng = np.random.default_rng(seed)
    bodies = [*SMALL.values(), CAPSULES, HOLED, sphere(2, 1.5), box((0.1, 0.1, 0.1))]
    models = [bodies[i % len(bodies)] for i in range(count)]
    poses = np.array([pose(rng, 1.0) for _ in models])
    return engine.Assembly(models), poses, np.array(list(itertools.combinations(range(count), 2)))


def singly(assembly, poses, pairs):
    """Return every signed distance from a query of its own."""
    return [
        engine.signed_distance(assembly.models[i], poses[i], assembly.models[j], poses[j])
        for i, j in pairs
    ]


@pytest.mark.parametrize("threads", [1, 3])
def test_an_assembly_knows_signs(threads):
    assembly, poses, pairs = crowd()
    found = assembly.distances(poses, pairs, signed=True, threads=threads)
    one = singly(assembly, poses, pairs)
    for k, each in enumerate(one):
        assert_alike(found.lower[k], found.upper[k], each)
    assert (found.upper < 0.0).sum() > 10
    # Some bodies lie wholly inside others, which the distances of surfaces do not show.
    surfaces = assembly.distances(poses, pairs)
    assert ((surfaces.lower > 0.0) & (found.upper < 0.0)).any()
    again = assembly.distances(poses, pairs, signed=True, hints=found.hints)
    assert (np.maximum(again.lower, found.lower) <= np.minimum(again.upper, found.upper)).all()


@pytest.mark.parametrize("clearance", [0.0, 0.3])
def test_a_clearance_decides_about_signed_distances(clearance):
    assembly, poses, pairs = crowd(1)
    exact = assembly.distances(poses, pairs, signed=True)
    found = assembly.distances(poses, pairs, signed=True, clearance=clearance)
    assert (found.lower <= exact.upper).all()
    assert (exact.lower <= found.upper).all()
    certain = np.abs(exact.upper - clearance) > 1e-12
    assert (found.within(clearance) == (exact.lower <= clearance))[certain].all()
    decided = (found.lower > clearance) | (found.upper <= clearance + 1e-12)
    # Next to a hole, the search may leave open how deep a body lies and whether it is inside.
    decided |= found.status == STATUS.index(engine.Status.INTERSECTING)
    assert decided[certain].all()


def finish(assembly, poses, pairs, **options):
    """Query the unfinished pairs without time until none is left.

    Yields each round's pairs and answers, and last the bounds (k, 2) and the number of rounds.
    """
    left, asked = np.arange(len(pairs)), 0
    bounds = np.full((len(pairs), 2), np.nan)
    while len(left):
        found = assembly.distances(poses, pairs[left], budget_s=0.0, **options)
        done = found.status != OPEN
        bounds[left[done]] = np.stack((found.lower, found.upper), axis=1)[done]
        yield left, found
        left, asked = left[~done], asked + 1
        assert asked < 20_000
    yield bounds, asked


def test_without_a_budget_no_answer_depends_on_the_clock(monkeypatch):
    assembly, poses, pairs = crowd(1)
    found = assembly.distances(poses, pairs, signed=True)
    monkeypatch.setattr(long_searches, "_SLICE_S", 0.0)
    again = engine.Assembly(assembly.models).distances(poses, pairs, signed=True)
    assert np.array_equal(again.rows, found.rows, equal_nan=True)


@pytest.mark.long
@pytest.mark.parametrize("threads", [1, 2])
def test_asking_about_signs_comes_to_an_end_with_any_budget(threads):
    models = [sphere(3, 1.0), sphere(3, 0.95), torus(24), box((0.1, 0.1, 0.1)), CAPSULES]
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[1, 0, 3] = 0.03
    pairs = np.array(list(itertools.combinations(range(5), 2)))
    whole = engine.Assembly(models).distances(poses, pairs, signed=True)
    *answers, (bounds, asked) = finish(
        engine.Assembly(models), poses, pairs, signed=True, threads=threads
    )
    for left, found in answers:
        assert (found.lower <= whole.upper[left]).all()
        assert (whole.lower[left] <= found.upper).all()
        assert (found.lower[~found.searched] == -np.inf).all()
    assert bounds[:, 1] == pytest.approx(whole.upper, abs=1e-13)
    assert bounds[:, 0] == pytest.approx(whole.lower, abs=1e-13)
    assert asked > 20, "searches were cut"


def test_a_depth_that_is_due_when_time_is_over_begins_the_next_call(monkeypatch):
    """Setting up the search for a depth takes longer than a short budget."""
    bodies, calls = engine.Assembly([sphere(4, 1.0), sphere(4, 0.95)]), []
    for kind, name in ((engine.Assembly, "rows"), (long_searches.LongSearches, "search")):
        original = getattr(kind, name)
        monkeypatch.setattr(
            kind,
            name,
            lambda *given, original=original, name=name: calls[-1].append(name) or original(*given),
        )
    poses = np.stack((np.eye(4), translation(1.0)))
    for _ in range(12):
        calls.append([])
        found = bodies.distances(poses, [[0, 1]], signed=True, budget_s=0.0)
    assert all(len(each) <= 1 for each in calls), "or a part of what it takes to begin"
    assert calls[0] == ["rows"]
    assert ["search"] in calls
    assert found.lower[0] < found.upper[0]


def test_a_cut_depth_goes_on_only_with_the_same_question():
    models = [sphere(4, 1.0), sphere(4, 0.95)]
    poses = np.tile(np.eye(4), (2, 1, 1))
    shifted = poses.copy()
    shifted[1, 0, 3] = 0.02

    def answer(assembly, where, **options):
        found = assembly.distances(where, [[0, 1]], signed=True, **options)
        return found.lower[0], found.upper[0]

    whole = {id(p): answer(engine.Assembly(models), p) for p in (poses, shifted)}
    assembly = engine.Assembly(models)
    for where in (poses, shifted, poses):
        for _ in range(5):
            lower, upper = answer(assembly, where, budget_s=0.0)
            assert lower <= whole[id(where)][1]
            assert whole[id(where)][0] <= upper
    models[1].deform(0.9 * models[1].vertices)
    again = answer(assembly, poses, budget_s=60.0)
    assert again == pytest.approx(answer(engine.Assembly(models), poses), abs=1e-13)


def test_a_question_that_is_asked_twice_in_one_call_goes_on_once():
    assembly = engine.Assembly([sphere(3, 1.0), sphere(3, 0.95)])
    poses, pairs = np.tile(np.eye(4), (2, 1, 1)), np.tile([[0, 1]], (200, 1))
    whole = assembly.distances(poses, pairs[:1], signed=True)
    cut = assembly.distances(poses, pairs, signed=True, budget_s=0.0)
    assert cut.status[0] == OPEN
    found = assembly.distances(poses, pairs, signed=True, threads=4)
    assert found.upper == pytest.approx(np.full(200, whole.upper[0]), abs=1e-14)
    assert found.lower == pytest.approx(np.full(200, whole.lower[0]), abs=1e-14)


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("threads", [1, 3])
def test_whatever_the_budget_the_bounds_hold(signed, threads):
    a, b = sphere(4), sphere(4, 1.005)
    poses_a, poses_b = path(5, 400, 0.001), path(6, 400, 0.001)
    some = slice(0, 400, 80)
    exact = engine.distances(a, poses_a[some], b, poses_b[some], signed=signed)
    least = -np.inf if signed else 0.0
    for budget_s in (0.0, 2e-3, 2e-2):
        found = engine.distances(
            a, poses_a, b, poses_b, signed=signed, budget_s=budget_s, threads=threads
        )
        assert len(found) == 400
        assert found.searched.any()
        assert not found.searched.all()
        unseen = ~found.searched
        assert (found.lower[unseen] == least).all()
        assert (found.upper[unseen] == np.inf).all()
        assert np.isnan(found.points_a[unseen]).all()
        assert (found.elements[unseen] == -1).all()
        assert (found.status[unseen] == OPEN).all()
        assert (found.lower[some] <= exact.upper).all()
        assert (exact.lower <= found.upper[some]).all()
        assert found.within(0.0)[unseen].all()
    ample = engine.distances(a, poses_a[:3], b, poses_b[:3], signed=signed, budget_s=60.0)
    assert (ample.status != OPEN).all()


def test_tolerances_of_signed_distances_hold():
    a, b = SOLIDS["solids"]
    poses_a, poses_b = path(7, 80, 0.5), path(8, 80, 0.5)
    exact = engine.distances(a, poses_a, b, poses_b, signed=True)
    loose = engine.distances(a, poses_a, b, poses_b, signed=True, abs_err=0.05)
    assert (loose.lower <= exact.upper).all()
    assert (exact.lower <= loose.upper).all()
    assert (loose.upper - loose.lower <= 0.05 + 1e-13).all()
    assert (loose.upper - loose.lower > 1e-6).any()


@pytest.mark.parametrize("signed", [False, True])
def test_no_poses_have_no_answers(signed):
    none = np.empty((0, 4, 4))
    found = engine.distances(box(), none, box(), none, signed=signed, clearance=0.1, threads=2)
    assert len(found) == 0
    assert found.within(0.1).shape == (0,)
    assembly, poses, _ = crowd()
    assert len(assembly.distances(poses, [], signed=signed)) == 0


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("letter", ["a", "b"])
def test_a_bad_pose_is_named(signed, letter):
    poses = {"a": np.tile(IDENTITY, (600, 1, 1)), "b": np.tile(translation(5.0), (600, 1, 1))}
    poses[letter][555, 0, 0] = np.nan
    with pytest.raises(ValueError, match=rf"poses_{letter}\[555\]\[0, 0\] = nan"):
        engine.distances(box(), poses["a"], box(), poses["b"], signed=signed, threads=2)


def test_signed_distances_are_searched_in_one_order():
    with pytest.raises(ValueError, match=r"order = 'priority': must be .* signed distances"):
        engine.distances(box(), [IDENTITY], box(), [IDENTITY], signed=True, order="priority")


def test_what_compiling_kept_from_being_asked_is_asked_again(monkeypatch):
    monkeypatch.setattr(KernelCache, "obtained", 0)
    compiled = iter([3, 1, 0, 1])

    def ask():
        KernelCache.obtained += next(compiled)

    long_searches._compile(ask)
    assert list(compiled) == [1], "it asked until nothing was compiled"


def test_a_signed_call_keeps_time_for_its_answers(monkeypatch):
    given, rows = [], engine.Assembly.rows

    def watched(self, query, deadline, threads):
        given.append(deadline)
        return rows(self, query, deadline, threads)

    monkeypatch.setattr(engine.Assembly, "rows", watched)
    monkeypatch.setattr(assembly, "perf_counter", lambda: 0.0)
    asked, poses = engine.Assembly([torus(12), box()]), np.stack((IDENTITY, translation(5.0)))
    for ask_signed in (False, True):
        asked.distances(poses, [[0, 1]], signed=ask_signed, budget_s=1e-3)
    assert given[0] - given[1] == pytest.approx(2.0 * assembly.HAND_OVER_S)
