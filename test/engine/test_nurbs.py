"""Points, derivatives and Bezier pieces of patches and curves, against scipy and fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from engine_bodies import covering
from engine_surfaces import (
    bumps,
    by_scipy,
    clamped,
    curve,
    patch,
    sphere_patches,
    torn,
    torus_patches,
    unclamped,
)
from scipy.interpolate import BSpline

from proximity_monitor import engine

KNOTS = (clamped, unclamped, torn)


def parameters(made, count=60):
    rng = np.random.default_rng(1)
    return [rng.uniform(*ends, count) for ends in made.domain]


@pytest.mark.parametrize("knots", KNOTS)
@pytest.mark.parametrize("degrees", [(1, 1), (2, 3), (3, 1), (5, 4), (9, 2), (15, 15)])
def test_points_and_derivatives_agree_with_scipy(degrees, knots):
    shape = degrees[0] * 2 + 4, degrees[1] * 2 + 3
    made = patch(3, shape, degrees, knots, decades=2.0)
    u, v = parameters(made)
    (x, w), (x_u, w_u), (x_v, w_v) = (
        np.split(by_scipy(made, u, v, *orders), [3], axis=1) for orders in ((0, 0), (1, 0), (0, 1))
    )
    found = made.derivatives(u, v)
    size = 1e-12 * np.abs(made.control).max()
    np.testing.assert_allclose(found[:, 0, 0], x / w, atol=size)
    for derivative, x_d, w_d in ((found[:, 1, 0], x_u, w_u), (found[:, 0, 1], x_v, w_v)):
        expected = (x_d - w_d * (x / w)) / w
        np.testing.assert_allclose(derivative, expected, atol=100.0 * np.abs(expected).max() * size)
    assert (found[:, 1, 1] == 0.0).all()


def test_second_derivatives_are_those_of_the_first():
    made, step = patch(4, decades=1.0), 1e-6
    u, v = (0.1 + 0.8 * each for each in parameters(made))
    second = made.derivatives(u, v, 2)
    for along, at, before in (
        (second[:, 2, 0], (u + step, v), (u - step, v)),
        (second[:, 1, 1], (u, v + step), (u, v - step)),
    ):
        of_first = made.derivatives(*at)[:, 1, 0] - made.derivatives(*before)[:, 1, 0]
        smooth = np.abs(along).max(axis=1) < 1e3
        assert smooth.sum() > 30
        np.testing.assert_allclose(
            along[smooth], of_first[smooth] / (2 * step), rtol=0.01, atol=1.0
        )


@pytest.mark.parametrize("knots", KNOTS)
def test_curves_agree_with_scipy(knots):
    made = curve(5, 9, 4, knots, columns=2)
    t = np.linspace(*made.domain, 50)
    flat = BSpline(made.knots, made.control, 4)
    np.testing.assert_allclose(made.evaluate(t), flat(t), atol=1e-13)
    np.testing.assert_allclose(made.derivatives(t, 3)[:, 2], flat(t, 2), atol=1e-9)
    assert (made.evaluate(t)[:, 2] == 0.0).all()
    assert made.evaluate(t[3]).shape == (3,)


def blossoms(knots, degree, points, span, low, high):
    """Return values of a B-spline's blossom in exact arithmetic (de Boor's scheme).

    None, one, two, ... of the arguments are `high`, and the rest are `low`.
    """

    def step(d, level, x):
        found = {}
        for i in range(span - degree + level, span + 1):
            left, right = knots[i], knots[i + degree + 1 - level]
            share = (x - left) / (right - left)
            found[i] = [(1 - share) * a + share * b for a, b in zip(d[i - 1], d[i], strict=True)]
        return found

    begun = [{i: points[i] for i in range(span - degree, span + 1)}]
    for level in range(1, degree + 1):
        begun.append(step(begun[-1], level, low))
    for lows in range(degree, -1, -1):
        d = begun[lows]
        for level in range(lows + 1, degree + 1):
            d = step(d, level, high)
        yield d[span]


@pytest.mark.long
@pytest.mark.parametrize(
    ("degree", "knots", "decades"), covering((1, 2, 3, 8, 15), KNOTS, (0.0, 8.0))
)
def test_pieces_are_those_of_exact_arithmetic(knots, degree, decades):
    """The pieces may differ from exact arithmetic by the rounding error that the tree states."""
    made = curve(6, degree + 5, degree, knots, decades)
    weights = np.ones(len(made.control)) if made.weights is None else made.weights
    exact = [[*(Fraction(x) for x in row), Fraction(1)] for row in made.control.tolist()]
    exact = [[Fraction(w) * x for x in row] for w, row in zip(weights.tolist(), exact, strict=True)]
    vector = [Fraction(each) for each in made.knots.tolist()]
    tree = made._hierarchy.tree
    error = Fraction(tree.scale[6])
    assert float(error) < 1e-12
    seen = 0
    for piece in tree.pieces:
        low, high = (Fraction(float(piece[end][0])) for end in ("low", "high"))
        span = max(i for i, knot in enumerate(vector[: len(exact)]) if knot <= low)
        rows = tree.nets[piece["net"] :][: 4 * piece["room"]].reshape(4, -1)
        assert (rows[3] > 0.0).all()
        assert (rows[:, degree + 1 :] == rows[:, degree : degree + 1]).all()
        for j, (*x, w) in enumerate(blossoms(vector, degree, exact, span, low, high)):
            *y, k = (Fraction(float(each)) for each in rows[:, j])
            way = [a / w - b / k for a, b in zip(x, y, strict=True)]
            assert sum(each * each for each in way) <= error * error
            seen += 1
    ends = {Fraction(float(t)) for end in ("low", "high") for t in tree.pieces[end][:, 0]}
    assert ends >= set(vector[degree : len(exact) + 1])
    assert seen == (len(ends) - 1) * (degree + 1)


@pytest.mark.long
@pytest.mark.parametrize("decades", [0.0, 3.0])
@pytest.mark.parametrize("knots", KNOTS)
def test_pieces_are_the_patch(knots, decades):
    made = patch(8, (9, 8), (4, 3), knots, decades)
    tree = made._hierarchy.tree
    s, t = np.random.default_rng(2).random((2, 5))
    for piece in tree.pieces:
        p, q = int(piece["degree_u"]), int(piece["degree_v"])
        room = int(piece["room"])
        assert (p, q, int(piece["points"])) == (4, 3, 20)
        rows = tree.nets[piece["net"] :][: 4 * room].reshape(4, room)[:, :20]
        net = np.moveaxis(rows.reshape(4, 5, 4), 0, -1)
        ends = [np.repeat([0.0, 1.0], n) for n in (p + 1, q + 1)]
        found = np.array([BSpline(ends[1], BSpline(ends[0], net, p)(a), q)(b)
                          for a, b in zip(s, t, strict=True)])  # fmt: skip
        u, v = (piece["low"] + np.stack((s, t), 1) * (piece["high"] - piece["low"])).T
        expected = by_scipy(made, u, v)
        np.testing.assert_allclose(
            found[:, :3] / found[:, 3:], expected[:, :3] / expected[:, 3:], atol=1e-12
        )
        assert bool(piece["rational"]) == (decades > 0.0)
        assert decades or (rows[3] == 1.0).all()


def test_a_bezier_patch_is_its_own_piece():
    control = np.random.default_rng(9).normal(size=(4, 5, 3))
    (net,) = engine.Patch(control).nets
    assert np.array_equal(net.pieces()[0, 0, ..., :3], control)
    assert net.error() == 0.0 < net.error((2, 2))


def test_pieces_that_are_joined_have_the_same_points_there():
    wide = (12, 9), (3, 2), clamped, 6.0
    whole, alike, unlike = (1, 1), (3, 3), (4, 2)
    for made, parts in (
        (bumps(3), whole), (patch(5, *wide), whole), (bumps(3), alike), (patch(5, *wide), unlike),
    ):  # fmt: skip
        cut = made.nets[0].pieces(parts)
        spans = [len(along.low) for along in made.nets[0].spans]
        assert cut.shape[:2] == (parts[0] * spans[0], parts[1] * spans[1])
        assert np.array_equal(cut[:-1, :, -1], cut[1:, :, 0])
        assert np.array_equal(cut[:, :-1, :, -1], cut[:, 1:, :, 0])


def test_normals():
    rng = np.random.default_rng(3)
    u, v = rng.random((2, 40))
    for octant in sphere_patches():
        points, normals = octant.evaluate(u, v), octant.normal(u, v)
        np.testing.assert_allclose(normals, points, atol=1e-12)
    for part in torus_patches():
        points, normals = part.evaluate(u, v), part.normal(u, v)
        flat = points * (1.0, 1.0, 0.0)
        ring = flat / np.linalg.norm(flat, axis=1, keepdims=True)
        np.testing.assert_allclose(normals, (points - ring) / 0.3, atol=1e-12)


def test_normals_of_a_pole_are_those_nearby_and_of_a_point_there_are_none():
    poles = [each.normal([0.0, 0.3, 1.0], end) for each, end in zip(
        sphere_patches(), 4 * [0.0] + 4 * [1.0], strict=True)]  # fmt: skip
    up = np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(poles, [3 * [-up]] * 4 + [3 * [up]] * 4, atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(poles, axis=2), 1.0)
    point = engine.Patch(np.ones((3, 3, 3)))
    assert (point.normal([0.0, 0.5], 0.5) == 0.0).all()


@pytest.mark.parametrize(
    "u, v, message",
    [
        (1.5, 0.5, r"patch: u = 1\.5: must be from 0\.0 to 1\.0"),
        ([0.5, 0.6], [0.5, -0.1], r"patch: v\[1\] = -0\.1: must be"),
        (np.nan, 0.5, "patch: u = nan"),
        ("x", 0.5, "u: not an array of numbers"),
    ],
)
def test_parameters_outside_are_refused(u, v, message):
    with pytest.raises(ValueError, match=message):
        patch(1).evaluate(u, v)
