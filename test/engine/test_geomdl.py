"""geomdl JSON files, compared with the geomdl package."""

from __future__ import annotations

import json

import numpy as np
import pytest
from engine_surfaces import clamped, curve, patch
from geomdl import NURBS, BSpline, exchange, multi

from proximity_monitor import engine
from proximity_monitor.engine import ModelError


def theirs(seed=1, sizes=(6, 5), degrees=(3, 2)):
    """Return a geomdl surface."""
    rng = np.random.default_rng(seed)
    made = NURBS.Surface()
    made.degree_u, made.degree_v = degrees
    made.ctrlpts_size_u, made.ctrlpts_size_v = sizes
    made.ctrlpts = rng.normal(size=(sizes[0] * sizes[1], 3)).tolist()
    made.weights = rng.uniform(0.5, 2.0, sizes[0] * sizes[1]).tolist()
    made.knotvector_u, made.knotvector_v = (
        clamped(rng, size, degree).tolist() for size, degree in zip(sizes, degrees, strict=True)
    )
    return made


PARAMETERS = np.random.default_rng(2).random((30, 2))


def points_of(surface):
    return np.array(surface.evaluate_list(PARAMETERS.tolist()))


def test_a_surface_of_geomdl_is_read(tmp_path):
    exchange.export_json(theirs(), str(tmp_path / "hood.json"))
    model = engine.load(tmp_path / "hood.json", deviation=0.1)
    assert (type(model), model.name, model.deviation) == (engine.Patch, "hood", 0.1)
    found = model.evaluate(*PARAMETERS.T)
    np.testing.assert_allclose(found, points_of(theirs()), atol=1e-14)
    expected = theirs().derivatives(0.3, 0.6, 2)
    derivatives = model.derivatives(0.3, 0.6, 2)
    for i, j in ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2)):
        np.testing.assert_allclose(derivatives[i, j], expected[i][j], rtol=1e-11, atol=1e-11)


def test_several_surfaces_are_one_model(tmp_path):
    both = multi.SurfaceContainer(theirs(), theirs(2, (4, 7), (2, 4)))
    exchange.export_json(both, str(tmp_path / "two.json"))
    model = engine.load(tmp_path / "two.json", unit=0.001, scale=2.0)
    assert isinstance(model, engine.ParametricSurface)
    assert model.describe(str) == "2 patches, 58 control points"
    np.testing.assert_allclose(model.control_points[:30], 0.002 * np.array(theirs().ctrlpts))


@pytest.mark.parametrize("columns", [2, 3])
def test_a_curve_of_geomdl_is_read(tmp_path, columns):
    rng = np.random.default_rng(3)
    given = BSpline.Curve()
    given.degree = 3
    given.ctrlpts = rng.normal(size=(8, columns)).tolist()
    given.knotvector = clamped(rng, 8, 3).tolist()
    exchange.export_json(given, str(tmp_path / "rail.json"))
    model = engine.load(tmp_path / "rail.json")
    expected = np.array(given.evaluate_list(PARAMETERS[:, 0].tolist()))
    found = model.evaluate(PARAMETERS[:, 0])
    np.testing.assert_allclose(found[:, :columns], expected, atol=1e-14)
    assert model.weights is None


def test_geomdl_reads_what_is_written(tmp_path):
    model, file = patch(4, decades=1.0), tmp_path / "made.json"
    engine.save_geomdl(model, file)
    (surface,) = exchange.import_json(str(file))
    np.testing.assert_allclose(points_of(surface), model.evaluate(*PARAMETERS.T), atol=1e-13)


@pytest.mark.parametrize(
    "model",
    [
        patch(4, decades=8.0),
        patch(5),
        curve(6, decades=2.0),
        engine.ParametricSurface([patch(7), patch(8, (5, 5), (4, 4), decades=1.0)], solid=None),
        engine.ParametricSurface([curve(7), curve(8)], solid=None),
    ],
    ids=repr,
)
def test_what_is_written_comes_back(tmp_path, model):
    engine.save_geomdl(model, tmp_path / "made.json")
    again = engine.load(tmp_path / "made.json")
    assert (type(again), again.digest()) == (type(model), model.digest())


def test_what_has_no_place_in_a_file_is_refused(tmp_path):
    file = tmp_path / "made.json"
    with pytest.raises(ModelError, match="surface: has patches and curves"):
        engine.save_geomdl(engine.ParametricSurface([patch(1), curve(1)]), file)
    with pytest.raises(TypeError, match="expected a parametric surface, got TriangleMesh"):
        engine.save_geomdl(engine.points([[0.0, 0.0, 0.0]]), file)
    assert not file.exists()


