"""Closed surfaces as solids: sides of points and largest balls, against formulas and samples."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from ball_oracle import winding_numbers
from engine_bodies import IDENTITY, box, pose, translation
from engine_surfaces import bumps, sphere_patches, torus_patches
from scipy.spatial import cKDTree
from test_closed import cube, moved, replaced, swapped

from proximity_monitor import engine
from proximity_monitor.engine import ParametricSurface, Status

TIGHT = 1e-12
NORMAL = np.array([1e-3, 1e-9, -1e-9])


def solid(patches, scale=1.0, shift=0.0, **how):
    made = ParametricSurface(patches, solid=True, **how)
    made.deform(made.control_points * scale + shift)
    return made


def ball(radius):
    return solid(sphere_patches(), radius)


def phi_ball(x):
    return np.linalg.norm(x, axis=1) - 1.0


def phi_torus(x):
    return np.hypot(np.hypot(x[:, 0], x[:, 1]) - 1.0, x[:, 2]) - 0.3


def phi_cube(x):
    q = np.abs(x - 0.5) - 0.5
    return np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0)


def on_ball(angles):
    return np.stack(
        (np.cos(angles[0]) * np.sin(angles[1]), np.sin(angles[0]) * np.sin(angles[1]),
         np.cos(angles[1])), axis=1
    )  # fmt: skip


def on_torus(angles):
    out = np.stack((np.cos(angles[0]), np.sin(angles[0]), np.zeros(len(angles[0]))), axis=1)
    normal = np.cos(angles[1])[:, None] * out + np.sin(angles[1])[:, None] * (0.0, 0.0, 1.0)
    return out, normal


def near_ball(rng):
    """Return points just off the surface in all directions, some at poles and joints."""
    angles = rng.uniform(0.0, 2.0 * np.pi, (2, 120))
    angles[0, :40] = np.round(2.0 * angles[0, :40] / np.pi) * np.pi / 2.0
    angles[1, 20:60] = np.round(2.0 * angles[1, 20:60] / np.pi) * np.pi / 2.0
    return on_ball(angles) * (1.0 + np.tile(NORMAL, 40))[:, None]


def near_torus(rng):
    angles = rng.uniform(0.0, 2.0 * np.pi, (2, 120))
    angles[0, :40] = np.round(2.0 * angles[0, :40] / np.pi) * np.pi / 2.0
    angles[1, 20:60] = np.round(2.0 * angles[1, 20:60] / np.pi) * np.pi / 2.0
    out, normal = on_torus(angles)
    return out + normal * (0.3 + np.tile(NORMAL, 40))[:, None]


def near_cube(rng):
    points = rng.random((120, 3))
    axis, side = rng.integers(3, size=120), rng.integers(2, size=120)
    points[:30] = np.round(points[:30])  # near corners
    points[np.arange(120), axis] = side + np.tile(NORMAL, 40)
    return points


BODIES = {
    "ball": (sphere_patches, phi_ball, near_ball),
    "torus": (torus_patches, phi_torus, near_torus),
    "cube": (cube, phi_cube, near_cube),
}


def check_sides(model, phi, points, scale=1.0, shift=0.0, at=IDENTITY):
    world = (points * scale + shift) @ at[:3, :3].T + at[:3, 3]
    found, expected = engine.closest_points(model, at, world, signed=True), scale * phi(points)
    size = scale + abs(shift)
    assert (found.lower <= expected + 1e-14 * size).all()
    assert (found.upper >= expected - 1e-14 * size).all()
    told = np.abs(expected) > 2e-10 * size
    assert told.sum() > 0.8 * len(points)
    assert (np.sign(found.lower[told]) == np.sign(expected[told])).all()
    assert (np.sign(found.upper[told]) == np.sign(expected[told])).all()


@pytest.mark.parametrize("name", BODIES)
def test_sides_are_those_of_formulas(name):
    patches, phi, near = BODIES[name]
    rng = np.random.default_rng(len(name))
    points = np.concatenate((rng.normal(size=(60, 3)), near(rng)))
    model = solid(patches())
    assert model.is_solid
    assert model.not_solid == ""
    check_sides(model, phi, points)
    check_sides(model, phi, points[:60], at=pose(rng, 3.0))
    check_sides(solid(patches(), 1e-3, 2.0), phi, points[:60], 1e-3, 2.0)
    # Inside out, then mirrored.
    check_sides(solid([swapped(each) for each in patches()]), phi, points[:60])
    mirrored, turned = solid(patches()), np.array([1.0, 1.0, -1.0])
    mirrored.deform(mirrored.control_points * turned)
    check_sides(mirrored, lambda x: phi(x * turned), points[:60])


def test_patches_turned_inward_bound_a_cavity():
    inner = [engine.Patch(0.5 * each.control, weights=each.weights) for each in sphere_patches()]
    shell = solid([*sphere_patches(), *map(swapped, inner)])

    def phi(x):
        r = np.linalg.norm(x, axis=1)
        return np.maximum(r - 1.0, 0.5 - r)

    rng = np.random.default_rng(4)
    check_sides(shell, phi, np.concatenate((rng.normal(size=(60, 3)), near_ball(rng) * 0.5)))
    check(engine.signed_distance(shell, IDENTITY, ball(0.2), translation(0.1)), 0.2)
    check(engine.signed_distance(shell, IDENTITY, ball(0.2), translation(0.4)), -0.1)
    check(engine.signed_distance(shell, IDENTITY, ball(0.2), translation(0.65)), -0.35)


def test_beyond_the_largest_distance_the_side_is_told():
    points = np.array([[0.1, 0.2, 0.3], [3.0, 0.0, 0.0], [0.99, 0.0, 0.0]])
    found = engine.closest_points(ball(1.0), IDENTITY, points, max_distance=0.1, signed=True)
    assert found.upper[0] < 0.0 and found.lower[0] == -np.inf
    assert found.lower[1] > 0.0 and found.upper[1] == np.inf
    assert found.upper[2] == pytest.approx(-0.01, abs=1e-11)


def blob(seed):
    """Return six bicubic patches around the origin, with creases where they meet."""
    rng = np.random.default_rng(seed)
    phase, made = rng.uniform(0.0, 6.0), []
    for axis in range(3):
        for side in (-1.0, 1.0):
            grid = np.linspace(-1.0, 1.0, 4)
            net = np.empty((4, 4, 3))
            net[..., (axis + 1) % 3], net[..., (axis + 2) % 3] = np.meshgrid(
                grid, grid, indexing="ij"
            )
            net[..., axis] = side
            net *= (1.0 + 0.3 * np.sin(3.0 * (net @ (1.0, 0.7, -0.4)) + phase))[..., None]
            net /= np.linalg.norm(net, axis=-1, keepdims=True) ** 0.5
            made.append(engine.Patch(net if side > 0.0 else net.transpose(1, 0, 2)))
    return made


def samples(patches, count=60):
    """Return triangles (m, 3, 3) of points of patches, and the surface's distance to them."""
    found, error = [], 0.0
    t = np.linspace(0.0, 1.0, count)
    u, v = np.meshgrid(t, t, indexing="ij")
    for each in patches:
        at = each.evaluate(u.ravel(), v.ravel()).reshape(count, count, 3)
        for part in (
            (at[:-1, :-1], at[1:, :-1], at[1:, 1:]),
            (at[:-1, :-1], at[1:, 1:], at[:-1, 1:]),
        ):
            found.append(np.stack(part, axis=2).reshape(-1, 3, 3))
        bends = [np.linalg.norm(np.diff(at, 2, axis=i), axis=-1).max() for i in (0, 1)]
        twist = np.linalg.norm(np.diff(np.diff(at, axis=0), axis=1), axis=-1).max()
        error = max(error, 0.5 * (sum(bends) + twist))
    return np.concatenate(found), error


