"""Solids of revolution at their limits: many spans, the axis, ratios of radii, bad shapes."""

import itertools
import math

import numpy as np
import pytest
from engine_bodies import IDENTITY, translation
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation

from proximity_monitor import engine
from proximity_monitor.engine import Curve, ModelError, SolidOfRevolution

HALF = math.sqrt(0.5)
RIM = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)])


def turned(*corners, **how):
    """Return the solid that a polygon sweeps about the axis."""
    return SolidOfRevolution([Curve(ends) for ends in itertools.pairwise(corners)], **how)


def cylinder(radius, height):
    return turned((0, 0), (radius, 0), (radius, height), (0, height))


def torus(large, small):
    knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
    points = [large, 0.0] + small * RIM
    return SolidOfRevolution([Curve(points, knots, [1, HALF] * 4 + [1])])


def to_point(model, x, z):
    """Return the distance to a point (x, z) of the profile's half-plane."""
    found = engine.distance(model, IDENTITY, engine.points([[x, 0.0, z]]), IDENTITY)
    assert found.lower <= found.upper
    return found


def from_polyline(points, corners):
    """Return the least distance of points from a polyline of the plane."""
    p, way = corners[:-1], np.diff(corners, axis=0)
    from_p = points[:, None] - p
    share = np.clip((from_p * way).sum(-1) / (way * way).sum(-1), 0.0, 1.0)
    return np.linalg.norm(from_p - share[..., None] * way, axis=-1).min()


def test_a_profile_of_500_spans():
    """The oracle is the distance to points of the profile by scipy, in the half-plane."""
    count = 503
    z = np.linspace(0.0, 1.0, count)
    rho = 0.2 + 0.02 * np.sin(np.arange(count)) + 0.05 * np.sin(9.0 * z)
    rho[[0, -1]] = 0.0
    knots = np.concatenate((np.zeros(3), np.arange(501.0), np.full(3, 500.0)))
    points = np.column_stack((rho, z))
    made = SolidOfRevolution([Curve(points, knots)])
    assert made.is_solid
    outline = BSpline(knots, points, 3)(np.linspace(0.0, 500.0, 400_001))
    rng = np.random.default_rng(5)
    for x, height in rng.uniform([0.0, -0.2], [0.6, 1.2], (12, 2)):
        found = to_point(made, x, height)
        near = np.linalg.norm(outline - [x, height], axis=1).min()
        assert found.lower <= near and found.upper == pytest.approx(near, abs=1e-6)
    moved = made.deform(points * [1.1, 1.0])
    assert moved == pytest.approx(0.1 * rho.max())
    assert len(made.control_points) == count


def test_two_cones_that_touch_in_a_point_of_the_axis():
    made = turned((0, 0), (1, 0), (0, 1), (1, 2), (0, 2))
    assert made.is_solid
    assert to_point(made, 0.5, 1.0).upper == pytest.approx(0.5 * HALF, abs=1e-12)
    signed = engine.closest_points(made, IDENTITY, [[0.3, 0, 0.3], [0, 0, 1.0]], signed=True)
    assert signed.upper[0] == pytest.approx(-0.4 * HALF, abs=1e-11)
    assert signed.lower[1] <= 0.0 <= signed.upper[1] + 1e-12


@pytest.mark.parametrize("ratio", [1e-6, 1e6])
def test_ratios_of_radii(ratio):
    """A wire or a plate, whose larger size is 1, and a hair-thin ring."""
    radius, height = (ratio, 1.0) if ratio < 1.0 else (1.0, 1.0 / ratio)
    made = cylinder(radius, height)
    found = to_point(made, 2.0, 0.5 * height)
    assert found.lower <= 2.0 - radius <= found.upper + 1e-15
    assert found.upper - found.lower < 1e-11
    beside = engine.distance(made, IDENTITY, made, translation(3.0, 0.0, 0.0))
    assert beside.upper == pytest.approx(3.0 - 2.0 * radius, abs=1e-12)
    ring = torus(1.0, 1e-6)
    assert to_point(ring, 0.0, 0.0).upper == pytest.approx(1.0 - 1e-6, abs=1e-12)
    size = 1e3 if ratio > 1.0 else 1e-3
    small = torus(size, 0.3 * size)
    found = to_point(small, size, size)
    assert found.upper == pytest.approx(0.7 * size, rel=1e-12)


