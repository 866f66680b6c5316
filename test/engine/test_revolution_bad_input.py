"""A profile is refused if it crosses itself or its axis, however little; others are accepted."""

import itertools
import math
import re

import numpy as np
import pytest
from engine_bodies import sampled

from proximity_monitor import engine
from proximity_monitor.engine import Curve, ModelError, SolidOfRevolution
from proximity_monitor.engine.models.profile import checked_profile

LINE = Curve([[0, 0], [1, 0]])
ACROSS = r"curves\[0\] at t = 0.8 and curves\[1\] at t = 0.2 cross near \[0.8, "
HALF = math.sqrt(0.5)


def refusal(curves):
    """Return why a profile is refused; empty if it is not."""
    try:
        checked_profile([curve.nets[0] for curve in curves], "part")
    except ModelError as error:
        return str(error)
    return ""


def polyline(*points):
    return [Curve(ends) for ends in itertools.pairwise(points)]


def hooked(slope, back=0.2):
    """Return a line and a curve that turns back beside it and crosses it `back` from the corner."""
    return [LINE, Curve([[1, 0], [0.5, 0.5 * back * slope], [0, (back - 1) * slope]])]


def looped(width):
    """Return a profile with a wall of one cubic: a loop if width > 0, a cusp if 0, else a bend."""
    wall = Curve([[1, 0], [3 + width, 1], [1 - width, 1], [3, 0]])
    return [LINE, wall, *polyline([3, 0], [3, 2], [0, 2])]


def dipped(depth, t=22.5 / 48):
    """Return a profile with a wall rho = (t' - t)^2 - depth and caps at both ends."""
    start, control, end = t * t - depth, t * t - t - depth, (1 - t) ** 2 - depth
    wall = Curve([[start, 0], [control, 0.5], [end, 1]])
    return [Curve([[0, 0], [start, 0]]), wall, Curve([[end, 1], [0, 1]])]


def spiked(weight):
    """Return a profile whose wall has a control point of this weight beyond the axis."""
    control = [[1, 0], [1, 0.45], [-0.1, 0.5], [1, 0.55], [1, 1]]
    return [LINE, Curve(control, weights=[1, 1, weight, 1, 1e12]), Curve([[1, 1], [0, 1]])]


@pytest.mark.parametrize("slope", [0.03, 0.02, 0.01, 1e-3, 1e-6, 1e-9])
def test_crosses_its_neighbour(slope):
    with pytest.raises(ModelError, match=ACROSS):
        SolidOfRevolution(hooked(slope))


@pytest.mark.parametrize("slope", [0.03, 1e-3, 1e-5])
def test_crosses_where_two_others_join(slope):
    found = refusal([*polyline([0, 0], [0.8, 0], [1, 0]), hooked(slope)[1]])
    assert "cross near [0.8, 0]" in found


@pytest.mark.parametrize("width", [1e-6, 1e-4, 1e-3, 0.05, 0.2])
def test_a_piece_that_crosses_itself(width):
    with pytest.raises(ModelError, match=r"curves\[1\] .* cross near \[2, .*\] m;") as refused:
        SolidOfRevolution(looped(width))
    # By symmetry the wall passes the crossing as long before the middle as after it.
    first, second = map(float, re.findall(r"curves\[1\] at t = ([\d.]*)", str(refused.value)))
    assert first < second
    assert first + second == pytest.approx(1.0, abs=2e-6)
    _, z = re.search(r"near \[(.*), (.*)\] m", str(refused.value)).groups()
    for point in looped(width)[1].evaluate([first, second]):
        assert point == pytest.approx([2.0, float(z), 0.0], abs=1e-5)
    assert not refusal(looped(-width))


