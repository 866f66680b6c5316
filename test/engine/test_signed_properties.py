"""Signed distances: properties that hold for any solids, poses, tolerances and budgets."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from depth_cases import SOLIDS, TIGHT, ask, check, together
from engine_bodies import (
    IDENTITY,
    box,
    pose,
    rotation,
    sphere,
    translation,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from proximity_monitor import engine
from proximity_monitor.engine import Status

poses = st.integers(0, 2**32 - 1).map(np.random.default_rng)
pairs = st.tuples(st.sampled_from(sorted(SOLIDS)), st.sampled_from(sorted(SOLIDS)))


@settings(max_examples=40, deadline=None)
@given(pairs, poses, st.floats(0.0, 2.0))
def test_symmetry_and_common_motion(names, rng, spread):
    a, b = (SOLIDS[name] for name in names)
    pose_a, pose_b, common = pose(rng, spread), pose(rng, spread), pose(rng, 3.0)
    found = ask(a, pose_a, b, pose_b)
    moved = engine.signed_distance(a, common @ pose_a, b, common @ pose_b)
    assert max(moved.lower, found.lower) <= min(moved.upper, found.upper) + 1e-11


@settings(max_examples=40, deadline=None)
@given(pairs, poses, st.floats(0.0, 1.0), st.floats(1e-6, 0.3))
def test_it_changes_by_no_more_than_the_relative_motion(names, rng, spread, way):
    a, b = (SOLIDS[name] for name in names)
    pose_a, pose_b = pose(rng, spread), pose(rng, spread)
    before = engine.signed_distance(a, pose_a, b, pose_b)
    step = rng.normal(size=3)
    pose_b[:3, 3] += way * step / np.linalg.norm(step)
    after = engine.signed_distance(a, pose_a, b, pose_b)
    assert after.lower <= before.upper + way + TIGHT
    assert before.lower - way - TIGHT <= after.upper


@settings(max_examples=40, deadline=None)
@given(pairs, poses, st.floats(0.0, 2.0))
def test_agrees_with_distance(names, rng, spread):
    """If no point is inside both solids, the answer is the surfaces' distance."""
    a, b = (SOLIDS[name] for name in names)
    pose_a, pose_b = pose(rng, spread), pose(rng, spread)
    found = engine.signed_distance(a, pose_a, b, pose_b)
    surfaces = engine.distance(a, pose_a, b, pose_b)
    if found.lower > 0.0:
        assert (found.lower, found.upper) == (surfaces.lower, surfaces.upper)
    if surfaces.lower == 0.0:
        assert found.lower <= 0.0


@settings(max_examples=60, deadline=None)
@given(
    pairs,
    poses,
    st.floats(0.0, 1.5),
    st.one_of(st.just(0.01), st.floats(0.001, 1.0), st.just(math.inf)),
    st.one_of(st.just(0.0), st.floats(0.0, 1.0), st.just(math.inf)),
    st.one_of(st.none(), st.just(0.0), st.floats(0.0, 1e-3)),
)
def test_bounds_hold_under_any_tolerance_and_budget(names, rng, spread, depth, absolute, budget):
    a, b = (SOLIDS[name] for name in names)
    pose_a, pose_b = pose(rng, spread), pose(rng, spread)
    close = engine.signed_distance(a, pose_a, b, pose_b)
    loose = engine.signed_distance(
        a, pose_a, b, pose_b, rel_err=depth, abs_err=absolute, depth_err=depth, budget_s=budget
    )
    assert loose.lower <= close.upper + TIGHT
    assert close.lower <= loose.upper + TIGHT
    if budget is None:
        assert (loose.lower > 0.0) == (close.lower > 0.0)
        assert (loose.upper < 0.0) == (close.upper < 0.0)
        share = depth * abs(close.lower) if close.upper != 0.0 else 0.0
        assert loose.upper - loose.lower <= max(share, absolute) + TIGHT


