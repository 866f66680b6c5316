"""Distances of parametric surfaces against an oracle of 30 digits (surface_oracle.py)."""

from __future__ import annotations

import pickle
from functools import cache

import numpy as np
import pytest
from engine_surfaces import (
    bumps,
    curve,
    patch,
    revolved,
    sphere_patches,
    torn,
    torus_patches,
    unclamped,
)
from surface_oracle import Shape, reference

from proximity_monitor import engine
from proximity_monitor.engine import Curve, ParametricSurface, Patch, Status

HERE = np.eye(4)


def moved(offset, seed=None):
    """Return a pose with an offset; with a seed, turned at random."""
    pose = np.eye(4)
    if seed is not None:
        q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
        q = q * np.sign(np.diag(r))
        pose[:3, :3] = q * np.sign(np.linalg.det(q))
    pose[:3, 3] = offset
    return pose


def shape(model, samples=8):
    if isinstance(model, engine.TriangleMesh):
        return Shape(triangles=model.vertices[model.faces], samples=samples)
    return Shape(model, samples=samples)


def check(answer, a, pose_a, b, pose_b, gap=4e-12, known=None):
    """Check an answer against the oracle. Return the oracle's distance.

    Args:
        answer: an answer of any status.
        a: the oracle's shape of the first model.
        pose_a: its pose.
        b: the oracle's shape of the second model.
        pose_b: its pose.
        gap: largest difference of an exact answer's bounds, as a share of the models' sizes.
        known: the distance by a formula, which the oracle must agree with.
    """
    sizes = a.size + b.size
    true, sampled = reference(a, pose_a, b, pose_b)
    assert known is None or abs(true - known) <= 1e-14 * (
        sizes + np.linalg.norm(pose_b[:3, 3] - pose_a[:3, 3])
    )
    # The witness points attain the upper bound, and the features name these points.
    apart = np.linalg.norm(answer.point_a - answer.point_b)
    if answer.status in (Status.OUT_OF_TIME, Status.WITHIN_TOLERANCE):
        true = min(true, apart)  # for near copies the oracle may find another local minimum
    assert answer.lower <= true <= answer.upper
    assert answer.lower <= sampled
    world = sizes + np.abs(pose_a[:3, 3]).sum() + np.abs(pose_b[:3, 3]).sum()
    assert apart <= answer.upper + 1e-15 * world
    assert answer.upper - apart <= 2e-13 * sizes + 2e-14 * world
    assert a.misses(answer.feature_a, pose_a, answer.point_a) <= 1.0
    assert b.misses(answer.feature_b, pose_b, answer.point_b) <= 1.0
    if answer.status is Status.EXACT:
        assert answer.upper - answer.lower <= gap * sizes + 1e-14 * world
    if answer.status in (Status.EXACT, Status.INTERSECTING):
        assert sampled >= apart - 1e-15 * world
    if answer.status is Status.INTERSECTING:
        assert answer.lower == 0.0
    return true


def ring(radius, columns=3):
    """Return a circle of rational quarters, in the plane."""
    made = revolved([[radius, 0.0], [radius, 1.0]], [1.0, 1.0])
    return ParametricSurface(
        [Curve(p.control[:, 0, :columns], None, p.weights[:, 0]) for p in made]
    )


def corner_mesh():
    rng = np.random.default_rng(3)
    faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 2, 2], [3, 3, 3]]
    return engine.TriangleMesh(rng.normal(size=(4, 3)), faces, solid=False)


