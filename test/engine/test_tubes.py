"""Solids of revolution that are spheres or tori: distances from the circle of their centres."""

import math
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from engine_bodies import pose
from test_coaxial import bore, lines, socket, turn
from test_revolution import ball, cylinder, torus, vase

from proximity_monitor import engine
from proximity_monitor.engine import Curve, SolidOfRevolution
from proximity_monitor.engine.models.tube import tube_of

CUP = lines((0, 0), (1, 1.5), (1.2, 1.5), (0.2, -0.2), (0, -0.2))
HELD = {
    "bore": (bore(0.5, 1.0), 0.2, 0.2),
    "cup": (CUP, 0.8, None),
    "socket": (socket(0.5), 0.1, None),
    "cylinder": (cylinder(0.5, 1.0), 1.7, 0.4),
    "vase": (vase(), 1.7, None),
    "torus": (torus(1.0, 0.2), 0.3, math.hypot(1.0, 0.3) - 0.5),
}
ROUND = 1e-11


def as_centre_tells(solid, at_solid, sphere, at_sphere, radius):
    """Check a sphere's distance, in either order, against that of its centre. Return it."""
    away = engine.closest_points(solid, at_solid, at_sphere[None, :3, 3])
    for asked in ((solid, at_solid, sphere, at_sphere), (sphere, at_sphere, solid, at_solid)):
        found = engine.distance(*asked)
        assert found.lower <= max(away.upper[0] - radius, 0.0) + ROUND
        assert found.upper >= max(away.lower[0] - radius, 0.0) - ROUND
        assert found.upper - found.lower < ROUND
        assert np.linalg.norm(found.point_a - found.point_b) == pytest.approx(
            found.upper, abs=ROUND
        )
    return found


@pytest.mark.parametrize("tilt", [0.0, 1e-9, 1e-3, 0.3, 1.2, math.pi / 2.0, 3.0])
@pytest.mark.parametrize("name", HELD)
def test_a_ball_on_an_axis_has_an_exact_distance_however_it_is_turned(name, tilt):
    """A circle, or a point on the axis, is nearest. The ball's centre alone gives the distance."""
    holder, height, truth = HELD[name]
    frame, there = pose(np.random.default_rng(5), 2.0), turn(tilt, 0.7)
    there[2, 3] = height
    found = as_centre_tells(holder, frame, ball(0.3), frame @ there, 0.3)
    assert found.bound_tests < 300
    if truth is not None:
        assert found.upper == pytest.approx(truth, abs=1e-12)


@pytest.mark.parametrize("name", HELD)
def test_a_ball_anywhere_is_as_far_as_its_centre_tells(name):
    holder, rng = HELD[name][0], np.random.default_rng(6)
    for radius in (1e-6, 0.05, 0.3, 3.0):
        held = ball(radius)
        for _ in range(20):
            at_one, at_other = pose(rng, 1.0), pose(rng, 3.0)
            away = engine.closest_points(holder, at_one, at_other[None, :3, 3])
            if away.lower[0] > radius:
                as_centre_tells(holder, at_one, held, at_other, radius)


def test_a_ball_around_another_solid_is_searched_as_any_other():
    """The ball's centre is of no use here, and no bound is taken from it."""
    inner, outer = lines((0, -0.4), (0.3, -0.4), (0.3, 0.4), (0, 0.4)), ball(1.0)
    found = engine.distance(outer, turn(0.4), inner, turn(1.0))
    assert found.lower - ROUND <= 0.5 <= found.upper + ROUND
    assert found.upper - found.lower < 1e-4


@pytest.mark.long
@pytest.mark.parametrize("gap", [1e-3, 1e-9, 1e-12, 1e-14, 0.0])
@pytest.mark.parametrize("name", ["bore", "cylinder", "torus", "ball"])
def test_a_ball_that_almost_touches_takes_one_bound(name, gap):
    """The ball is outside the other solid or inside it, as in a torus's tube or a larger ball."""
    holder = ball(0.7) if name == "ball" else HELD[name][0]
    rng, looked = np.random.default_rng(8), 0
    for _ in range(20):
        at = pose(rng, 1.0)
        radius = engine.closest_points(holder, np.eye(4), at[None, :3, 3]).upper[0] - gap
        if radius > 0.01:
            looked += 1
            as_centre_tells(holder, np.eye(4), ball(radius), at, radius)
            found = engine.distance(holder, np.eye(4), ball(radius), at)
            assert found.bound_tests <= 2
    assert looked > 10