def test_sides_and_balls_of_a_blob_by_samples():
    rng = np.random.default_rng(7)
    models, trees, coarse = [], [], []
    for seed in (1, 2):
        corners, error = samples(blob(seed))
        models.append(solid(blob(seed)))
        trees.append(cKDTree(corners.reshape(-1, 3)))
        spacing = np.linalg.norm(np.diff(corners, axis=1), axis=2).max()
        coarse.append(samples(blob(seed), 12))
    points = rng.uniform(-1.5, 1.5, (300, 3))
    found = engine.closest_points(models[0], IDENTITY, points, signed=True)
    far = trees[0].query(points)[0] > 4.0 * coarse[0][1]
    inside = np.abs(winding_numbers(points[far], coarse[0][0])) > 0.5
    assert far.sum() > 200
    assert 20 < inside.sum() < 200
    assert (found.upper[far][inside] < 0.0).all()
    assert (found.lower[far][~inside] > 0.0).all()
    at = translation(1.2, 0.3, 0.2)

    def radii(x):
        depths = []
        for k, y in enumerate((x, x - at[:3, 3])):
            sign = np.where(np.abs(winding_numbers(y, coarse[k][0])) > 0.5, 1.0, -1.0)
            depths.append(sign * trees[k].query(y)[0])
        return np.minimum(*depths)

    best, width = np.array([0.6, 0.15, 0.1]), 0.4
    for _ in range(10):
        tried = np.concatenate((best[None], best + width * rng.normal(size=(100, 3))))
        deep = radii(tried)
        best, width = tried[deep.argmax()], 0.55 * width
    found = engine.signed_distance(models[0], IDENTITY, models[1], at)
    # Distances to samples are too large by about half the spacing's square over the distance.
    deepest, slack = 2.0 * deep.max(), error + 0.5 * spacing**2 / deep.max()
    assert deepest > 0.3
    assert deepest - 2.0 * slack <= -found.lower
    assert -found.upper <= deepest + 2.0 * slack
    assert found.lower >= found.upper * 1.0101


