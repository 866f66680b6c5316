"""Circles, and very thin rings, against 30-digit arithmetic; and other pairs at their limits."""

import itertools
import math

import mpmath
import numpy as np
import pytest
from engine_bodies import IDENTITY, pose, translation
from numba.core.caching import NullCache
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree
from test_revolution import torus

from proximity_monitor import engine
from proximity_monitor.engine import Curve, SolidOfRevolution
from proximity_monitor.engine.kernels.base import jit
from proximity_monitor.engine.kernels.revolution import circles
from proximity_monitor.engine.kernels.revolution.bound import half_of

DIGITS, STARTS = 30, 720


def squared(large, radius, at, angle):
    """Return the squared distance of a placed circle's point from a circle about z; 30 digits."""
    cos, sin = mpmath.cos(angle), mpmath.sin(angle)
    x, y, z = (at[i][3] + (at[i][0] * cos + at[i][1] * sin) * radius for i in range(3))
    return (mpmath.hypot(x, y) - large) ** 2 + z**2


def circles_apart(large, radius, at, most=False):
    """Return the least distance of a placed circle from one about z, or that of its farthest point.

    It refines the eight best local minima among STARTS samples by golden-section search.
    """
    sign = -1 if most else 1
    with mpmath.workdps(DIGITS):
        exact = [[mpmath.mpf(float(each)) for each in row] for row in at]
        turn = 2.0 * np.pi * np.arange(STARTS) / STARTS
        rim = at[:3, :2] @ np.array([np.cos(turn), np.sin(turn)]) * radius + at[:3, 3:]
        values = sign * ((np.hypot(rim[0], rim[1]) - large) ** 2 + rim[2] ** 2)
        near = np.minimum(np.roll(values, 1), np.roll(values, -1))
        chosen = np.flatnonzero(values <= near)
        chosen = chosen[np.argsort(values[chosen], kind="stable")][:8]
        share = (mpmath.sqrt(5) - 1) / 2
        found = []
        for i in chosen:
            low = mpmath.mpf(float(turn[i])) - 2 * mpmath.pi / STARTS
            high = low + 4 * mpmath.pi / STARTS
            a, b = high - share * (high - low), low + share * (high - low)
            at_a, at_b = (sign * squared(large, radius, exact, each) for each in (a, b))
            for _ in range(60):
                if at_a < at_b:
                    high, b, at_b = b, a, at_a
                    a = high - share * (high - low)
                    at_a = sign * squared(large, radius, exact, a)
                else:
                    low, a, at_a = a, b, at_b
                    b = low + share * (high - low)
                    at_b = sign * squared(large, radius, exact, b)
            found.append(min(at_a, at_b))
        return float(mpmath.sqrt(sign * min(found)))


