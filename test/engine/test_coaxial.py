"""Nested solids of revolution about the same axis, or nearly so, such as shafts in bores."""

import functools
import itertools
import math

import numpy as np
import pytest
from engine_bodies import IDENTITY, from_python, translation
from numba import njit
from scipy.optimize import minimize_scalar
from test_revolution import ball, cylinder, torus, vase
from test_rings import SOLIDS, TURNED, patches

from proximity_monitor import engine
from proximity_monitor.engine import Curve, SolidOfRevolution, Status
from proximity_monitor.engine.kernels.base.linking import ROOT
from proximity_monitor.engine.kernels.base.tables import tree_at
from proximity_monitor.engine.kernels.base.trees import RevolutionTree
from proximity_monitor.engine.kernels.revolution import bound, certificate, coaxial, newton

_nearest_rings, _nearest_at_ends = newton.nearest_rings, newton.nearest_at_ends
_least_around = certificate.least_around
between_circles, _begin_of = from_python(coaxial.between_circles), bound.begin_of
SMALL = [0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.03]


@njit(pipeline_class=ROOT)
def begin_of(table, b, sector, motion, normal, azimuth):
    solid, _ = tree_at(RevolutionTree, table)
    none = solid.arcs[:0]
    return _begin_of(solid, none, b, 1e-9, sector, motion, normal, azimuth, np.inf)


@njit(pipeline_class=ROOT)
def proven(table_a, table_b, a, b, motion, start, extent, aside, wanted):
    """Return the least distance proven in a box beside a minimum, its middle angle, and its limits.

    `extent` holds half sizes: two curve parameters and an angle. `aside` is the offset from the
    minimum as a share of these.
    """
    (one, _), (other, _) = tree_at(RevolutionTree, table_a), tree_at(RevolutionTree, table_b)
    arc_a, arc_b = one.arcs[a], other.arcs[b]
    curves = one.curves[arc_a.curve], other.curves[arc_b.curve]
    found = _nearest_rings(*curves, motion, start[0], start[1], start[2], 0.0, 0.0)
    _, s, t, angle = _nearest_at_ends(*curves, motion, found, 0.0, 0.0)
    ds, dt, half = extent
    s, t = min(max(s + aside[0] * ds, 0.0), 1.0), min(max(t + aside[1] * dt, 0.0), 1.0)
    angle += aside[2] * half
    box = max(s - ds, 0.0), min(s + ds, 1.0), max(t - dt, 0.0), min(t + dt, 1.0), half
    least = _least_around(*curves, arc_a, arc_b, motion, (s, t, angle), box, np.inf, wanted)
    return least, angle, box


def turn(tilt, around=0.0):
    """Return a rotation by `tilt` about the y axis, which is turned by `around` about z."""
    c, s, made = math.cos(tilt), math.sin(tilt), np.eye(4)
    made[:3, :3] = [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]
    spin = np.eye(4)
    spin[:2, :2] = [[math.cos(around), -math.sin(around)], [math.sin(around), math.cos(around)]]
    return spin @ made @ spin.T


def lines(*points):
    """Return a solid whose profile runs straight from point to point."""
    points = np.array(points, float)
    return SolidOfRevolution([Curve(points[k : k + 2]) for k in range(len(points) - 1)])


def bore(radius, half):
    """Return a tube from z = -half to half."""
    wide = radius + 0.2
    return lines((radius, -half), (wide, -half), (wide, half), (radius, half), (radius, -half))


def socket(radius):
    """Return a block with half a ball removed from its top."""
    block = [Curve([(0, -1), (1, -1)]), Curve([(1, -1), (1, 0)]), Curve([(1, 0), (radius, 0)])]
    quarter = [(radius, 0), (radius, -radius), (0, -radius)]
    hollow = Curve(quarter, [0, 0, 0, 1, 1, 1], [1.0, math.sqrt(0.5), 1.0])
    return SolidOfRevolution([*block, hollow])


