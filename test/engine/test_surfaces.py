"""Patches, curves and surfaces of several as models: input, hierarchy, display and copies."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from engine_surfaces import (
    bumps,
    clamped,
    curve,
    patch,
    sphere_patches,
    torn,
    torus_patches,
    unclamped,
)

from proximity_monitor import engine
from proximity_monitor.engine import Curve, ModelError, ParametricSurface, Patch
from proximity_monitor.engine.kernels.base.tables import arrays_of, model_table
from proximity_monitor.engine.models.surface_tree import check_surface_tree

NAN = float("nan")
NET = np.random.default_rng(1).normal(size=(4, 5, 3))


def changed(array, place, value):
    array = np.array(array, dtype=np.float64)
    array[place] = value
    return array


LINE = [0.0, 0.0, 0.0, 0.4, 1.0, 1.0, 1.0]
"""Knots of degree 2 for four control points."""

BAD = {
    "no numbers": (lambda: Patch("x"), "patch: control: not an array of numbers"),
    "flat control": (lambda: Patch(NET[0]), r"patch: control: shape \(5, 3\), expected \(n_u, n_v"),
    "planar patch": (lambda: Patch(NET[..., :2]), r"patch: control: shape \(4, 5, 2\)"),
    "one row": (lambda: Patch(NET[:1]), "patch: knots_u: None means .* not 1"),
    "no row": (lambda: Patch(NET[:0]), "patch: knots_u: None means .* not 0"),
    "too many": (lambda: Patch(np.zeros((17, 2, 3))), "knots_u: None means .* 2 to 16 .* not 17"),
    "NaN": (
        lambda: Patch(changed(NET, (1, 2, 0), NAN)),
        r"patch: control\[1\]\[2\] = \[nan, .*: every coordinate must be finite",
    ),
    "huge": (
        lambda: Curve(changed(NET[0], (3, 2), -2e45), name="rail"),
        r"rail: control\[3\] = .* at most 1e\+45 m",
    ),
    "decreasing": (
        lambda: Patch(NET, changed(LINE, 2, 0.5)),
        r"patch: knots_u\[3\] = 0\.4: is less than the knot before",
    ),
    "knots are not finite": (
        lambda: Patch(NET, None, changed([0, 0, 0, 0, 1, 2, 2, 2, 2], 4, NAN)),
        r"patch: knots_v\[4\] = nan: every knot must be finite",
    ),
    "too few knots": (
        lambda: Patch(NET, LINE[:5]),
        "knots_u: 5 knots for 4 control points give degree 0 .*must be 1 to 15",
    ),
    "too many knots": (
        lambda: Patch(NET, [0.0] * 9 + [1.0]),
        "knots_u: 10 knots for 4 control points give degree 5, .*at least 6",
    ),
    "degree 16": (
        lambda: Curve(np.zeros((20, 3)), np.arange(37.0)),
        "curve: knots: 37 .* give degree 16",
    ),
    "no domain": (
        lambda: Patch(NET, [0.0, 1.0, 1.0, 1.0, 1.0, 2.0, 3.0]),
        "knots_u: knots 2 and 4, .* are both 1.0",
    ),
    "knots in rows": (lambda: Patch(NET, [LINE]), r"knots_u: shape \(1, 7\), expected \(n,\)"),
    "too wide": (
        lambda: Patch(NET, [-1.7e308, -1e308, 0.0, 1.0, 2.0, 1e308, 1.7e308]),
        "knots_u: the range from -1.7e.308 to 1.7e.308 overflows",
    ),
    "weights' shape": (
        lambda: Patch(NET, weights=np.ones((5, 4))),
        r"patch: weights: shape \(5, 4\), expected \(4, 5\)",
    ),
    "weight 0": (
        lambda: Patch(NET, weights=changed(np.ones((4, 5)), (2, 3), 0.0)),
        r"patch: weights\[2\]\[3\] = 0.0: every weight must be finite and above 0",
    ),
    "weight NaN": (
        lambda: Curve(NET[0], weights=[1, 1, 1, NAN, -1]),
        r"curve: weights\[3\] = nan: .* \(2 such places\)",
    ),
    "infinite weight": (
        lambda: Curve(NET[0], weights=[1, 1, np.inf, 1, 1]),
        r"curve: weights\[2\] = inf",
    ),
    "tiny weight": (
        lambda: Curve(NET[0], weights=[1, 1, 1e-60, 1, 1]),
        r"curve: weights\[2\] = 1e-60: must be at least 1e-50 of the largest",
    ),
    "deviation": (lambda: Patch(NET, deviation=-1.0), "patch: deviation = -1.0: must be from 0 to"),
    "nothing": (lambda: ParametricSurface([]), "surface: patches: must not be empty"),
    "a mesh": (
        lambda: ParametricSurface([Patch(NET), engine.points([[0, 0, 0]])]),
        r"surface: patches\[1\]: expected Patch or Curve, got TriangleMesh",
    ),
    "a surface of surfaces": (
        lambda: ParametricSurface([ParametricSurface([Patch(NET), Curve(NET[0])])]),
        r"patches\[0\]: expected Patch or Curve, got ParametricSurface",
    ),
}


@pytest.mark.parametrize("make, message", BAD.values(), ids=BAD)
def test_what_is_wrong_is_named(make, message):
    with pytest.raises(ModelError, match=message):
        make()


def mixed():
    return ParametricSurface([curve(1), patch(2), curve(3, decades=4.0), patch(4, decades=2.0)])


def many(count):
    rng = np.random.default_rng(count)
    control = rng.normal(size=(count, 1, 1, 3)) + 0.1 * rng.normal(size=(count, 3, 4, 3))
    return ParametricSurface([Patch(each) for each in control])


def far():
    return Patch(NET * 1e-3 + 1e6, weights=10.0 ** (8.0 * np.random.default_rng(5).random((4, 5))))


MODELS = {
    "patch": lambda: patch(1),
    "extreme weights": lambda: patch(2, decades=45.0),
    "torn": lambda: patch(3, knots=torn),
    "unclamped": lambda: patch(4, (30, 30), (3, 3), unclamped),
    "degree 15": lambda: patch(5, (20, 18), (15, 15), clamped, 2.0),
    "flat": lambda: Patch(NET * (1.0, 1.0, 0.0)),
    "a point": lambda: Patch(np.ones((3, 4, 3)), weights=np.arange(1.0, 13.0).reshape(3, 4)),
    "the origin": lambda: Patch(np.zeros((2, 2, 3))),
    "a needle": lambda: Patch(NET * (1.0, 1e-9, 1e-9)),
    "collapsed edge": lambda: Patch(np.concatenate((NET, np.tile(NET[-1:, :1], (1, 5, 1))))),
    "huge": lambda: Patch(NET / np.abs(NET).max() * 1e45),
    "tiny": lambda: Patch(NET * 1e-40),
    "vanishing": lambda: Patch(NET * 1e-300),
    "far from the origin": far,
    "curve": lambda: curve(6, decades=6.0),
    "curve in the plane": lambda: curve(7, columns=2),
    "mixed": mixed,
    "sphere": lambda: ParametricSurface(sphere_patches()),
    "torus": lambda: ParametricSurface(torus_patches()),
} | {f"{n} patches": lambda n=n: many(n) for n in (2, 16, 17, 300)}


def sampled(model, count=7):
    """Return points of all patches and curves."""
    made = []
    for net in model.nets:
        u, v = (np.linspace(each.low[0], each.high[-1], count) for each in net.spans)
        made.append(net.derivatives(np.repeat(u, count), np.tile(v, count), 0)[:, 0, 0])
    return np.concatenate(made)


@pytest.mark.long
@pytest.mark.parametrize("name", MODELS)
def test_every_volume_holds_its_pieces_also_when_they_moved(name):
    model = MODELS[name]()
    for _ in range(2):
        tree = model._hierarchy.tree
        check_surface_tree(tree)
        with pytest.raises(ValueError, match="read-only"):
            tree.nets[0] = 1.0
        assert np.array_equal(model._hierarchy.numbers, tree.pieces["patch"])
        ways = (sampled(model) - model.centre) * tree.scale[1]
        radius = (model.radius + 1e-45) * tree.scale[1]  # below that, squares underflow
        assert np.linalg.norm(ways, axis=1).max() <= radius * (1.0 + 1e-12)
        assert model._hierarchy.spread_corners().max() < 3 * len(tree.pieces)
        model.deform(np.roll(model.control_points, 1, axis=1) * (0.1, 0.3, 0.2))
    assert model.revision == 2


def damaged(field, place, factor, model):
    array = getattr(tree := model._hierarchy.tree, field).copy()
    array[place] *= factor
    return tree._replace(**{field: array})


@pytest.mark.parametrize(
    "field, place, factor, message",
    [
        ("nodes", slice(9 * 16, 9 * 16 + 1), 1.0 - 1e-5, "node 0 lane 0: a control point lies"),
        ("nodes", slice(192, 195), 1.5, "node 1 lane 0: a control point lies"),
        ("centres", (1, 0), 1.1, "node 1 lane 0"),
        ("centres", (1, 3), 0.5, "node 1 lane .*: reaches"),
        ("sizes", 0, 0.1, "node 0 lane 0: its size"),
        ("scale", 0, 0.25, "lies .* outside|scale"),
        ("scale", 2, 0.9, "scale: a control point lies beyond"),
        ("nets", slice(0, 5), 3.0, "node"),
    ],
)
def test_damage_is_found(field, place, factor, message):
    with pytest.raises(AssertionError, match=message):
        check_surface_tree(damaged(field, place, factor, many(40)))


def test_tables_of_all_kinds_have_one_width_and_refuse_other_arrays():
    core = many(2)._hierarchy
    mesh = engine.points([[0.0, 0.0, 0.0]])._hierarchy
    assert core.table.shape == mesh.table.shape
    with pytest.raises(TypeError, match=r"sizes: float64 .*, expected float32"):
        model_table(core.numbers, core.tree._replace(sizes=core.tree.sizes.astype(float)))


def test_a_piece_in_no_leaf_is_found():
    tree = many(40)._hierarchy.tree
    children = tree.children.copy()
    (leaves,) = np.nonzero((children < 0) & (children != -(2**31)))
    children[leaves[-1]] = children[leaves[0]]
    with pytest.raises(AssertionError, match=r"stands in [02] leaves|outside"):
        check_surface_tree(tree._replace(children=children))


@pytest.mark.parametrize("name", ["patch", "extreme weights", "torn", "curve", "mixed"])
def test_no_point_moves_farther_than_deform_says(name):
    model, rng = MODELS[name](), np.random.default_rng(8)
    before, digest = sampled(model), model.digest()
    ways = 0.1 * rng.normal(size=model.control_points.shape)
    most = model.deform(model.control_points + ways)
    assert np.linalg.norm(ways, axis=1).max() <= most * (1.0 + 1e-15)
    moved = np.linalg.norm(sampled(model) - before, axis=1)
    assert 0.0 < moved.max() <= most * (1.0 + 1e-12)
    assert model.digest() != digest
    fresh = MODELS[name]()
    fresh.deform(model.control_points)
    assert fresh.digest() == model.digest()
    assert np.array_equal(fresh._hierarchy.tree.nets, model._hierarchy.tree.nets)


@pytest.mark.parametrize(
    "points, message",
    [
        (NET.reshape(-1, 3)[:-1], "patch: control_points: 19 given, expected 20"),
        (NET, r"patch: control_points: shape \(4, 5, 3\)"),
        (changed(NET.reshape(-1, 3), (7, 1), NAN), r"patch: control_points\[7\] = .*finite"),
    ],
)
def test_a_deformation_that_is_refused_changes_nothing(points, message):
    model = Patch(NET)
    digest, hierarchy = model.digest(), model._hierarchy
    with pytest.raises(ModelError, match=message):
        model.deform(points)
    assert (model.digest(), model.revision) == (digest, 0)
    assert model._hierarchy is hierarchy


def test_what_is_given_is_copied_and_weights_lose_a_power_of_two():
    control, weights = NET.copy(), np.full((4, 5), 4.0)
    model = Patch(control, weights=weights)
    assert model.weights is None
    control[:] = 0.0
    assert np.array_equal(model.control, NET)
    weights[0, 0] = 20.0
    model = Patch(NET, weights=weights)
    assert model.weights.max() == 20.0 / 32.0
    for array in (model.control, model.weights, model.knots_u, model.control_points):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    assert Patch(NET, weights=1024.0 * weights).digest() == model.digest()


def test_a_surface_describes_itself():
    one, line = Patch(NET), Curve(NET[0])
    several = ParametricSurface([one, Patch(NET)], name="hood")
    texts = [each.describe(str) for each in (one, line, several, ParametricSurface([one, line]))]
    assert texts == [
        "1 patch of degree 3 x 4, 20 control points",
        "1 curve of degree 4, 5 control points",
        "2 patches of degree 3 x 4, 40 control points",
        "1 patch of degree 3 x 4 and 1 curve of degree 4, 25 control points",
    ]
    assert repr(several).startswith("ParametricSurface('hood', 2 patches")
    assert "2 patches and 2 curves, " in mixed().describe(str) or "2 curves" in mixed().describe(
        str
    )
    assert {one.kind, line.kind, several.kind} == {"surface"}
    assert (one.has_area, line.has_area, mixed().has_area) == (True, False, True)
    assert not one.is_solid
    assert one.not_solid == "it is declared a surface (solid=False)"
    assert line.not_solid == one.not_solid
    assert (one.degrees, line.degree) == ((3, 4), 4)
    assert one.domain == ((0.0, 1.0), (0.0, 1.0))
    assert line.domain == (0.0, 1.0)
    assert several.deviation == 0.0
    assert ParametricSurface([Patch(NET, deviation=0.2), one], deviation=0.1).deviation == 0.2
    assert Patch(NET, deviation=0.2).radius == pytest.approx(one.radius + 0.2)


def test_a_point_lies_on_a_patch_or_on_a_curve():
    on_patch = ParametricSurface.feature(3, np.array([0.2, 0.3, 0.0]))
    assert (on_patch.kind, on_patch.index, on_patch.parameters.tolist()) == ("patch", 3, [0.2, 0.3])
    on_curve = Curve.feature(1, np.array([0.2, 0.0, 1.0]))
    assert (on_curve.kind, on_curve.index, on_curve.parameters.tolist()) == ("curve", 1, [0.2])
    for model in (patch(1, knots=unclamped), curve(2, knots=unclamped)):
        core = model._hierarchy
        u, v, third, element = core.some_feature
        at = (u,) if isinstance(model, Curve) else (u, v)
        np.testing.assert_allclose(model.evaluate(*at), core.some_point, atol=1e-13)
        assert (third, element) == (float(isinstance(model, Curve)), 0.0)


@pytest.mark.parametrize("route", [copy.deepcopy, lambda m: pickle.loads(pickle.dumps(m))])
def test_copies_are_the_same_and_own_their_memory(route):
    model = mixed()
    model.deform(model.control_points * 1.1)
    again = route(model)
    assert (again.digest(), again.name, again.revision) == (model.digest(), "surface", 1)
    trees = [list(arrays_of(each._hierarchy.tree)) for each in (model, again)]
    for one, other in zip(*trees, strict=True):
        np.testing.assert_array_equal(one, other)
        assert not np.shares_memory(one, other)
        assert not other.flags.writeable
    assert not any(net.control.flags.writeable for net in again.nets)
    again.deform(again.control_points + 1.0)
    assert (again.revision, model.revision) == (2, 1)


def test_a_pickle_of_another_version_is_refused():
    state = Patch(NET, name="lid").__getstate__() | {"kernels": "older"}
    with pytest.raises(ModelError, match="lid: pickled by another version"):
        Patch.__new__(Patch).__setstate__(state)


def spread(mesh, count=8):
    """Return points of a display mesh's triangles."""
    s, t = np.random.default_rng(1).random((2, count))
    s, t = np.where(s + t > 1.0, 1.0 - s, s), np.where(s + t > 1.0, 1.0 - t, t)
    a, b, c = (mesh.corners()[:, None, i] for i in range(3))
    return (a + s[:, None] * (b - a) + t[:, None] * (c - a)).reshape(-1, 3)


