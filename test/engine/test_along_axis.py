"""Parts of a profile along its axis bound nothing: they are left out, or else refused."""

import math

import numpy as np
import pytest
from test_revolution_bad_input import polyline

from proximity_monitor import engine
from proximity_monitor.engine import Curve, ModelError, SolidOfRevolution

HALF = math.sqrt(0.5)
SKETCH = [[0, -1], [0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]


@pytest.mark.parametrize("first", range(4))
def test_what_is_closed_along_the_axis_has_no_boundary_there(first):
    sides = polyline([0, 0], [1, 0], [1, 1], [0, 1], [0, 0])
    made = SolidOfRevolution(sides[first:] + sides[:first])
    points = np.array([[0, 0, 0.5], [0.1, 0, 0.5], [0.3, 0, 0.5]])
    found = engine.closest_points(made, np.eye(4), points, signed=True)
    np.testing.assert_allclose(found.upper, -0.5, atol=1e-12)
    assert [len(net.points) for net in made.profile.nets] == [2, 2, 2]
    np.testing.assert_array_equal(made.control_points[0], [0, 0, 0])
    ball = engine.shapes.sphere(0.2)
    middle = np.eye(4)
    middle[2, 3] = 0.5
    assert engine.distance(made, np.eye(4), ball, middle).upper == pytest.approx(0.3, abs=1e-12)


@pytest.mark.parametrize("first", range(5))
def test_a_curve_is_parted_where_it_comes_to_the_axis(first):
    """A closed sketch is often one curve. A stub beyond the solid, on the axis, bounds nothing."""
    corners = SKETCH if first == 0 else SKETCH[first:] + SKETCH[2 : first + 1]
    knots = [0, *range(len(corners)), len(corners) - 1]
    made = SolidOfRevolution([Curve(corners, knots)])
    points = np.array([[0, 0, 0.5], [0, 0, -0.5], [0.1, 0, 0.5]])
    found = engine.closest_points(made, np.eye(4), points, signed=True)
    np.testing.assert_allclose(found.upper, [-0.5, 0.5, -0.5], atol=1e-12)
    assert made.control_points[0].tolist() == [0, 0, 0]


def test_a_part_of_a_rational_curve_is_what_it_was():
    wall = [[0, 0], [1, 0], [1, 1], [1, 2], [0, 2], [0, 1.5], [0, 0]]
    weights = [1, HALF, 1, HALF, 8, 3, 2]
    sketch = Curve(wall, [0, 0, 0, 1, 1, 2, 2, 3, 3, 3], weights=weights)
    alone = Curve(wall[:5], [0, 0, 0, 1, 1, 2, 2, 2], weights=weights[:5])
    made, expected = SolidOfRevolution([sketch]), SolidOfRevolution([alone])
    np.testing.assert_array_equal(made.profile.pieces[0], expected.profile.pieces[0])
    (net,) = made.profile.nets
    assert 0.5 <= net.weights.max() < 1.0
    np.testing.assert_array_equal(net.knots_u, alone.nets[0].knots_u)


@pytest.mark.parametrize(
    ("curves", "said"),
    [
        (polyline([0, -1], [1, 0], [0, 1], [-5, 0], [0, -1]), r"curves\[2\]: crosses the axis"),
        (
            polyline([0, 0], [1, 0], [0, 1], [0, 2]) + polyline([0, 5], [0, 7]),
            r"curves\[3\] begins",
        ),
        (polyline([0, 1], [0, 0], [1, 0], [-0.5, 0.5], [0, 1]), r"curves\[2\]: crosses the axis"),
        (polyline([0, 1], [0, 0], [1, 0]) + polyline([0.6, 1], [0, 1]), r"curves\[2\] begins"),
        (
            [*polyline([0, 0], [1, 0], [0, 1]), Curve([[0, 1, 0], [0, 0, 1]])],
            r"curves\[2\]: .* not in",
        ),
    ],
)
def test_what_is_left_out_has_to_fit_in_too(curves, said):
    """Messages count the curves as they were given, including those left out."""
    with pytest.raises(ModelError, match=said):
        SolidOfRevolution(curves)


def test_what_runs_along_the_axis_otherwise_is_refused():
    corners = [[0, 0], [1, 0], [1, 1], [0, 1], [0, 2], [1, 2], [1, 3], [0, 3]]
    with pytest.raises(ModelError, match=r"curves\[3\]: runs along the axis from t = 0 to 1"):
        SolidOfRevolution(polyline(*corners))
    smooth = Curve(
        [[1, 1], [0, 1], [0, 0.7], [0, 0.3], [0, 0], [1, 0]], [0, 0, 0, 1, 2, 3, 4, 4, 4]
    )
    with pytest.raises(ModelError, match=r"curves\[0\]: runs along the axis from t = 1 to 2"):
        SolidOfRevolution([smooth, *polyline([1, 0], [1, 1])])