NESTED = {
    "shaft in a bore": (cylinder(0.5, 0.5), bore(0.6, 0.5), IDENTITY, 0.1),
    "higher": (cylinder(0.5, 0.5), bore(0.6, 0.5), translation(0, 0, 0.3), 0.1),
    "upside down": (cylinder(0.5, 0.5), bore(0.6, 0.5), translation(0, 0, 0.3) @ TURNED, 0.1),
    "off the axis": (cylinder(0.5, 0.5), bore(0.6, 0.5), translation(0.03, 0.04, 0.1), 0.05),
    "nearly coaxial": (cylinder(0.5, 0.5), bore(0.6, 0.5), translation(1e-9, 0, 0), 0.1 - 1e-9),
    "cylinder in cylinder": (cylinder(0.5, 0.5), cylinder(0.6, 0.7), translation(0, 0, -0.1), 0.1),
    "concentric rings": (torus(1.0, 0.3), torus(2.0, 0.2), IDENTITY, 0.5),
    "ball in a ring": (ball(0.5), torus(1.0, 0.3), IDENTITY, 0.2),
    "ball in a ball": (ball(0.5), ball(0.25), IDENTITY, 0.25),
    "out of the middle": (ball(0.5), ball(0.25), translation(0.12, 0, 0.09), 0.1),
    "ring in a ring": (torus(1.0, 0.3), torus(1.0, 0.1), IDENTITY, 0.2),
    "ball in its socket": (ball(0.5), socket(0.55), IDENTITY, 0.05),
}


@pytest.mark.parametrize("name", NESTED)
def test_continua_of_nearest_points_have_exact_distances(name):
    """Without bounds about one axis, these searches fill the room for pairs in 25 ms, unsettled."""
    a, b, at, expected = NESTED[name]
    for found in (engine.distance(a, IDENTITY, b, at), engine.distance(b, at, a, IDENTITY)):
        assert found.status is Status.EXACT
        assert found.lower <= expected + 1e-15 and found.upper >= expected - 1e-12
        assert found.upper - found.lower < 1e-11
        assert found.bound_tests < 400
        gap = np.linalg.norm(found.point_a - found.point_b)
        assert gap == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("tilt", [0.0, 1e-6, 1e-3])
@pytest.mark.parametrize("height", [-0.25, 0.1])
def test_a_shaft_that_is_too_wide_crosses_its_bore(tilt, height):
    shaft, tube = cylinder(0.61, 0.5), bore(0.6, 0.5)
    at = translation(0, 0, height) @ turn(tilt)
    for found in (
        engine.distance(shaft, at, tube, IDENTITY), engine.distance(tube, IDENTITY, shaft, at),
    ):  # fmt: skip
        assert found.status is Status.INTERSECTING
        assert found.upper < 1e-12
        assert found.bound_tests < 500
    deep = engine.signed_distance(shaft, at, tube, IDENTITY)
    assert deep.upper == pytest.approx(-0.01, rel=0.1)
    assert deep.status is Status.WITHIN_TOLERANCE


@pytest.mark.parametrize(("tilt", "off"), [*itertools.product([*SMALL, 0.1], SMALL)])
def test_a_tilted_shaft_in_a_long_bore(tilt, off):
    """The nearest point is on one of the shaft's rims; the gap is perpendicular to the wall."""
    radius, length, wide = 0.5, 0.6, 0.65
    shaft, tube = cylinder(radius, length), bore(wide, 1.2)
    at = translation(off, 0.4 * off, 0.1) @ turn(tilt, 0.7)

    # The shaft's ends are at z = 0 and z = length.
    def within(angle, side):
        rim = (radius * math.cos(angle), radius * math.sin(angle), side * length)
        return -math.hypot(*(at[:3, :3] @ rim + at[:3, 3])[:2])

    farthest, angles = 0.0, np.linspace(0.0, 2.0 * math.pi, 400)
    for side in (0.0, 1.0):
        first = min(angles, key=lambda angle: within(angle, side))
        nearby = {"bounds": (first - 0.02, first + 0.02), "method": "bounded"}
        found = minimize_scalar(within, args=(side,), options={"xatol": 1e-12}, **nearby)
        farthest = max(farthest, -found.fun, -within(first, side))
    expected = wide - farthest
    for found in (
        engine.distance(shaft, at, tube, IDENTITY), engine.distance(tube, IDENTITY, shaft, at),
    ):  # fmt: skip
        assert found.status is Status.EXACT
        assert found.lower <= expected + 1e-14 and found.upper >= expected - 1e-12
        assert found.upper - found.lower < 1e-11
        assert found.bound_tests < 4000


