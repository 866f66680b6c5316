"""Depths of solids about nearly one axis: press fits, rings of largest balls; see sleeves.py."""

from __future__ import annotations

import math

import numpy as np
import pytest
from engine_bodies import IDENTITY, from_python, translation
from test_coaxial import bore, lines, turn
from test_revolution import ball, cylinder, torus

from proximity_monitor import engine
from proximity_monitor.engine import Status
from proximity_monitor.engine.kernels.revolution import sleeves
from proximity_monitor.engine.kernels.revolution.meridian import Place

rest_of = from_python(sleeves._rest)


def both_orders(a, at, b):
    return (
        engine.signed_distance(a, at, b, IDENTITY),
        engine.signed_distance(b, IDENTITY, a, at),
    )


@pytest.mark.parametrize("wide", [0.01, 1e-3, 1e-4])
@pytest.mark.parametrize(("off", "tilt"), [(0.0, 0.0), (1e-4, 0.0), (1e-4, 1e-4)])
def test_a_press_fit_is_as_deep_as_its_shaft_is_too_wide(wide, off, tilt):
    """Formerly, the bounds were up to fifty times the depth apart after 33,000 cells."""
    shaft, tube = cylinder(0.6 + wide, 0.5), bore(0.6, 0.5)
    at = translation(off, 0.0, 0.0) @ turn(tilt)
    # An offset of the shaft adds to the depth on one side, and a tilt adds 0.5 * tilt at its end.
    least, most = wide, wide + off + 0.5 * tilt + 1e-7
    for found in both_orders(shaft, at, tube):
        assert found.status is Status.WITHIN_TOLERANCE
        assert found.upper - found.lower <= 0.011 * abs(found.upper)
        assert -found.lower >= least - 1e-12 and -found.upper <= most
        assert found.bound_tests < 4000


def test_a_shaft_that_touches_its_bore_along_a_line():
    """The overlap is a lens. Formerly, no seed was in it."""
    shaft, tube = cylinder(0.5, 0.5), bore(0.6, 0.5)
    for found in both_orders(shaft, translation(0.1001, 0.0, 0.2), tube):
        assert found.status is Status.WITHIN_TOLERANCE
        assert found.lower <= -1e-4 <= found.upper * 0.98


def test_a_thin_ring_is_no_deeper_than_it_is_thick():
    """Largest balls lie all around the ring. Each touches the ring's surface only."""
    ring, around = torus(1.0, 1e-3), lines((0, -0.3), (1.5, -0.3), (1.5, 0.3), (0, 0.3))
    for found in both_orders(ring, translation(0.01, 0.0, 0.05) @ turn(0.1), around):
        assert found.status is Status.WITHIN_TOLERANCE
        assert found.lower <= -2e-3 <= found.upper * 0.98


FITS = {
    "shaft": cylinder(0.602, 0.5),
    "cone": lines((0, -0.5), (0.58, -0.5), (0.63, 0.5), (0, 0.5)),
    "barrel": lines((0, -0.5), (0.598, -0.5), (0.64, -0.3), (0.64, 0.3), (0.599, 0.5), (0, 0.5)),
    "ring": torus(0.6, 0.004),
    "ball": ball(0.601),
}


@pytest.mark.long
@pytest.mark.parametrize("name", FITS)
def test_no_point_is_deeper_than_the_bound(name):
    """The oracle is points around the bore's wall that climb at random to greater depth."""
    rng = np.random.default_rng(sorted(FITS).index(name))
    shaft, tube = FITS[name], bore(0.6, 0.4)
    for tilt, off, height in ((1e-6, 1e-3, 0.0), (0.003, 0.0, 0.2), (0.05, 0.02, -0.15)):
        turned = turn(tilt, rng.uniform(0.0, 2.0 * math.pi))
        at = translation(off, 0.3 * off, height) @ turned
        found = both_orders(shaft, at, tube)
        lower = max(each.lower for each in found)
        assert lower <= min(each.upper for each in found)
        angle, z = rng.uniform(0.0, 2.0 * math.pi, 4000), rng.uniform(-0.42, 0.42, 4000)
        rho = rng.uniform(0.59, 0.66, 4000)
        points, step = np.column_stack((rho * np.cos(angle), rho * np.sin(angle), z)), 0.02
        deepest = 0.0
        for _ in range(20):
            depths = np.maximum(
                engine.closest_points(shaft, at, points, signed=True).upper,
                engine.closest_points(tube, IDENTITY, points, signed=True).upper,
            )
            best = np.argsort(depths)[:100]
            deepest = min(deepest, 2.0 * depths[best[0]])
            tried = points[best, None] + step * rng.normal(size=(100, 20, 3))
            points, step = np.concatenate((points[best], tried.reshape(-1, 3))), 0.7 * step
        assert lower <= deepest + 1e-12
        assert deepest <= 0.97 * min(each.upper for each in found)  # the bound is about as deep


def seen(origin, axis, half):
    """Return the cell around the world's origin as `sleeves.Seen` from an axis."""
    away = -origin - axis * (-origin @ axis)
    rho = np.linalg.norm(away)
    u, z, nothing = tuple(away / rho), tuple(axis), (0.0, 0.0, 0.0)
    corners = np.array(np.meshgrid(*([-1.0, 1.0],) * 3)).reshape(3, -1).T * half
    across = np.linalg.norm(corners - np.outer(corners @ axis, axis), axis=1).max()
    along = abs(corners @ axis).max()
    return sleeves.Seen(Place(rho, 0.0, u, nothing, 0.0), u, z, across, along)


@pytest.mark.parametrize("tilt", [0.0, 1e-6, 1e-3, 0.1])
@pytest.mark.parametrize("off", [0.0, 1e-6, 1e-3, 0.1])
def test_distances_from_two_axes_differ_by_what_is_linear_but_for_the_rest(tilt, off):
    rng = np.random.default_rng(3)
    closest = 0.0
    for _ in range(100):
        half = np.array(10.0 ** rng.uniform(-3, -0.7, 3))
        origin = np.array([-1.0, 0.0, rng.normal()])
        turned = turn(tilt, rng.uniform(0.0, 6.0))[:3, 2]
        beside = origin + off * np.append(rng.normal(size=2), 0.0)
        one, other = seen(origin, np.array([0.0, 0.0, 1.0]), half), seen(beside, turned, half)
        axis = np.array(other.axis)
        rest = rest_of(one, other, other.axis, half)
        points = half * rng.choice([-1.0, 1.0, 0.0, 0.5, -0.5], (200, 3))
        first = np.hypot(points[:, 0] - origin[0], points[:, 1] - origin[1])
        second = np.linalg.norm(np.cross(points - beside, axis), axis=1)
        straight = points @ (np.array(other.u) - one.u) + other.place.rho - one.place.rho
        differ = abs(second - first - straight).max()
        assert differ <= rest + 1e-14
        closest = max(closest, (differ + 1e-14) / (rest + 1e-14))
    assert closest > 0.02  # the bound is at most 50 times too large