MODELS = {
    "point": lambda: engine.points([[0.3, -0.2, 0.1]]),
    "polyline": lambda: engine.polyline([[0, 0, 0], [1, 0.3, 0], [1, 1, 1]]),
    "mesh": corner_mesh,
    "bumps": lambda: bumps(1),
    "curve": lambda: curve(1),
    "rational curve": lambda: curve(2, decades=4.0),
    "plane curve": lambda: curve(7, columns=2),
    "plane ring": lambda: ring(1.0, 2),
    "line": lambda: Curve([[0.0, 0.0], [1.0, 2.0]]),
    "degree 15": lambda: patch(5, (16, 16), (15, 15)),
    "degree 1": lambda: patch(8, (3, 4), (1, 1)),
    "curve of degree 15": lambda: curve(9, 17, 15),
    "rational": lambda: patch(3, decades=2.0),
    "8 decades": lambda: patch(6, (4, 5), (3, 4), decades=8.0),
    "unclamped": lambda: patch(4, (8, 7), (3, 3), unclamped),
    "torn": lambda: patch(3, (8, 6), (3, 2), torn),
    "sphere": lambda: ParametricSurface(sphere_patches()),
    "torus": lambda: ParametricSurface(torus_patches()),
    "mixed": lambda: ParametricSurface([curve(1), patch(2), curve(3, decades=2.0)]),
}

PAIRS = [
    ("point", "plane ring"), ("point", "rational curve"), ("point", "bumps"), ("torn", "point"),
    ("curve", "rational curve"), ("plane curve", "plane ring"), ("curve of degree 15", "line"),
    ("curve", "bumps"), ("torus", "rational curve"), ("polyline", "rational"), ("mesh", "curve"),
    ("mesh", "sphere"), ("unclamped", "mesh"), ("bumps", "rational"), ("degree 15", "degree 1"),
    ("8 decades", "torn"), ("sphere", "torus"), ("mixed", "unclamped"), ("torn", "mixed"),
]  # fmt: skip


@cache
def made(name):
    model = MODELS[name]()
    return model, shape(
        model, 12 if "degree 15" in name or "decades" in name or "rational" in name else 8
    )


@pytest.mark.long
@pytest.mark.parametrize("names", PAIRS, ids=" and ".join)
def test_every_pair_of_kinds_is_exact(names):
    (a, oracle_a), (b, oracle_b) = (made(name) for name in names)
    pair = engine.Pair(a, b)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        pose_a = moved(rng.normal(size=3), seed + 10)
        pose_b = moved(pose_a[:3, 3] + (seed + 0.5) * rng.normal(size=3), seed + 20)
        answer = pair.distance(pose_a, pose_b)
        true = check(answer, oracle_a, pose_a, oracle_b, pose_b)
        assert answer.status is (Status.INTERSECTING if true < 1e-20 else Status.EXACT)


@pytest.mark.parametrize("name", ["bumps", "rational curve", "sphere"])
def test_curves_in_the_plane_stay_in_it(name):
    flat = MODELS["plane curve"]()
    assert (flat.control[:, 2] == 0.0).all()
    a, b = Shape(flat), made(name)[1]
    check(
        engine.distance(flat, HERE, made(name)[0], moved((0, 0, 4))), a, HERE, b, moved((0, 0, 4))
    )


def dome(sign=1.0):
    """Return a biquadratic patch with its top at the origin, bent differently in u and v."""
    x, y = np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0], indexing="ij")
    control = np.stack((x, y, -sign * (0.5 * (x * x + 0.4 * y * y))), axis=-1)
    control[1, :, 2] += sign * 0.5
    control[:, 1, 2] += sign * 0.2
    return Patch(control)


@pytest.mark.parametrize("exponent", range(-12, 0, 2))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_near_tangency_and_crossing_by_as_little(exponent, sign):
    lower, upper = dome(), dome(-1.0)
    a, b = Shape(lower), Shape(upper)
    pose_a = moved((0.1, 0.2, 0.3), 5)
    gap = sign * 10.0**exponent
    pose_b = pose_a @ moved((0.0, 0.0, gap))
    answer = engine.distance(lower, pose_a, upper, pose_b)
    true = check(answer, a, pose_a, b, pose_b)
    assert abs(float(true) - max(gap, 0.0)) <= 1e-15
    if gap > 1e-11:
        assert answer.status is Status.EXACT
    elif gap < -1e-11:
        assert answer.status is Status.INTERSECTING