@pytest.mark.parametrize("seed", range(12))
def test_nested_solids_as_their_patches(seed):
    rng = np.random.default_rng(seed)
    outer = [bore(0.6, 0.5), torus(2.0, 0.4), socket(0.9), lines((0, -1), (2, -1), (1, 1), (0, 1))]
    inner = [vase(), ball(0.3), SOLIDS["wavy"], SOLIDS["rational"]]
    a, b = outer[rng.integers(4)], inner[rng.integers(4)]
    tilt, (x, y) = rng.choice(SMALL), rng.choice(SMALL) * rng.normal(size=2)
    at = translation(x, y, rng.uniform(-1.5, 0.5)) @ turn(tilt, rng.uniform(0.0, 6.0))
    at = at @ TURNED if seed % 2 else at
    expected = engine.distance(patches(a), IDENTITY, patches(b), at, rel_err=1e-3, abs_err=1e-4)
    for found in (
        engine.distance(a, IDENTITY, b, at), engine.distance(b, at, a, IDENTITY),
        engine.distance(a, IDENTITY, b, at, rel_err=1e-3),
    ):  # fmt: skip
        assert found.lower <= expected.upper + 1e-12
        assert found.upper >= expected.lower - 1e-12
        assert found.status is not Status.OUT_OF_TIME


def points_under(solid, arc, count):
    """Return points (k, 2) of the profile under an arc; of all of it if the arc has no piece."""
    curves = solid._hierarchy.curves
    t = np.linspace(arc["low"], arc["high"], count)
    made = []
    for curve in curves if arc["curve"] < 0 else curves[[arc["curve"]]]:
        net = solid.profile.nets[curve["patch"]]
        at = curve["low"] + t * (curve["high"] - curve["low"])
        made.append(net.derivatives(at, np.zeros(count), 0)[:, 0, 0, :2])
    return np.concatenate(made)


def motion_of(at):
    return np.append(at[:3, :3].ravel(), at[:3, 3])


@pytest.mark.long
@pytest.mark.parametrize("name", ["vase", "torus", "cylinder", "rational", "many spans"])
def test_no_point_begins_before_its_bound(name):
    """The bound holds for any tilt, sector and direction. About one axis, it is tight."""
    solid, rng, tight = SOLIDS[name], np.random.default_rng(len(name)), 0
    hierarchy = solid._hierarchy
    single = np.flatnonzero(hierarchy.arcs["curve"] >= 0)
    under = functools.cache(lambda arc: points_under(solid, hierarchy.arcs[arc], 9))
    for case in range(400):
        which = 0 if case % 4 == 0 else rng.choice(single)
        tilt, off = rng.choice([*SMALL, 0.1, 0.4]), rng.choice([*SMALL, 0.3])
        at = translation(*(off * rng.normal(size=2)), rng.normal()) @ turn(tilt, rng.uniform(0, 6))
        at = at @ TURNED if case % 2 else at
        angle, half = rng.uniform(0.0, 6.0), rng.choice([1e-3, 0.1, 1.0, 2.0, math.pi])
        n = rng.normal(size=2)
        n = (n[0] / math.hypot(*n), n[1] / math.hypot(*n))
        e = rng.uniform(0.0, 6.0)
        sector = (math.cos(angle), math.sin(angle), math.cos(half), math.sin(half))
        if half == math.pi:
            sector = (1.0, 0.0, -1.0, 0.0)
        begin = begin_of(
            hierarchy.table, which, sector, motion_of(at), n, (math.cos(e), math.sin(e))
        )
        rho, z = under(which).T[:, :, None]
        phi = angle + half * np.linspace(-1.0, 1.0, 129)
        points = np.stack(np.broadcast_arrays(rho * np.cos(phi), rho * np.sin(phi), z))
        x, y, z = np.tensordot(at[:3, :3], points, 1) + at[:3, 3][:, None, None]
        first = (n[0] * np.hypot(x, y) + n[1] * z).min()
        assert begin <= first + 1e-14
        tight += tilt <= 1e-9 and off <= 1e-9 and begin >= first - 0.02
    assert tight > 40


