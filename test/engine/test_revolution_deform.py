"""What `deform` of a solid of revolution accepts, refuses, and makes anew."""

import math

import numpy as np
import pytest
from test_revolution_bad_input import polyline

from proximity_monitor import engine
from proximity_monitor.engine import Curve, ModelError, SolidOfRevolution

HALF = math.sqrt(0.5)
HERE = np.eye(4)


def cup(height, radius=1.0, sides=2.0, knot=1.0, **how):
    """Return a closed drawing of a line along the axis, a foot, a rational wall and a lid."""
    control = [[radius, 0], [sides * radius, 0.5 * height], [radius, height]]
    return [
        Curve([[0, height], [0, 0]]),
        Curve([[0, 0], [radius, 0]], **how),
        Curve(control, [0, 0, 0, knot, knot, knot], weights=[1, HALF, 1]),
        Curve([[radius, height], [0, height]]),
    ]


@pytest.mark.parametrize("given", [list, tuple, iter], ids=["list", "tuple", "iterator"])
def test_deform_takes_what_a_new_solid_takes(given):
    made, new = SolidOfRevolution(cup(1.0)), SolidOfRevolution(cup(1.5, 1.2))
    moved = made.deform(given(cup(1.5, 1.2)))
    assert moved == pytest.approx(math.hypot(0.2, 0.5))  # of the rim
    assert made.revision == 1
    np.testing.assert_array_equal(made.control_points, new.control_points)
    ball, at = engine.shapes.sphere(0.2), np.eye(4)
    at[:3, 3] = 3.0, 0.0, 1.4
    found, expected = (engine.distance(each, HERE, ball, at) for each in (made, new))
    assert found.upper == pytest.approx(expected.upper, abs=1e-12)
    # The points of these curves, as a node's topic brings them, are the same shape.
    other = SolidOfRevolution(cup(1.0))
    assert other.deform(new.control_points) == moved
    assert other.digest() == made.digest()


@pytest.mark.parametrize(
    ("curves", "message"),
    [
        (cup(1.0)[:-1], r"the profile is open|curves: 2 given that do not lie along"),
        (polyline([0, 0], [1, 0], [0, 1]), r"curves: 2 given .* along the axis, expected 3"),
        (cup(1.0, knot=2.0), r"curves\[2\]: knots \[.* 2.0, 2.0, 2.0\]: expected \[.* 1.0, 1.0\]"),
        (
            [*cup(1.0)[:2], Curve(cup(1.0)[2].control), cup(1.0)[3]],
            r"curves\[2\]: weights equal: expected \[0.5, ",
        ),
        (cup(1.0, deviation=0.01), r"curves\[1\]: deviation 0.01 m: larger than the solid's"),
        ([*cup(1.0)[:3], [1, 2]], r"curves\[3\]: expected Curve, got list"),
        (cup(1.0)[0], "expected a list of curves"),
        (cup(1.0, sides=-3.0), r"curves\[2\]: crosses the axis: rho = .* at t = 0.5, z = 0.5 m"),
        ([*cup(1.0)[:3], Curve([[1, 1.1], [0, 1]])], r"curves\[3\] begins at \[1, 1.1\] m"),
    ],
)
def test_curves_of_another_structure_leave_the_shape_as_it_was(curves, message):
    """Messages count the curves as they are given, including those along the axis."""
    made = SolidOfRevolution(cup(1.0), name="cup")
    before = made.digest()
    with pytest.raises(ModelError, match=f"cup: .*({message})"):
        made.deform(curves)
    assert (made.revision, made.digest()) == (0, before)


def test_what_runs_from_axis_to_axis_becomes_a_loop_and_back():
    """How the patches close up depends on that: a loop has no ends to close on the axis."""
    whole = np.array([[0, 0], [1, 0], [1, 1], [0, 0.5]])
    ring = np.array([[0.5, 0], [1, 0], [1, 1], [0.5, 0]])
    made = SolidOfRevolution([Curve(whole, [0, 0, 1, 2, 3, 3])])
    places = np.array([[0.8, 0.0, 0.3], [3.0, 0.0, 0.0]])
    for points in (ring, whole, ring):
        made.deform(points)
        assert made.profile.closed is (points is ring)
        new = SolidOfRevolution([Curve(points, [0, 0, 1, 2, 3, 3])])
        found, expected = (
            engine.closest_points(each, HERE, places, signed=True) for each in (made, new)
        )
        np.testing.assert_allclose(found.lower, expected.lower, atol=1e-12)
        np.testing.assert_allclose(found.upper, expected.upper, atol=1e-12)


@pytest.mark.parametrize("weights", [None, [1.0, 2.0, 1.0, 2.0, 1.0]], ids=["plain", "rational"])
def test_a_deformed_solid_has_the_tree_of_a_new_one(weights):
    """Its structure stays. The pieces, their control points and the sphere are as if made anew."""
    points = np.array([[0.0, 0], [1, 0], [1.5, 0.5], [1, 1], [0, 1]])
    knots = [0, 0, 0, 1, 2, 3, 3, 3]
    made = SolidOfRevolution([Curve(points, knots, weights)])
    structure = made._hierarchy
    made.deform(points * [1.3, 0.9])
    found = made._hierarchy
    new = SolidOfRevolution([Curve(points * [1.3, 0.9], knots, weights)])._hierarchy
    np.testing.assert_array_equal(found.order, structure.order)
    np.testing.assert_array_equal(found.places, structure.places)
    np.testing.assert_array_equal(found.tree.nets, new.tree.nets)
    np.testing.assert_array_equal(found.arcs, new.arcs)
    np.testing.assert_array_equal(found.curves, new.curves)
    assert found.radius == pytest.approx(new.radius, rel=1e-14)
    np.testing.assert_allclose(found.centre, new.centre, atol=1e-15)
    ours, theirs = (each.tree.pieces[np.argsort(each.order)] for each in (found, new))
    for name in ours.dtype.names:
        if name != "face":
            np.testing.assert_array_equal(ours[name], theirs[name], err_msg=name)
    np.testing.assert_array_equal(found.tree.pieces["face"], np.arange(len(ours)))
