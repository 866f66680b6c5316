"""Solids of revolution as models: input, properties, and distances to every other kind."""

import itertools
import json
import math
import pickle
from pathlib import Path

import numpy as np
import pytest
from engine_bodies import IDENTITY, box, pose, translation

from proximity_monitor import engine
from proximity_monitor.engine import Curve, ModelError, SolidOfRevolution

HALF = math.sqrt(0.5)
RIM = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]


def ball(radius=1.0, **how):
    """Return a ball around the origin."""
    low = Curve([[0, -radius], [radius, -radius], [radius, 0]], weights=[1, HALF, 1])
    high = Curve([[radius, 0], [radius, radius], [0, radius]], weights=[1, HALF, 1])
    return SolidOfRevolution([low, high], **how)


def cylinder(radius, height, **how):
    """Return a cylinder about the axis, from z = 0 up."""
    corners = [[0, 0], [radius, 0], [radius, height], [0, height]]
    return SolidOfRevolution([Curve(ends) for ends in itertools.pairwise(corners)], **how)


def torus(large, small, **how):
    """Return a torus about the axis."""
    knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
    control = [[large + small * x, small * y] for x, y in RIM]
    return SolidOfRevolution([Curve(control, knots, [1, HALF] * 4 + [1])], **how)


def vase(bulge=0.6):
    """Return a vase: a spline outside, a spline inside, a wall between, open at the top."""
    outside = [[0, 0], [0.5, 0], [bulge, 0.4], [0.2, 0.8], [0.4, 1.2]]
    inside = [[0.35, 1.2], [0.15, 0.8], [bulge - 0.1, 0.45], [0.3, 0.1], [0, 0.1]]
    knots = [0, 0, 0, 0, 0.5, 1, 1, 1, 1]
    return SolidOfRevolution(
        [Curve(outside, knots), Curve([outside[-1], inside[0]]), Curve(inside, knots)], name="vase"
    )


def test_points_of_patches_are_those_of_the_profile():
    made = vase()
    t, v = np.linspace(0.0, 1.0, 7), np.array([0.0, 0.3, 1.0, 2.7, 3.99])
    u, v = (each.ravel() for each in np.meshgrid(t, v))
    for net, own in zip(made.nets, made.profile.nets, strict=True):
        points = net.derivatives(u, v, 0)[:, 0, 0]
        rho, z, _ = own.derivatives(u, 0 * u, 0)[:, 0, 0].T
        theta = [made.feature(0, np.array([0.0, each, 0.0])).parameters[1] for each in v]
        expected = np.column_stack((rho * np.cos(theta), rho * np.sin(theta), z))
        assert np.abs(points - expected).max() < 1e-15


@pytest.mark.parametrize("axis", [(0, 0, 1), (1, 0, 0), (0, -2, 0), (1, 2, 3)])
def test_axis_and_origin(axis):
    made = ball(1.0, origin=(1, 2, 3), axis=axis)
    assert made.is_solid
    found = engine.distance(made, IDENTITY, engine.points([[4.0, 2, 3]]), IDENTITY)
    assert found.lower <= 2.0 <= found.upper < 2.0 + 1e-12
    long = cylinder(0.1, 5.0, axis=axis)
    tip = 5.0 * np.array(axis) / np.linalg.norm(axis)
    found = engine.closest_points(long, IDENTITY, [1.2 * tip])
    assert abs(found.upper[0] - 1.0) < 1e-12


def test_signs():
    ring = torus(2.0, 0.5)
    found = engine.closest_points(ring, IDENTITY, [[2.0, 0, 0], [0, 0, 0], [0, -3, 0]], signed=True)
    assert np.allclose(found.upper, [-0.5, 1.5, 0.5], atol=1e-12)
    found = engine.closest_points(vase(), IDENTITY, [[0.0, 0, 0.05], [0, 0, 0.5]], signed=True)
    assert found.upper[0] < 0.0 < found.lower[1]  # a point in its bottom, a point in its hollow


