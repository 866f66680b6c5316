"""Many pairs of bodies in one call: the answers are those of single queries."""

from __future__ import annotations

import itertools
from functools import cached_property

import numpy as np
import pytest
from engine_bodies import IDENTITY, SMALL, pose, sphere, torus

from proximity_monitor import engine
from proximity_monitor.engine.questions.ball import BallSearch
from proximity_monitor.engine.questions.result import Distances

STATUS = tuple(engine.Status)
FIELDS = [
    name
    for name, value in vars(Distances).items()
    if isinstance(value, property | cached_property) and not name.startswith("_")
]


def crowd(seed=0, count=24, spread=2.0):
    """Return an assembly of bodies that share a few meshes, their poses, and all pairs."""
    rng = np.random.default_rng(seed)
    meshes = list(SMALL.values())
    models = [meshes[i % len(meshes)] for i in range(count)]
    poses = np.array([pose(rng, spread) for _ in models])
    return engine.Assembly(models), poses, np.array(list(itertools.combinations(range(count), 2)))


def alone(assembly, poses, pair, **tolerance):
    i, j = pair
    return engine.distance(assembly.models[i], poses[i], assembly.models[j], poses[j], **tolerance)


@pytest.mark.parametrize("threads", [1, 3])
def test_the_answers_are_those_of_single_questions(threads):
    assembly, poses, pairs = crowd()
    found = assembly.distances(poses, pairs, threads=threads)
    assert found.searched.all()
    other = 0
    for k, pair in enumerate(pairs):
        one = alone(assembly, poses, pair)
        assert STATUS[found.status[k]] is one.status
        features = one.feature_a, one.feature_b
        if found.elements[k].tolist() != [feature.index for feature in features]:
            # Both entries contain the kernel, compiled separately, so their float32 bounds may
            # differ in the last bits. These decide which of several nearest triangles is found.
            assert found.upper[k] == pytest.approx(one.upper, rel=0.0, abs=1e-13)
            other += 1
            continue
        assert (found.lower[k], found.upper[k]) == (one.lower, one.upper)
        assert np.array_equal(found.points_a[k], one.point_a)
        assert np.array_equal(found.points_b[k], one.point_b)
        assert np.array_equal(found.parameters[k], [each.parameters for each in features])
        assert found.bound_tests[k] == pytest.approx(one.bound_tests, rel=0.1, abs=64)
    assert other < 0.05 * len(pairs)
    assert {STATUS[code] for code in found.status} == {
        engine.Status.EXACT,
        engine.Status.INTERSECTING,
    }


def test_hints_save_tests_and_change_no_distance():
    assembly, poses, pairs = crowd(1)
    found = assembly.distances(poses, pairs)
    again = assembly.distances(poses, pairs, hints=found.hints)
    apart = found.lower > 0.0
    assert np.allclose(again.upper, found.upper, rtol=0.0, atol=1e-13)
    assert again.bound_tests[apart].sum() < found.bound_tests[apart].sum()
    strange = np.full((len(pairs), 2), 2**30, np.int32)
    none = assembly.distances(poses, pairs, hints=strange)
    assert np.array_equal(none.upper, found.upper)


def test_each_pair_has_its_own_tolerance():
    assembly, poses, pairs = crowd(2)
    rng = np.random.default_rng(2)
    rel_err = rng.choice([0.0, 0.1, 1.0], len(pairs))
    abs_err = rng.choice([0.0, 0.05], len(pairs))
    found = assembly.distances(poses, pairs, rel_err=rel_err, abs_err=abs_err)
    for k in range(0, len(pairs), 7):
        one = alone(assembly, poses, pairs[k], rel_err=rel_err[k], abs_err=abs_err[k])
        assert (found.lower[k], found.upper[k]) == (one.lower, one.upper)
        assert STATUS[found.status[k]] is one.status


@pytest.mark.parametrize("clearance", [0.0, 0.1, 0.7])
def test_a_clearance_ends_a_search_when_the_side_is_certain(clearance):
    assembly, poses, pairs = crowd(3)
    exact = assembly.distances(poses, pairs)
    found = assembly.distances(poses, pairs, clearance=clearance)
    assert (found.lower <= exact.upper).all()
    assert (exact.lower <= found.upper).all()
    far = exact.lower > clearance + 1e-12
    near = exact.upper < clearance - 1e-12
    assert (found.lower[far] > clearance).all()
    assert (found.upper[near] <= clearance + 1e-12).all()
    assert far.any()
    assert near.any() or clearance == 0.0
    assert found.bound_tests.sum() < exact.bound_tests.sum()
    # If the search ended early, it does not claim to be exact.
    gap = found.upper - found.lower > 1e-12
    assert not any(STATUS[code] is engine.Status.EXACT for code in found.status[gap])