SQUARE = Patch(np.array([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]], float))


def cone():
    """Return a cone about z. At its tip, the origin, an edge of each of four patches is a point."""
    return ParametricSurface(revolved([[0.0, 0.0], [0.5, 1.0]], [1.0, 1.0]))


def cylinder(radius):
    return ParametricSurface(revolved([[radius, -1.0], [radius, 1.0]], [1.0, 1.0]))


WHERE = {
    "corner and corner": (SQUARE, SQUARE, moved((1.5, 1.5, 0.5)), np.sqrt(0.75)),
    "corner and inside": (SQUARE, SQUARE, moved((0.5, 0.5, 0.3), 4), None),
    "edge and edge": (SQUARE, cylinder(1.0), moved((2.5, 0.5, 0.0)), 0.5),
    "pole and inside": (SQUARE, cone(), moved((0.5, 0.5, 0.25)), 0.25),
    "pole and pole": (cone(), cone(), moved((0, 0, -0.5), None) @ np.diag([1, -1, -1, 1.0]), 0.5),
    "pole of a sphere": (SQUARE, ParametricSurface(sphere_patches()), moved((0.5, 0.5, 1.5)), 0.5),
    "equal minima": (
        Curve([[-1, 0, 0], [-0.5, 2, 0], [0.5, 2, 0], [1, 0, 0]]),
        Curve([[-1, -1, 0], [-0.5, -3, 0], [0.5, -3, 0], [1, -1, 0]]),
        HERE,
        1.0,
    ),
}


@pytest.mark.parametrize("name", WHERE)
def test_minima_wherever_they_are(name):
    a, b, pose, known = WHERE[name]
    for first, second, poses in ((a, b, (HERE, pose)), (b, a, (pose, HERE))):
        answer = engine.distance(first, poses[0], second, poses[1])
        check(answer, shape(first), poses[0], shape(second), poses[1], known=known)
        assert answer.status is Status.EXACT


CONTINUA = {
    "parallel planes": (SQUARE, SQUARE, moved((0.2, 0.3, 0.5)), 0.5),
    "antiparallel normals": (
        SQUARE,
        SQUARE,
        moved((0.1, 1.2, 0.5)) @ np.diag([1, -1, -1, 1.0]),
        0.5,
    ),
    "same square": (SQUARE, SQUARE, HERE, 0.0),
    "concentric cylinders": (cylinder(1.0), cylinder(0.999), HERE, 1e-3),
    "cylinders far apart": (cylinder(1.0), cylinder(0.5), moved((0, 0, 0.5)), 0.5),
    "concentric rings": (ring(1.0), ring(0.75), HERE, 0.25),
    "patch and itself": (bumps(1), bumps(1), HERE, 0.0),
    "patch and its copy": (bumps(1), bumps(1), moved((0.0, 0.0, 1e-3)), None),
    "sphere and point": (
        ParametricSurface(sphere_patches()),
        engine.points([[0, 0, 0]]),
        HERE,
        1.0,
    ),
}


@pytest.mark.parametrize("name", CONTINUA)
def test_a_continuum_of_minima_ends_and_its_bounds_are_right(name):
    a, b, pose, known = CONTINUA[name]
    answer = engine.distance(a, HERE, b, pose, budget_s=0.3)
    check(answer, shape(a), HERE, shape(b), pose, known=known)
    rough = engine.distance(a, HERE, b, pose, rel_err=0.1)
    check(rough, shape(a), HERE, shape(b), pose, known=known)
    if rough.status is not Status.OUT_OF_TIME:
        assert rough.upper <= 1.1 * answer.upper + 1e-12