KINDS = {
    "revolution": vase(),
    "mesh": box((0.4, 0.5, 0.6)),
    "ball": engine.points([[0, 0, 0]], radius=0.2),
    "points": engine.points([[0, 0, 0], [0.3, 0, 0]]),
    "polyline": engine.polyline([[0, 0, 0], [0.3, 0, 0], [0.3, 0.4, 0]]),
    "patch": engine.Patch([[[0, 0, 0], [0, 1, 0.2]], [[1, 0, 0], [1, 1, 0]]]),
    "curve": Curve([[0, 0, 0], [0.5, 0.5, 0], [0, 1, 0]]),
}


@pytest.mark.parametrize("other", KINDS)
def test_against_every_kind(other):
    """Distances agree with those of fine tessellations, within the error of the tessellations."""
    tolerance = 1e-3
    models = vase(), KINDS[other]
    meshes = []
    for model in models:
        shown = model.display_mesh(tolerance)
        solid = None if model.is_solid else False
        meshes.append(
            engine.TriangleMesh(shown.vertices, shown.faces, deviation=tolerance, solid=solid)
        )
    rng = np.random.default_rng(3)
    for place in (0.3, 0.8, 5.0):
        poses = pose(rng), pose(rng, place)
        for a, b in ((0, 1), (1, 0)):
            found = engine.distance(models[a], poses[a], models[b], poses[b])
            about = engine.distance(meshes[a], poses[a], meshes[b], poses[b])
            assert about.lower - 1e-12 <= found.upper
            assert found.lower <= about.upper + 1e-12
            assert found.upper - found.lower <= 1e-9
            ends = (found.point_a, found.feature_a, a), (found.point_b, found.feature_b, b)
            for point, feature, k in ends:
                if isinstance(models[k], SolidOfRevolution):
                    assert feature.kind == "profile"
                    net = models[k].profile.nets[feature.index]
                    t, theta = feature.parameters
                    rho, z, _ = net.derivatives(np.array([t]), np.zeros(1), 0)[0, 0, 0]
                    own = np.array([rho * math.cos(theta), rho * math.sin(theta), z])
                    placed = poses[k][:3, :3] @ own + poses[k][:3, 3]
                    assert np.abs(placed - point).max() < 1e-12
        signed = engine.signed_distance(models[0], poses[0], models[1], poses[1])
        assert signed.lower <= about.upper + 1e-12


def test_deform():
    made = vase()
    pair = engine.Pair(made, engine.points([[2.0, 0, 0.4]]))
    before = pair.distance(IDENTITY, IDENTITY).upper
    moved = made.deform(vase(0.9).control_points)
    assert moved == pytest.approx(0.3)
    assert pair.distance(IDENTITY, IDENTITY).upper < before - 0.05
    assert made.revision == 1
    again = made.deform(vase().control_points[:, [0, 2]])
    assert again == pytest.approx(0.3)
    assert pair.distance(IDENTITY, IDENTITY).upper == pytest.approx(before, abs=1e-12)
    with pytest.raises(ModelError, match="off the half-plane"):
        made.deform(made.control_points + np.array([0, 0.1, 0]))
    with pytest.raises(ModelError, match="crosses the axis"):
        made.deform(made.control_points - np.array([0.3, 0, 0]))
    assert made.revision == 2


def test_pickled():
    made = pickle.loads(pickle.dumps(vase()))
    assert made.digest() == vase().digest() != vase(0.7).digest()
    assert made.profile.nets[0].control.shape == (5, 1, 3)
    assert "3 curves, 12 control points up to 0.6 m from the axis" in repr(made)
    at = translation(2.0)
    assert engine.distance(made, IDENTITY, made, at).upper == pytest.approx(
        engine.distance(vase(), IDENTITY, vase(), at).upper, abs=1e-15
    )


@pytest.mark.parametrize("up", [True, False])
def test_normals_to_show_point_outward(up):
    ends = [[0, 0], [1, 0], [1, 1], [0, 1]]
    curves = [Curve(each) for each in itertools.pairwise(ends if up else ends[::-1])]
    shown = SolidOfRevolution(curves).display_mesh(0.01)
    from_middle = shown.corners().mean(axis=1) - [0, 0, 0.5]
    a, b, c = shown.corners().transpose(1, 0, 2)
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), from_middle) >= -1e-12).all()
    assert (np.einsum("ij,ij->i", shown.normals, shown.vertices - [0, 0, 0.5]) > 0.0).all()


