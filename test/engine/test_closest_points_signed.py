"""Closest points with signs, against solid angles, brute force and known shapes."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
import trimesh
from engine_bodies import IDENTITY, box, pose, soup, sphere, torus, translation
from engine_oracles import exactly_moved, pairwise_distances, triangles

from proximity_monitor import engine


def joined(*parts):
    mesh = trimesh.util.concatenate([trimesh.Trimesh(p.vertices, p.faces) for p in parts])
    return engine.TriangleMesh(mesh.vertices, mesh.faces)


def turned(mesh):
    return engine.TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])


def moved(mesh, x):
    return engine.TriangleMesh(mesh.vertices + np.array([x, 0.0, 0.0]), mesh.faces)


SOLIDS = {
    "torus": torus(16),
    "inside out": turned(torus(16)),
    "shell": joined(sphere(2), turned(sphere(2, 0.6))),
    "union": joined(box(), moved(sphere(2, 0.7), 0.6)),
    "holed": engine.TriangleMesh(torus(16).vertices, torus(16).faces[3:], solid="robust"),
    "with degenerate faces": engine.TriangleMesh(
        box().vertices, [*box().faces.tolist(), [0, 1, 0], [2, 2, 2]]
    ),
}


def winding_numbers(points, corners):
    """Return the sums of solid angles over 4 pi (Van Oosterom and Strackee)."""
    a, b, c = np.moveaxis(corners[None] - points[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(each, axis=-1) for each in (a, b, c))
    above = np.einsum("...i,...i", a, np.cross(b, c))
    below = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
    return np.arctan2(above, below).sum(axis=1) / (2.0 * np.pi)


def expected_of(model, matrix, given):
    """Return signed distances by brute force, and how far winding numbers are from 1/2."""
    corners = triangles(model, matrix)
    distances = pairwise_distances(np.repeat(given[:, None], 3, axis=1), corners).min(axis=1)
    winding = np.abs(winding_numbers(given, corners))
    return np.where(winding > 0.5, -distances, distances), np.abs(winding - 0.5)


def around(model, rng, matrix, count=150):
    """Return points in and near a model, some of them on it."""
    corners = triangles(model, matrix)
    some = corners[rng.integers(len(corners), size=20)]
    upon = np.einsum("ni,nij->nj", rng.dirichlet((1, 1, 1), 20), some)
    return np.concatenate((matrix[:3, 3] + 0.7 * rng.normal(size=(count, 3)), upon))


@pytest.mark.long
@pytest.mark.parametrize("name", SOLIDS)
def test_signs_are_those_of_solid_angles(name):
    model, rng = SOLIDS[name], np.random.default_rng(1)
    assert model.is_solid
    matrix = pose(rng, 2.0)
    given = around(model, rng, matrix)
    expected, sure = expected_of(model, matrix, given)
    found = engine.closest_points(model, matrix, given, signed=True, normals=True)
    slack = 2e-14
    sure = (sure > 1e-3) & (np.abs(expected) > slack)
    assert (expected[sure] < 0.0).sum() > 10
    assert np.abs(found.upper - expected)[sure].max() <= 2.0 * slack
    assert (found.upper - found.lower)[sure].max() <= 2.0 * slack
    assert (found.lower <= expected + slack).all()
    assert (expected <= found.upper + slack).all()
    plain = engine.closest_points(model, matrix, given, normals=True)
    for each in ("points", "elements", "normals", "done"):
        assert np.array_equal(getattr(found, each), getattr(plain, each)), each


def test_next_to_a_face_the_bounds_hold_the_exact_value():
    """Points beside one face of a 2 m cube, at 0.5 m down to the resolution of float64."""
    cube = box((2.0, 2.0, 2.0))
    steps = np.concatenate((2.0 ** -np.arange(1, 70), [0.0]))
    x = np.unique(np.concatenate((1.0 - steps, 1.0 + steps)))
    given = np.stack((x, np.full(len(x), 0.3), np.full(len(x), -0.2)), axis=1)
    found = engine.closest_points(cube, IDENTITY, given, signed=True)
    for k, at in enumerate(x):
        assert Fraction(found.lower[k]) <= Fraction(at) - 1 <= Fraction(found.upper[k])
    sure = np.abs(x - 1.0) > 1e-13
    assert np.array_equal(found.upper[sure] < 0.0, x[sure] < 1.0)
    assert np.array_equal(found.lower[sure] > 0.0, x[sure] > 1.0)


@pytest.mark.parametrize("seed", range(3))
def test_next_to_a_turned_face_the_bounds_hold_the_exact_value(seed):
    """The points are so near that the rounding of their local coordinates may change the side."""
    rng = np.random.default_rng(seed)
    cube, matrix = box((2.0, 2.0, 2.0)), pose(rng, 10.0)
    face = np.array([(1.0, -1.0, -1.0), (1.0, 1.0, -1.0), (1.0, -1.0, 1.0)])
    corner, first, second = exactly_moved(matrix.tolist(), face)
    e, f = ([p - q for p, q in zip(end, corner, strict=True)] for end in (first, second))
    normal = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]]
    squared = sum(n * n for n in normal)
    local = np.stack((1.0 + 1e-15 * rng.normal(size=300), *rng.uniform(-0.5, 0.5, (2, 300))))
    given = (matrix[:3, :3] @ local).T + matrix[:3, 3]
    found = engine.closest_points(cube, matrix, given, signed=True)
    signs = set()
    for k, point in enumerate(given.tolist()):
        height = sum(n * (Fraction(p) - c) for n, p, c in zip(normal, point, corner, strict=True))
        lower, upper = Fraction(found.lower[k]), Fraction(found.upper[k])
        assert lower * abs(lower) * squared <= height * abs(height) <= upper * abs(upper) * squared
        signs.add(height > 0)
    assert signs == {False, True}


def rounded_cube(p, half, radius):
    """Return signed distances to a cube swept by a ball: those to the cube minus the radius."""
    q = np.abs(p) - half
    return np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0) - radius


def capsule(p, half, radius):
    along = np.clip(p[:, 0], -half, half)
    return np.linalg.norm(p - np.stack((along, 0 * along, 0 * along), axis=1), axis=1) - radius


SWEPT = {
    "sphere": (engine.points([[0.0, 0.0, 0.0]], radius=0.8), lambda p: capsule(p, 0.0, 0.8)),
    "capsule": (
        engine.polyline([[-0.6, 0.0, 0.0], [0.6, 0.0, 0.0]], radius=0.5),
        lambda p: capsule(p, 0.6, 0.5),
    ),
    "cube": (
        engine.TriangleMesh(box((1.0, 1.0, 1.0)).vertices, box().faces, radius=0.3),
        lambda p: rounded_cube(p, 0.5, 0.3),
    ),
}


@pytest.mark.parametrize("name", SWEPT)
def test_swept_models_are_what_they_stand_for(name):
    model, signed_distance = SWEPT[name]
    rng = np.random.default_rng(2)
    matrix, local = pose(rng, 1.0), 0.7 * rng.normal(size=(200, 3))
    local[0] = 0.0
    local[1] = 0.2, 0.0, 0.0  # on the axis of the capsule
    given = local @ matrix[:3, :3].T + matrix[:3, 3]
    expected = signed_distance(local)
    found = engine.closest_points(model, matrix, given, signed=True, normals=True)
    assert (expected < 0.0).sum() > 20
    assert np.abs(found.lower - expected).max() < 1e-13
    assert np.abs(found.upper - expected).max() < 1e-13
    foot = (found.points - matrix[:3, 3]) @ matrix[:3, :3]
    assert np.abs(signed_distance(foot)).max() < 1e-13
    assert np.linalg.norm(given - found.points, axis=1) == pytest.approx(np.abs(expected))
    # Normals point outward: a short step along one adds its length to the distance.
    outward = found.normals @ matrix[:3, :3]
    assert signed_distance(foot + 1e-3 * outward) == pytest.approx(1e-3, abs=1e-12)


def test_a_deviation_widens_the_bounds_of_either_sign():
    plain = box((2.0, 2.0, 2.0))
    rough = engine.TriangleMesh(plain.vertices, plain.faces, deviation=0.1)
    x = np.array([0.0, 0.5, 0.95, 1.0, 1.05, 1.5])
    given = np.stack((x, 0.0 * x, 0.0 * x), axis=1)
    found = engine.closest_points(rough, IDENTITY, given, signed=True)
    true = x - 1.0
    true[0] = -1.0
    assert (found.lower <= true - 0.1).all()
    assert (found.upper >= true + 0.1).all()
    assert np.abs(found.upper - found.lower - 0.2).max() < 1e-12


@pytest.mark.parametrize("name", [*SOLIDS, *SWEPT])
def test_beyond_the_largest_distance_the_side_is_told(name):
    model = SOLIDS[name] if name in SOLIDS else SWEPT[name][0]
    rng = np.random.default_rng(3)
    matrix = pose(rng, 1.0)
    given = around(model, rng, matrix)[:150]
    whole = engine.closest_points(model, matrix, given, signed=True)
    inside, outside = whole.upper < 0.0, whole.lower > 0.0
    assert (inside | outside).all()
    for farthest in (0.0, 0.1, float(np.abs(whole.upper[3]))):
        found = engine.closest_points(model, matrix, given, signed=True, max_distance=farthest)
        assert found.done.all()
        assert (found.lower <= whole.upper).all()
        assert (whole.lower <= found.upper).all()
        told = np.isfinite(found.lower) & np.isfinite(found.upper)
        assert told[np.abs(whole.upper) < farthest - 1e-12].all()
        assert np.abs(found.upper - whole.upper)[told].max(initial=0.0) < 1e-13
        assert (found.lower[~told & outside] >= farthest).all()
        assert np.isinf(found.upper[~told & outside]).all()
        assert (found.upper[~told & inside] <= -farthest).all()
        assert np.isinf(found.lower[~told & inside]).all()
        assert np.isnan(found.points[~told]).all()
        assert (found.elements[~told] == -1).all()


@pytest.mark.parametrize("name", ["torus", "holed", "capsule"])
def test_what_the_budget_does_not_suffice_for_is_open_and_can_be_asked_again(name):
    model = SOLIDS[name] if name in SOLIDS else SWEPT[name][0]
    given = np.random.default_rng(4).normal(size=(5000, 3))
    whole = engine.closest_points(model, IDENTITY, given, signed=True)
    cut = engine.closest_points(model, IDENTITY, given, signed=True, budget_s=0.0, threads=2)
    assert 0 < cut.done.sum() < len(given)
    left, calls = np.arange(len(given)), 0
    while len(left):
        found = engine.closest_points(model, IDENTITY, given[left], signed=True, budget_s=5e-3)
        assert found.done.any()
        open_ = ~found.done
        assert np.isneginf(found.lower[open_]).all()
        assert np.isposinf(found.upper[open_]).all()
        assert np.isnan(found.points[open_]).all()
        assert (found.elements[open_] == -1).all()
        now = left[found.done]
        assert found.upper[found.done] == pytest.approx(whole.upper[now], abs=1e-14)
        left, calls = left[open_], calls + 1
    assert calls <= len(given)


def test_signed_answers_do_not_depend_on_threads():
    given = np.random.default_rng(5).normal(size=(10_000, 3))
    one, many = (
        engine.closest_points(
            SOLIDS["union"], IDENTITY, given, threads=threads, normals=True, signed=True
        )
        for threads in (1, 3)
    )
    for name in ("lower", "upper", "points", "elements", "done", "normals"):
        assert np.array_equal(getattr(one, name), getattr(many, name))


def test_of_a_surface_a_sign_changes_nothing():
    given = np.random.default_rng(6).normal(size=(100, 3))
    lidless = engine.TriangleMesh(box().vertices, box().faces[2:])
    told = engine.TriangleMesh(box().vertices, box().faces, solid=False)
    for model in (lidless, told, soup(2)):
        plain, signed = (
            engine.closest_points(model, IDENTITY, given, signed=s, max_distance=1.0)
            for s in (False, True)
        )
        for name in ("lower", "upper", "points", "elements", "done"):
            assert np.array_equal(getattr(plain, name), getattr(signed, name), equal_nan=True)


def test_a_refitted_solid_is_seen_as_it_is():
    model = sphere(2)
    centre = [[0.0, 0.0, 0.0]]
    assert engine.closest_points(model, IDENTITY, centre, signed=True).upper[0] < -0.9
    model.deform(model.vertices + np.array([3.0, 0.0, 0.0]))
    assert engine.closest_points(model, IDENTITY, centre, signed=True).lower[0] > 1.9
    away = engine.closest_points(model, translation(-3.0), centre, signed=True)
    assert -1.0 <= away.lower[0] <= away.upper[0] < -0.9


@pytest.mark.parametrize("far", [1e6, 1e12, 1e30])
def test_points_far_away_are_outside(far):
    given = far * np.random.default_rng(7).normal(size=(20, 3))
    for model in (SOLIDS["torus"], SOLIDS["holed"], SWEPT["sphere"][0]):
        found = engine.closest_points(model, IDENTITY, given, signed=True)
        expected = np.linalg.norm(given, axis=1)
        assert (found.lower > 0.0).all()
        assert (np.abs(found.upper - expected) <= 2.0 + 1e-14 * expected).all()
        assert not math.isnan(found.lower.sum())
