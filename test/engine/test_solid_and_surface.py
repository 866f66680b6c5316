"""Signed distances if only one model is a solid, and if a solid has holes."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from ball_oracle import deepest_of_surface, winding_numbers
from engine_bodies import IDENTITY, box, pose, sphere, torus, translation
from engine_oracles import pairwise_distances, triangles
from hypothesis import given, settings
from hypothesis import strategies as st

from proximity_monitor import engine
from proximity_monitor.engine import Status

TIGHT = 1e-12


def surface(mesh: engine.TriangleMesh) -> engine.TriangleMesh:
    """Return the same mesh as a surface."""
    return engine.TriangleMesh(mesh.vertices, mesh.faces, name=mesh.name, solid=False)


def robust(mesh: engine.TriangleMesh, keep: np.ndarray) -> engine.TriangleMesh:
    """Return a mesh of some of the faces, whose inside is to be guessed."""
    return engine.TriangleMesh(mesh.vertices, mesh.faces[keep], name="open", solid="robust")


def bowl(height: float, subdivisions: int = 3) -> engine.TriangleMesh:
    """Return a sphere without the faces above a height."""
    ball = sphere(subdivisions)
    low = ball.vertices[ball.faces][:, :, 2].max(axis=1) <= height
    return robust(ball, low)


def check(found, solid, pose_solid, other, pose_other) -> None:
    """Check that the bounds agree with the wider bounds from points on the surface."""
    shallow, deep = deepest_of_surface(solid, pose_solid, other, pose_other)
    assert max(-found.lower, 0.0) >= shallow - TIGHT
    assert -found.upper <= deep + TIGHT
    if found.lower > 0.0:
        corners, points = triangles(solid, pose_solid), triangles(other, pose_other)
        nearest = float(pairwise_distances(corners, points).min())
        assert found.lower - TIGHT <= nearest <= found.upper + TIGHT
    elif shallow > 0.01:
        assert found.lower >= 1.01 * found.upper - TIGHT


SOLIDS = {"box": box(), "sphere": sphere(1), "torus": torus(8)}
SURFACES = {
    "box": surface(box((0.3, 0.4, 0.2))),
    "sphere": surface(sphere(1, 0.4)),
    "points": engine.points(np.random.default_rng(1).normal(0.0, 0.3, (20, 3))),
    "polyline": engine.polyline(np.random.default_rng(2).normal(0.0, 0.3, (10, 3))),
    "point": engine.points([[0.0, 0.0, 0.0]]),
    "large sphere": surface(sphere(1, 3.0)),
}


@pytest.mark.long
@pytest.mark.parametrize("first", SOLIDS)
@pytest.mark.parametrize("second", SURFACES)
def test_a_solid_and_a_surface_by_brute_force(first, second):
    a, b = SOLIDS[first], SURFACES[second]
    rng = np.random.default_rng([len(first), len(second)])
    for spread in (0.02, 0.4, 1.5):
        pose_a, pose_b = pose(rng, 2.0), pose(rng)
        pose_b[:3, 3] = pose_a[:3, 3] + spread * rng.normal(size=3)
        found = engine.signed_distance(a, pose_a, b, pose_b)
        other = engine.signed_distance(b, pose_b, a, pose_a)
        for each in (found, other):
            check(each, a, pose_a, b, pose_b)


def test_the_solid_does_not_lie_inside_a_surface():
    small, shell = box((0.1, 0.1, 0.1)), surface(box((1.0, 1.0, 1.0)))
    found = engine.signed_distance(small, IDENTITY, shell, IDENTITY)
    assert found.lower == pytest.approx(0.45)
    assert engine.signed_distance(surface(small), IDENTITY, box(), IDENTITY).upper < -0.25
    assert engine.signed_distance(surface(small), IDENTITY, shell, IDENTITY).lower > 0.4


def test_two_surfaces_are_asked_for_their_distance():
    a, b = surface(sphere(3)), surface(sphere(3, 0.5))
    pair = engine.Pair(a, b)
    plain, signed = pair.distance(IDENTITY, IDENTITY), pair.signed_distance(IDENTITY, IDENTITY)
    assert (signed.lower, signed.upper) == (plain.lower, plain.upper)
    cut = pair.signed_distance(IDENTITY, IDENTITY, budget_s=0.0)
    assert cut.status is Status.OUT_OF_TIME
    assert cut.lower <= plain.upper
    assert plain.lower <= cut.upper
    while cut.status is Status.OUT_OF_TIME:
        cut = pair.signed_distance(IDENTITY, IDENTITY, budget_s=1e-4)
    assert cut.upper == pytest.approx(plain.upper, abs=TIGHT)


def test_a_model_that_turns_into_a_surface_is_one_from_then_on():
    model = box((1.0, 1.0, 1.0))
    probe = engine.points([[0.1, 0.0, 0.0]])
    pair = engine.Pair(model, probe)
    whole = model.vertices
    for size, expected in ((1.0, -0.4), (0.0, 0.1), (1.0, -0.4)):
        model.deform(whole * (size, 1.0, 1.0))
        found = pair.signed_distance(IDENTITY, IDENTITY)
        assert found.upper == pytest.approx(expected, rel=0.01)
        assert found.lower == pytest.approx(expected, rel=0.01)


def test_a_wall_that_a_surface_passes_through_step_by_step():
    zone, part = box((1.0, 1.0, 1.0)), surface(sphere(2, 0.05))
    pair = engine.Pair(part, zone)
    for x in np.arange(0.7, -0.71, -0.01):
        found = pair.signed_distance(translation(x), IDENTITY)
        reach = abs(x) - 0.05
        assert (found.lower > 0.0) == (reach > 0.5 + TIGHT)


def test_a_cloud_is_not_looked_at_point_by_point():
    """A point of the cloud that lies inside must still be found."""
    solid, rng = sphere(3, 0.5), np.random.default_rng(8)
    cloud = rng.normal(size=(20_000, 3))
    cloud *= (0.7 + rng.random((20_000, 1))) / np.linalg.norm(cloud, axis=1)[:, None]
    clear = engine.signed_distance(solid, IDENTITY, engine.points(cloud), IDENTITY)
    assert 0.19 < clear.lower <= clear.upper < 0.22
    assert clear.primitive_tests < 2000
    cloud[12_345] = 0.1, 0.0, 0.05
    inside = engine.signed_distance(solid, IDENTITY, engine.points(cloud), IDENTITY)
    assert -0.4 < inside.lower <= inside.upper < -0.37
    assert inside.feature_b.index == 12_345


# Solids with holes


def test_the_winding_number_of_an_open_mesh_decides():
    """Points on a grid around a bowl. The oracle is their winding numbers by spherical excess."""
    open_ball = bowl(0.3, 2)
    assert open_ball.is_solid
    grid = np.stack(np.meshgrid(*3 * [np.linspace(-1.1, 1.1, 7)]), axis=-1).reshape(-1, 3) + 0.013
    corners = triangles(open_ball)
    expected = np.abs(winding_numbers(grid, corners)) > 0.5
    nearest = pairwise_distances(np.repeat(grid[:, None], 3, axis=1), triangles(open_ball)).min(1)
    assert 0.1 < expected.mean() < 0.5
    probe = engine.points([[0.0, 0.0, 0.0]])
    for place, inside, apart in zip(grid, expected, nearest, strict=True):
        found = engine.signed_distance(open_ball, IDENTITY, probe, translation(*place))
        value = -apart if inside else apart
        assert found.lower - TIGHT <= value <= found.upper + TIGHT
        assert found.upper - found.lower < TIGHT


def test_a_robust_solid_may_face_either_way():
    model = bowl(0.3)
    turned = engine.TriangleMesh(model.vertices, model.faces[:, ::-1], solid="robust")
    probe = engine.points([[0.1, 0.0, -0.3]])
    for each in (model, turned):
        assert engine.signed_distance(each, IDENTITY, probe, IDENTITY).upper < -0.5


def test_one_face_turned():
    ball = sphere(3)
    faces = ball.faces.copy()
    faces[7] = faces[7, ::-1]
    model = engine.TriangleMesh(ball.vertices, faces, solid="robust")
    assert engine.signed_distance(model, IDENTITY, sphere(1, 0.2), IDENTITY).upper < -0.3
    assert engine.signed_distance(model, IDENTITY, sphere(1, 0.2), translation(1.5)).lower > 0.2


@pytest.mark.long
@settings(max_examples=30, deadline=None)
@given(
    st.integers(0, 2**32 - 1).map(np.random.default_rng),
    st.floats(0.0, 1.0),
    st.sampled_from([0.8, 0.3, 0.0]),
    st.sampled_from(
        [{}, {"rel_err": 0.3}, {"abs_err": 0.3}, {"budget_s": 0.0}, {"budget_s": 1e-4}]
    ),
)
def test_bounds_of_a_surface_in_an_open_solid_hold(rng, spread, height, options):
    model, small = bowl(height, 2), surface(box((0.3, 0.4, 0.2)))
    pose_a, pose_b = pose(rng, 1.0), pose(rng)
    pose_b[:3, 3] = pose_a[:3, 3] + spread * rng.normal(size=3)
    found = engine.signed_distance(model, pose_a, small, pose_b, **options)
    shallow, _ = deepest_of_surface(model, pose_a, small, pose_b)
    assert max(-found.lower, 0.0) >= shallow - TIGHT
    if not options:
        assert shallow >= -found.upper - 0.12  # the spacing of the points on the surface


def test_what_passes_a_hole_changes_sides_at_once():
    """What a pair remembers of one side must not be used on the other side."""
    model, part = bowl(0.3, 2), surface(sphere(0, 0.05))
    pair = engine.Pair(model, part)
    for z in (*np.arange(0.7, -0.2, -0.02), *np.arange(-0.8, 1.3, 0.2)):
        here = translation(0.0, 0.0, z)
        found = pair.signed_distance(IDENTITY, here)
        fresh = engine.signed_distance(model, IDENTITY, part, here)
        assert max(found.lower, fresh.lower) <= min(found.upper, fresh.upper) + TIGHT
        assert (found.upper < 0.0) == (fresh.upper < 0.0)
        assert found.upper < 0.0 or z > 0.2
        assert found.lower > 0.0 or z < 0.45


def test_a_robust_solid_that_deforms():
    model, probe = bowl(0.3), engine.points([[0.0, 0.0, -1.5]])
    pair = engine.Pair(model, probe)
    whole = model.vertices
    for size in (1.0, 2.0, 1.0, 3.0):
        model.deform(size * whole)
        found = pair.signed_distance(IDENTITY, IDENTITY)
        corners = triangles(model)
        apart = float(pairwise_distances(np.full((1, 3, 3), (0.0, 0.0, -1.5)), corners).min())
        inside = abs(winding_numbers(np.array([[0.0, 0.0, -1.5]]), corners)[0]) > 0.5
        expected = -apart if inside else apart
        assert (found.lower, found.upper) == pytest.approx((expected, expected), abs=TIGHT)


def test_what_is_surely_outside_is_not_looked_at_vertex_by_vertex():
    model, part = bowl(0.9, 5), surface(sphere(5, 0.2))
    found = engine.signed_distance(model, IDENTITY, part, translation(1.25))
    assert found.lower == pytest.approx(0.05, abs=1e-3)
    points = (
        found.primitive_tests
        - engine.distance(model, IDENTITY, part, translation(1.25)).primitive_tests
    )
    assert points < 0.1 * len(part.vertices)


def test_a_ridge_that_is_equally_deep_all_along_ends():
    solid, inner = (
        trimesh.creation.torus(1.0, radius, major_sections=24, minor_sections=12)
        for radius in (0.3, 0.1)
    )
    a = engine.TriangleMesh(solid.vertices, solid.faces)
    b = engine.TriangleMesh(inner.vertices, inner.faces, solid=False)
    found = engine.signed_distance(a, IDENTITY, b, IDENTITY, depth_err=1e-6)
    assert found.upper - found.lower <= -1e-6 * found.lower
    assert found.bound_tests < 100_000
