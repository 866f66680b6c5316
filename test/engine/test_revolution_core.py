"""Spheres and capsules beside solids of revolution: circles and lines of nearest points."""

import itertools
import math

import numpy as np
import pytest
from engine_bodies import IDENTITY, pose, translation
from test_revolution import ball, torus

from proximity_monitor import engine
from proximity_monitor.engine import Curve, SolidOfRevolution, Status, shapes

CORNERS = [(1.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 0.0)]
BUSH = SolidOfRevolution([Curve(CORNERS[k : k + 2]) for k in range(4)])
SOCKET = SolidOfRevolution(
    [
        Curve([(0.0, -2.0), (2.0, -2.0)]),
        Curve([(2.0, -2.0), (2.0, 0.0)]),
        Curve([(2.0, 0.0), (1.0, 0.0)]),
        Curve([(1.0, 0.0), (1.0, -1.0), (0.0, -1.0)], weights=[1.0, math.sqrt(0.5), 1.0]),
    ]
)
RING = torus(1.0, 0.3)

ON_THE_AXIS = {
    "sphere above a ring": (RING, shapes.sphere(0.3), 1.1, math.hypot(1.0, 1.1) - 0.6),
    "sphere in a ring": (RING, shapes.sphere(0.7 - 1e-9), 0.0, 1e-9),
    "point in a ring": (RING, engine.points([[0.0, 0.0, 0.0]]), 0.0, 0.7),
    "capsule through a ring": (RING, shapes.capsule(0.6, 4.0), 0.5, 0.1),
    "capsule above a ring": (RING, shapes.capsule(0.3, 1.0), 1.6, math.hypot(1.0, 1.1) - 0.6),
    "sphere in a bush": (BUSH, shapes.sphere(0.9), 0.5, 0.1),
    "capsule in a bush": (BUSH, shapes.capsule(0.9, 0.4), 0.5, 0.1),
    "capsule longer than a bush": (BUSH, shapes.capsule(1.0 - 1e-9, 4.0), 0.5, 1e-9),
    "chain in a bush": (BUSH, engine.polyline([[0, 0, z] for z in (-1, 0.2, 0.6, 2)]), 0.0, 1.0),
    "sphere in a socket": (SOCKET, shapes.sphere(0.9), 0.0, 0.1),
    "capsule in a socket": (SOCKET, shapes.capsule(0.9, 1.0), 0.5, 0.1),
    "forty links in a bush": (
        BUSH,
        engine.polyline([[0, 0, 0.02 * z] for z in range(41)]),
        0.1,
        1.0,
    ),
    "capsule in a ball": (ball(1.0), shapes.capsule(0.2, 0.4), 0.1, 0.5),
}


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("name", ON_THE_AXIS)
def test_on_the_axis(name, turned):
    solid, rounded, z, distance = ON_THE_AXIS[name]
    at = pose(np.random.default_rng(3)) if turned else IDENTITY
    there = at @ translation(0.0, 0.0, z)
    for found in (
        engine.distance(solid, at, rounded, there),
        engine.distance(rounded, there, solid, at),
    ):
        assert found.status is Status.EXACT
        assert found.lower - 1e-13 <= distance <= found.upper + 1e-13
        assert found.upper - found.lower < 1e-11
        assert np.linalg.norm(found.point_a - found.point_b) == pytest.approx(distance, abs=1e-11)
    assert engine.within(solid, at, rounded, there, distance + 1e-11).within
    assert not engine.within(solid, at, rounded, there, distance - 1e-11).within


def along(corners):
    """Return points (n, 2) along a polygon, no farther from each other than 0.005."""
    ends = itertools.pairwise(corners)
    return np.concatenate([np.linspace(one, other, 401) for one, other in ends])


def around(rho, radius, low, high):
    """Return points (n, 2) of an arc about (rho, 0)."""
    turn = np.linspace(low, high, 1201)
    return np.stack((rho + radius * np.cos(turn), radius * np.sin(turn)), axis=1)


PROFILES = {
    "ring": (RING, around(1.0, 0.3, 0.0, 2.0 * math.pi)),
    "bush": (BUSH, along(CORNERS)),
    "socket": (
        SOCKET,
        np.concatenate(
            (
                along([(0.0, -2.0), (2.0, -2.0), (2.0, 0.0), (1.0, 0.0)]),
                around(0.0, 1.0, -0.5 * math.pi, 0.0),
            )
        ),
    ),
}