def test_a_crossing_is_named_by_the_curves_own_parameters():
    """Both curves have several spans, and are cut where they lie along the axis."""
    steps = [[0, 0], [1, 0], [1, 1], [2, 1], [2, 2]]
    first = Curve(steps, [1, 1, 2, 3, 4, 5, 5])
    second = Curve([[2, 2], [0.5, 2], [0.5, -1], [0, -1], [0, 0]], [10, 10, 20, 30, 40, 50, 50])
    with pytest.raises(ModelError) as refused:
        SolidOfRevolution([first, second], name="mug")
    crossing = r"mug: curves\[0\] at t = (.*) and curves\[1\] at t = (.*) cross near \[0.5, 0\] m;"
    s, t = map(float, re.match(crossing, str(refused.value)).groups())
    assert first.evaluate(s) == pytest.approx([0.5, 0.0, 0.0], abs=1e-6)
    assert second.evaluate(t) == pytest.approx([0.5, 0.0, 0.0], abs=1e-5)
    assert str(refused.value).endswith("move control points until they stay apart")


def test_open_ends_are_named_with_their_gap():
    mug = [Curve([[0.3, 0], [1, 0]], [2, 2, 3, 3]), Curve([[1, 0], [0.3, 0.4]])]
    assert refusal(mug) == (
        "part: curves: the profile is open: it begins at [0.3, 0] m (curves[0], t = 2), 0.3 m off "
        "the axis and ends at [0.3, 0.4] m (curves[1], t = 1), 0.3 m off the axis; its ends are "
        "0.4 m apart. Move both ends to the axis, or both to one place"
    )
    assert refusal([LINE, mug[1]]) == (
        "part: curves: the profile is open: it begins at [0, 0] m (curves[0], t = 0), on the axis "
        "and ends at [0.3, 0.4] m (curves[1], t = 1), 0.3 m off the axis; its ends are 0.5 m apart."
        " Move both ends to the axis, or both to one place"
    )
    torn = [LINE, Curve([[1, 0.003], [0.5, 0.5]]), Curve([[0.5, 0.5], [0, 1]])]
    assert refusal(torn) == (
        "part: curves[1] begins at [1, 0.003] m (t = 0), 0.003 m from [1, 0] m, where curves[0] "
        "ends (t = 1); let it begin there"
    )


def test_a_point_out_of_the_plane_and_curves_without_an_area_are_named():
    out = [Curve([[0, 0, 0], [1, 0, 0]]), Curve([[1, 0, 0], [1, 1, 0.5], [0, 1, 0]])]
    assert "curves[1]: control[1] = [1.0, 1.0, 0.5]: not in the plane; give (rho, z)" in refusal(
        out
    )
    assert "they span 1 m in rho and 0 m in z" in refusal(polyline([0, 0], [1, 0], [0, 0]))
    corners = polyline([0, 0], [1, 0], [1, 1], [0, 1], [0, 2.5], [1, 2.5], [1, 3], [0, 3])
    assert "curves[3]: runs along the axis from t = 0 to 1 (z = 1 to 2.5 m)" in refusal(corners)


def test_what_deform_makes_of_a_cusp():
    made = SolidOfRevolution(looped(0.0))
    points = np.concatenate([curve.nets[0].points for curve in looped(1e-3)])
    with pytest.raises(ModelError, match="cross near"):
        made.deform(points[:, :2])
    assert made.revision == 0


@pytest.mark.parametrize("depth", [1e-3, 1e-4, 1e-6, 1e-8, 1e-10])
def test_crosses_the_axis(depth):
    with pytest.raises(ModelError, match=f"crosses the axis: rho = -{depth:.2g}"):
        SolidOfRevolution(dipped(depth))
    made = SolidOfRevolution(dipped(0.0))
    points = np.concatenate([curve.nets[0].points for curve in dipped(depth)])
    with pytest.raises(ModelError, match=r"curves\[1\]: crosses the axis: .* at t = 0.46875"):
        made.deform(points[:, :2])


def test_crosses_the_axis_by_little_more_than_is_allowed():
    for t in (22.5 / 48, 0.5, 1 / 3, 0.123456789):
        assert "crosses the axis: rho = -1.1" in refusal(dipped(1.15e-12, t))


