"""Closest points of a model to many points, against brute force and exact arithmetic."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from engine_bodies import IDENTITY, box, pose, soup, sphere, torus, translation
from engine_oracles import exact_squared_distance, pairwise_distances, triangles

from proximity_monitor import engine

MODELS = {
    "sphere": sphere(2),
    "torus": torus(16),
    "box": box(),
    "soup": soup(1, 200, 0.1),
    "points": engine.points(np.random.default_rng(2).normal(size=(40, 3))),
    "polyline": engine.polyline(np.random.default_rng(3).normal(size=(40, 3))),
    "triangle": soup(4, 1),
}


@pytest.mark.long
@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("spread", [0.3, 1.0, 5.0])
def test_against_brute_force(name, spread):
    model = MODELS[name]
    rng = np.random.default_rng(5)
    matrix = pose(rng, 2.0)
    given = matrix[:3, 3] + spread * rng.normal(size=(60, 3))
    found = engine.closest_points(model, matrix, given)
    corners = triangles(model, matrix)
    expected = pairwise_distances(np.repeat(given[:, None], 3, axis=1), corners).min(axis=1)
    slack = 1e-14 * (1.0 + np.abs(given).max())
    assert np.abs(found.upper - expected).max() <= 2.0 * slack
    assert (found.lower <= expected + slack).all()
    assert (found.upper - found.lower <= 2.0 * slack).all()
    assert np.linalg.norm(found.points - given, axis=1) == pytest.approx(expected, abs=slack)
    for point, triangle in zip(found.points, found.elements, strict=True):
        at = pairwise_distances(np.array([[point] * 3]), corners[[triangle]])
        assert at[0, 0] <= slack


@pytest.mark.parametrize("name", MODELS)
def test_bounds_hold_the_exact_distance(name):
    model = MODELS[name]
    rng = np.random.default_rng(6)
    corners = triangles(model)
    on_it = [rng.dirichlet((1, 1, 1)) @ corners[i % len(corners)] for i in range(10)]
    given = np.concatenate((rng.normal(size=(10, 3)), corners[:, 0][:5], on_it))
    found = engine.closest_points(model, IDENTITY, given)
    distances = pairwise_distances(np.repeat(given[:, None], 3, axis=1), corners)
    for point, row, lower, upper in zip(given, distances, found.lower, found.upper, strict=True):
        near = np.flatnonzero(row <= row.min() + 1e-9)
        squared = min(
            exact_squared_distance(corners[i].tolist(), [point.tolist()] * 3) for i in near
        )
        assert Fraction(lower) ** 2 <= squared <= Fraction(upper) ** 2


@pytest.mark.parametrize("far", [1e6, 1e10, 1e16, 1e20, 1e40])
def test_points_far_away(far):
    rng = np.random.default_rng(7)
    given = far * rng.normal(size=(20, 3))
    found = engine.closest_points(MODELS["torus"], IDENTITY, given)
    expected = np.linalg.norm(given, axis=1)
    assert (np.abs(found.upper - expected) <= 2.0 + 1e-14 * expected).all()
    assert (found.lower <= found.upper).all()
    # If float64 resolves the model at this distance, the nearest point is on the near side.
    if far <= 1e10:
        assert (np.einsum("ij,ij->i", found.points, given) > 0.0).all()


@pytest.mark.parametrize("scale", [1e-20, 1e20])
def test_models_of_any_size(scale):
    model = engine.TriangleMesh(MODELS["sphere"].vertices * scale, MODELS["sphere"].faces)
    given = np.random.default_rng(8).normal(size=(20, 3))
    plain = engine.closest_points(MODELS["sphere"], IDENTITY, given)
    scaled = engine.closest_points(model, IDENTITY, given * scale)
    assert scaled.upper == pytest.approx(plain.upper * scale, rel=1e-13)


def test_agrees_with_distance_to_a_point_model():
    rng = np.random.default_rng(9)
    model, matrix = MODELS["torus"], pose(rng, 1.0)
    given = rng.normal(size=(20, 3))
    found = engine.closest_points(model, matrix, given)
    for k, point in enumerate(given):
        answer = engine.distance(model, matrix, engine.points([point]), IDENTITY)
        assert found.upper[k] == pytest.approx(answer.upper, abs=1e-13)


def test_each_answer_depends_on_its_point_alone():
    rng = np.random.default_rng(10)
    given = rng.normal(size=(30, 3))
    together = engine.closest_points(MODELS["torus"], IDENTITY, given)
    for k, point in enumerate(given):
        alone = engine.closest_points(MODELS["torus"], IDENTITY, [point])
        assert alone.upper[0] == pytest.approx(together.upper[k], abs=1e-14)


def test_no_points_have_no_answers():
    found = engine.closest_points(MODELS["box"], IDENTITY, np.empty((0, 3)))
    assert found.lower.shape == found.upper.shape == found.elements.shape == (0,)
    assert found.points.shape == (0, 3)


@pytest.mark.parametrize("points", [[0.0, 0.0, 0.0], [[0.0, 0.0]], np.zeros((2, 3, 1))])
def test_points_of_another_shape(points):
    with pytest.raises(ValueError, match=r"points: shape .*\(k, 3\)"):
        engine.closest_points(MODELS["box"], IDENTITY, points)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_points_that_are_not_finite(value):
    given = np.zeros((3, 3))
    given[1, 2] = value
    with pytest.raises(ValueError, match=r"points\[1\]"):
        engine.closest_points(MODELS["box"], IDENTITY, given)


def test_a_pose_that_is_no_rigid_motion():
    with pytest.raises(ValueError, match="pose"):
        engine.closest_points(MODELS["box"], 2.0 * np.eye(4), [[0.0, 0.0, 0.0]])


@pytest.mark.parametrize("radius", [0.0, 0.2])
@pytest.mark.parametrize("name", MODELS)
def test_beyond_the_largest_distance_only_that_is_told(name, radius):
    model = MODELS[name]
    model = engine.TriangleMesh(model.vertices, model.faces, radius=radius, deviation=0.5 * radius)
    rng = np.random.default_rng(11)
    matrix, given = pose(rng, 1.0), 3.0 * rng.normal(size=(80, 3))
    whole = engine.closest_points(model, matrix, given)
    for farthest in (0.0, float(np.median(whole.lower)), float(whole.lower[3]), 1e9):
        found = engine.closest_points(model, matrix, given, max_distance=farthest)
        near = np.isfinite(found.upper)
        assert found.done.all()
        assert (found.lower[~near] >= farthest).all()
        assert np.isnan(found.points[~near]).all()
        assert (found.elements[~near] == -1).all()
        assert near[whole.lower < farthest - 1e-12].all()
        assert found.lower[~near] == pytest.approx(farthest, abs=1e-12)
        assert (found.lower[~near] <= whole.upper[~near]).all()
        assert found.upper[near] == pytest.approx(whole.upper[near], abs=1e-13)
        assert found.points[near] == pytest.approx(whole.points[near], abs=1e-9)
    assert near.all()


def test_what_the_budget_does_not_suffice_for_can_be_asked_again():
    rng = np.random.default_rng(12)
    model, given = sphere(4), 2.0 * rng.normal(size=(20_000, 3))
    whole = engine.closest_points(model, IDENTITY, given)
    left, calls = np.arange(len(given)), 0
    upper = np.full(len(given), math.nan)
    while len(left):
        found = engine.closest_points(model, IDENTITY, given[left], budget_s=0.0005)
        assert found.done.any()
        assert (found.lower[~found.done] == 0.0).all()
        assert np.isinf(found.upper[~found.done]).all()
        assert (found.elements[~found.done] == -1).all()
        upper[left[found.done]] = found.upper[found.done]
        left, calls = left[~found.done], calls + 1
    assert calls > 2
    assert upper == pytest.approx(whole.upper, abs=1e-14)


def test_answers_do_not_depend_on_threads():
    rng = np.random.default_rng(13)
    given = rng.normal(size=(10_000, 3))
    one, many = (
        engine.closest_points(MODELS["soup"], IDENTITY, given, threads=threads, normals=True)
        for threads in (1, 3)
    )
    for name in ("lower", "upper", "points", "elements", "done", "normals"):
        assert np.array_equal(getattr(one, name), getattr(many, name))


def test_normals_are_those_of_faces():
    rng = np.random.default_rng(14)
    model, matrix = MODELS["box"], pose(rng, 1.0)
    given = matrix[:3, 3] + 3.0 * rng.normal(size=(50, 3))
    found = engine.closest_points(model, matrix, given, normals=True)
    corners = triangles(model, matrix)[found.elements]
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    assert np.allclose(found.normals, n, atol=1e-14)
    assert engine.closest_points(model, matrix, given).normals is None


def test_normals_of_balls_and_of_what_has_none():
    given = np.random.default_rng(15).normal(size=(20, 3))
    ball = engine.points([[0.0, 0.0, 0.0]], radius=0.3)
    found = engine.closest_points(ball, translation(5.0), given, normals=True)
    way = given - (5.0, 0.0, 0.0)
    assert np.allclose(found.normals, way / np.linalg.norm(way, axis=1, keepdims=True))
    found = engine.closest_points(MODELS["polyline"], IDENTITY, given, normals=True)
    assert (found.normals == 0.0).all()


@pytest.mark.parametrize(
    ("wrong", "error"),
    [
        ({"max_distance": -1.0}, ValueError),
        ({"max_distance": math.nan}, ValueError),
        ({"max_distance": "far"}, TypeError),
        ({"budget_s": -1.0}, ValueError),
        ({"threads": 0}, ValueError),
    ],
)
def test_limits_that_make_no_sense(wrong, error):
    with pytest.raises(error, match=next(iter(wrong))):
        engine.closest_points(MODELS["box"], IDENTITY, [[0.0, 0.0, 0.0]], **wrong)


def test_the_parameters_of_a_surface_lead_to_its_nearest_points():
    rng = np.random.default_rng(11)
    matrix = pose(rng, 2.0)
    rotation, offset = matrix[:3, :3], matrix[:3, 3]
    given = offset + rng.normal(size=(200, 3))
    patch = engine.Patch(rng.normal(size=(5, 4, 3)), weights=rng.uniform(0.5, 2.0, (5, 4)))
    curve = engine.Curve(rng.normal(size=(6, 3)))
    made = engine.ParametricSurface([patch, curve])
    found = engine.closest_points(made, matrix, given)
    for i, (u, v) in enumerate(found.parameters):
        on = curve.evaluate([u]) if found.elements[i] else patch.evaluate([u], [v])
        assert rotation @ on[0] + offset == pytest.approx(found.points[i], abs=1e-13)
    walls = [[0.0, -1.0], [0.8, -1.0]], [[0.8, -1.0], [1.2, 0.3], [0.5, 1.0]], [[0.5, 1], [0, 1]]
    turned = engine.SolidOfRevolution([engine.Curve(wall) for wall in walls])
    found = engine.closest_points(turned, matrix, given)
    for i, (t, theta) in enumerate(found.parameters):
        rho, z = engine.Curve(walls[found.elements[i]]).evaluate([t])[0][:2]
        on = np.array([rho * math.cos(theta), rho * math.sin(theta), z])
        assert rotation @ on + offset == pytest.approx(found.points[i], abs=1e-13)
        assert 0.0 <= theta <= 2.0 * math.pi
    far = engine.closest_points(turned, matrix, given, max_distance=1e-3)
    assert np.isnan(far.parameters[far.elements < 0]).all()
    assert engine.closest_points(sphere(2), matrix, given).parameters is None


@pytest.mark.parametrize("far", [1e46, 1e160, 1e200])
def test_points_beyond_all_coordinates_are_refused(far):
    for model in (box(), engine.shapes.cylinder(1.0, 2.0)):
        with pytest.raises(ValueError, match=r"points\[1\] = .*at most 1e\+45 m"):
            engine.closest_points(model, IDENTITY, [[0.0, 0.0, 0.0], [0.0, 0.0, far]])