def test_the_file_that_the_documents_show(tmp_path):
    text = (Path(__file__).parents[2] / "docs" / "models.md").read_text(encoding="utf-8")
    (tmp_path / "cone.json").write_text(text.partition("```json\n")[2].partition("```")[0])
    cone = engine.load(tmp_path / "cone.json")
    assert isinstance(cone, SolidOfRevolution)
    found = engine.closest_points(cone, IDENTITY, [[0.0, 0.0, 0.1]])
    assert found.upper[0] == pytest.approx(0.05, abs=1e-12)


def test_written_and_read(tmp_path):
    made = SolidOfRevolution(
        [Curve(net.points[:, :2], net.knots_u) for net in vase().profile.nets],
        origin=(0.1, 0.2, 0.3),
        axis=(0, 3, 4),
    )
    engine.save_geomdl(made, tmp_path / "vase.json")
    again = engine.load(tmp_path / "vase.json")
    assert isinstance(again, SolidOfRevolution)
    assert np.array_equal(again.control_points, made.control_points)
    assert again.digest() == made.digest()
    half = engine.load(tmp_path / "vase.json", unit=0.001, scale=500.0)
    assert np.allclose(half.control_points, 0.5 * made.control_points, atol=1e-16)
    flat = engine.load(tmp_path / "vase.json", solid=False)
    assert isinstance(flat, engine.ParametricSurface)
    assert not flat.is_solid


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"profile": 3}, r"revolution.profile: expected list, got int"),
        ({"profile": [3]}, r"revolution.profile\[0\]: expected an object"),
        ({"axis": {"direction": [0, 0, 0]}}, "axis = .* must not be the zero vector"),
        ({"axis": {"origin": ["x"]}}, "revolution.axis.origin: must contain only numbers"),
        ({"axis": []}, "revolution.axis: expected dict, got list"),
        ({"profile": []}, "must not be empty"),
    ],
)
def test_files_that_are_refused(tmp_path, change, message):
    file = tmp_path / "part.json"
    engine.save_geomdl(vase(), file)
    tree = json.loads(file.read_text())
    tree["revolution"] |= change
    file.write_text(json.dumps(tree))
    with pytest.raises(ModelError, match=message) as caught:
        engine.load(file)
    assert "part.json" in str(caught.value)
    engine.save_geomdl(vase(), file)
    file.write_text(file.read_text().replace("0.5,\n", "-0.5,\n", 1))
    with pytest.raises(ModelError, match=r"revolution.profile\[0\]"):
        engine.load(file)


LINE = Curve([[0, 0], [1, 0]])


@pytest.mark.parametrize(
    ("curves", "message"),
    [
        ([], "must not be empty"),
        ([box()], r"curves\[0\]: expected Curve"),
        ([LINE], "no area|off the axis"),
        ([Curve([[0, 0], [1, 0], [1, 1]])], "ends at .* off the axis"),
        ([Curve([[1, 0], [1, 1], [0, 1]])], "begins at .* off the axis"),
        ([LINE, Curve([[1, 0.1], [0, 1]])], r"curves\[1\] begins at .* 0.1 m from"),
        ([LINE, Curve([[0, 1], [1, 0]])], r"reverse curves\[1\]"),
        ([Curve([[0, 0], [-1, 0.5], [0, 1]])], "crosses the axis: rho = -0.5"),
        ([Curve([[0, 0, 0], [1, 0.5, 1], [0, 1, 0]])], "not in the plane"),
        ([Curve([[0, 0], [0, 1]])], "no area"),
        (
            [Curve([[0, 0], [1, 1]]), Curve([[1, 1], [1, 0]]), Curve([[1, 0], [0, 1]])],
            r"curves\[0\] at t = 0.5 and curves\[2\] at t = 0.5 cross near \[0.5, 0.5\] m",
        ),
    ],
)
def test_what_is_refused(curves, message):
    with pytest.raises(ModelError, match=message):
        SolidOfRevolution(curves, name="part")


