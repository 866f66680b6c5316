"""A surface and a mesh are searched in one order. The other order gives the mirrored answer."""

import pickle

import numpy as np
import pytest
from engine_bodies import IDENTITY, pose
from engine_surfaces import torus_patches

from proximity_monitor import engine
from proximity_monitor.engine.kernels.base.state import (
    FEATURE_A,
    FEATURE_B,
    LOWER,
    POINT_A,
    POINT_B,
    RADIUS_A,
    RADIUS_B,
    STATUS,
    SURFACE_A,
    SURFACE_B,
    TREE_A,
    TREE_B,
)
from proximity_monitor.study import shapes

RING = engine.ParametricSurface(torus_patches())
BALL = engine.TriangleMesh(*shapes.sphere(0.7, 12))
PLACES = {
    "apart": pose(np.random.default_rng(1), (1.1, 0.4, 0.9)),
    "crossing": pose(np.random.default_rng(2), (1.0, 0.2, 0.3)),
}
COLUMNS = [LOWER, LOWER + 1, *range(POINT_B, POINT_B + 3), *range(POINT_A, POINT_A + 3),
           *range(FEATURE_B, FEATURE_B + 4), *range(FEATURE_A, FEATURE_A + 4), TREE_B, TREE_A,
           18, 19, STATUS, RADIUS_B, RADIUS_A, *range(SURFACE_B, SURFACE_B + 3),
           *range(SURFACE_A, SURFACE_A + 3)]  # fmt: skip
"""The columns of an answer with both models exchanged."""


@pytest.mark.parametrize(
    ("at", "order"),
    [
        ("apart", "depth_first"),
        ("crossing", "depth_first"),
        pytest.param("apart", "breadth_first", marks=pytest.mark.long),  # it compiles long
    ],
)
def test_the_answer_is_the_mirror_of_the_other(at, order):
    where = PLACES[at]
    one = engine.Pair(RING, BALL).distance(IDENTITY, where, order=order)
    other = engine.Pair(BALL, RING).distance(where, IDENTITY, order=order)
    np.testing.assert_array_equal(other.row[COLUMNS], one.row)
    assert (other.feature_a.kind, other.feature_b.kind) == ("face", "patch")


def test_all_that_may_be_nearest_is_the_mirror():
    where = PLACES["apart"]
    asked = {"manifold": True, "abs_err": 1e-3, "param_err": 0.1}
    one = engine.Pair(RING, BALL).distance(IDENTITY, where, **asked).manifold
    other = engine.Pair(BALL, RING).distance(where, IDENTITY, **asked).manifold
    assert len(one) > 1
    assert one.rectangles_b is None and other.rectangles_a is None
    np.testing.assert_array_equal(other.rectangles_b, one.rectangles_a)
    np.testing.assert_array_equal(other.faces_a, one.faces_b)
    for name in ("lower", "upper"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=0.0, atol=1e-12)
    for k in range(len(one)):
        (patches, faces), (faces_too, patches_too) = one.faces(k), other.faces(k)
        assert (patches.tolist(), faces.tolist()) == (patches_too.tolist(), faces_too.tolist())


def test_all_contacts_are_the_mirror():
    where = PLACES["crossing"]
    one = engine.Pair(RING, BALL).collide(IDENTITY, where, all_contacts=True)
    other = engine.Pair(BALL, RING).collide(where, IDENTITY, all_contacts=True)
    assert len(one.contacts) > 4
    pairs = [tuple(pair) for pair in one.contacts.tolist()]
    assert sorted(pairs) == sorted((b, a) for a, b in other.contacts.tolist())


def test_a_search_that_is_cut_goes_on_and_a_copy_begins_where_it_ended():
    pair, where = engine.Pair(BALL, RING), PLACES["apart"]
    truth = engine.Pair(RING, BALL).distance(IDENTITY, where).upper
    for _ in range(2000):
        found = pair.distance(where, IDENTITY, budget_s=0.0)
        assert found.lower <= truth <= found.upper + 1e-12
        if found.status is engine.Status.EXACT:
            break
    assert found.upper == pytest.approx(truth, abs=1e-12)
    near = found.row[[TREE_A, TREE_B]].tolist()
    copy = pickle.loads(pickle.dumps(pair))
    assert copy._begin_with[2] == tuple(near)
    assert copy.distance(where, IDENTITY).upper == pytest.approx(truth, abs=1e-12)


def test_a_bad_pose_is_the_one_that_was_given():
    bad = np.diag([2.0, 1.0, 1.0, 1.0])
    for a, b in ((RING, BALL), (BALL, RING)):
        with pytest.raises(ValueError, match="pose_a"):
            engine.distance(a, bad, b, IDENTITY)
        with pytest.raises(ValueError, match="poses_b"):
            engine.distances(a, np.stack([IDENTITY] * 2), b, np.stack([IDENTITY, bad]))


def test_pairs_of_an_assembly_come_in_either_order():
    models = RING, BALL, RING
    assembly = engine.Assembly(models)
    poses = np.stack([IDENTITY, PLACES["apart"], pose(np.random.default_rng(3), (3.0, 0.0, 0.0))])
    pairs = [(0, 1), (1, 0), (1, 2), (2, 1)]
    answers = assembly.distances(poses, pairs)
    for k, (a, b) in enumerate(pairs):
        true = engine.distance(models[a], poses[a], models[b], poses[b])
        assert answers.upper[k] == pytest.approx(true.upper, abs=1e-12)
        np.testing.assert_allclose(answers.points_a[k], true.point_a, atol=1e-6)
        np.testing.assert_allclose(answers.points_b[k], true.point_b, atol=1e-6)
