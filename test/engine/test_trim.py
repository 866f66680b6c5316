"""Trims against known answers for circles and rectangles, and the refusal of bad trims."""

import math

import numpy as np
import pytest

from proximity_monitor import engine
from proximity_monitor.engine.kernels.surface.trim import CROSSING, INSIDE, OUTSIDE
from proximity_monitor.engine.kernels.surface.trim_entries import (
    classify_points,
    classify_rectangles,
    nearest_trim_points,
)
from proximity_monitor.engine.models.patch import Patch
from proximity_monitor.engine.models.trim import Trim, TrimCurve, joined

CENTRE, RADIUS = np.array([5.0, 2.5]), 2.0
LOW, HIGH = np.array([0.0, 0.0]), np.array([10.0, 5.0])


def circle(centre, radius):
    """Return a full circle as four rational quadratics."""
    made, middle = [], math.sqrt(0.5)
    for i in range(4):
        angles = [(i + 0.5 * k) * math.pi / 2 for k in range(3)]
        unit = np.array([(math.cos(a), math.sin(a)) for a in angles])
        unit[1] /= middle
        made.append(TrimCurve(centre + radius * unit, np.array([1.0, middle, 1.0])))
    return made


def polygon(*corners):
    points = np.array(corners, dtype=float)
    return [
        TrimCurve(np.array([a, b])) for a, b in zip(points, np.roll(points, -1, 0), strict=True)
    ]


def frame(low=LOW, high=HIGH):
    return polygon(low, (high[0], low[1]), high, (low[0], high[1]))


def sides(trim, parameters):
    made = np.empty(len(parameters), np.int8)
    kind = classify_points if parameters.shape[1] == 2 else classify_rectangles
    # The trim is the second one of its model, so that every index has an offset.
    kind(joined([Trim([circle((0, 0), 1)], (-1, -1), (1, 1)), None, trim]), 2, parameters, made)
    return made


HOLE = Trim([frame(), circle(CENTRE, RADIUS)], LOW, HIGH)


def test_points_are_on_the_side_where_the_circle_has_them():
    random = np.random.default_rng(1)
    angle = random.uniform(0, 2 * math.pi, 4000)
    apart = 10.0 ** random.uniform(-12, 0, 4000) * random.choice([-1.0, 1.0], 4000)
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    points = CENTRE + (RADIUS + apart)[:, None] * out
    inner = ((points > LOW) & (points < HIGH)).all(axis=1)
    found = sides(HOLE, points[inner])
    assert (found != CROSSING).all()
    np.testing.assert_array_equal(found == INSIDE, apart[inner] > 0.0)


def test_points_on_the_curve_are_not_told_wrongly():
    angle = np.linspace(0, 2 * math.pi, 999)
    points = CENTRE + RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])
    assert (sides(HOLE, points) == CROSSING).all()


def test_points_of_the_rectangle_s_sides_belong_to_it():
    u, v = np.meshgrid([0.0, 1.0, 5.0, 10.0], [0.0, 2.5, 5.0])
    rim = (u == 0) | (u == 10) | (v == 0) | (v == 5)
    assert (sides(HOLE, np.column_stack([u[rim], v[rim]])) == INSIDE).all()


def test_rectangles_are_never_told_wrongly_and_hardly_ever_not_told():
    random = np.random.default_rng(2)
    size = 10.0 ** random.uniform(-10, 0.5, (6000, 1))
    angle = random.uniform(0, 2 * math.pi, 6000)
    at = CENTRE + RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])
    low = np.clip(at + 2 * size * random.normal(size=(6000, 2)), LOW, HIGH)
    high = np.clip(low + size * random.uniform(size=(6000, 2)), LOW, HIGH)
    nearest = np.linalg.norm(np.clip(CENTRE, low, high) - CENTRE, axis=1)
    farthest = np.linalg.norm(np.maximum(abs(low - CENTRE), abs(high - CENTRE)), axis=1)
    found = sides(HOLE, np.column_stack([low, high]))
    assert (nearest[found == INSIDE] >= RADIUS - 1e-14).all()
    assert (farthest[found == OUTSIDE] <= RADIUS + 1e-14).all()
    apart = (nearest > RADIUS + 1e-12) | (farthest < RADIUS - 1e-12)
    assert (found[apart] != CROSSING).mean() > 0.999
    assert all((found == each).sum() > 500 for each in (INSIDE, OUTSIDE, CROSSING))