def test_where_the_middle_of_the_tube_is_on_the_axis():
    """With R = 0 a torus is a ball. With R < r it crosses its axis, and its outer part is left."""
    arc = Curve([[0, -1], [1, -1], [1, 0], [1, 1], [0, 1]], [0, 0, 0, 1, 1, 2, 2, 2],
                [1, HALF, 1, HALF, 1])  # fmt: skip
    ball = SolidOfRevolution([arc])
    rng = np.random.default_rng(2)
    for _ in range(5):
        at = rng.normal(size=3)
        at *= rng.uniform(2.01, 4.0) / np.linalg.norm(at)
        found = engine.distance(ball, IDENTITY, ball, translation(*at))
        assert found.lower <= np.linalg.norm(at) - 2.0 + 1e-15
        assert found.upper == pytest.approx(np.linalg.norm(at) - 2.0, abs=1e-12)
    # The outer part ("apple") of a torus of R = 0.5 and r = 1. Its ends are at +-sqrt(3) / 2.
    angle = math.acos(-0.5)
    half = 0.5 * angle
    corners = [(0.5 + math.cos(a), math.sin(a)) for a in (-angle, 0.0, angle)]
    middles = [(0.5 + math.cos(a) / math.cos(half), math.sin(a) / math.cos(half))
               for a in (-half, half)]  # fmt: skip
    net = [corners[0], middles[0], corners[1], middles[1], corners[2]]
    net[0] = (0.0, net[0][1])
    net[-1] = (0.0, net[-1][1])
    weights = [1, math.cos(half), 1, math.cos(half), 1]
    apple = SolidOfRevolution([Curve(net, [0, 0, 0, 1, 1, 2, 2, 2], weights)])
    assert to_point(apple, 3.0, 0.0).upper == pytest.approx(1.5, abs=1e-12)
    assert to_point(apple, 0.5, 2.0).upper == pytest.approx(1.0, abs=1e-12)
    assert to_point(apple, 0.0, 2.0).upper == pytest.approx(math.hypot(0.5, 2.0) - 1.0, abs=1e-12)


@pytest.mark.parametrize(
    ("one", "other", "apart", "expected"),
    [
        (lambda: torus(1.0, 0.1), lambda: torus(1.0, 0.2), 1.0, 0.7),
        (lambda: cylinder(0.5, 1.0), lambda: cylinder(0.7, 0.2), 1.5, 0.5),
        (lambda: torus(1.0, 0.1), lambda: cylinder(0.4, 1.0), -0.5, 0.5),
    ],
    ids=["tori", "discs", "shaft in a ring"],
)
def test_coaxial_solids_whose_nearest_points_are_a_continuum(one, other, apart, expected):
    found = engine.distance(one(), IDENTITY, other(), translation(0.0, 0.0, apart), abs_err=1e-4)
    assert found.lower <= expected <= found.upper
    assert found.upper - found.lower <= 1.01e-4


@pytest.mark.parametrize(
    ("one", "other", "off", "up"),
    [
        ([(0, -0.0846), (0.577, 0), (0, 0.0857)], [(0, -6.2e-6), (0.352, 0), (0, 3.1e-4)], 3e-5, 0),
        ([(0, -0.381), (0.0239, 0), (0, 0.381)], [(0, -0.762), (0.109, 0), (0, 0.762)], 3e-9, 6e-6),
        ([(0, -0.349), (1.3e-4, 0), (0, 0.349)], [(0, -0.825), (0.0166, 0), (0, 0.825)], 3e-9, 0),
        ([(0, -1.9e-5), (0.603, 0), (0, 9e-6)], [(0, -2e-3), (0.896, 0), (0, 5e-4)], 1e-3, 1.5e-4),
    ],
    ids=["flat in steep", "thin in thick", "needle", "flat in flat"],
)
def test_cones_at_small_angles_about_nearly_one_axis(one, other, off, up):
    """Both orders have to end, though `facing` is far off for chords at a small angle."""
    one, other = np.array(one, float), np.array(other, float)
    a, b, there = turned(*one), turned(*other), translation(off, 0.0, up)
    there_b = other + np.array([0.0, up])
    apart = min(from_polyline(there_b, one), from_polyline(one, there_b))
    for models in ((a, IDENTITY, b, there), (b, there, a, IDENTITY)):
        found = engine.distance(*models)
        assert found.upper - found.lower <= 1e-10
        assert found.lower <= apart + off and found.upper >= apart - off
        assert found.bound_tests < 5000


def turned_by(angle, axis):
    """Return the pose of a turn about the x, y or z axis."""
    made = np.eye(4)
    made[:3, :3] = Rotation.from_euler(axis, angle).as_matrix()
    return made


@pytest.mark.parametrize("gap", [1e-9, 1e-7, 1e-5])
@pytest.mark.parametrize("roll", [1e-9, 0.3])
@pytest.mark.parametrize("lying", [True, False], ids=["on its side", "upright beside a side"])
def test_a_cylinder_rolled_about_its_own_axis_next_to_a_flat_face(lying, roll, gap):
    """The nearest points are a line, and the azimuth between two of them has half the digits."""
    flat, side = cylinder(3.0, 1.0), cylinder(0.5, 2.0)
    lies = turned_by(math.pi / 2.0, "y")
    at = translation(0.0, 0.0, 1.5 + gap) @ lies
    if not lying:
        flat, side = side, cylinder(0.4, 1.0)
        at = translation(0.5 + gap, 0.0, 0.7) @ lies
    a, b = (flat, turned_by(roll, "z")), (side, at @ turned_by(1.7 * roll, "z"))
    for models in ((*a, *b), (*b, *a)):
        found = engine.distance(*models)
        assert found.lower <= gap <= found.upper + 1e-15
        assert found.upper - found.lower <= 1e-11
        assert found.bound_tests < 1000


