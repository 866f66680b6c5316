"""Closest points to many points within a tolerance: the bounds are as tight as promised."""

from __future__ import annotations

import math

import numpy as np
import pytest
from engine_bodies import IDENTITY, pose, soup, sphere, torus
from engine_surfaces import bumps, sphere_patches, torus_patches

from proximity_monitor import engine

VASE = [[0, 0], [0.4, 0]], [[0.4, 0], [1.3, 0.4], [0.2, 1.1]], [[0.2, 1.1], [0, 1.1]]
MODELS = {
    "torus": torus(16),
    "soup": soup(1, 200, 0.1),
    "swept": engine.TriangleMesh(torus(8).vertices, torus(8).faces, radius=0.1),
    "deviating": engine.TriangleMesh(sphere(2).vertices, sphere(2).faces, deviation=0.01),
    "surface": bumps(1),
    "solid of patches": engine.ParametricSurface(torus_patches(), solid=True),
    "revolution": engine.SolidOfRevolution([engine.Curve(wall) for wall in VASE]),
}
ROUNDING = 1e-11
ERRORS = [(0.1, 0.0), (1e-3, 0.0), (0.0, 0.05), (0.0, 1e-4), (1e-2, 1e-3)]


def asked(model, points, rel_err, abs_err, matrix=IDENTITY, **more):
    """Return the exact answer and one within tolerances, after checking its bounds."""
    exact = engine.closest_points(model, matrix, points, **more)
    found = engine.closest_points(
        model, matrix, points, rel_err=rel_err, abs_err=abs_err, **more
    )  # fmt: skip
    assert (found.lower <= exact.upper).all()
    assert (exact.lower <= found.upper).all()
    rest = 2.0 * model.deviation + ROUNDING
    near = found.elements >= 0
    gap = (found.upper - found.lower)[near] - rest
    nearer = np.minimum(abs(found.upper), abs(found.lower))[near] + model.deviation
    assert (gap <= np.maximum(rel_err * nearer, abs_err) * (1.0 + 1e-12)).all()
    return exact, found


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("name", MODELS)
def test_bounds_are_as_near_as_was_asked_for(name, signed):
    model, rng = MODELS[name], np.random.default_rng(5)
    matrix = pose(rng, 1.0)
    centre = matrix[:3, :3] @ model.centre + matrix[:3, 3]
    points = centre + model.radius * rng.uniform(-1.5, 1.5, (300, 3))
    points[:30] = engine.closest_points(model, matrix, points[:30]).points  # some near the surface
    points[:30] += 1e-3 * rng.normal(size=(30, 3))
    farther = 0
    for rel_err, abs_err in ERRORS:
        exact, found = asked(model, points, rel_err, abs_err, matrix, signed=signed)
        distances = np.linalg.norm(found.points - points, axis=1)
        outside = found.lower > 0.0
        assert np.allclose(distances[outside], found.upper[outside] - model.deviation, atol=1e-9)
        farther += (found.upper > exact.upper + ROUNDING).sum()
    assert farther > 20  # otherwise the tolerance saved nothing


@pytest.mark.parametrize("name", MODELS)
def test_a_point_is_found_whatever_the_error(name):
    points = 3.0 * np.random.default_rng(6).normal(size=(40, 3))
    for errors in ({"rel_err": math.inf}, {"abs_err": math.inf}):
        found = engine.closest_points(MODELS[name], IDENTITY, points, **errors)
        assert np.isfinite(found.points).all()
        exact = engine.closest_points(MODELS[name], IDENTITY, points)
        assert (found.lower <= exact.upper).all()
        assert (exact.lower <= found.upper).all()


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("errors", [(0.2, 0.0), (0.0, 0.1)])
def test_what_is_beyond_the_largest_distance_is_so_in_spite_of_errors(name, signed, errors):
    model = MODELS[name]
    points = model.radius * np.random.default_rng(7).normal(size=(200, 3))
    whole = engine.closest_points(model, IDENTITY, points, signed=signed)
    limit = float(np.median(abs(whole.upper)))
    _, found = asked(model, points, *errors, max_distance=limit, signed=signed)
    beyond = found.elements < 0
    assert 20 < beyond.sum() < 180
    assert (abs(whole.upper[beyond]) >= limit).all()
    inside = whole.upper < 0.0 if signed else np.zeros(len(points), bool)
    assert (found.lower[beyond & ~inside] >= limit).all()
    assert (found.upper[beyond & inside] <= -limit).all()


@pytest.mark.parametrize("name", ["torus", "solid of patches", "revolution"])
def test_sides_are_found_of_points_nearer_than_the_error(name):
    """If a point's side stays open, its bounds have both signs and differ by at most the error."""
    model, rng = MODELS[name], np.random.default_rng(8)
    on = engine.closest_points(model, IDENTITY, rng.normal(size=(100, 3)), normals=True)
    depths = rng.uniform(-0.1, 0.1, 100)
    points = on.points + depths[:, None] * on.normals
    asked(model, points, 0.0, 0.15, signed=True)
    asked(model, points, 10.0, 0.0, signed=True, max_distance=0.05)


def test_errors_bound_what_a_long_search_tolerates():
    """Near its centre, all of a sphere is about equally near. A long search tolerates ever more."""
    points = 1e-3 * np.random.default_rng(0).normal(size=(10, 3))
    model = engine.ParametricSurface(sphere_patches())
    asked(model, points, 1e-3, 0.0)
    asked(model, points, 1e-6, 0.0)


@pytest.mark.parametrize(
    ("wrong", "error"),
    [
        ({"rel_err": -1.0}, ValueError),
        ({"abs_err": math.nan}, ValueError),
        ({"abs_err": "small"}, TypeError),
    ],
)
def test_errors_that_make_no_sense(wrong, error):
    with pytest.raises(error, match=next(iter(wrong))):
        engine.closest_points(MODELS["torus"], IDENTITY, [[0.0, 0.0, 0.0]], **wrong)