def test_nearest_points_lie_on_the_loop():
    random = np.random.default_rng(3)
    points = random.uniform(LOW, HIGH, (500, 2))
    found = np.empty_like(points)
    assert nearest_trim_points(joined([HOLE]), 0, points, 1.0, 1.0, found)
    off = np.linalg.norm(points - CENTRE, axis=1)
    np.testing.assert_allclose(np.linalg.norm(found - CENTRE, axis=1), RADIUS, rtol=1e-14)
    far = off > 1.0
    apart = np.linalg.norm(found - points, axis=1)
    np.testing.assert_allclose(apart[far], abs(off - RADIUS)[far], atol=1e-7)
    assert not nearest_trim_points(joined([None]), 0, points, 1.0, 1.0, found)


def test_a_loop_around_the_rectangle_trims_nothing():
    assert Trim([frame()], LOW, HIGH).whole
    assert Trim([frame(LOW - 1e-12, HIGH + 1e-12)], LOW, HIGH).snapped.max() <= 2e-12
    assert Trim([frame(LOW - 1.0, HIGH + 1.0)], LOW, HIGH).whole
    whole = Trim([frame((0, 0), (1, 1))], (0, 0), (1, 1))
    assert Patch(np.zeros((2, 2, 3)), trim=whole).trim is None
    with pytest.raises(engine.ModelError, match="leave nothing"):
        Trim([frame(), frame()], LOW, HIGH)


def test_a_loop_that_shares_sides_with_the_rectangle():
    """Curves along a side do not make the cells there uncertain. One corner is cut off."""
    cut = Trim([polygon((0, 0), (10, 0), (10, 3), (7, 5), (0, 5))], LOW, HIGH)
    points = np.array([[9.9, 4.9], [8.0, 4.2], [7.9, 4.2], [10.0, 2.0], [0.0, 5.0], [10.0, 5.0]])
    assert sides(cut, points).tolist() == [0, 1, 1, 1, 1, 0]
    cells = np.array([[9.0, 0.0, 10.0, 2.5], [0.0, 0.0, 5.0, 5.0], [8.0, 3.0, 10.0, 5.0]])
    assert sides(cut, cells).tolist() == [INSIDE, INSIDE, CROSSING]


def test_angles_of_arcs_become_parameters():
    """A window in a cylinder, by angles and heights. Inside arcs, parameters are not angles."""
    angle, arcs = 1.5 * math.pi, 3
    low, high = np.array([-0.5, 0.0]), np.array([-0.5 + angle, 2.0])
    window = polygon((0.1, 0.5), (2.0, 0.5), (2.0, 1.5), (0.1, 1.5))
    ends = low[0] + np.arange(2 * arcs + 1) * angle / (2 * arcs)
    middle = math.cos(angle / arcs / 2)
    reach = np.where(np.arange(2 * arcs + 1) % 2 == 1, 1 / middle, 1.0)
    rim = np.column_stack([np.cos(ends) * reach, np.sin(ends) * reach])
    control = np.stack([np.column_stack([rim, np.full(len(rim), z)]) for z in (0.0, 2.0)], axis=1)
    knots = np.concatenate([[low[0]], np.repeat(ends[::2], 2), [ends[-1]]])
    weights = np.repeat((1.0 / reach)[:, None], 2, axis=1)
    trim = Trim([frame(low, high), window], low, high, (arcs, 0))
    patch = Patch(control, knots, [0, 0, 2, 2], weights, trim=trim)
    random = np.random.default_rng(4)
    parameters = random.uniform(low, high, (3000, 2))
    x, y, z = patch.evaluate(*parameters.T).T
    np.testing.assert_allclose(np.hypot(x, y), 1.0, rtol=1e-14)
    turned = np.mod(np.arctan2(y, x) - low[0], 2 * math.pi) + low[0]
    gone = (turned > 0.1) & (turned < 2.0) & (z > 0.5) & (z < 1.5)
    np.testing.assert_array_equal(sides(patch.trim, parameters) == OUTSIDE, gone)
    found = np.empty_like(parameters)
    nearest_trim_points(joined([patch.trim]), 0, parameters, 1.0, 1.0, found)
    x, y, z = patch.evaluate(*found.T).T
    turned = np.mod(np.arctan2(y, x) - low[0], 2 * math.pi) + low[0]
    rim = np.minimum(np.minimum(abs(turned - 0.1), abs(turned - 2.0)),
                     np.minimum(abs(z - 0.5), abs(z - 1.5)))  # fmt: skip
    assert rim.max() < 1e-13