def check(found, expected, depth_err=0.01):
    assert found.lower <= expected + TIGHT
    assert found.upper >= expected - TIGHT
    if expected < 0.0:
        assert found.status in (Status.EXACT, Status.WITHIN_TOLERANCE)
        assert found.lower >= (1.0 + 1.001 * depth_err) * found.upper - 1e-10


@pytest.mark.parametrize("overlap", [0.7, 0.1, 1e-3, 1e-6, -0.25])
def test_largest_ball_of_two_balls(overlap):
    a, b, rng = ball(1.0), ball(0.5), np.random.default_rng(3)
    at = pose(rng, 2.0)
    to = at @ translation(*(1.5 - overlap) * np.array([0.6, 0.0, 0.8]))
    expected = -overlap
    check(engine.signed_distance(a, at, b, to), expected)
    check(engine.signed_distance(a, at, b, to, depth_err=1e-4), expected, 1e-4)
    found = engine.signed_distance(b, to, a, at)
    check(found, expected)
    if overlap > 1e-3:
        way = (found.point_a - found.point_b) / np.linalg.norm(found.point_a - found.point_b)
        assert way @ (at[:3, :3] @ (0.6, 0.0, 0.8)) == pytest.approx(-1.0, abs=0.02)
        for point, radius, place in ((found.point_a, 0.5, to), (found.point_b, 1.0, at)):
            assert np.linalg.norm(point - place[:3, 3]) == pytest.approx(radius, abs=1e-12)
        assert found.feature_a.kind == found.feature_b.kind == "patch"


def test_what_lies_inside_is_found():
    a, b = ball(1.0), ball(0.3)
    for x, expected in ((0.2, -0.6), (0.69, -0.6), (0.0, -0.6), (1.0, -0.3), (1.6, 0.3)):
        check(engine.signed_distance(a, IDENTITY, b, translation(x)), expected)
        check(engine.signed_distance(b, translation(x), a, IDENTITY), expected)
    torus = solid(torus_patches())
    check(engine.signed_distance(ball(2.0), IDENTITY, torus, IDENTITY), -0.6)
    check(engine.signed_distance(torus, IDENTITY, ball(0.1), translation(0.9, 0.0, 0.0)), -0.2)
    check(engine.signed_distance(torus, IDENTITY, ball(0.1), IDENTITY), 0.6)
    # The distance of the surfaces themselves ignores the inside, as with meshes.
    assert engine.distance(a, IDENTITY, b, IDENTITY).lower > 0.69
    assert not engine.collide(a, IDENTITY, b, IDENTITY).colliding


def test_an_assembly_sees_it_too():
    models = [ball(1.0), ball(0.3), box((3.0, 3.0, 3.0)), bumps(3, 5), box((0.2, 0.2, 0.2))]
    assembly = engine.Assembly(models)
    poses = np.array([IDENTITY] * 5)
    poses[3, :3, 3] = 5.0
    pairs = [[0, 1], [1, 2], [2, 0], [0, 3], [0, 4], [4, 1]]
    found = assembly.distances(poses, pairs, signed=True)
    for k, (i, j) in enumerate(pairs):
        alone = engine.signed_distance(models[i], poses[i], models[j], poses[j])
        assert found.lower[k] <= alone.upper + TIGHT
        assert found.upper[k] >= alone.lower - TIGHT
        assert np.sign(found.upper[k]) == np.sign(alone.upper)