@pytest.mark.long
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("away", [0.0, 1e8])
def test_scales_and_poses_far_away(scale, away):
    a = Patch(scale * bumps(1).control, bumps(1).knots_u, bumps(1).knots_v)
    b = Patch(scale * patch(3, decades=2.0).control, weights=np.exp(patch(3).control[..., 0]))
    pose_a = moved(scale * away * np.array([0.6, -0.5, 0.4]), 1)
    pose_b = moved(pose_a[:3, 3] + scale * np.array([3.0, 1.0, -2.0]), 2)
    answer = engine.distance(a, pose_a, b, pose_b)
    oracle = Shape(a), Shape(b, samples=12)
    check(answer, oracle[0], pose_a, oracle[1], pose_b)
    assert answer.status is Status.EXACT
    lone = moved(scale * np.array([1e8, 1e7, 0.0]))
    check(engine.distance(a, HERE, b, lone), oracle[0], HERE, oracle[1], lone)


def degenerate(name):
    net = np.random.default_rng(11).normal(size=(4, 5, 3))
    line = np.linspace(0.0, 1.0, 4)[:, None, None] * np.ones(3)
    return {
        "collapsed edge": lambda: Patch(np.concatenate((net[:1, :1] + 0 * net[:1], net[1:]))),
        "two collapsed edges": lambda: Patch(
            np.concatenate((net[:2, :1].repeat(5, 1), net[2:3], 0.0 * net[:1]))
        ),
        "a line": lambda: Patch(np.broadcast_to(line, (4, 3, 3))),
        "a line that folds": lambda: Patch(line[[0, 3, 0, 3]] * np.ones((4, 5, 1))),
        "a point": lambda: Patch(np.ones((3, 4, 3))),
        "flat": lambda: Patch(net * (1.0, 1.0, 0.0)),
        "cusp": lambda: Curve([[0, 0], [1, 1], [0, 1], [1, 0]]),
        "knots of full multiplicity": lambda: patch(21, (8, 8), (3, 3), torn),
        "8 decades of weights": lambda: patch(22, (4, 4), (3, 3), decades=8.0),
        "a curve of 8 decades": lambda: curve(23, 5, 3, decades=8.0),
    }[name]()  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    ["collapsed edge", "two collapsed edges", "a line", "a line that folds", "a point", "flat",
     "cusp", "knots of full multiplicity", "8 decades of weights", "a curve of 8 decades"],
)  # fmt: skip
def test_degenerate_patches(name):
    model = degenerate(name)
    oracle = Shape(model, samples=16)
    other, other_oracle = made("rational curve")
    for seed in range(3):
        pose = moved(2.5 * np.random.default_rng(seed).normal(size=3), seed)
        check(engine.distance(model, HERE, other, pose), oracle, HERE, other_oracle, pose)
        answer = engine.distance(SQUARE, pose, model, HERE, budget_s=1.0)
        check(answer, Shape(SQUARE), pose, oracle, HERE)


@pytest.mark.long
@pytest.mark.parametrize("tolerance", [{"rel_err": 0.3}, {"abs_err": 0.1}, {"abs_err": 1e-6}])
@pytest.mark.parametrize("order", ["depth_first", "priority", "breadth_first"])
def test_tolerances_and_orders(tolerance, order):
    # Each order of each pair of kinds is compiled separately, which takes a while.
    of_mesh = (("mesh", "sphere"),) if order == "depth_first" else ()
    asked = known = 0
    for names in (("bumps", "rational"), ("curve", "torus"), *of_mesh):
        (a, oracle_a), (b, oracle_b) = (made(name) for name in names)
        for seed in range(2):
            pose = moved(3.0 * np.random.default_rng(seed).normal(size=3), seed)
            answer = engine.distance(a, HERE, b, pose, order=order, **tolerance)
            true = float(check(answer, oracle_a, HERE, oracle_b, pose))
            allowed = max(tolerance.get("rel_err", 0.0) * true, tolerance.get("abs_err", 0.0))
            assert answer.upper - true <= allowed + 1e-12
            exact = engine.distance(a, HERE, b, pose, order=order)
            assert abs(exact.upper - true) <= 1e-11
            asked, known = asked + answer.bound_tests, known + exact.bound_tests
    assert asked <= known