@pytest.mark.parametrize("depth", [0.9e-12, 1e-13, 1e-15, 0.0, -1e-13, -1e-3])
def test_touches_the_axis_but_for_rounding(depth):
    for t in (22.5 / 48, 0.5, 1 / 3, 0.123456789):
        assert not refusal(dipped(depth, t))


def test_crosses_the_axis_between_weights_of_many_magnitudes():
    assert "crosses the axis: rho = -0.0963382 m at t = 0.00099" in refusal(spiked(1e8))
    assert not refusal(spiked(1e6))


def test_the_knot_span_where_it_crosses_the_axis():
    control = np.array([[0, 0], [1, 0], [1, 1], [1, 2], [-0.5, 2.5], [1, 3], [1, 4], [0, 4]])
    found = refusal([Curve(control, [2, 2, 2, 3, 4, 5, 6, 7, 8, 8, 8])])
    place = "rho = -0.125 m at t = 5.5, z = 2.5 m; move its control points"
    assert f"curves[0]: crosses the axis: {place}" in found


def arc(*control):
    return Curve(control, weights=[1, HALF, 1])


LEGAL = {
    "corners on the axis": polyline([0, 0], [1, 0.5], [0, 1], [1, 1.5], [0, 2]),
    "loop with a corner on the axis": polyline([1, 0], [0, 0.5], [1, 1], [2, 0.5], [1, 0]),
    "begins and ends at one place": polyline([0, 0], [1, -1], [1, 1], [0, 0]),
    "begins and ends nearly there": polyline([0, 0], [1, -1], [1, 1], [0, 1e-11]),
    "two arcs": [Curve([[1, 0], [2, 0.5], [1, 1]]), Curve([[1, 1], [1.2, 0.5], [1, 0]])],
    "two arcs with one tangent at their tips": [
        Curve([[1, 0], [2, 0], [1, 1]]),
        Curve([[1, 1], [2 - 1e-6, 0], [1, 0]]),
    ],
    "line and arc": [
        *polyline([1, 0.3], [1, 0], [2, 0]),
        arc([2, 0], [1.7, 0], [1.7, 0.3]),
        Curve([[1.7, 0.3], [1, 0.3]]),
    ],
    "line and a small arc": [
        *polyline([1, 1e-4], [1, 0], [2, 0]),
        arc([2, 0], [2 - 1e-4, 0], [2 - 1e-4, 1e-4]),
        Curve([[2 - 1e-4, 1e-4], [1, 1e-4]]),
    ],
    "cusp": looped(0.0),
    "short pieces": polyline([0, 0], [1, 0], [1 + 1e-9, 1e-9], [1, 1], [0, 1]),
    "pieces of no length": polyline([0, 0], [1, 0], [1 + 1e-13, 0], [1, 1], [0, 1]),
    "ends that are apart": [
        LINE,
        Curve([[1 - 9e-13, 3e-13], [0.5, 3e-13], [0, 0.1]]),
    ],
    "horn torus": [
        Curve(
            [[0, 0], [0, -1], [1, -1], [2, -1], [2, 0], [2, 1], [1, 1], [0, 1], [0, 0]],
            [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4],
            [1, HALF] * 4 + [1],
        )
    ],
    "weights of many magnitudes": [
        Curve([[0, 0], [1, 0], [1, 1], [0, 1]], weights=[1, 1e30, 1, 1e-15])
    ],
}


@pytest.mark.parametrize("name", LEGAL)
def test_legal(name):
    assert not refusal(LEGAL[name])
    turned = [
        Curve(net.points[::-1, :2], -net.knots_u[::-1], weights)
        for net in (curve.nets[0] for curve in LEGAL[name][::-1])
        for weights in [None if net.weights is None else net.weights[::-1, 0]]
    ]
    assert not refusal(turned)