def test_patches_are_as_deep_as_the_same_triangles():
    patches, mesh = solid(cube()), box((1.0, 1.0, 1.0))
    middle, rng = translation(0.5, 0.5, 0.5), np.random.default_rng(5)
    places = [translation(1.0 - overlap, 0.1, 0.2) for overlap in (0.5, 1e-3, 1e-6, -0.1)]
    for _ in range(4):
        places.append(pose(rng))
        places[-1][:3, 3] = 0.4 * rng.normal(size=3)
    for k, to in enumerate(places):
        found = [
            engine.signed_distance(mesh, middle, mesh, to @ middle),
            engine.signed_distance(patches, IDENTITY, patches, to),
            engine.signed_distance(patches, IDENTITY, mesh, to @ middle),
            engine.signed_distance(mesh, middle, patches, to),
        ]
        assert max(each.lower for each in found) <= min(each.upper for each in found) + TIGHT
        for each in found:
            if k < 4:
                check(each, (-0.5, -1e-3, -1e-6, 0.1)[k])
            elif each.upper < 0.0:
                assert each.lower >= 1.0101 * each.upper - 1e-10


def test_a_budget_cuts_and_the_next_call_goes_on():
    a, b = ball(2.0), solid(torus_patches())
    pair, lower, upper, calls = engine.Pair(a, b), -np.inf, np.inf, 0
    for _ in range(20_000):
        calls += 1
        found = pair.signed_distance(IDENTITY, IDENTITY, budget_s=2e-4)
        assert found.lower <= -0.6 + TIGHT and found.upper >= -0.6 - TIGHT
        assert found.lower >= lower and found.upper <= upper
        lower, upper = found.lower, found.upper
        if found.status is not Status.OUT_OF_TIME:
            break
    assert calls > 2
    check(found, -0.6)


def test_how_deep_a_surface_reaches_into_patches():
    a, at = ball(1.0), translation(0.1, 0.2, 0.3)
    flat = 2.0 * np.stack(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [0.0], indexing="ij"), -1)
    for height, expected in ((0.4, -0.6), (0.0, -1.0), (1.25, 0.25)):
        up = at @ translation(0.0, 0.0, height)
        for sheet in (
            engine.Patch(flat.reshape(2, 2, 3)),
            engine.TriangleMesh(flat.reshape(-1, 3), [[0, 1, 2], [1, 3, 2]]),
        ):
            check(engine.signed_distance(a, at, sheet, up), expected)
            found = engine.signed_distance(sheet, up, a, at)
            check(found, expected)
            assert np.linalg.norm(found.point_b - at[:3, 3]) == pytest.approx(1.0, abs=1e-9)


def test_gaps_as_large_as_the_deviation_leave_sides_and_widen_bounds():
    model = ParametricSurface(replaced(moved), deviation=1e-5, solid=True)
    rng = np.random.default_rng(9)
    points = np.concatenate((rng.normal(size=(100, 3)), near_torus(rng)))
    found, expected = engine.closest_points(model, IDENTITY, points, signed=True), phi_torus(points)
    assert (found.lower <= expected).all() and (found.upper >= expected).all()
    far = np.abs(expected) > 1e-4
    assert (np.sign(found.lower[far]) == np.sign(expected[far])).all()
    assert (np.sign(found.upper[far]) == np.sign(expected[far])).all()
    assert (found.lower[~far] < 0.0).all() and (found.upper[~far] > 0.0).all()
    apart = engine.signed_distance(model, IDENTITY, ball(0.1), translation(1.0))
    assert apart.lower <= -0.2 - 2e-5 and apart.upper >= -0.2 + 2e-5
    assert apart.lower >= -0.203


def test_a_solid_stays_one_when_it_is_deformed_and_pickled():
    model = ball(0.5)
    for each in (model, pickle.loads(pickle.dumps(model))):
        assert each.is_solid
        found = engine.closest_points(each, IDENTITY, [[0.1, 0.0, 0.0]], signed=True)
        assert found.upper[0] == pytest.approx(-0.4, abs=1e-11)
    model.deform(2.0 * model.control_points)
    found = engine.closest_points(model, IDENTITY, [[0.1, 0.0, 0.0]], signed=True)
    assert found.upper[0] == pytest.approx(-0.9, abs=1e-11)
