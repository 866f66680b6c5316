"""Solids of revolution near a point: their nearest point, its side, and how high they reach."""

import math

import numpy as np
import pytest
from engine_bodies import IDENTITY, translation
from numba import njit
from test_reaches import chess, comb, points_of

from proximity_monitor import engine
from proximity_monitor.engine import Curve, SolidOfRevolution, Status
from proximity_monitor.engine.kernels.base.linking import ROOT
from proximity_monitor.engine.kernels.base.tables import tree_at
from proximity_monitor.engine.kernels.base.trees import RevolutionTree
from proximity_monitor.engine.kernels.revolution.cap import height_within
from proximity_monitor.engine.kernels.revolution.closest import nearest_on
from proximity_monitor.engine.kernels.revolution.inside import turns_around
from proximity_monitor.engine.kernels.revolution.meridian import place_in

SAMPLES = 801
"""Samples of each piece of a profile."""


@njit(pipeline_class=ROOT)
def seen_from(table, points, share, spare, found):
    tree, _ = tree_at(RevolutionTree, table)
    for i in range(len(points)):
        p = place_in(tree, (points[i, 0], points[i, 1], points[i, 2]), (0.0, 0.0, 0.0))
        least, most, piece, t, looks = nearest_on(tree, p.rho, p.z, p.margin, share, spare)
        found[i, 0], found[i, 1], found[i, 2], found[i, 3] = least, most, piece, t
        found[i, 4], found[i, 5] = turns_around(tree, p.rho, p.z, p.margin, 0.0), looks


@njit(pipeline_class=ROOT)
def heights(table, place, normal, radius, height, top):
    tree, _ = tree_at(RevolutionTree, table)
    o, n = (place[0], place[1], place[2]), (normal[0], normal[1], normal[2])
    return height_within(tree, o, n, radius, height, top)


def loop():
    """Return a ring off the axis with an elliptic section, a rational curve."""
    w = math.sqrt(0.5)
    rim = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
    points = [(0.6 + 0.3 * x, 0.5 * z) for x, z in rim]
    return SolidOfRevolution(
        [Curve(points, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], [1, w] * 4 + [1])]
    )


SOLIDS = {
    "table": lambda: chess("table"), "cup": lambda: chess("cup"), "comb": lambda: comb(61),
    "loop": loop,
}  # fmt: skip


@pytest.fixture(scope="module", params=SOLIDS)
def solid(request):
    """Return a solid, its largest coordinate 1 m, and dense points (k, 2) along its profile."""
    made = SOLIDS[request.param]()
    made.deform(made.control_points / np.abs(made.control_points).max())
    curves = made._hierarchy.curves
    return made, np.concatenate(
        [points_of(each, np.linspace(0.0, 1.0, SAMPLES)) for each in curves]
    )


def around(made, profile, rng, count):
    """Return points beside the surface, near and far, and some on the axis."""
    points = profile[rng.integers(len(profile), size=count)]
    turn = rng.uniform(0.0, 2.0 * math.pi, count)
    xyz = np.stack((points[:, 0] * np.cos(turn), points[:, 0] * np.sin(turn), points[:, 1]), axis=1)
    xyz += rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-7.0, 0.0, (count, 1))
    xyz[::17, :2] = 0.0
    return xyz


def nearest_sample(curves, profile, rho, z):
    """Return a point's distance from the profile, from ever denser samples about the nearest."""
    found = np.inf
    for best in np.argsort(((profile - (rho, z)) ** 2).sum(axis=1))[:8]:
        piece, t, step = best // SAMPLES, best % SAMPLES / (SAMPLES - 1), 2.0 / (SAMPLES - 1)
        for _ in range(7):
            tried = np.clip(t + np.linspace(-step, step, 65), 0.0, 1.0)
            far = np.hypot(*(points_of(curves[piece], tried) - (rho, z)).T)
            t, step = tried[far.argmin()], step / 16.0
        found = min(found, far.min())
    return found


def is_inside(profile, rho, z):
    """Return whether a point lies inside the profile's polygon, by crossings of a ray."""
    beyond = np.array([[-1.0, profile[-1, 1]], [-1.0, profile[0, 1]], profile[0]])
    if profile[0, 0] > 1e-9:
        beyond = profile[:1]  # a loop off the axis
    ends = np.concatenate((profile, beyond)) - (rho, z)
    (x0, z0), (x1, z1) = ends[:-1].T, ends[1:].T
    across = (z0 <= 0.0) != (z1 <= 0.0)
    at = x0[across] - z0[across] * (x1 - x0)[across] / (z1 - z0)[across]
    return bool((at > 0.0).sum() % 2)


@pytest.mark.long
@pytest.mark.parametrize(("share", "spare"), [(0.01, 1e-12), (0.0, 1e-9), (0.0, 2e-12)])
def test_the_nearest_point_and_the_side_of_many_points(solid, share, spare):
    made, profile = solid
    points = around(made, profile, np.random.default_rng(7), 150)
    found = np.empty((len(points), 6))
    seen_from(made._hierarchy.table_of_all, points, share, spare, found)
    curves = made._hierarchy.curves
    for p, (least, most, piece, t, turns, _) in zip(points, found, strict=True):
        rho, z = math.hypot(p[0], p[1]), p[2]
        distance = nearest_sample(curves, profile, rho, z)
        assert least <= distance + 1e-12 and distance <= most + 1e-12
        assert 0.0 <= most - least <= max(share * most, spare) + 2e-12
        at = points_of(curves[int(piece)], np.array([t]))[0]
        assert math.hypot(at[0] - rho, at[1] - z) == pytest.approx(most, abs=2e-12)
        if distance > 1e-5:  # the polygon is off the profile by less
            assert (turns != 0) == is_inside(profile, rho, z)
    assert np.median(found[:, 5]) < 60