@pytest.mark.parametrize("tolerance", [0.1, 1e-2, 1e-3])
def test_triangles_to_show_are_within_their_tolerance(tolerance):
    ball = ParametricSurface(sphere_patches()).display_mesh(tolerance)
    ring = ParametricSurface(torus_patches()).display_mesh(tolerance)
    assert np.abs(np.linalg.norm(spread(ball), axis=1) - 1.0).max() <= ball.off <= tolerance
    x, y, z = spread(ring).T
    assert np.abs(np.hypot(np.hypot(x, y) - 1.0, z) - 0.3).max() <= ring.off <= tolerance
    np.testing.assert_allclose(ball.normals, ball.vertices, atol=1e-5)
    assert len(ring.faces) * tolerance < 200.0  # no more triangles than needed
    for made, larger in ((bumps(4), 1.0), (patch(6, decades=0.5), 30.0)):
        shown = made.display_mesh(tolerance * larger)
        mesh = engine.TriangleMesh(shown.vertices, shown.faces)
        found = engine.closest_points(mesh, np.eye(4), sampled(made, 50))
        assert found.upper.max() <= min(shown.off, tolerance * larger)


def test_faces_to_show_point_to_the_side_of_their_normals():
    for model in (bumps(5), ParametricSurface(sphere_patches())):
        mesh = model.display_mesh(1e-2)
        a, b, c = (mesh.corners()[:, i] for i in range(3))
        flat = np.cross(b - a, c - a)
        along = np.einsum("ij,ij->i", flat, mesh.normals[mesh.faces].mean(axis=1))
        assert (along[np.linalg.norm(flat, axis=1) > 1e-9] > 0.0).all()
        lengths = np.linalg.norm(mesh.normals, axis=1)
        np.testing.assert_allclose(lengths, 1.0)


def test_what_is_flat_is_shown_as_it_is_and_the_finest_has_an_end():
    square = Patch(np.array([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]]))
    assert len(square.display_mesh(0.0).faces) == 2
    assert square.display_mesh(0.0).off < 1e-11
    raised = engine.Patch(np.stack(np.meshgrid([0, 1, 2], [0, 1, 2, 3], [5.0]), -1)[:, :, 0])
    assert len(raised.display_mesh(0.0).faces) == 2
    assert 1000 < len(ParametricSurface(sphere_patches()).display_mesh(0.0).faces) <= 120_000
    assert len(MODELS["unclamped"]().display_mesh(0.0).faces) <= 120_000
    assert len(MODELS["extreme weights"]().display_mesh(1e-3).faces) <= 120_000


def test_a_curve_is_shown_as_a_polyline():
    line = curve(3, knots=torn)
    shown = line.display_mesh(1e-3)
    assert (shown.faces[:, 1] == shown.faces[:, 2]).all()
    assert shown.normals is None
    mesh = engine.TriangleMesh(shown.vertices, shown.faces)
    t = np.linspace(*line.domain, 500)
    found = engine.closest_points(mesh, np.eye(4), line.evaluate(t))
    assert found.upper.max() <= 1e-3
