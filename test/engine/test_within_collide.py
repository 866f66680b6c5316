"""The yes-or-no questions, against `distance`, exact arithmetic and brute force."""

from __future__ import annotations

import math

import numpy as np
import pytest
from engine_bodies import IDENTITY, Fcl, box, pose, soup, sphere, torus, translation
from engine_oracles import crossing, exact_squared_distance, exactly_moved, triangles

from proximity_monitor import engine
from proximity_monitor.engine import Status

A, B = sphere(3), torus(24)


def placed(seed, count=40):
    """Yield random poses, apart and crossing, with the exact answer."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        pose_a, pose_b = pose(rng, 1.0), pose(rng, 1.0)
        yield pose_a, pose_b, engine.distance(A, pose_a, B, pose_b)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0 - 1e-9, 1.0 + 1e-9, 2.0, math.inf])
def test_within_agrees_with_distance(share):
    answers = set()
    for pose_a, pose_b, exact in placed(1):
        clearance = exact.upper * share if exact.upper else share
        found = engine.within(A, pose_a, B, pose_b, clearance)
        assert found.within == (clearance >= exact.lower)
        assert found.lower <= exact.upper
        assert exact.lower <= found.upper
        gap = np.linalg.norm(found.point_a - found.point_b)
        assert found.upper == pytest.approx(gap, abs=1e-13)
        if found.within:
            assert found.upper <= clearance + 1e-13 or found.lower <= clearance
            assert gap <= clearance + 1e-13
        else:
            assert found.lower > clearance
        answers.add(found.within)
    assert answers == ({True} if share > 1.0 else {True, False})


def test_within_is_cheaper_than_distance():
    near = far = exact = 0
    for pose_a, pose_b, answer in placed(2):
        if answer.status is Status.EXACT:
            near += engine.within(A, pose_a, B, pose_b, 2.0 * answer.upper).bound_tests
            far += engine.within(A, pose_a, B, pose_b, 0.5 * answer.upper).bound_tests
            exact += answer.bound_tests
    assert near < exact
    assert far < exact


@pytest.mark.parametrize("clearance", [-1e-12, -math.inf, math.nan])
def test_within_refuses_a_clearance_that_makes_no_sense(clearance):
    with pytest.raises(ValueError, match="clearance"):
        engine.within(A, IDENTITY, B, IDENTITY, clearance)


@pytest.mark.parametrize(
    ("a", "b"), [(A, B), (soup(1, 400, 0.1), B), (box(), soup(2, 400, 0.1)), (box(), box())]
)
def test_collide_agrees_with_distance_and_fcl(a, b):
    oracle = Fcl(a, b)
    rng = np.random.default_rng(3)
    answers = set()
    for _ in range(40):
        pose_a, pose_b = pose(rng, 1.0), pose(rng, 1.0)
        found = engine.collide(a, pose_a, b, pose_b)
        exact = engine.distance(a, pose_a, b, pose_b)
        assert found.colliding == (exact.status is Status.INTERSECTING)
        assert found.colliding == oracle.collide(pose_a, pose_b)
        assert len(found.contacts) == int(found.colliding)
        if found.colliding:
            for mesh, matrix in ((a, pose_a), (b, pose_b)):
                assert engine.closest_points(mesh, matrix, found.points).upper[0] < 1e-13
        answers.add(found.colliding)
    assert answers == {True, False}


def contacts_of(found):
    pairs = [tuple(pair) for pair in found.contacts.tolist()]
    assert len(set(pairs)) == len(pairs)
    return set(pairs)


@pytest.mark.parametrize(
    ("a", "b"), [(sphere(1), box()), (torus(8), soup(4, 40)), (soup(5, 30), sphere(1))]
)
def test_all_contacts_are_those_of_exact_arithmetic(a, b):
    rng = np.random.default_rng(6)
    count = 0
    for _ in range(6):
        pose_b = pose(rng, 0.6)
        first, second = triangles(a), triangles(b, pose_b)
        low_a, high_a = first.min(axis=1), first.max(axis=1)
        low_b, high_b = second.min(axis=1) - 1e-9, second.max(axis=1) + 1e-9
        apart = (low_a[:, None] > high_b) | (high_a[:, None] < low_b)
        expected = {
            (i, j)
            for i, j in np.argwhere(~apart.any(axis=2)).tolist()
            if exact_squared_distance(first[i].tolist(), exactly_moved(pose_b, triangles(b)[j]))
            == 0
        }
        found = engine.collide(a, IDENTITY, b, pose_b, all_contacts=True)
        assert found.colliding == bool(expected)
        assert contacts_of(found) == expected
        count += len(expected)
    assert count > 20


def test_more_contacts_than_one_portion_holds():
    a, b = soup(7, 220, 3.0), soup(8, 200, 3.0)
    expected = {tuple(pair) for pair in np.argwhere(crossing(triangles(a), triangles(b))).tolist()}
    assert len(expected) > 3000
    found = engine.collide(a, IDENTITY, b, IDENTITY, all_contacts=True)
    assert contacts_of(found) == expected
    assert len(engine.collide(a, IDENTITY, b, IDENTITY).contacts) == 1


def test_touching_counts_as_contact():
    cube = box((1.0, 1.0, 1.0))
    beside = engine.collide(cube, IDENTITY, cube, translation(1.0), all_contacts=True)
    assert beside.colliding
    ours = triangles(cube)
    expected = {
        (i, j)
        for i in range(12)
        for j in range(12)
        if exact_squared_distance(ours[i].tolist(), (ours[j] + (1.0, 0.0, 0.0)).tolist()) == 0
    }
    assert contacts_of(beside) == expected
    apart = engine.collide(cube, IDENTITY, cube, translation(1.0 + 1e-12), all_contacts=True)
    assert not apart.colliding
    assert apart.contacts.shape == (0, 2)


def test_a_pair_asks_all_questions_in_turn():
    pair = engine.Pair(A, B)
    for pose_a, pose_b, exact in placed(9):
        assert pair.collide(pose_a, pose_b).colliding == (exact.lower == 0.0)
        assert pair.within(pose_a, pose_b, exact.upper + 1e-9).within
        assert pair.within(pose_a, pose_b, 0.0).within == (exact.lower == 0.0)
        assert pair.distance(pose_a, pose_b).upper == pytest.approx(exact.upper, abs=1e-13)
        once = pair.collide(pose_a, pose_b, all_contacts=True)
        again = engine.collide(A, pose_a, B, pose_b, all_contacts=True)
        assert contacts_of(once) == contacts_of(again)


@pytest.mark.parametrize("name", ["pose_a", "pose_b"])
@pytest.mark.parametrize("ask", [engine.collide, engine.distance, engine.within])
def test_bad_poses_are_named(ask, name):
    poses = {"pose_a": IDENTITY, "pose_b": IDENTITY, name: 2.0 * np.eye(4)}
    more = (0.1,) if ask is engine.within else ()
    with pytest.raises(ValueError, match=name):
        ask(A, poses["pose_a"], B, poses["pose_b"], *more)