@pytest.mark.parametrize("threads", [1, 2])
def test_whatever_the_budget_the_bounds_hold(threads):
    rng = np.random.default_rng(4)
    models = [torus(48), sphere(4)] * 3
    poses = np.array([pose(rng, 1.0) for _ in models])
    pairs = np.array(list(itertools.combinations(range(6), 2)))
    assembly = engine.Assembly(models)
    exact = assembly.distances(poses, pairs)
    cut = 0
    for budget_s in (0.0, 1e-5, 1e-4, 5e-4, 10.0):
        found = assembly.distances(poses, pairs, budget_s=budget_s, threads=threads)
        assert (found.lower <= exact.upper).all()
        assert (exact.lower <= found.upper).all()
        looked = found.searched
        assert np.isfinite(found.points_a[looked]).all()
        assert np.isnan(found.points_a[~looked]).all()
        assert (found.upper[~looked] == np.inf).all()
        assert (found.lower[~looked] == 0.0).all()
        assert all(STATUS[code] is engine.Status.OUT_OF_TIME for code in found.status[~looked])
        if threads == 1:
            assert (np.diff(looked.astype(int)) <= 0).all(), "in the order given"
        cut += not looked.all()
    assert looked.all()
    assert cut


def test_a_mesh_that_was_refitted_is_seen_anew():
    mesh = sphere(2)
    assembly = engine.Assembly([mesh, sphere(2)])
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[1, 0, 3] = 4.0
    before = assembly.distances(poses, [[0, 1]]).upper[0]
    mesh.deform(1.5 * mesh.vertices)
    after = assembly.distances(poses, [[0, 1]])
    assert after.upper[0] == pytest.approx(before - 0.5, abs=1e-3)
    assert after.upper[0] == alone(assembly, poses, (0, 1)).upper


def test_no_pairs_have_no_answers():
    assembly, poses, _ = crowd()
    for pairs in ([], np.empty((0, 2), np.int64)):
        none = assembly.distances(poses, pairs, threads=2)
        assert len(none) == 0
        assert {len(getattr(none, field)) for field in FIELDS} == {0}


@pytest.mark.parametrize("threads", [1, 2])
def test_asking_about_what_is_left_comes_to_an_end_with_any_budget(threads):
    models = [sphere(3, 1.0), sphere(3, 1.01), sphere(3, 1.02)]
    poses = np.tile(np.eye(4), (3, 1, 1))
    left = np.array([(0, 1), (0, 2), (1, 2), (2, 0)])
    assembly = engine.Assembly(models)
    whole = {tuple(p): d for p, d in zip(left, assembly.distances(poses, left).upper, strict=True)}
    tests = assembly.distances(poses, left).bound_tests.sum()
    asked = 0
    while len(left):
        found = assembly.distances(poses, left, budget_s=0.0, threads=threads)
        open_ = np.array([STATUS[code] is engine.Status.OUT_OF_TIME for code in found.status])
        for pair, upper in zip(left[~open_], found.upper[~open_], strict=True):
            assert upper == pytest.approx(whole[tuple(pair)], abs=1e-14)
        left, asked = left[open_], asked + 1
        assert asked <= tests
    assert asked > 4, "searches were cut"


def test_a_cut_search_goes_on_only_with_the_same_question():
    models = [sphere(4, 1.0), sphere(4, 1.01), sphere(4, 1.02)]
    poses = np.tile(np.eye(4), (3, 1, 1))
    turned = poses.copy()
    turned[1] = pose(np.random.default_rng(3))

    def cut():
        assembly = engine.Assembly(models)
        assembly.distances(poses, [[0, 1]], budget_s=0.0)
        return assembly

    once = engine.Assembly(models).distances(poses, [[0, 1]], budget_s=0.0).bound_tests[0]
    again = cut().distances(poses, [[0, 1]], budget_s=0.0).bound_tests[0]
    assert again > once
    for asked in (
        {"poses": turned, "pairs": [[0, 1]]},
        {"poses": poses, "pairs": [[0, 2]]},
        {"poses": poses, "pairs": [[0, 1]], "rel_err": 0.5},
    ):
        other = cut()
        found, fresh = (each.distances(**asked) for each in (other, engine.Assembly(models)))
        assert (found.lower, found.upper) == (fresh.lower, fresh.upper)
        found, fresh = (
            each.distances(**asked, budget_s=0.0) for each in (cut(), engine.Assembly(models))
        )
        assert found.bound_tests == fresh.bound_tests
    refitted = cut()
    models[0].deform(1.005 * models[0].vertices)
    found = refitted.distances(poses, [[0, 1]], budget_s=60.0)
    assert found.upper == engine.distance(models[0], IDENTITY, models[1], IDENTITY).upper


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"pairs": [[0, 24]]}, r"pairs\[0\] = \[0, 24\]: there are 24 bodies"),
        ({"pairs": [[0, 1], [-1, 2]]}, r"pairs\[1\]"),
        ({"pairs": [[0.5, 1.0]]}, "expected integers"),
        ({"pairs": [0, 1]}, r"expected integers \(k, 2\)"),
        ({"poses": np.eye(4)}, "poses: shape"),
        ({"poses": np.tile(np.eye(4), (3, 1, 1))}, "poses: 3 poses for 24 bodies"),
        ({"rel_err": -0.1}, r"rel_err\[0\] = -0.1"),
        ({"abs_err": [0.0, np.nan]}, r"abs_err\[1\] = nan"),
        ({"clearance": -1.0}, r"clearance\[0\] = -1.0"),
        ({"budget_s": -1.0}, "budget_s = -1.0"),
        ({"threads": 0}, "threads = 0"),
        ({"hints": np.zeros((3, 2), np.int32)}, r"hints: shape \(3, 2\), expected \(2, 2\)"),
    ],
)
def test_what_makes_no_sense_is_refused(asked, said):
    assembly, poses, _ = crowd()
    with pytest.raises(ValueError, match=said):
        assembly.distances(**{"poses": poses, "pairs": [[0, 1], [1, 2]]} | asked)