@pytest.mark.parametrize("depth_err", [0.1, 1e-3, 1e-5])
def test_the_depth_is_as_close_as_it_was_asked_for(depth_err):
    found = engine.signed_distance(
        sphere(3), IDENTITY, sphere(3), translation(1.9, 0.1, 0.2), depth_err=depth_err
    )
    assert -found.lower <= (1.0 + depth_err) * -found.upper + TIGHT
    close = engine.signed_distance(sphere(3), IDENTITY, sphere(3), translation(1.9, 0.1, 0.2))
    assert max(found.lower, close.lower) <= min(found.upper, close.upper)


def test_no_time_at_all_still_bounds():
    for x in (0.0, 0.9, 1.6, 5.0):
        found = engine.signed_distance(
            sphere(3), IDENTITY, sphere(3, 0.6), translation(x), budget_s=0.0
        )
        close = engine.signed_distance(sphere(3), IDENTITY, sphere(3, 0.6), translation(x))
        assert found.lower <= close.upper
        assert close.lower <= found.upper
        assert found.status in (Status.OUT_OF_TIME, close.status)


def test_a_largest_ball_is_found_without_looking_everywhere():
    """The number of points asked about depends on a mesh's shape, not on its triangles."""
    tests = []
    for subdivisions in (3, 5):
        a = sphere(subdivisions)
        found = engine.signed_distance(a, IDENTITY, a, translation(1.9, 0.2, 0.1))
        assert found.upper < 0.0
        tests.append(found.primitive_tests)
    assert max(tests) < 100


def test_boxes_that_share_an_edge_are_a_solid():
    """Four faces meet at the edge, two in either direction."""
    second = trimesh.creation.box((1, 1, 1))
    second.apply_translation((1.0, 1.0, 0.0))
    stairs = together(trimesh.creation.box((1, 1, 1)), second)
    found = engine.signed_distance(stairs, IDENTITY, box((0.1, 0.1, 0.1)), translation(1.0, 1.0))
    check(found, -0.1)


def test_no_ball_passes_the_walls_inside_a_union():
    walled = together(trimesh.creation.box((1, 1, 1)), trimesh.creation.box((1, 0.2, 1)))
    check(ask(walled, IDENTITY, box((0.6, 0.6, 0.6)), translation(0.0, 0.1)), -0.3)


def test_any_angle_of_turned_plates():
    plate, rng = box((10.0, 10.0, 0.1)), np.random.default_rng(17)
    for _ in range(5):
        here = np.eye(4)
        here[:3, :3] = rotation(rng)
        check(ask(plate, here, plate, here @ translation(0.1, 0.2, 0.05)), -0.05)


def _corners_and_faces(size):
    solid = box(tuple(size))
    return solid.vertices, solid.faces


@pytest.mark.parametrize("seed", range(20))
def test_points_of_swept_solids_that_overlap_lie_on_their_surfaces(seed):
    rng = np.random.default_rng(seed)
    radii = rng.uniform(0.0, 0.4), rng.uniform(0.05, 0.4)
    a, b = (
        engine.TriangleMesh(*_corners_and_faces(rng.uniform(0.5, 1.5, 3)), radius=radius)
        for radius in radii
    )
    pose_a, pose_b = pose(rng, 0.1), pose(rng, 0.4)
    found = engine.signed_distance(a, pose_a, b, pose_b)
    assert found.upper < 0.0
    for model, at, point in ((a, pose_a, found.point_a), (b, pose_b, found.point_b)):
        beside = engine.closest_points(model, at, point[None], signed=True)
        assert max(abs(beside.lower[0]), abs(beside.upper[0])) < 1e-9


def test_the_deepest_point_in_the_sweep_of_a_solid_is_beside_its_surface():
    solid = engine.TriangleMesh(*_corners_and_faces((2.0, 2.0, 2.0)), radius=0.3)
    surface = engine.TriangleMesh(
        [[-0.01, 0.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.01, 0.002]], [[0, 1, 2]], solid=False
    )
    found = engine.signed_distance(solid, IDENTITY, surface, translation(1.1, 0.0, 0.0))
    assert found.upper == pytest.approx(-0.21, abs=1e-9)
    assert found.point_a == pytest.approx((1.3, 0.0, 0.0), abs=1e-9)
    assert found.point_b == pytest.approx((1.09, 0.0, 0.0), abs=1e-9)
