"""The nearest points of surfaces to points, against samples and an oracle of 30 digits."""

import mpmath
import numpy as np
import pytest
from engine_bodies import from_python
from engine_surfaces import bumps, patch, sphere_patches, torus_patches
from surface_oracle import DIGITS, Shape, reference
from test_surface_distance import MODELS, made

from proximity_monitor import engine
from proximity_monitor.engine.kernels.inside.visit import ROOM
from proximity_monitor.engine.kernels.surface import closest, evaluate, limits, minimum, square
from proximity_monitor.engine.questions import closest_surface

HERE = np.eye(4)
jet_at, limits_of = from_python(evaluate.jet_at), from_python(limits.limits_of)
bound_at, is_beyond = from_python(minimum.bound_at), from_python(square.is_beyond)
SURFACES = [name for name in MODELS if name not in ("point", "polyline", "mesh")]


def size_of(model):
    return float(np.linalg.norm(model.control_points, axis=1).max())


@pytest.mark.parametrize("name", ["bumps", "rational", "8 decades", "degree 15", "torus", "curve"])
def test_limits_hold_every_derivative(name):
    """Third derivatives are compared with differences of second ones."""
    tree, known = made(name)[0]._hierarchy.tree, 0
    for piece in tree.pieces[:: max(len(tree.pieces) // 8, 1)]:
        of = limits_of(piece)
        if not np.isfinite(of.uuu):
            continue
        known += 1
        step, high = 1e-4, (1.0, 1.0 if piece["degree_v"] else 0.0)
        for u, v in np.random.default_rng(1).random((24, 2)) * high:
            _, du, dv, duu, duv, dvv = np.array(jet_at(piece, tree.nets, u, v))
            found = [du, dv, duu, duv, dvv]
            for at in ((step, 0.0), (0.0, step * high[1])):
                one = np.array(jet_at(piece, tree.nets, u - at[0], v - at[1]))[3:]
                other = np.array(jet_at(piece, tree.nets, u + at[0], v + at[1]))[3:]
                found += list((other - one) / (2.0 * step))
            lengths = np.linalg.norm(found, axis=1)
            third = [lengths[5], max(lengths[6], lengths[8]), max(lengths[7], lengths[9])]
            third.append(lengths[10])
            products = [
                abs(3.0 * du @ duu), abs(2.0 * du @ duv + duu @ dv),
                abs(2.0 * dv @ duv + dvv @ du), abs(3.0 * dv @ dvv),
            ]  # fmt: skip
            rounding = 1e-7 * max(lengths.max(), lengths.max() ** 2)
            assert (np.array([*lengths[:5], *third, *products]) <= np.array(of) + rounding).all()
    assert known


@pytest.mark.parametrize("name", ["bumps", "rational", "degree 15", "torus", "torn", "curve"])
def test_bounds_of_rectangles_hold(name):
    """No sample of a rectangle is nearer than its bound; the rectangle left holds the nearest."""
    model = made(name)[0]
    tree, rng = model._hierarchy.tree, np.random.default_rng(5)
    steps, told, less = np.linspace(0.0, 1.0, 9), 0, 0
    for turn in range(120):
        piece = tree.pieces[rng.integers(len(tree.pieces))]
        of, curve = limits_of(piece), piece["degree_v"] == 0
        low = rng.random(2) * (1.0 - 0.5 ** (turn % 6))
        high = low + 0.5 ** (turn % 6)
        if curve:
            low[1] = high[1] = 0.0
        at = minimum.Rectangle(low[0], high[0], low[1], high[1])
        u, v = low + rng.choice([0.0, 0.5, 1.0, 0.3], 2) * (high - low)
        jet = jet_at(piece, tree.nets, u, v)
        p = np.array(jet[0]) + 10.0 ** rng.uniform(-2.0, 0.5) * rng.normal(size=3)
        way = tuple(np.array(jet[0]) - p)
        bound, left, _ = bound_at(piece, of, jet, way, at, u, v, 1e-13)
        near = []
        for each in (at, left):
            points = [
                jet_at(
                    piece, tree.nets,
                    each.low_u + a * (each.high_u - each.low_u),
                    each.low_v + b * (each.high_v - each.low_v),
                )[0]
                for a in steps for b in steps
            ]  # fmt: skip
            near.append(np.linalg.norm(np.array(points) - p, axis=1).min())
        assert bound <= near[0]
        told += bound > 0.9 * near[0]
        less += left != at
        if left != at and (left.low_u in (u, at.low_u, at.high_u)):
            assert near[1] <= near[0] + 1e-12
    assert told > 30
    assert less > 10


@pytest.mark.long
@pytest.mark.parametrize("name", SURFACES)
def test_nearest_points_are_those_of_the_oracle(name):
    """The points are around the model, and very near it."""
    model, oracle = made(name)
    rng, size = np.random.default_rng(2), size_of(model)
    on = engine.closest_points(model, HERE, size * rng.normal(size=(3, 3))).points
    points = np.concatenate((on[:1] + 1e-9 * size, on[1:2] + 1e-3 * size, on[2:] * 1.5, on[:1]))
    found = engine.closest_points(model, HERE, points)
    distances = np.linalg.norm(found.points - points, axis=1)
    for k, p in enumerate(points):
        point = Shape(triangles=np.tile(p, (1, 3, 1)), samples=1)
        true, _ = reference(oracle, HERE, point, HERE)
        with mpmath.workdps(DIGITS):
            assert found.lower[k] <= true <= found.upper[k]
    assert (found.upper - found.lower <= 5e-12 * size).all()
    assert np.abs(found.upper - distances).max() <= 1e-12 * size


@pytest.mark.long
def test_no_sample_is_nearer():
    model, rng = bumps(1), np.random.default_rng(3)
    u, v = np.meshgrid(*2 * [np.linspace(0.0, 1.0, 150)], indexing="ij")
    samples = model.evaluate(u.ravel(), v.ravel())
    points = samples.mean(axis=0) + rng.normal(size=(500, 3))
    found = engine.closest_points(model, HERE, points, normals=True)
    least = np.linalg.norm(points[:, None] - samples, axis=2).min(axis=1)
    assert (found.upper <= least + 1e-13).all()
    assert (least - found.lower).max() < 4e-3  # the spacing of the samples
    ways = points - found.points
    across = ways - found.normals * (ways * found.normals).sum(axis=1)[:, None]
    inner = np.linalg.norm(across, axis=1) < 1e-3  # the nearest point is not on the edge
    assert inner.sum() > 100
    assert np.abs(across[inner]).max() < 1e-6


def test_slices_do_not_change_the_answers():
    model, rng = engine.ParametricSurface(torus_patches()), np.random.default_rng(4)
    points = np.concatenate((rng.normal(size=(20, 3)), [[0.0, 0.0, 0.3]]))
    table, count, answers = model._hierarchy.table, len(points), []
    for steps in (1 << 40, 1):
        stack, stacked, going = np.empty(ROOM, np.int32), np.empty(ROOM), np.zeros(closest.GOING)
        bounds, feet = np.empty((count, 2)), np.empty((count, 3))
        elements, parameters = np.empty(count, np.int32), np.empty((count, 2))
        done = calls = 0
        while done < count:
            done = closest.closest_points(
                table, HERE, points, np.inf, 0.0, 0.0, False, done, steps, stack, stacked, going,
                bounds, feet, elements, parameters,
            )  # fmt: skip
            calls += 1
        answers.append(bounds)
    assert calls > 10 * count
    one, other = (each[:-1] for each in answers)
    assert np.abs(one - other).max() < 1e-11
    assert (one[:, 0] <= other[:, 1]).all()
    assert (other[:, 0] <= one[:, 1]).all()


def test_searches_end_where_all_is_as_near():
    """At a sphere's centre the whole sphere is equally near; on a torus's axis, a whole circle."""
    for patches, points, truth in (
        (sphere_patches(), np.zeros((1, 3)), [1.0]),
        (torus_patches(), [[0.0, 0.0, 0.4], [0.0, 0.0, 0.0]], [np.hypot(1.0, 0.4) - 0.3, 0.7]),
    ):
        found = engine.closest_points(engine.ParametricSurface(patches), HERE, points)
        assert (found.lower <= truth).all()
        assert (truth <= found.upper).all()
        assert np.abs(found.upper - truth).max() < 1e-13
        assert (found.upper - found.lower).max() < 1e-4


def test_poles_are_exact_from_inside():
    """At a pole, the squared distance is not convex in any parameters."""
    for points, truth, gap in (
        ([[0, 0, 0.5], [0, 0, -0.9]], [0.5, 0.1], 5e-12),
        ([[1e-6, 0, 0.3]], [0.7], 1e-8),
    ):
        found = engine.closest_points(engine.ParametricSurface(sphere_patches()), HERE, points)
        assert (found.upper - found.lower).max() < gap
        assert np.abs(found.upper - truth).max() < 1e-11


@pytest.mark.parametrize("away", [1e-2, 1e-3, 1e-5])
@pytest.mark.parametrize("height", [1.3, 0.7])
def test_points_beside_the_axis_through_a_pole(away, height):
    """Near a pole, weights vary but the surface does not. Formerly, cells were divided for that."""
    around = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False) + 0.1
    points = np.stack((away * np.cos(around), away * np.sin(around), 0.0 * around + height), axis=1)
    found = engine.closest_points(engine.ParametricSurface(sphere_patches()), HERE, points)
    truth = np.abs(np.linalg.norm(points, axis=1) - 1.0)
    assert (found.lower <= truth + 1e-15).all()
    assert (truth <= found.upper + 1e-15).all()
    assert (found.upper - found.lower).max() < 5e-12  # formerly 1e-8, by a larger tolerance


@pytest.mark.parametrize("name", ["bumps", "rational", "sphere", "curve"])
def test_squared_distances_tell_what_is_beyond(name):
    """If a piece's control points prove it to be beyond a distance, no sample of it is nearer."""
    tree, rng, told = made(name)[0]._hierarchy.tree, np.random.default_rng(8), 0
    for piece in rng.permutation(tree.pieces)[:40]:
        high_v = 1.0 if piece["degree_v"] else 0.0
        grid = [(u, v * high_v) for u in np.linspace(0, 1, 9) for v in np.linspace(0, 1, 9)]
        points = np.array([jet_at(piece, tree.nets, u, v)[0] for u, v in grid])
        p = points[0] + 10.0 ** rng.uniform(-2.0, 0.5) * rng.normal(size=3)
        least = np.linalg.norm(points - p, axis=1).min()
        room = int(piece["room"])
        x, y, z, w = tree.nets[piece["net"] :][: 4 * room].reshape(4, room)[:, : piece["points"]]
        net = np.stack((x - p[0] * w, y - p[1] * w, z - p[2] * w, w), axis=1).reshape(-1)
        for share in (0.5, 0.9, 0.99, 1.0 + 1e-6, 1.1):
            beyond = is_beyond(piece, net, 0, share * least, 1e-13)
            assert not (beyond and share > 1.0)
            told += beyond
    assert told > 40


def test_points_beyond_the_largest_distance_are_told_to_be():
    model = patch(3, decades=1.0)
    points = size_of(model) * np.random.default_rng(6).normal(size=(200, 3))
    whole = engine.closest_points(model, HERE, points)
    limit = float(np.median(whole.upper))
    found = engine.closest_points(model, HERE, points, max_distance=limit)
    near = found.elements >= 0
    assert 50 < near.sum() < 150
    assert (found.lower[~near] >= limit).all()
    assert np.isinf(found.upper[~near]).all()
    assert np.abs(found.upper - whole.upper)[near].max() < 1e-11
    assert (whole.upper[~near] >= limit).all()


@pytest.mark.parametrize("model", ["torus", "ring"])
def test_normals_and_angles_take_none_of_a_budget(model, monkeypatch):
    """They are computed on reading, from the surface as it was when it was asked about."""
    model = made("torus")[0] if model == "torus" else engine.shapes.torus(1.0, 0.3)
    given, read = np.random.default_rng(3).normal(size=(50, 3)), []
    before = engine.closest_points(model, HERE, given, normals=True)
    normals, parameters = before.normals, before.parameters
    for name in ("angle", "unit_normals"):
        work = getattr(closest_surface, name)
        monkeypatch.setattr(
            closest_surface, name, lambda *a, work=work, name=name: read.append(name) or work(*a)
        )
    pose = HERE.copy()
    found = engine.closest_points(model, pose, given, normals=True)
    assert not read
    pose[:3, :3] = np.diag((-1.0, -1.0, 1.0))
    model.deform(model.control_points * (1.0, 1.0, 1.5))
    assert np.array_equal(found.normals, normals)
    assert np.array_equal(found.parameters, parameters)
    assert "unit_normals" in read