def test_no_points_are_nearer_than_their_circles():
    rng, some = np.random.default_rng(4), 0
    solids = [ball(0.5), ball(0.2), torus(1.0, 0.3), torus(1.0, 0.1), vase()]
    for case in range(300):
        a, b = (solids[k] for k in rng.integers(len(solids), size=2))
        arcs = [
            rng.choice(each._hierarchy.arcs[each._hierarchy.arcs["sine"] != 0]) for each in (a, b)
        ]
        tilt = rng.choice([*SMALL, 2.0])
        off = rng.choice(SMALL) * rng.normal(size=3)
        at = translation(*off) @ turn(tilt, rng.uniform(0.0, 6.0))
        at = at @ TURNED if case % 2 else at
        found = between_circles(*arcs, motion_of(at))
        p, q = points_under(a, arcs[0], 25), points_under(b, arcs[1], 25)
        phi = np.linspace(0.0, 6.3, 60)
        x, y, z = np.broadcast_arrays(q[:, :1] * np.cos(phi), q[:, :1] * np.sin(phi), q[:, 1:])
        x, y, z = np.tensordot(at[:3, :3], np.stack((x, y, z)), 1) + at[:3, 3][:, None, None]
        rho, z = np.hypot(x, y).ravel(), z.ravel()
        apart = np.hypot(p[:, :1] - rho, p[:, 1:] - z).min()
        assert found <= apart + 1e-14
        some += found > 0.5 * apart
    assert some > 20


@pytest.mark.parametrize("wanted", [-1.0, 1e-3, math.inf])
def test_nothing_around_a_minimum_is_nearer_than_is_proven(wanted):
    """The profiles are nearly parallel lines, and other curves."""
    inner = [
        cylinder(0.5, 0.6),
        SOLIDS["wavy"],
        lines((0, 0), (0.4, 0), (0.3, 1), (0, 1)),
        ball(0.4),
    ]
    outer = [bore(0.65, 1.2), torus(1.5, 0.4), lines((0, -1), (0.7, -1), (0.8, 1), (0, 1))]
    rng, known = np.random.default_rng(8), 0
    for case in range(600):
        a, b = inner[rng.integers(4)], outer[rng.integers(3)]
        at = translation(*(rng.choice(SMALL) * rng.normal(size=2)), rng.uniform(-0.5, 0.5))
        at = at @ turn(rng.choice([*SMALL, 0.3]), rng.uniform(0.0, 6.0))
        at = at @ TURNED if case % 3 == 0 else at
        if case % 2:
            a, b, at = b, a, np.linalg.inv(at)
        arcs = [each._hierarchy.arcs for each in (a, b)]
        whole = [
            np.flatnonzero((own["high"] - own["low"] == 1.0) & (own["curve"] >= 0)) for own in arcs
        ]
        chosen = [rng.choice(each) for each in whole]
        extent = tuple(10.0 ** rng.uniform(-4.0, 0.0, 3) * [1.0, 1.0, 0.3])
        motion, tables = motion_of(at), [each._hierarchy.table for each in (a, b)]
        start = *rng.uniform(size=2), rng.uniform(0.0, 6.0)
        aside = tuple(rng.choice([0.0, 0.3]) * rng.uniform(-1.0, 1.0, 3))
        given = motion, start, extent, aside, wanted
        least, angle, box = proven(*tables, *chosen, *given)
        if least < 0.0:
            continue
        known, half = known + 1, box[4]
        one, other = (own[[k]][0] for own, k in zip(arcs, chosen, strict=True))
        one["low"], one["high"], other["low"], other["high"] = box[:4]
        p, q = points_under(a, one, 17), points_under(b, other, 17)
        phi = angle + half * np.linspace(-1.0, 1.0, 41)
        x, y, z = np.broadcast_arrays(q[:, :1] * np.cos(phi), q[:, :1] * np.sin(phi), q[:, 1:])
        x, y, z = np.tensordot(at[:3, :3], np.stack((x, y, z)), 1) + at[:3, 3][:, None, None]
        rho, z = np.hypot(x, y).ravel(), z.ravel()
        assert least <= np.hypot(p[:, :1] - rho, p[:, 1:] - z).min() + 1e-13
    assert known > 25