def tree(**more):
    """Return the content of a file with one surface; `more` replaces values of its keys."""
    points = np.arange(12.0).reshape(4, 3).tolist()
    item = {
        "degree_u": 1, "degree_v": 1, "size_u": 2, "size_v": 2,
        "knotvector_u": [0.0, 0.0, 1.0, 1.0], "knotvector_v": [0, 0, 1, 1],
        "control_points": {"points": points},
    }  # fmt: skip
    return {"shape": {"type": "surface", "count": 1, "data": [item | more]}}


def without(key):
    made = tree()
    del made["shape"]["data"][0][key]
    return made


POINTS = tree()["shape"]["data"][0]["control_points"]["points"]
BAD = {
    "no JSON": (b"{]", "invalid JSON"),
    "infinite": (b'{"shape": Infinity}', "Infinity is not a number"),
    "a key twice": (b'{"shape": {"type": "curve", "type": "surface"}}', "'type' appears twice"),
    "another JSON": ([1, 2], "shape is missing"),
    "no type": ({"shape": {}}, "shape.type is missing"),
    "volume": ({"shape": {"type": "volume"}}, "shape.type = 'volume': must be 'curve' or"),
    "no data": ({"shape": {"type": "curve", "data": {}}}, "shape.data: expected list, got dict"),
    "empty": ({"shape": {"type": "curve", "data": []}}, "patches: must not be empty"),
    "no object": ({"shape": {"type": "curve", "data": [3]}}, r"shape.data\[0\]: expected an obj"),
    "trims": (tree(trims={"count": 1}), r"shape.data\[0\].trims: trimmed surfaces are not supp"),
    "no degree": (without("degree_v"), r"shape.data\[0\].degree_v is missing"),
    "no knots": (without("knotvector_u"), r"data\[0\].knotvector_u is missing"),
    "a true degree": (tree(degree_u=True), "degree_u: expected int, got bool"),
    "sizes": (tree(size_u=3), "points: 4 points, but size_u and size_v require 3 x 2"),
    "degree": (tree(degree_u=2), "4 knots, but 2 control points of degree 2 need 5"),
    "text": (tree(knotvector_u=["a"] * 4), "knotvector_u: must contain only numbers"),
    "flat": (tree(control_points={"points": [1, 2, 3, 4]}), r"points: shape \(4,\), expected 2"),
    "rows": (
        tree(control_points={"points": [[1, 2, 3], [1, 2]]}),
        "points: the rows have different",
    ),
    "two columns": (
        tree(control_points={"points": [row[:2] for row in POINTS]}),
        r"shape.data\[0\]: control: shape \(2, 2, 2\)",
    ),
    "few weights": (
        tree(control_points={"points": POINTS, "weights": [1.0]}),
        "control_points.weights: 1 weights for 4 points",
    ),
    "a bad weight": (
        tree(control_points={"points": POINTS, "weights": [1, 1, 0, 1]}),
        r"shape.data\[0\]: weights\[1\]\[0\] = 0.0: every weight",
    ),
    "decreasing": (
        tree(knotvector_v=[0.0, 1.0, 0.5, 1.0]),
        r"shape.data\[0\]: knots_v\[2\] = 0.5: is less than",
    ),
    "count": (
        tree() | {"shape": tree()["shape"] | {"count": 2}},
        "shape.count = 2, but shape.data has 1",
    ),
    "both": (tree() | {"revolution": {}}, "both 'shape' and 'revolution'"),
    "overflow": (
        tree(control_points={"points": [[1e300] * 3] * 4}),
        r"shape.data\[0\]: control\[0\]\[0\] = .* at most 1e\+45",
    ),
}


@pytest.mark.parametrize("content, message", BAD.values(), ids=BAD)
def test_a_file_that_is_wrong_is_refused_by_its_name_and_key(tmp_path, content, message):
    file = tmp_path / "bad.json"
    file.write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())
    with pytest.raises(ModelError, match=message) as caught:
        engine.load(file)
    assert str(caught.value).startswith(f"{file}: ")


@pytest.mark.parametrize(
    "how, message",
    [
        ({"volume": "obb"}, "volume = 'obb': must be 'rss'"),
        ({"solid": "robust"}, "solid = 'robust': only for meshes"),
    ],
)
def test_what_surfaces_do_not_take_is_refused(tmp_path, how, message):
    file = tmp_path / "a.json"
    file.write_text(json.dumps(tree()))
    assert engine.load(file, solid=False).degrees == (1, 1)
    file.write_text(json.dumps(tree(trims={"count": 0, "data": []})))
    assert engine.load(file, solid=False).degrees == (1, 1)
    with pytest.raises(ModelError, match=rf"a\.json: {message}"):
        engine.load(file, **how)