@pytest.mark.parametrize("names", [("bumps", "rational"), ("sphere", "torus"), ("mesh", "torn")])
def test_with_hardly_any_budget_a_pair_comes_to_its_end(names):
    (a, oracle_a), (b, oracle_b) = (made(name) for name in names)
    pose = moved((2.0, 1.5, 1.0), 8)
    true, _ = reference(oracle_a, HERE, oracle_b, pose)
    pair = engine.Pair(a, b)
    last = 0.0, np.inf
    for _ in range(500):
        answer = pair.distance(HERE, pose, budget_s=0.0)
        assert last[0] <= answer.lower <= true <= answer.upper <= last[1]
        last = answer.lower, answer.upper
        if answer.status is not Status.OUT_OF_TIME:
            break
    assert answer.status is Status.EXACT


@pytest.mark.long
def test_motion_deformation_and_copies_of_a_pair():
    (a, oracle_a), b = made("rational"), bumps(1)
    pair, rng = engine.Pair(a, b), np.random.default_rng(2)
    for step in range(12):
        pose = moved((0.1 * step - 0.5, 0.05 * step, 3.0 - 0.25 * step), 3)
        if step in (4, 8):
            b.deform(b.control_points + 0.05 * rng.normal(size=b.control_points.shape))
        if step == 6:
            pair = pickle.loads(pickle.dumps(pair))
            b = pair.b
        answer = pair.distance(HERE, pose)
        true = check(answer, oracle_a, HERE, Shape(b), pose)
        fresh = engine.distance(a, HERE, b, pose)
        assert max(fresh.lower, answer.lower) <= min(fresh.upper, answer.upper)
        for clearance in (0.5 * float(true), float(true) * 1.5 + 1e-9)[true < 1e-15 :]:
            asked = pair.within(HERE, pose, clearance)
            assert asked.decided
            assert asked.within == (true <= clearance)
        met = pair.collide(HERE, pose)
        assert met.decided
        assert met.colliding == (true < 1e-15)


def test_many_poses_at_once():
    a, b = made("sphere")[0], made("rational")[0]
    poses = np.stack([moved(2.0 * np.random.default_rng(i).normal(size=3), i) for i in range(8)])
    found = engine.distances(a, np.broadcast_to(HERE, poses.shape), b, poses)
    for i, pose in enumerate(poses):
        true, _ = reference(made("sphere")[1], HERE, made("rational")[1], pose)
        assert found.lower[i] <= true <= found.upper[i] <= found.lower[i] + 1e-10


@pytest.mark.parametrize("seed, turn", [(2, 2), (7, 0), (8, 0), (13, 1), (94, 1), (143, 2)])
def test_flat_cells_are_not_divided_for_ever(seed, turn):
    # Next to such a corner or edge, a cell's bend is noise: divided along it, the cell stays long.
    a, b = patch(seed, (10, 5), (4, 1), torn, 4.0), curve(seed + 50, 6, 4)
    pose = moved(3.0 * np.random.default_rng(10 * seed + turn).normal(size=3), seed)
    answer = engine.distance(a, HERE, b, pose, budget_s=5.0)
    assert answer.status is Status.EXACT
    assert answer.bound_tests < 3000
    check(answer, Shape(a, samples=12), HERE, Shape(b), pose)


@pytest.mark.parametrize("seed", [8, 12, 13, 15, 18])
def test_fans_are_divided_along_their_ribs_too(seed):
    # The ribs are straight and meet in a point: no bend along them, but a twist between them.
    ribs = patch(seed, (7, 2), (4, 1))
    control = ribs.control.copy()
    control[:, 0] = control[0, 0]
    a, b = Patch(control, ribs.knots_u, ribs.knots_v), curve(seed + 50, 6, 3, columns=2)
    pose = moved(3.0 * np.random.default_rng(seed).normal(size=3), seed)
    answer = engine.distance(a, HERE, b, pose, budget_s=5.0)
    assert answer.status is Status.EXACT
    assert answer.bound_tests < 5000
    check(answer, Shape(a), HERE, Shape(b), pose)