def upright(x, y=0.0, z=0.0):
    """Return a pose whose axis lies along y."""
    made = translation(x, y, z)
    made[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    return made


def tilted(angle, x=0.0, y=0.0, z=0.0):
    """Return a pose turned about x."""
    made, cos, sin = translation(x, y, z), math.cos(angle), math.sin(angle)
    made[1:3, 1:3] = [[cos, -sin], [sin, cos]]
    return made


POSES = {
    "parallel axes": (0.7, translation(2.5, 0.0, 0.3)),
    "parallel axes, across": (0.7, translation(1.1, 0.2, 0.3)),
    "perpendicular axes": (0.7, upright(2.0, 0.3, 0.1)),
    "interlocked": (0.7, upright(0.9, 0.1, 0.0)),
    "interlocked, the other side": (0.7, upright(-1.2, 0.0, 0.3)),
    "around the tube": (0.7, upright(1.0)),
    "around the tube, of one size": (1.0, upright(1.0)),
    "nearly around the tube": (0.7, upright(1.0 + 1e-9, 0.0, 1e-9)),
    "equal minima": (0.5, upright(0.0)),
    "equal minima, tilted": (0.5, tilted(0.4)),
    "nearly concentric": (0.5, translation(1e-9, 0.0, 0.0)),
    "nearly coaxial": (0.5, tilted(1e-7, z=0.2)),
    "through the axis": (0.3, upright(0.3)),
    "across the axis": (0.5, translation(0.5, 0.0, 0.4)),
    "beside the axis": (0.5, tilted(0.3, 0.5 + 1e-8, 0.0, 0.4)),
    "much larger": (1e6, tilted(1.0, 1e6 + 3.0, 0.0, 0.5)),
    "much smaller": (1e-6, tilted(1.0, 1.5, 0.2, 0.5)),
    "much smaller, near": (1e-6, tilted(1.0, 1.0 + 2e-3, 0.0, 0.0)),
}


@jit.entry
def ask(motion, around, radius, spare):
    return circles.distance_of_circles(circles.circles_of(motion, around, 0.0, radius, 0.0), spare)


@jit.entry
def bound(motion, around, radius, angle, half):
    apart, least, _ = circles._bound(
        circles.circles_of(motion, around, 0.0, radius, 0.0), angle, half
    )
    return apart, least


@jit.entry
def beside_tube(motion, around, radius):
    return circles._around_tube(circles.circles_of(motion, around, 0.0, radius, 0.0))


ask._cache = bound._cache = beside_tube._cache = NullCache()


def check_circles(around, radius, at, sharp):
    """Check the bound against 30 digits, and that it errs by at most `sharp` times all sizes."""
    if radius > around:
        around, radius, at = radius, around, np.linalg.inv(at)
    size = around + radius + np.linalg.norm(at[:3, 3])
    motion = np.concatenate((at[:3, :3].ravel(), at[:3, 3]))
    least, angle, apart, _ = ask(motion, around, radius, 1e-14 * size)
    expected = circles_apart(around, radius, at)
    assert least <= expected
    assert expected - least <= sharp * size
    assert abs(apart - expected) <= 1e-14 * size
    x, y, z = at[:3, 3] + radius * (at[:3, :2] @ (math.cos(angle), math.sin(angle)))
    assert math.hypot(math.hypot(x, y) - around, z) == pytest.approx(apart, abs=1e-14 * size)


@pytest.mark.parametrize("name", POSES)
def test_circles_at_their_limits(name):
    radius, at = POSES[name]
    check_circles(1.0, radius, at, 1e-13)


def test_circles_at_random():
    rng = np.random.default_rng(11)
    for k in range(60):
        radius, scale = 10.0 ** rng.uniform(-3, 3), 10.0 ** rng.uniform(-6, 6)
        at = pose(rng, (1.0 + radius) * (0.01, 0.3, 0.8, 3.0)[k % 4])
        at[:3, 3] *= scale
        check_circles(scale, scale * radius, at, 3e-14)


def test_circles_far_away_and_of_no_radius():
    rng = np.random.default_rng(12)
    for _ in range(8):
        check_circles(1.0, 0.5, pose(rng, 1e8), 3e-14)
        check_circles(1.0, 0.0, pose(rng, 2.0), 3e-14)
        check_circles(0.0, 0.0, pose(rng, 2.0), 3e-14)


@pytest.mark.parametrize("gap", [1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 0.0])
def test_circles_that_nearly_touch(gap):
    """The circles share a point. Then one moves off it, along the normal of both."""
    rng = np.random.default_rng(13)
    for _ in range(4):
        radius, at = rng.uniform(0.1, 1.0), pose(rng, 1.0)
        turn, rim = rng.uniform(0.0, 2.0 * np.pi, 2)
        common = np.array([math.cos(rim), math.sin(rim), 0.0])
        along = np.array([-math.sin(rim), math.cos(rim), 0.0])
        other = at[:3, :2] @ (-math.sin(turn), math.cos(turn))
        normal = np.cross(along, other) / np.linalg.norm(np.cross(along, other))
        out = at[:3, :2] @ (math.cos(turn), math.sin(turn))
        at[:3, 3] = common + gap * normal - radius * out
        check_circles(1.0, radius, at, 1e-13)


@pytest.mark.parametrize("z", [0.0, 1e-6, 0.3])
@pytest.mark.parametrize("radius", [0.4, 1.0 - 1e-6, 1.0])
def test_circles_about_one_axis(radius, z):
    """Every point of one circle is equally near to the other."""
    check_circles(1.0, radius, translation(0.0, 0.0, z), 1e-13)
    check_circles(1.0, radius, tilted(1e-9, z=z), 1e-13)


def test_no_point_of_an_interval_is_nearer_than_its_bound():
    rng = np.random.default_rng(14)
    turns = np.linspace(-1.0, 1.0, 401)
    for k in range(300):
        radius, at = 10.0 ** rng.uniform(-3, 0), pose(rng, 10.0 ** rng.uniform(-2, 0.3))
        if k % 5 == 0:  # close to the axis, where the direction of rho turns fast
            at[:3, 3] = (radius * (1.0 + 10.0 ** rng.uniform(-8, -1)), 0.0, rng.uniform(0, 1))
        angle, half = rng.uniform(0.0, 2.0 * np.pi), 10.0 ** rng.uniform(-6, -0.3)
        motion = np.concatenate((at[:3, :3].ravel(), at[:3, 3]))
        apart, least = bound(motion, 1.0, radius, angle, half)
        way = angle + half * turns
        rim = at[:3, :2] @ np.array([np.cos(way), np.sin(way)]) * radius + at[:3, 3:]
        found = np.hypot(np.hypot(rim[0], rim[1]) - 1.0, rim[2])
        assert least <= found.min() + 1e-15
        assert apart == pytest.approx(found[200], abs=2e-15)
        assert least >= apart - 1.01 * radius * half - 1e-13


def test_no_point_of_a_circle_around_a_tube_is_nearer_than_its_centre_tells():
    rng, sharp = np.random.default_rng(15), 0
    turns = np.linspace(0.0, 2.0 * np.pi, 720)
    for _ in range(400):
        radius, off = rng.choice([0.3, 0.7, 1.0]), 10.0 ** rng.uniform(-12, 0)
        at = upright(1.0) @ pose(rng, 0.0) if rng.random() < 0.2 else upright(1.0)
        at[:3, 3] += off * rng.normal(size=3)
        at = tilted(10.0 ** rng.uniform(-12, 0)) @ at
        motion = np.concatenate((at[:3, :3].ravel(), at[:3, 3]))
        rim = at[:3, :2] @ np.array([np.cos(turns), np.sin(turns)]) * radius + at[:3, 3:]
        found = np.hypot(np.hypot(rim[0], rim[1]) - 1.0, rim[2]).min()
        least = beside_tube(motion, 1.0, radius)
        assert least <= found + 1e-15
        sharp += least > found - 1e-6
    assert sharp > 50


@pytest.mark.parametrize("thin", [1e-3, 1e-9])
@pytest.mark.parametrize("name", POSES)
def test_thin_rings_are_as_far_apart_as_circles(name, thin):
    radius, at = POSES[name]
    small = min(thin * radius, 0.1)
    one, other = torus(1.0, thin), torus(radius, small)
    expected = circles_apart(1.0, radius, at) - thin - small
    back = np.linalg.inv(at)
    size = max(1.0, radius)
    for found in (
        engine.distance(one, IDENTITY, other, at),
        engine.distance(other, IDENTITY, one, back),
    ):
        assert found.lower <= expected + 1e-15 * size
        assert found.upper >= expected - 1e-15 * size
        assert found.upper - found.lower <= 3e-12 * size
        assert found.bound_tests == 1


def test_thin_rings_at_random():
    rng = np.random.default_rng(4)
    for k in range(24):
        radius, thin = 10.0 ** rng.uniform(-2, 2), 10.0 ** rng.uniform(-9, -3)
        small = thin * radius
        at = pose(rng, (1.0 + radius) * (0.3, 0.8, 1.5)[k % 3])
        expected = circles_apart(1.0, radius, at) - thin - small
        found = engine.distance(torus(1.0, thin), IDENTITY, torus(radius, small), at)
        if expected > 0.0:
            assert found.lower <= expected + 1e-14 * (1.0 + radius)
            assert found.upper >= expected - 1e-14 * (1.0 + radius)
            assert found.upper - found.lower <= 1e-11 * (1.0 + radius)
        else:
            assert found.lower == 0.0


@pytest.mark.parametrize("gap", [1e-12, 1e-9, 1e-3])
@pytest.mark.parametrize("kind", ["outside", "interlocked", "tilted"])
def test_rings_that_nearly_touch(kind, gap):
    """30-digit circles confirm the gap."""
    apart = 0.3 + 0.2 + gap
    at = {
        "outside": translation(1.0 + 0.7 + apart, 0.0, 0.0),
        "interlocked": upright(1.0 - 0.7 + apart, 0.0, 0.0),
        "tilted": tilted(0.7, 1.0 + 0.7 + apart, 0.0, 0.0),
    }[kind]
    expected = circles_apart(1.0, 0.7, at) - 0.3 - 0.2
    assert expected == pytest.approx(gap, abs=1e-15)
    found = engine.distance(torus(1.0, 0.3), IDENTITY, torus(0.7, 0.2), at)
    assert found.lower <= expected + 1e-15 and found.upper >= expected - 1e-15
    assert found.upper - found.lower <= 4e-12


@pytest.mark.parametrize(
    "at", [translation(0.05, 0.0, 0.1), tilted(0.2), tilted(0.1, 0.02, 0.03, 0.04)]
)
def test_a_ring_in_the_tube_of_another(at):
    """The gap is the difference of the tubes' radii minus how far the inner circle strays."""
    expected = 0.4 - 0.02 - circles_apart(1.0, 0.95, at, most=True)
    found = engine.distance(torus(1.0, 0.4), IDENTITY, torus(0.95, 0.02), at)
    assert found.lower <= expected + 1e-14 and found.upper >= expected - 1e-14
    assert found.upper - found.lower <= 1e-10
    signed = engine.signed_distance(torus(1.0, 0.4), IDENTITY, torus(0.95, 0.02), at)
    assert signed.lower <= -0.04 <= signed.upper + 1e-12


@pytest.mark.parametrize("off", [0.0, 1e-12, 1e-9])
def test_a_link_of_a_chain_that_reaches_the_axis_of_the_other(off):
    """The nearest points lie near the axis, where they are hard to find."""
    at, link = upright(1.0, off), torus(1.0, 0.1)
    found = engine.distance(link, IDENTITY, link, at)
    expected = circles_apart(1.0, 1.0, at) - 0.2
    assert found.status is engine.Status.EXACT
    assert found.lower <= expected + 1e-14 and found.upper >= expected - 1e-14


def test_a_thin_ring_in_a_tube_that_is_nearest_in_two_places():
    """Halving a sector of almost a full turn leaves no gap: the second place would lie in it."""
    large, tube, radius, thin = 0.243192549, 0.204462611, 0.25129693, 2.47713013e-4
    at = tilted(8.0824013e-6, 3.91746048e-6, -2.35908564e-6, -2.06665678e-6)
    expected = tube - thin - circles_apart(large, radius, at, most=True)
    for turn in np.linspace(0.0, 2.0 * np.pi, 7)[1:]:
        cos, sin = math.cos(turn), math.sin(turn)
        turned = at @ [[cos, -sin, 0, 0], [sin, cos, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
        found = engine.distance(
            torus(large, tube), IDENTITY, torus(radius, thin), turned, budget_s=0.1
        )
        assert found.lower <= expected + 1e-15
        assert found.upper >= expected - 1e-15


@jit.entry
def part(angle, half, which):
    return half_of(angle, half, which)


part._cache = NullCache()


@pytest.mark.parametrize(
    "half", [math.pi, math.pi - 0.1, 3.05, 3.0 + 1e-12, 3.0, 2.9, 1.0, 1e-3, 1e-9]
)
def test_both_parts_of_a_sector_are_all_of_it(half):
    for angle in (0.3, 6.1, -2.0):
        parts = [part(angle, half, which) for which in (0, 1)]
        for aside in half * np.linspace(-1.0, 1.0, 2001):
            away = [abs(angle + aside - middle) for middle, _ in parts]
            away = [abs((each + math.pi) % (2.0 * math.pi) - math.pi) for each in away]
            wide = [each for _, each in parts]
            assert away[0] <= wide[0] + 1e-15 or away[1] <= wide[1] + 1e-15


@pytest.mark.parametrize("bulge", [1e-3, 1e-9, 1e-14, 0.0])
@pytest.mark.parametrize("at", [translation(2.5, 0.0, 0.1), tilted(0.6, 2.5)])
def test_arcs_that_are_nearly_straight(bulge, at):
    """The sides of two barrels are parabolas of height `bulge`; the oracle takes their middles."""
    corners = [(0.0, -1.0), (1.0, -1.0), (1.0, 1.0), (0.0, 1.0)]
    curves = [Curve(ends) for ends in itertools.pairwise(corners)]
    curves[1] = Curve([(1.0, -1.0), (1.0 + 2.0 * bulge, 0.0), (1.0, 1.0)])
    barrel = SolidOfRevolution(curves)
    found = engine.distance(barrel, IDENTITY, barrel, at)
    low = 0.5 - 2.0 * bulge
    # If the middles differ in height, the nearest points are a little off them.
    assert found.lower <= low + 0.01 * bulge + 1e-15 and found.upper >= low - 1e-15
    # Bounds do not see a bend that is smaller than their resolution.
    assert found.upper - found.lower <= 1e-10 + 2.0 * bulge


def test_two_profiles_of_500_spans():
    """The axes are parallel, so the nearest points lie in their plane. Scipy samples it."""
    count = 503
    knots = np.concatenate((np.zeros(3), np.arange(501.0), np.full(3, 500.0)))
    z = np.linspace(0.0, 1.0, count)
    nets = []
    for pace in (1.0, 1.3):
        rho = 0.2 + 0.02 * np.sin(pace * np.arange(count)) + 0.05 * np.sin(9.0 * pace * z)
        rho[[0, -1]] = 0.0
        nets.append(np.column_stack((rho, z)))
    solids = [SolidOfRevolution([Curve(net, knots)]) for net in nets]
    t = np.linspace(0.0, 500.0, 60_001)
    one, other = (BSpline(knots, net, 3)(t) for net in nets)
    near = cKDTree(one)
    for apart, up in ((0.7, 0.013), (0.6, -0.4), (1.5, 0.9)):
        away, _ = near.query([apart, up] + other * [-1.0, 1.0])
        found = engine.distance(solids[0], IDENTITY, solids[1], translation(apart, 0.0, up))
        assert found.lower <= away.min() and found.upper == pytest.approx(away.min(), abs=1e-6)
        assert found.upper - found.lower <= 1e-10