def test_bad_trims_are_refused():
    with pytest.raises(engine.ModelError, match="a loop without curves"):
        Trim([[]], (0.0, 0.0), (1.0, 1.0))
    with pytest.raises(engine.ModelError, match="no loops"):
        Trim([], LOW, HIGH)
    with pytest.raises(engine.ModelError, match="is empty"):
        Trim([frame()], LOW, LOW)
    with pytest.raises(engine.ModelError, match=r"shape \(2, 2\) and weights of shape \(3,\)"):
        Trim([[TrimCurve(np.zeros((2, 2)), np.ones(3))]], LOW, HIGH)
    with pytest.raises(engine.ModelError, match="must be finite"):
        Trim([[TrimCurve(np.zeros((2, 2)), np.array([1.0, 0.0]))]], LOW, HIGH)
    with pytest.raises(engine.ModelError, match=r"its u ranges from 0.0 to 10.0, but that of the"):
        Patch(np.zeros((2, 2, 3)), trim=HOLE)
    with pytest.raises(engine.ModelError, match=r"2 arcs in u need .* the patch has 1 of"):
        Patch(np.zeros((3, 2, 3)), trim=Trim([frame((0, 0), (1, 1))], (0, 0), (1, 1), (2, 0)))


def test_what_is_shown_is_what_is_left():
    low, high = np.array([0.0, 0.0]), np.array([10.0, 5.0])
    control = np.array([[[u, v, 0.0] for v in (0.0, 5.0)] for u in (0.0, 10.0)])
    knots = np.repeat([0.0, 10.0], 2), np.repeat([0.0, 5.0], 2)
    patch = Patch(control, *knots, trim=HOLE)
    shown = patch.display_mesh(1e-3)
    assert math.isinf(shown.off)
    a, b, c = shown.corners().transpose(1, 0, 2)
    turned = np.cross(b - a, c - a)[:, 2]
    assert (turned >= -1e-12).all()  # triangles face as the patch's normal does
    assert 0.5 * turned.sum() == pytest.approx(50.0 - math.pi * RADIUS**2, rel=1e-3)
    middle = (a + b + c)[turned > 1e-9, :2] / 3.0
    assert (np.linalg.norm(middle - CENTRE, axis=1) > RADIUS - 0.02).all()
    assert (middle >= low).all() and (middle <= high).all()


def test_some_point_is_left_of_trimmed_patches():
    control = np.array([[[u, v, 1.0] for v in (0.0, 5.0)] for u in (0.0, 10.0)])
    knots = np.repeat([0.0, 10.0], 2), np.repeat([0.0, 5.0], 2)
    cut, whole = Patch(control, *knots, trim=HOLE), Patch(control + 7.0, *knots)
    made = engine.ParametricSurface([cut, whole])._hierarchy
    assert made.some_feature == (0.0, 0.0, 0.0, 1.0)
    np.testing.assert_array_equal(made.some_point, [7.0, 7.0, 8.0])
    made = cut._hierarchy
    u, v, _, patch = made.some_feature
    assert patch == 0.0
    assert made.some_point == pytest.approx([u, v, 1.0])
    assert math.dist((u, v), CENTRE) == pytest.approx(RADIUS, rel=1e-14)