def test_walls_may_be_thin():
    """Two curves that are close to each other need not cross."""
    wave = np.column_stack((1.0 + 0.3 * np.sin(np.arange(8)), np.arange(8) / 7))
    knots = [0, 0, 0, 0, 1, 2, 3, 4, 5, 5, 5, 5]
    out, back = Curve(wave, knots), Curve((wave - [1e-6, 0])[::-1], knots)
    ends = wave[[0, -1]]
    rims = [Curve([ends[1], ends[1] - [1e-6, 0]]), Curve([ends[0] - [1e-6, 0], ends[0]])]
    assert SolidOfRevolution([out, rims[0], back, rims[1]]).profile.closed
    with pytest.raises(ModelError, match="cross near"):
        shifted = Curve(
            (wave - [1e-6, 0] + [[2e-6, 0]] * (np.arange(8) == 4)[:, None])[::-1], knots
        )
        SolidOfRevolution([out, rims[0], shifted, rims[1]])


def test_refused_axis():
    with pytest.raises(ModelError, match="must not be the zero vector"):
        ball(axis=(0, 0, 0))
    with pytest.raises(ModelError, match="three finite numbers"):
        ball(origin=(0, math.nan, 0))


def test_an_arc_holds_a_curve_that_runs_to_its_circle_s_far_side():
    """One curve makes a fin. Its middle is at the fin's foot: an arc through that bulges away."""
    z = (0, 0.825936, 1.206125, 1.238894, 1.02257, 0.65548, 0.235952, -0.137687, -0.36711, -0.35399)
    rho = (2.005, 2.005, 2.004778, 2.004333, 2.003667, 2.002778, 2.001667, 2.000333, 1.998778)
    weights = 1.0 * (7.0 / 3.0) ** np.arange(11)
    points = np.stack(((*rho, 1.997, 1.995), (*z, 0.0)), axis=1)
    fin = engine.Curve(points, weights=weights)
    around = [(1.995, 0.0), (0.0, 0.0)], [(0.0, -1.0), (3.0, -1.0)], [(3.0, -1.0), (3.0, 0.0)]
    lines = [engine.Curve(each) for each in (*around, [(3.0, 0.0), (2.005, 0.0)])]
    solid = engine.SolidOfRevolution([*lines[1:], fin, lines[0]])
    flank = fin.evaluate(np.linspace(0.0, 1.0, 20_001))
    tip = flank[:, 1].argmax()
    height = np.linspace(0.1, 0.98, 23)
    left = np.interp(height, flank[: tip + 1, 1], flank[: tip + 1, 0])
    right = np.interp(height, flank[:tip:-1, 1], flank[:tip:-1, 0])
    middle = np.stack((0.5 * (left + right), 0.0 * height, height), axis=1)
    found = engine.closest_points(solid, IDENTITY, middle, signed=True)
    assert (found.upper < 0.0).all()
    above = np.array([[flank[tip, 0], 0.0, flank[tip, 1] + 0.3]])
    found = engine.closest_points(solid, IDENTITY, above)
    assert found.lower[0] <= 0.3 <= found.upper[0] + 1e-6
    ball, at = engine.shapes.sphere(0.05), np.eye(4)
    at[:3, 3] = above[0]
    for lower in (
        engine.distance(solid, IDENTITY, ball, at).lower,
        engine.distance(ball, at, solid, IDENTITY).lower,
    ):
        assert lower <= 0.25 + 1e-9


@pytest.mark.parametrize("skew", [1e-2, 1e-4, 1e-6])
def test_a_circle_has_the_same_feet_whatever_its_end_weights(skew):
    half = math.sqrt(0.5)
    upper = engine.Curve([[1, 0], [1, 1], [0, 1]], weights=[1.0, skew * half, skew * skew])
    lower = engine.Curve([[0, -1], [1, -1], [1, 0]], weights=[1.0, half, 1.0])
    ball, rng = engine.SolidOfRevolution([lower, upper]), np.random.default_rng(0)
    angle, away = rng.uniform(0.02, 1.55, 500), rng.choice([1e-6, 0.01, 0.3, -0.3], 500)
    points = np.stack((np.cos(angle), 0.0 * angle, np.sin(angle)), axis=1)
    found = engine.closest_points(ball, IDENTITY, points * (1.0 + away)[:, None], signed=True)
    assert (found.lower <= away + 1e-12).all()
    assert (found.upper >= away - 1e-12).all()
    assert (found.upper - found.lower).max() < 1e-9
