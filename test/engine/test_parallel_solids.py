"""Depths of solids whose surfaces are nearly parallel or touch along lines, and their cost."""

from __future__ import annotations

import numpy as np
import pytest
from engine_bodies import IDENTITY, pose, translation
from engine_surfaces import revolved
from test_closed import moved, replaced
from test_surface_solids import TIGHT, ball, check

from proximity_monitor import engine
from proximity_monitor.engine import ParametricSurface, Status
from proximity_monitor.scene import bundled

FIT = 0.005


def turned(*profile):
    """Return a solid of revolution about z; its profile is a polygon of (radius, z) corners."""
    made = []
    for first, last in zip(profile, profile[1:] + profile[:1], strict=True):
        if first[0] + last[0] > 0.0:
            made += revolved(np.array([first, last], float), np.ones(2))
    return ParametricSurface(made, solid=True)


@pytest.fixture(scope="module")
def shaft():
    return turned((0.0, -1.0), (0.5, -1.0), (0.5, 1.0), (0.0, 1.0))


@pytest.fixture(scope="module")
def bearing():
    return turned((0.5 + FIT, -0.8), (0.8, -0.8), (0.8, 0.8), (0.5 + FIT, 0.8))


@pytest.mark.parametrize("overlap", [1e-2, 1e-3, 1e-4])
def test_a_shaft_beside_the_axis_of_its_bearing(shaft, bearing, overlap):
    """Both surfaces are nearly parallel. Formerly, planes took 32,768 cells and did not end."""
    at = pose(np.random.default_rng(2), 1.0)
    to = at @ translation(FIT + overlap, 0.0, 0.1)
    both = [(shaft, at, bearing, to), (bearing, to, shaft, at)]
    # With the bearing first, the thinnest overlap does not end: no ball is found at the start.
    for a, pose_a, b, pose_b in both[: 1 if overlap < 1e-3 else 2]:
        found = engine.signed_distance(a, pose_a, b, pose_b)
        check(found, -overlap)
        assert found.primitive_tests < 8000
        way = found.point_a - found.point_b
        axis = at[:3, 2]
        assert abs(way @ axis) < 0.02 * np.linalg.norm(way)


def test_a_blade_pushed_into_its_shroud():
    """The tip is ruled. Formerly, its parts kept their length, and no point of it was found."""
    models = bundled("turbine").parent / "models"
    blade = engine.load(models / "blade.json", solid=True)
    shroud = engine.load(models / "shroud.json", solid=True)
    for push, least, most in ((0.1, 0.0980, 0.0992), (0.01, 0.0088, 0.0090)):
        at = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], float)
        at[1, 3] = -(0.249 + push)
        found = engine.signed_distance(blade, at, shroud, IDENTITY)
        assert found.status is Status.WITHIN_TOLERANCE
        assert least <= -found.upper <= -found.lower <= most
        assert -found.lower <= -1.0101 * found.upper
        assert found.primitive_tests < 10_000


def test_a_status_tells_what_gaps_between_patches_leave_open():
    model = ParametricSurface(replaced(moved), deviation=1e-5, solid=True)
    deep = engine.signed_distance(model, IDENTITY, ball(0.5), translation(1.0))
    assert deep.status is Status.WITHIN_TOLERANCE
    shallow = engine.signed_distance(model, IDENTITY, ball(0.5), translation(1.8 - 1e-3))
    assert shallow.status is Status.INTERSECTING
    assert shallow.lower <= -1e-3 and shallow.upper >= -1e-3
    assert shallow.lower >= -1.05e-3 and shallow.upper <= -0.95e-3
    exact = engine.signed_distance(ball(1.0), IDENTITY, ball(0.5), translation(1.2), depth_err=0.0)
    assert exact.lower <= -0.3 + TIGHT and exact.upper >= -0.3 - TIGHT