def test_runs_on_itself_before_it_leaves():
    """At a corner of zero angle, the sides may run on each other. A crossing beyond is found."""
    out = np.array([[1, 0], [1.3, 0.3], [1.6, 0.2], [2, 0.5], [2.2, 1], [2.3, 1.5], [2.5, 2]])
    knots = [0, 0, 0, 1, 2, 3, 4, 5, 5, 5]
    for above in (True, False):  # the curve leaves to the side it came from, or to the other
        back = out[::-1].copy()
        back[-3:] = [[1.5, 0.6], [1.3, 1], [1, 1]] if above else [[1.5, 0.3], [1.5, -0.3], [1, 0.8]]
        found = refusal([Curve(out, knots), Curve(back, knots), Curve([back[-1], out[0]])])
        assert bool(re.search(r"curves\[0\] .* and curves\[1\] .* cross near", found)) is not above


def test_random_stars_are_accepted():
    """Seen from the middle, each piece turns one way, whatever its weights. So no pieces cross."""
    random = np.random.default_rng(5)
    for _ in range(150):
        degrees = random.integers(1, 7, random.integers(3, 7))
        steps = random.uniform(0.05, 1.0, degrees.sum())
        # The control points of a piece lie within less than half a turn.
        steps /= np.repeat(np.add.reduceat(steps, np.cumsum(degrees) - degrees), degrees)
        angles = np.concatenate(([0.0], np.cumsum(steps))) * 2.0 * np.pi / len(degrees)
        radii = 10.0 ** random.uniform(-2.0, 0.0, len(angles))
        points = np.column_stack((np.cos(angles), np.sin(angles))) * radii[:, None] + [1.0, 0.0]
        points[-1] = points[0]
        starts = np.cumsum(degrees) - degrees
        curves = [
            Curve(points[a : a + n + 1], weights=10.0 ** random.uniform(-3.0, 3.0, n + 1))
            for a, n in zip(starts, degrees, strict=True)
        ]
        assert not refusal(curves)


@pytest.mark.long
def test_random_cusps_and_corners_of_no_angle():
    random = np.random.default_rng(6)
    for size in 10.0 ** random.uniform(-6.0, -2.0, 100):
        t, turn = random.uniform(0.2, 0.8), random.uniform(0.0, 2.0 * np.pi)
        rotated = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        for loop in (size, 0.0, -size):
            # The curve (s^2, s^3 - loop s) with s = t' - t, by its polar form.
            roots = np.array([[0, 0, 0], [0, 0, 1], [0, 1, 1], [1, 1, 1]]) - t
            pairs = (roots * np.roll(roots, 1, axis=1)).mean(axis=1)
            control = np.column_stack((pairs, roots.prod(axis=1) - loop * roots.mean(axis=1)))
            ends = [control[-1], [3.0, 0.0], control[0]]
            whole = [np.asarray(each) @ rotated + 5.0 for each in (control, ends[:2], ends[1:])]
            assert ("cross near" in refusal([Curve(each) for each in whole])) == (loop > 0.0)
        slope, back = 10.0 ** random.uniform(-5.0, 0.0), random.uniform(0.01, 0.9)
        assert "cross near" in refusal(hooked(slope, back))
        assert not refusal([LINE, Curve([[1, 0], [back, 0], [0, slope]])])


def crossing(points, kept=None):
    """Return whether lines between points cross. The first and the last line may meet."""
    places = np.arange(len(points) - 1) if kept is None else np.nonzero(kept[:-1] & kept[1:])[0]
    start = points[places]
    step = points[places + 1] - start

    def side(point):
        x, y = np.moveaxis(point[None] - start[:, None], 2, 0)
        return step[:, :1] * y - step[:, 1:] * x

    over = side(start) * side(start + step) < 0.0
    i, j = np.nonzero(over & over.T)
    return bool(((j > i + 1) & (places[j] - places[i] < len(points) - 2)).any())