@pytest.mark.parametrize("off", [1e-9, 1e-7, 1e-5, 1e-3])
def test_an_end_on_the_axis_beside_an_axis_that_is_nearly_the_same(off):
    """The distance from the other axis bends most there, and halving sectors does not help."""
    ring = lines((0.4, 0), (0.6, -0.2), (0.6, 0.2), (0.4, 0))
    plug = lines((0, -0.4), (0.3, -0.4), (0, 0.5))
    beside = translation(off, 0.0, 0.0)
    found = engine.distance(ring, IDENTITY, plug, beside)
    swapped = engine.distance(plug, beside, ring, IDENTITY)
    assert found.status is swapped.status is Status.EXACT
    assert found.lower <= swapped.upper and swapped.lower <= found.upper
    # The nearest point of the cone lies in the plane of both axes, on the ring's near side.
    cone = np.array([0.9, 0.3]) / math.hypot(0.9, 0.3)
    assert found.upper == pytest.approx(cone @ (0.4 - off, -0.5), abs=1e-12)


def test_steep_lines_that_cross_flat_ones_about_one_axis():
    """Their chords may seem far apart at first, but the search must still find the minimum."""
    rng = np.random.default_rng(77)
    for _ in range(60):
        narrow, high, below, more = rng.uniform([0.3, 0.4, 0.001, 0.0], [0.6, 0.6, 0.04, 0.05])
        one = lines((0, 0), (narrow, 0), (0.8, high), (0, high))
        rim, top = 0.8 + more, high - below
        other = lines((0, -0.4), (rim, -0.4), (rim - 0.01, top), (0, top))
        found = engine.distance(one, IDENTITY, other, IDENTITY)
        assert found.status is Status.INTERSECTING and found.upper < 1e-12


def test_no_yes_is_decided_that_no_points_attain():
    """Memory ends before the answer is known: an edge bends almost like the ring beside it."""
    ring, tube = (
        torus(1.0, 0.1),
        lines((1.9, -0.1), (2.1, -0.1), (2.1, 0.1), (1.9, 0.1), (1.9, -0.1)),
    )
    at = translation(0.0, 0.0, 1.0) @ turn(math.pi / 4)
    found = engine.distance(ring, IDENTITY, tube, at)
    assert found.status is Status.OUT_OF_TIME
    for share in (-0.1, 0.3, 0.5, 0.7, 1.1):
        clearance = found.lower + share * (found.upper - found.lower)
        answer = engine.within(ring, IDENTITY, tube, at, clearance)
        assert answer.decided == (answer.lower > clearance or answer.upper <= clearance)