def test_nothing_in_the_ball_is_higher_than_is_said_and_little_is_lower(solid):
    """The plane's normal lies in the half-plane of its place, as is usual, or beside it."""
    made, profile = solid
    rng = np.random.default_rng(11)
    turns = math.pi * np.linspace(-1.0, 1.0, 65) ** 3  # denser near the place's half-plane
    told = close = 0
    for i, place in enumerate(around(made, profile, rng, 120)):
        rho = math.hypot(place[0], place[1])
        out = np.array([place[0] / rho, place[1] / rho, 0.0]) if rho > 0.0 else np.eye(3)[0]
        lean, radius = rng.uniform(0.0, 2.0 * math.pi), 10.0 ** rng.uniform(-3.0, 0.0)
        normal = math.cos(lean) * out + math.sin(lean) * np.eye(3)[2]
        if i % 3 == 0:
            normal = rng.normal(size=3)
            normal /= np.linalg.norm(normal)
        least, top = 1e-3 * radius, 0.8 * radius
        table = made._hierarchy.table_of_all
        said, _ = heights(table, place, normal, radius, least, top)
        near = profile[np.hypot(profile[:, 0] - rho, profile[:, 1] - place[2]) < radius]
        near = near[:: len(near) // 2000 + 1]
        turn = math.atan2(out[1], out[0]) + turns[:, None]
        x = np.stack(
            (near[:, 0] * np.cos(turn), near[:, 0] * np.sin(turn), near[:, 1] + 0.0 * turn), axis=2
        )
        x -= place
        x = x[(x * x).sum(axis=2) < radius * radius]
        highest = max((x @ normal).max(initial=-np.inf), least)
        assert highest <= said
        if i % 3:
            told += 1
            close += said <= highest + 0.05 * radius or (said == np.inf and highest > 0.9 * top)
    assert close > 0.9 * told


def test_a_point_near_the_centre_of_a_ball():
    """All of an arc is about equally near, so only its own bound helps, none of second order."""
    w, knots = math.sqrt(0.5), [0, 0, 0, 1, 1, 1]
    high = Curve(np.array([(0, 8), (2, 8), (2, 6)]) * 1e-3, knots, [1.0, w, 1.0])
    side = Curve(np.array([(2, 6), (2, 0)]) * 1e-3)
    low = Curve(np.array([(2, 0), (2, -2), (0, -2)]) * 1e-3, knots, [1.0, w, 1.0])
    rng = np.random.default_rng(5)
    points = rng.normal(size=(100, 3)) * 10.0 ** rng.uniform(-9.0, -4.0, (100, 1))
    points[:, 2] = 6e-3 + np.abs(points[:, 2])
    capsule = SolidOfRevolution([high, side, low])
    found = engine.closest_points(capsule, IDENTITY, points, signed=True)
    depths = 2e-3 - np.linalg.norm(points - (0.0, 0.0, 6e-3), axis=1)
    assert (-found.upper <= depths + 1e-14).all() and (depths - 1e-14 <= -found.lower).all()
    assert (found.upper - found.lower).max() < 1e-13


@pytest.mark.parametrize("other", ["cylinder", "box"])
def test_depths_of_cylinders_are_those_of_formulas(other):
    """All balls along the axis are equally large, a ridge. With patches, this takes far longer."""
    a = engine.shapes.cylinder(0.05, 0.3)
    b = {
        "cylinder": lambda: engine.shapes.cylinder(0.06, 0.2),
        "box": lambda: engine.shapes.box((0.12, 0.12, 0.2)),
    }[other]()
    for at, depth in (
        (translation(0.0, 0.0, 0.0), 0.1), (translation(0.0, 0.0, 0.2), 0.05),
        (translation(0.1, 0.0, 0.0), 0.01), (translation(0.0, 0.0, 0.2499), 1e-4),
    ):  # fmt: skip
        for one, place, two, there in ((a, IDENTITY, b, at), (b, at, a, IDENTITY)):
            found = engine.signed_distance(one, place, two, there)
            assert found.status in (Status.EXACT, Status.WITHIN_TOLERANCE)
            assert found.lower <= -depth * (1.0 - 1e-9)
            assert -depth * (1.0 + 1e-9) <= found.upper <= -depth / 1.01 + 1e-9
            assert found.primitive_tests < 400


def test_a_sample_of_points_inside_both_is_never_deeper_than_is_said():
    a, b = chess("cup"), chess("pawn")
    size = np.abs(a.control_points).max()
    rng = np.random.default_rng(3)
    overlapping = 0
    for _ in range(12):
        at = np.eye(4)
        at[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        at[:3, :3] *= np.linalg.det(at[:3, :3])
        at[:3, 3] = rng.normal(size=3) * 0.3 * size
        found = engine.signed_distance(a, IDENTITY, b, at)
        points = rng.uniform(-1.1, 1.1, (4000, 3)) * size
        depths = np.minimum(
            -engine.closest_points(a, IDENTITY, points, signed=True).upper,
            -engine.closest_points(b, at, points, signed=True).upper,
        )
        assert -found.lower >= 2.0 * depths.max()
        if found.upper < 0.0:
            overlapping += 1
            assert found.upper - found.lower <= 0.0101 * -found.upper
            middle = 0.5 * (found.point_a + found.point_b)
            radius = [
                -engine.closest_points(model, pose, middle[None], signed=True).lower[0]
                for model, pose in ((a, IDENTITY), (b, at))
            ]
            assert min(radius) <= -0.5 * found.lower
    assert overlapping > 4