@pytest.mark.parametrize("name", PROFILES)
def test_near_the_axis_against_samples(name):
    """The oracle samples the profile and the segment, so it is above the distance by little."""
    solid, profile = PROFILES[name]
    rng, t = np.random.default_rng(5), np.linspace(-0.5, 0.5, 401)
    for k in range(20):
        length, radius = rng.uniform(0.05, 2.0), rng.uniform(0.0, 0.1)
        tilt, off = 10.0 ** rng.uniform(-12.0, -0.5, 2)
        at = translation(off, 0.0, rng.uniform(-1.0, 1.5))
        at[1:3, 1:3] = [[math.cos(tilt), -math.sin(tilt)], [math.sin(tilt), math.cos(tilt)]]
        rounded = shapes.capsule(radius, length)
        core = at[:3, 3] + np.outer(length * t, at[:3, 2])
        points = np.stack((np.hypot(core[:, 0], core[:, 1]), core[:, 2]), axis=1)
        apart = np.linalg.norm(points[:, None, :] - profile[None, :, :], axis=2).min() - radius
        found = engine.distance(solid, IDENTITY, rounded, at)
        assert found.status in (Status.EXACT, Status.INTERSECTING), k
        assert found.lower <= max(apart, 0.0)
        assert found.upper >= apart - 0.02


def test_features_and_a_deformed_core():
    rounded = shapes.capsule(0.2, 1.0)
    pair = engine.Pair(RING, rounded)
    assert pair.distance(IDENTITY, translation(0.0, 0.0, 0.2)).lower == pytest.approx(0.5)
    rounded.deform(np.add(rounded.control_points, [0.1, 0.0, 0.0]))
    found = pair.distance(IDENTITY, translation(0.0, 0.0, 0.2))
    assert found.status is Status.EXACT
    assert found.lower == pytest.approx(0.4, abs=1e-11)
    assert found.feature_a.kind == "profile"
    core = rounded.vertices[rounded.faces[found.feature_b.index]]
    on_core = found.feature_b.parameters @ core + [0.0, 0.0, 0.2]
    assert np.linalg.norm(on_core - found.point_b) == pytest.approx(0.2)


@pytest.mark.parametrize("radius", [0.0, 0.005])
def test_what_decides_a_clearance_is_not_said_to_be_nearest(radius):
    """The first segment is within the clearance, the last one is nearer."""
    solid, here = engine.shapes.cylinder(0.05, 0.2), np.eye(4)
    bent = engine.polyline([[0.14, 0, 0], [0.14, 0, 0.05], [0.07, 0, 0.05]], radius=radius)
    for a, b in ((solid, bent), (bent, solid)):
        nearest = engine.distance(a, here, b, here)
        assert nearest.upper == pytest.approx(0.02 - radius)
        found = engine.within(a, here, b, here, 0.1)
        assert found.within and found.lower <= nearest.upper


def wavy(spans, amplitude):
    """Return about a ball around the origin, whose profile has so many spans."""
    turn = np.linspace(-0.5 * math.pi, 0.5 * math.pi, spans + 3)
    radius = 1.0 + amplitude * np.random.default_rng(1).uniform(-1.0, 1.0, len(turn))
    points = np.stack((radius * np.cos(turn), radius * np.sin(turn)), axis=1)
    points[[0, -1], 0] = 0.0
    return SolidOfRevolution([Curve(points, knots=[0] * 4 + [*range(1, spans)] + [spans] * 4)])


CORES = {
    "point": np.zeros((1, 3)),
    "points": 1e-9 * np.random.default_rng(2).normal(size=(8, 3)),
    "links": 1e-9 * np.random.default_rng(3).normal(size=(9, 3)),
}


@pytest.mark.parametrize("name", CORES)
def test_the_search_of_a_core_can_be_cut_anywhere(name):
    """Nearly all of a profile is nearly as near to the middle as its nearest point."""
    solid, points = wavy(60, 1e-10), CORES[name]
    core = engine.polyline(points) if name == "links" else engine.points(points)
    exact = engine.distance(solid, IDENTITY, core, IDENTITY)
    assert exact.status is Status.EXACT
    pair, lower = engine.Pair(solid, core), []
    while True:
        found = pair.distance(IDENTITY, IDENTITY, budget_s=0.0)
        assert found.lower <= exact.upper and exact.lower <= found.upper
        lower.append(found.lower)
        if found.status is Status.EXACT:
            break
        assert found.status is Status.OUT_OF_TIME
        assert len(lower) < 10_000
    assert len(lower) > 10
    assert abs(found.upper - exact.upper) < 1e-11