def ball(radius):
    return SolidOfRevolution(
        [Curve([(0, -radius), (radius, -radius), (radius, 0)], weights=[1, HALF, 1]),
         Curve([(radius, 0), (radius, radius), (0, radius)], weights=[1, HALF, 1])]
    )  # fmt: skip


@pytest.mark.parametrize(
    ("inner", "least"),
    [
        (lambda: cylinder(0.3, 0.4), 1.0 - math.hypot(0.3, 0.5)),
        (lambda: turned((0, 0), (0.5, 0), (0, 0.7)), 1.0 - 0.8),
        (lambda: torus(0.5, 0.1), 1.0 - math.hypot(0.5, 0.1) - 0.1),
    ],
    ids=["cylinder", "cone", "torus"],
)
def test_a_solid_in_a_ball_that_is_turned(inner, least):
    """The nearest points are a circle about the inner solid's axis, not about the ball's."""
    at = turned_by(0.5, "x") @ turned_by(0.7, "z")
    inside, around = (inner(), translation(0.0, 0.0, 0.1)), (ball(1.0), at)
    for models in ((*inside, *around), (*around, *inside)):
        found = engine.distance(*models)
        assert found.lower <= least + 1e-15 and found.upper >= least - 1e-15
        assert found.upper - found.lower <= 1e-11
        assert found.bound_tests < 1000


GOOD = np.array([[0.0, 0], [1, 0], [1.5, 0.5], [1, 1], [0, 1]])
KNOTS = [0, 0, 1, 2, 3, 4, 4]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({2: [math.nan, 0.5]}, r"control_points\[2\]|not finite"),
        ({3: [math.inf, 1.0]}, r"control_points\[3\]|not finite"),
        ({2: [-0.5, 0.5]}, "crosses the axis: rho = -0.5"),
        ({1: [1, 1], 3: [0.5, -0.5]}, "cross near"),
        ({0: [0.3, 0]}, "begins at .* off the axis"),
        ({4: [0.3, 1]}, "ends at .* off the axis"),
        ({1: [0, 0], 2: [0, 0.5], 3: [0, 1]}, "no area"),
    ],
)
def test_profiles_that_are_refused_leave_the_shape_as_it_was(change, message):
    bad = GOOD.copy()
    for row, point in change.items():
        bad[row] = point
    made = SolidOfRevolution([Curve(GOOD, KNOTS)], name="part")
    before = made.digest()
    with pytest.raises(ModelError, match=message) as caught:
        made.deform(bad)
    assert "part" in str(caught.value)
    assert (made.revision, made.digest()) == (0, before)
    with pytest.raises(ModelError):
        SolidOfRevolution([Curve(bad, KNOTS)], name="part")


@pytest.mark.parametrize("points", [GOOD[:-1], np.zeros((5, 4)), np.zeros(5), "points"])
def test_control_points_of_another_count_or_form(points):
    made = SolidOfRevolution([Curve(GOOD, KNOTS)], name="part")
    with pytest.raises(ModelError, match="part: control_points"):
        made.deform(points)
    assert made.revision == 0


def test_cylinders_cones_and_tori_from_dimensions():
    shapes = engine.shapes
    made = {
        "cylinder": (shapes.cylinder(0.5, 2.0), [[2, 0, 0], [0, 0, 3]], [1.5, 2.0]),
        "cone": (shapes.cone(1.0, 0.0, 2.0), [[0, 0, 2], [1, 0, 1]], [1.0, 2.0 / math.sqrt(5)]),
        "torus": (shapes.torus(1.0, 0.25), [[0, 0, 0], [0, 3, 0]], [0.75, 1.75]),
    }
    for name, (model, points, expected) in made.items():
        assert isinstance(model, SolidOfRevolution)
        assert (model.name, model.is_solid) == (name, True)
        assert model.deviation < 1e-14
        found = engine.closest_points(model, IDENTITY, points).upper
        assert found == pytest.approx(expected, abs=1e-12)
    flat = shapes.torus(1.0, 0.25, name="skin", solid=False, deviation=0.1)
    assert (flat.name, flat.is_solid) == ("skin", False)
    assert flat.deviation == pytest.approx(0.1)
    for how in ({"volume": "pss"}, {"solid": "robust"}):
        with pytest.raises(ModelError, match="are only for meshes"):
            shapes.cylinder(1.0, 1.0, **how)
    for make, message in (
        (lambda: shapes.torus(1.0, 1.5), r"small = 1\.5: must be at most large = 1\.0 m"),
        (lambda: shapes.torus(1.0, 0.0), "small = 0.0: must be above 0"),
        (lambda: shapes.cylinder(0.0, 1.0), "cylinder: radius = 0.0: must be above 0"),
        (lambda: shapes.cylinder(1.0, 0.0), "cylinder: height = 0.0: must be above 0"),
        (lambda: shapes.cone(0.0, 0.0, 1.0), "cone: low and high are 0"),
    ):
        with pytest.raises(ModelError, match=message):
            make()