@pytest.mark.long
def test_random_profiles_against_samples():
    random = np.random.default_rng(7)
    crossed = 0
    for _ in range(200):
        corners = random.uniform(0.1, 1.0, (random.integers(3, 6), 2))
        corners[[0, -1], 0] = 0.0
        spread, curves = random.choice([0.05, 0.2, 0.6]), []
        for ends in itertools.pairwise(corners):
            degree, spans = random.integers(1, 6), random.integers(1, 4)
            share = np.linspace(0.0, 1.0, degree + spans)[:, None]
            points = (1.0 - share) * ends[0] + share * ends[1]
            points[1:-1] += spread * random.normal(size=(len(points) - 2, 2)) / len(points) ** 0.5
            points[:, 0] = np.abs(points[:, 0])
            knots = [0] * (degree + 1) + [*range(1, spans)] + [spans] * (degree + 1)
            weights = 10.0 ** random.uniform(-1.0, 1.0, len(points))
            curves.append(Curve(points, knots, weights))
        found = refusal(curves)
        truth = crossing(sampled(curves, 30))
        if found and not truth:  # the loop may be smaller than the spacing of the samples
            rho, z = re.search(r"near \[(.*), (.*)\] m", found).groups()
            fine = sampled(curves, 3000)
            far = np.linalg.norm(fine - [float(rho), float(z)], axis=1)
            truth = crossing(fine, far <= np.sort(far)[600])
        assert truth == ("cross near" in found)
        crossed += truth
    assert 50 < crossed < 150


def test_a_curve_that_is_torn_within():
    torn = Curve([[0, 0], [1, 0], [1.5, 1], [0, 1]], [0, 0, 1, 1, 2, 2])
    with pytest.raises(
        ModelError,
        match=r"curves\[0\]: is discontinuous at t = 1: .* 1.12 m from \[1, 0\] m to \[1.5",
    ):
        SolidOfRevolution([torn])
    whole = SolidOfRevolution([Curve([[0, 0], [1, 0], [1, 0], [0, 1]], [0, 0, 1, 1, 2, 2])])
    with pytest.raises(ModelError, match="is discontinuous"):
        whole.deform(torn.control_points[:, :2])
    assert whole.revision == 0


@pytest.mark.parametrize("length", [1e-300, 1e-160, 1.0, 1e30])
def test_an_axis_of_any_length(length):
    made = SolidOfRevolution(polyline([0, 0], [1, 0], [1, 1], [0, 1]), axis=np.full(3, length))
    np.testing.assert_allclose(made.axis, 3**-0.5, rtol=1e-15)


def test_what_deform_is_given_back_far_from_the_origin():
    pin = polyline([0, 0], [0.05, 0], [0.05, 0.1], [0, 0.1])
    for far in (1e4, 1e6):
        made = SolidOfRevolution(pin, origin=(far, -far, far), axis=(1, 2, 3))
        assert made.deform(made.control_points) <= 1e-14 * far
        assert made.deform(made.control_points + 0.3 * made.axis) == pytest.approx(0.3)


def test_what_are_no_curves_and_no_sizes():
    for given in (LINE, None, 3):
        with pytest.raises(ModelError, match="curves: expected a list of curves"):
            SolidOfRevolution(given)
    made = SolidOfRevolution(polyline([0, 0], [1, 0], [1, 1], [0, 1]))
    with pytest.raises(ModelError, match=r"control_points\[0\] = \[inf"):
        made.deform(np.full((6, 3), np.inf))
    shapes = engine.shapes
    for wrong, what in (
        (lambda: shapes.box((1, 1)), "size"),
        (lambda: shapes.box("abc"), "size"),
        (lambda: shapes.torus(1, -0.2), "small"),
        (lambda: shapes.cone(1, 1, -1), "height"),
        (lambda: shapes.capsule(0.1, -1), "length"),
        (lambda: shapes.cylinder(1, -1, 6), "height"),
    ):
        with pytest.raises(ModelError, match=what):
            wrong()
    with pytest.raises(ModelError, match=r"knots\[0\] = 0.0: repeated more than 3 times"):
        Curve([[0, 0], [5, 5], [1, 0], [1, 1], [0, 1]], [0, 0, 0, 0, 1, 1, 1, 1])
