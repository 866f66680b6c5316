"""Arcs whose control points are far away, with small weights: lemons, whose centres are beyond."""

import math

import numpy as np
import pytest
from engine_bodies import IDENTITY

from proximity_monitor import engine
from proximity_monitor.engine import Curve, SolidOfRevolution, Status
from proximity_monitor.engine.models.revolution_hierarchy import RevolutionHierarchy


def lemon(off, radius):
    """Return what an arc of a circle sweeps whose centre is at rho = -off."""
    turn = math.acos(off / radius)
    high = radius * math.sin(turn)
    points = [(0.0, -high), (radius / math.cos(turn) - off, 0.0), (0.0, high)]
    return SolidOfRevolution([Curve(points, weights=[1.0, math.cos(turn), 1.0])])


def ring(radius, thick):
    """Return a torus."""
    root = math.sqrt(0.5)
    around = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
    points = [(radius + thick * x, thick * z) for x, z in around]
    knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
    return SolidOfRevolution([Curve(points, knots=knots, weights=[1.0, root] * 4 + [1.0])])


def tilted(tilt, off, z):
    made = np.eye(4)
    made[1:3, 1:3] = [[math.cos(tilt), -math.sin(tilt)], [math.sin(tilt), math.cos(tilt)]]
    made[:3, 3] = off, 0.0, z
    return made


def in_ring(z):
    """Return the distance of `lemon(0.05, 1.0)` from `ring(2.0, 0.4)` that is z above it."""
    return math.hypot(2.05, z) - 1.4


def beside_tip(z):
    """Return the distance of `lemon(0.1, 1.0)` from a tip of `lemon(0.5, 1.0)`, z above it."""
    return 1.0 - math.hypot(0.1, math.sqrt(0.75) + z)


PAIRS = {
    "in a ring": (lemon(0.05, 1.0), ring(2.0, 0.4), in_ring),
    "tip": (lemon(0.1, 1.0), lemon(0.5, 1.0), beside_tip),
}


@pytest.mark.parametrize("tilt, off", [(0.0, 0.0), (1e-8, 0.0), (3e-10, 1e-9)])
@pytest.mark.parametrize("z", [0.0, 0.1])
@pytest.mark.parametrize("name", PAIRS)
def test_about_one_axis(name, z, tilt, off):
    a, b, distance_at = PAIRS[name]
    there = tilted(tilt, off, z)
    for found in (engine.distance(a, IDENTITY, b, there), engine.distance(b, there, a, IDENTITY)):
        assert found.status is Status.EXACT
        assert found.bound_tests < 10_000
        moved = 3.0 * (tilt + off) + 1e-13
        assert found.lower - moved <= distance_at(z) <= found.upper + moved
        assert found.upper - found.lower < 1e-11


@pytest.mark.parametrize("off, radius", [(0.01, 1.0), (0.3, 1.0), (1e-3, 2.0)])
def test_errors_are_shares_of_where_the_profile_is(off, radius):
    """All arcs hold the circle, though they are about as thin as if no points were far away."""
    solid = lemon(off, radius)
    hierarchy = solid._hierarchy
    assert isinstance(hierarchy, RevolutionHierarchy)
    assert hierarchy.frame[4, 0] <= 4.0 * radius
    leaves = hierarchy.arcs[hierarchy.arcs["child"] < 0]
    assert leaves["error"].max() <= 2e-12 * radius
    for leaf in leaves:
        for side in (-1.0, 0.0, 1.0):
            bulge = np.array([-leaf["half"][1], leaf["half"][0]]) * (
                leaf["sine"] / (1.0 + leaf["cosine"])
            )
            x, z = leaf["middle"] + (side * leaf["half"] if side else bulge)
            assert abs(math.hypot(x + off, z) - radius) <= leaf["error"]