def test_spheres_and_tori_are_told_from_what_is_nearly_one():
    half = math.sqrt(0.5)

    def egg(wide, middle, above=1.0):
        profile = [(0, -1), (wide, -1), (wide, 0), (wide, above), (0, above)]
        points = np.add(profile, (0.0, middle))
        return SolidOfRevolution([Curve(points, [0, 0, 0, 1, 1, 2, 2, 2], [1, half, 1, half, 1])])

    for middle in (0.0, 5.0, -1e3):
        centre, radius, around = tube_of(egg(1.0, middle).profile)
        assert (centre, around) == (middle, 0.0)
        assert 0.0 <= radius - 1.0 < 1e-12 * (1.0 + abs(middle))
    for small in (1e-9, 1e-3, 0.2, 0.999):
        centre, radius, around = tube_of(torus(1.0, small).profile)
        assert (centre, around) == pytest.approx((0.0, 1.0), abs=1e-15)
        assert 0.0 <= radius - small < 1e-13
    for wide, above in ((1.0 + 1e-9, 1.0), (1.0, 1.0 + 1e-9), (0.9, 1.0)):
        assert tube_of(egg(wide, 0.0, above).profile) == (0.0, 0.0, 0.0)
    square = lines((1, 0), (2, 0), (2, 1), (1, 1), (1, 0))
    oval = torus(1.0, 0.2)
    oval.deform(oval.control_points * (1.0, 1.0, 1.0 + 1e-9))
    for solid in (cylinder(0.5, 1.0), vase(), socket(0.5), square, oval):
        assert tube_of(solid.profile) == (0.0, 0.0, 0.0)


QUARTERS = (
    [(0, -1), (1, -1), (1, 0)], [(1, 0), (1, 1), (0, 1)], [(0, 1), (-1, 1), (-1, 0)],
    [(-1, 0), (-1, -1), (0, -1)],
)  # fmt: skip


def test_no_point_of_a_circle_is_beyond_its_radius():
    """The oracle is exact sums of fractions, for quarters of degree 2 and 3, of both kinds."""
    rng = np.random.default_rng(7)
    for k in range(40):
        split, size = rng.uniform(0.3, 0.7), 10.0 ** rng.uniform(-3, 3)
        around = size * 10.0 ** rng.uniform(0.1, 3) if k % 4 > 1 else 0.0
        middle, curves = (around, rng.normal() * size), []
        for quarter in QUARTERS if around else QUARTERS[:2]:
            w = np.array([1.0, math.sqrt(0.5), 1.0])
            rows = np.column_stack((np.array(quarter) * size + middle, np.ones(3)))
            rows *= w[:, None]
            if k % 2:
                rows = np.array(
                    [rows[0], rows[:2].T @ (1, 2) / 3, rows[1:].T @ (2, 1) / 3, rows[2]]
                )
            ends = [0] * len(rows), [1] * len(rows)
            curves.append(Curve(rows[:, :2] / rows[:, 2:], np.concatenate(ends), rows[:, 2]))
        made = SolidOfRevolution(curves)
        centre, radius, found = tube_of(made.profile)
        assert radius > 0.0 and found == pytest.approx(around, rel=1e-12)
        assert radius - size < 1e-13 * (size + around + abs(middle[1]))
        for pieces in made.profile.pieces:
            for rows in pieces:
                control = [[Fraction(float(x)) for x in row] for row in rows]
                for t in (Fraction(float(split)), Fraction(1, 3), Fraction(0), Fraction(1)):
                    each = control
                    while len(each) > 1:
                        each = [
                            [(1 - t) * x + t * y for x, y in zip(p, q, strict=True)]
                            for p, q in pairwise(each)
                        ]
                    x, z, w = each[0]
                    square = (x / w - Fraction(found)) ** 2 + (z / w - Fraction(centre)) ** 2
                    assert square <= Fraction(radius) ** 2
