"""Distances of meshes: against exact arithmetic, brute force and FCL; witnesses; invariances."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from engine_bodies import (
    IDENTITY,
    ORDERS,
    SMALL,
    Fcl,
    box,
    plate,
    pose,
    soup,
    sphere,
    torus,
    translation,
)
from engine_oracles import (
    exact_mesh_distance,
    exactly_moved,
    magnitude,
    pairwise_distances,
    root,
    triangles,
)

from proximity_monitor import engine
from proximity_monitor.engine import Status

LARGE = {"sphere": sphere(3), "torus": torus(40), "box": box(), "soup": soup(5, 1000, 0.1)}
LARGE_PAIRS = [
    ("sphere", "sphere"), ("sphere", "torus"), ("torus", "torus"), ("torus", "box"),
    ("soup", "torus"), ("box", "soup"), ("soup", "soup"), ("box", "box"),
]  # fmt: skip


def extent(a, b, pose_a, pose_b):
    """Return the magnitude of the coordinates; rounding errors are a share of it."""
    return a.radius + b.radius + float(np.linalg.norm(pose_a[:3, 3] - pose_b[:3, 3]))


def check_witness(mesh, matrix, point, feature):
    weights = feature.parameters
    assert weights.min() >= 0.0
    assert abs(weights.sum() - 1.0) <= 1e-15
    corners = triangles(mesh, matrix)[feature.index]
    assert np.abs(weights @ corners - point).max() <= 4e-15 * np.abs(corners).max()


def check_answer(a, pose_a, b, pose_b, found):
    """Check what every answer promises of its witness points, whatever stopped the search."""
    check_witness(a, pose_a, found.point_a, found.feature_a)
    check_witness(b, pose_b, found.point_b, found.feature_b)
    world = np.abs([found.point_a, found.point_b]).max()
    rounding = 4e-15 * (world + extent(a, b, pose_a, pose_b))
    gap = np.linalg.norm(found.point_a - found.point_b)
    assert found.lower <= gap + rounding
    assert abs(found.upper - gap) <= 4e-15 * extent(a, b, pose_a, pose_b) + rounding
    assert 0.0 <= found.lower <= found.upper
    assert found.elapsed_s >= 0.0
    assert found.primitive_tests >= 1


@pytest.mark.long
@pytest.mark.parametrize("first", SMALL)
@pytest.mark.parametrize("second", SMALL)
def test_bounds_hold_the_exact_distance(first, second):
    a, b = SMALL[first], SMALL[second]
    rng = np.random.default_rng(hash((len(first), len(second))) % 1000)
    for spread in (0.0, 1.0, 2.0, 4.0):
        pose_b = pose(rng, spread)
        squared = exact_mesh_distance(a, b, pose_b)
        for order in ORDERS:
            found = engine.distance(a, IDENTITY, b, pose_b, order=order)
            assert Fraction(found.lower) ** 2 <= squared <= Fraction(found.upper) ** 2
            assert found.upper - found.lower <= 8e-15 * magnitude(a, b, IDENTITY, pose_b)
            assert (squared == 0) == (found.status is Status.INTERSECTING)
            check_answer(a, IDENTITY, b, pose_b, found)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize(("first", "second"), LARGE_PAIRS)
def test_agrees_with_fcl(first, second, order):
    a, b = LARGE[first], LARGE[second]
    oracle = Fcl(a, b)
    rng = np.random.default_rng(len(first) * len(second))
    touching = 0
    for spread in 6 * (0.3, 1.0, 2.0, 3.0):
        pose_a, pose_b = pose(rng, spread), pose(rng, spread)
        expected = oracle.distance(pose_a, pose_b)
        found = engine.distance(a, pose_a, b, pose_b, order=order)
        assert found.status is (Status.EXACT if expected else Status.INTERSECTING)
        assert found.lower <= expected + 1e-12
        assert found.upper >= expected - 1e-12
        assert found.upper - found.lower <= 8e-15 * magnitude(a, b, pose_a, pose_b)
        check_answer(a, pose_a, b, pose_b, found)
        touching += not expected
    assert 0 < touching < 24


def test_surfaces_inside_each_other_are_apart():
    inner, outer = sphere(3, 0.9), sphere(3, 1.0)
    found = engine.distance(inner, IDENTITY, outer, IDENTITY)
    expected = Fcl(inner, outer).distance(IDENTITY, IDENTITY)
    assert found.status is Status.EXACT
    assert found.upper == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("far", [1e3, 1e8, 2.0**40])
def test_bodies_far_from_the_origin_keep_their_clearance(far):
    """These translations are exact in float64, so relative motion and answer stay the same."""
    a, b = SMALL["torus"], SMALL["box"]
    rng = np.random.default_rng(8)
    for _ in range(10):
        pose_a, pose_b = pose(rng), pose(rng)
        pose_b[:3, 3] = np.round(rng.normal(size=3) * 3.0, 1) // 2.0**-4 * 2.0**-4
        here = engine.distance(a, pose_a, b, pose_b)
        pose_a[:3, 3] += far
        pose_b[:3, 3] += far
        there = engine.distance(a, pose_a, b, pose_b)
        assert (there.lower, there.upper, there.status) == (here.lower, here.upper, here.status)
        assert np.abs(there.point_a - here.point_a - far).max() <= 4e-16 * far


@pytest.mark.parametrize("far", [1e8, 1e14, 1e15, 1e20, 1e40])
def test_bodies_far_from_each_other(far):
    a, b = SMALL["box"], SMALL["torus"]
    rng = np.random.default_rng(9)
    for _ in range(3):
        pose_b = pose(rng, far)
        squared = exact_mesh_distance(a, b, pose_b) if far < 1e14 else None
        found = engine.distance(a, IDENTITY, b, pose_b)
        expected = math.hypot(*pose_b[:3, 3])
        assert found.lower <= expected + 3.0
        assert found.upper >= expected * (1.0 - 1e-15) - 3.0
        assert found.upper - found.lower <= 8e-15 * magnitude(a, b, IDENTITY, pose_b)
        if squared is not None:
            assert Fraction(found.lower) ** 2 <= squared <= Fraction(found.upper) ** 2


def test_poses_of_six_digits_are_within_their_share():
    a, b = SMALL["torus"], SMALL["box"]
    rng = np.random.default_rng(11)
    for _ in range(30):
        pose_a, pose_b = pose(rng, 2.0), pose(rng, 2.0)
        exact = engine.distance(a, pose_a, b, pose_b)
        rounded = engine.distance(a, np.round(pose_a, 6), b, np.round(pose_b, 6))
        assert rounded.upper == pytest.approx(exact.upper, abs=2e-5)
        frame = np.linalg.norm(np.round(pose_a, 6)[:3, :3], 2)
        gap = np.linalg.norm(rounded.point_a - rounded.point_b)
        assert gap == pytest.approx(rounded.upper, abs=4e-6 * frame * extent(a, b, pose_a, pose_b))


def test_imperfect_rotations_prune_nothing_that_is_nearer():
    """The rotations stretch as much as permitted; the plates are about equally near everywhere.

    The transposed rotation is then no exact inverse. The oracle is the same query without
    rotations: the vertices of b are moved into a's frame beforehand.
    """
    a = b = plate(16)
    rng = np.random.default_rng(12)
    for _ in range(40):
        pose_a = pose(rng, 1.0)
        tilt = translation(*rng.normal(size=2), rng.uniform(0.5, 2.0))
        tilt[2, :2] = 1e-6 * rng.normal(size=2)
        tilt[:2, 2] = -tilt[2, :2]
        pose_b = pose_a @ tilt
        pose_a[:3, :3] *= 1.0 + 9e-7 * rng.choice((-1.0, 1.0))
        pose_b[:3, :3] *= 1.0 + 9e-7 * rng.choice((-1.0, 1.0))
        turned = pose_a[:3, :3].T @ pose_b[:3, :3]
        shift = pose_a[:3, :3].T @ (pose_b[:3, 3] - pose_a[:3, 3])
        moved = engine.TriangleMesh(b.vertices @ turned.T + shift, b.faces)
        expected = engine.distance(a, IDENTITY, moved, IDENTITY)
        found = engine.distance(a, pose_a, b, pose_b)
        assert found.upper == pytest.approx(expected.upper, abs=4e-14)


def test_the_oracles_agree_with_each_other():
    """Three independent oracles agree on the same poses, so none has a mistake of its own."""
    a, b = SMALL["torus"], SMALL["box"]
    rng = np.random.default_rng(13)
    for _ in range(5):
        pose_b = pose(rng, 2.0)
        exact = float(root(exact_mesh_distance(a, b, pose_b)))
        brute = pairwise_distances(triangles(a), triangles(b, pose_b)).min()
        assert brute == pytest.approx(exact, abs=1e-14)
        assert Fcl(a, b).distance(IDENTITY, pose_b) == pytest.approx(exact, abs=1e-12)
    moved = exactly_moved(translation(0.1), np.array([[0.2, 0.0, 0.0]]))
    assert moved[0][0] == Fraction(0.1) + Fraction(0.2)