def test_a_bad_pose_of_a_pair_is_named_and_of_others_does_not_matter():
    assembly, poses, _ = crowd()
    poses[5, 0, 0] = np.nan
    assert assembly.distances(poses, [[0, 1]]).searched.all()
    for pair in ([5, 6], [4, 5]):
        with pytest.raises(ValueError, match=r"poses\[5\]\[0, 0\] = nan"):
            assembly.distances(poses, [pair])


def test_an_assembly_needs_a_body():
    with pytest.raises(ValueError, match="models: must not be empty"):
        engine.Assembly([])


def test_a_depth_begins_with_what_is_known_of_the_surfaces(monkeypatch):
    """The surfaces have been compared already, so the search does not compare them again."""
    repeated, compare = [], engine.Pair.distance

    def noted(pair, *given, **how):
        found = compare(pair, *given, **how)
        if found.lower == 0.0:
            repeated.append(found.bound_tests)
        return found

    monkeypatch.setattr(engine.Pair, "distance", noted)
    rng = np.random.default_rng(11)
    poses = np.array([pose(rng, 0.4) for _ in range(12)])
    twice = np.repeat(list(itertools.combinations(range(12), 2)), 2, axis=0)
    assembly = engine.Assembly([torus(12)] * 12)
    assembly.distances(poses, twice[:40], signed=True)  # compiling may take more than the budget
    found = assembly.distances(poses, twice, signed=True, budget_s=60.0)
    assert (found.upper < 0.0).sum() > 40
    assert len(repeated) > 10
    assert not any(repeated)
    # The second query about a pair has the answer of the first, although a search just ended.
    np.testing.assert_allclose(found.upper[::2], found.upper[1::2], rtol=0.02, atol=1e-12)


@pytest.mark.parametrize("offset", [0.4, 1.5], ids=["deep", "shallow"])
def test_a_depth_begins_little_by_little_where_no_time_is_left(monkeypatch, offset):
    done, poses = [], np.array([IDENTITY, IDENTITY])
    poses[1, 0, 3] = offset

    def watch(kind, name):
        work = getattr(kind, name)

        def watched(*given):
            done.append(name)
            return work(*given)

        monkeypatch.setattr(kind, name, watched)

    assembly = engine.Assembly([sphere(3), sphere(3)])
    asked = {"poses": poses, "pairs": [[0, 1]], "signed": True}
    whole = assembly.distances(**asked)
    parts = "rows", "__init__", "_begin_search", "begin", "_slice"
    owners = engine.Assembly, BallSearch, engine.Pair, BallSearch, BallSearch
    for owner, name in zip(owners, parts, strict=True):
        watch(owner, name)
    calls = []
    while True:
        done.clear()
        found = assembly.distances(**asked, budget_s=0.0)
        calls.append(done[:])
        assert found.lower[0] <= whole.upper[0]
        assert whole.lower[0] <= found.upper[0]
        if STATUS[found.status[0]] is not engine.Status.OUT_OF_TIME and found.upper[0] < 0.0:
            break
    assert {tuple(names) for names in calls} == {(part,) for part in parts}, calls


def test_a_body_that_got_another_model_is_measured_anew():
    """A cut depth search of the old model must not go on with the model that replaces it."""
    large, other = sphere(4), sphere(4, 0.9)
    small = engine.TriangleMesh(0.01 * other.vertices + (5.0, 0.0, 0.0), other.faces)
    poses = np.stack((np.eye(4), np.eye(4)))
    poses[1, 0, 3] = 0.3
    true = engine.signed_distance(large, poses[0], small, poses[1])
    for budget_s in (0.0, 1e-5, 1e-4, 3e-4):
        for cuts in range(1, 6):
            assembly = engine.Assembly([large, other])
            for _ in range(cuts):
                assembly.distances(poses, [(0, 1)], signed=True, budget_s=budget_s)
            assembly.replace(1, small)
            for left_s in (0.0, budget_s):
                found = assembly.distances(poses, [(0, 1)], signed=True, budget_s=left_s)
                assert found.lower[0] <= true.upper + 1e-9
                assert found.upper[0] >= true.lower - 1e-9
