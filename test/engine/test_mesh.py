"""Triangle meshes, points and polylines from arrays; each bad array is refused by name."""

from __future__ import annotations

import math
import pickle
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest
from engine_bodies import IDENTITY, soup, sphere, translation

from proximity_monitor import engine
from proximity_monitor.engine import ModelError

CORNERS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
FACES = [[0, 1, 2], [0, 1, 3]]


def with_vertex(index, vertex):
    return [*CORNERS[:index], vertex, *CORNERS[index + 1 :]]


@pytest.mark.parametrize(
    ("vertices", "message"),
    [
        (with_vertex(2, [0.0, math.nan, 0.0]), r"vertices\[2\] .*finite"),
        (with_vertex(0, [math.inf, 0.0, 0.0]), r"vertices\[0\] .*finite"),
        (with_vertex(3, [0.0, 0.0, -math.inf]), r"vertices\[3\] .*finite"),
        (with_vertex(1, [1e46, 0.0, 0.0]), r"vertices\[1\] .*at most 1e\+45 m"),
        ([], "vertices: shape"),
        (np.empty((0, 3)), "vertices: must not be empty"),
        ([[0.0, 0.0]] * 4, r"vertices: shape \(4, 2\), expected \(n, 3\)"),
        (np.zeros((4, 3, 1)), r"vertices: shape \(4, 3, 1\)"),
        ([0.0, 0.0, 0.0], r"vertices: shape \(3,\)"),
        ([[0.0, 0.0, 0.0], [0.0, 0.0]], "vertices: not an array of numbers"),
        ([["a", "b", "c"]] * 4, "vertices: not an array of numbers"),
        (None, "vertices"),
    ],
)
def test_bad_vertices(vertices, message):
    with pytest.raises(ModelError, match=message) as caught:
        engine.TriangleMesh(vertices, FACES, name="bracket")
    assert str(caught.value).startswith("bracket: ")


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        ([[0, 1, 2], [0, 1, 4]], r"faces\[1\] = \[0, 1, 4\]: not all are vertices; there are 4"),
        ([[0, -1, 2]], r"faces\[0\] = \[0, -1, 2\]"),
        (np.array([[0, 1, 2**40]]), r"faces\[0\]"),
        (np.array([[0, 1, 2**63]], dtype=np.uint64), r"faces\[0\]"),
        ([], "faces: must not be empty"),
        (np.empty((0, 3), dtype=int), "faces: must not be empty"),
        ([[0, 1, 2, 3]], r"faces: shape \(1, 4\), expected \(m, 3\)"),
        ([0, 1, 2], r"faces: shape \(3,\)"),
        ([[0.0, 1.0, 2.0]], "faces: dtype float64, expected integers"),
        ([[True, False, True]], "faces: dtype bool, expected integers"),
        ([["0", "1", "2"]], "faces: dtype"),
        ([[0, 1, 2], [0, 1]], "faces: not an array"),
    ],
)
def test_bad_faces(faces, message):
    with pytest.raises(ModelError, match=message) as caught:
        engine.TriangleMesh(CORNERS, faces, name="bracket")
    assert str(caught.value).startswith("bracket: ")


def test_how_many_are_bad_is_said():
    vertices = np.zeros((5, 3))
    vertices[[1, 3]] = np.nan
    with pytest.raises(ModelError, match=r"vertices\[1\].*2 such vertices"):
        engine.TriangleMesh(vertices, FACES)
    with pytest.raises(ModelError, match=r"faces\[1\].*2 such faces"):
        engine.TriangleMesh(CORNERS, [[0, 1, 2], [0, 1, 9], [9, 1, 2]])


def test_a_model_error_is_a_value_error():
    assert issubclass(ModelError, ValueError)


@pytest.mark.parametrize("dtype", [np.int8, np.uint8, np.int16, np.uint32, np.int64, np.uint64])
@pytest.mark.parametrize("order", ["C", "F"])
def test_arrays_of_other_types_and_layouts(dtype, order):
    vertices = np.array(CORNERS, dtype=np.float32, order=order)
    mesh = engine.TriangleMesh(vertices, np.array(FACES, dtype=dtype, order=order))
    assert mesh.vertices.dtype == np.float64
    assert mesh.faces.dtype == np.int32
    assert mesh.vertices.tolist() == CORNERS
    assert mesh.faces.tolist() == FACES


def test_arrays_are_copied_and_frozen():
    vertices, faces = np.array(CORNERS), np.array(FACES, dtype=np.int32)
    mesh = engine.TriangleMesh(vertices, faces)
    vertices[0] = 7.0
    faces[0] = 3
    assert mesh.vertices.tolist() == CORNERS
    assert mesh.faces.tolist() == FACES
    for array in (mesh.vertices, mesh.faces, mesh.centre):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_name_and_description():
    assert engine.TriangleMesh(CORNERS, FACES).name == "mesh"
    mesh = engine.TriangleMesh(CORNERS, FACES, name="bracket")
    assert mesh.name == "bracket"
    assert repr(mesh) == "TriangleMesh('bracket', 4 vertices, 2 faces)"


@pytest.mark.parametrize("scale", [1e-30, 1e-6, 1.0, 1e9, 1e38])
@pytest.mark.parametrize("shift", [0.0, 1.0, 1e6])
def test_the_sphere_holds_every_vertex_exactly(scale, shift):
    mesh = soup(1)
    moved = engine.TriangleMesh((mesh.vertices + shift) * scale, mesh.faces)
    centre = [Fraction(x) for x in moved.centre.tolist()]
    radius = Fraction(moved.radius)
    for vertex in moved.vertices.tolist():
        offset = [Fraction(x) - c for x, c in zip(vertex, centre, strict=True)]
        assert sum(x * x for x in offset) <= radius**2
    assert moved.radius <= np.linalg.norm(np.ptp(moved.vertices, axis=0)) * (1.0 + 1e-9)


def test_the_sphere_of_one_point():
    mesh = engine.points([[3.0, 4.0, 5.0]])
    assert mesh.centre == pytest.approx([3.0, 4.0, 5.0])
    assert 0.0 <= mesh.radius <= 2e-14


def test_a_vertex_that_no_face_uses_is_not_part_of_the_surface():
    used = engine.TriangleMesh([*CORNERS, [50.0, 0.0, 0.0]], FACES)
    assert used.radius < 2.0
    found = engine.distance(used, IDENTITY, engine.points([[50.0, 0.0, 0.0]]), IDENTITY)
    assert found.upper == pytest.approx(49.0)


def test_degenerate_triangles_take_part():
    """A triangle, a segment, a point and a repeated triangle: each is nearest to some point."""
    vertices = [*CORNERS, [5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [-5.0, 0.0, 0.0]]
    faces = [[0, 1, 2], [4, 5, 5], [6, 6, 6], [0, 1, 2]]
    mesh = engine.TriangleMesh(vertices, faces)
    assert len(mesh.faces) == 4
    for x, expected, triangles in ((5.5, 1.0, {1}), (-7.0, 5.0**0.5, {2}), (0.2, 1.0, {0, 3})):
        found = engine.distance(mesh, IDENTITY, engine.points([[x, 0.0, 1.0]]), IDENTITY)
        assert found.upper == pytest.approx(expected)
        assert found.feature_a.index in triangles


def test_points_are_a_model():
    cloud = engine.points([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]], name="probe")
    assert cloud.name == "probe"
    assert cloud.faces.tolist() == [[0, 0, 0], [1, 1, 1]]
    found = engine.distance(cloud, IDENTITY, engine.points([[3.0, 4.0, 0.0]]), IDENTITY)
    assert found.lower <= 4.0 <= found.upper
    assert found.feature_a.index == 1
    assert found.feature_a.kind == "vertex"


def test_a_polyline_is_a_model():
    line = engine.polyline([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 2.0, 0.0]], name="cable")
    assert line.name == "cable"
    assert len(line.faces) == 2
    found = engine.distance(line, IDENTITY, engine.points([[1.0, 0.0, 3.0]]), IDENTITY)
    assert found.lower <= 3.0 <= found.upper
    assert found.point_a == pytest.approx([1.0, 0.0, 0.0])
    assert found.feature_a.kind == "edge"
    crossed = engine.distance(line, IDENTITY, line, translation(-1.0, -1.0))
    assert crossed.status is engine.Status.INTERSECTING


@pytest.mark.parametrize("make", [engine.points, engine.polyline])
def test_bad_points_are_refused(make):
    with pytest.raises(ModelError, match=r"vertices\[1\]"):
        make([[0.0, 0.0, 0.0], [0.0, math.nan, 0.0]])
    with pytest.raises(ModelError, match="must not be empty"):
        make(np.empty((0, 3)))
    with pytest.raises(ModelError, match="shape"):
        make([0.0, 0.0, 0.0])


@pytest.mark.parametrize("make", [engine.points, engine.polyline])
def test_points_and_polylines_have_any_kind_of_volume(make):
    coordinates = np.random.default_rng(1).normal(size=(100, 3))
    expected = engine.distance(make(coordinates), translation(9.0), sphere(1), IDENTITY)
    for volume in ("rss", "lss", "pss", "hybrid"):
        made = make(coordinates, volume=volume)
        assert made.volume == volume
        found = engine.distance(made, translation(9.0), sphere(1), IDENTITY)
        assert found.upper == pytest.approx(expected.upper)
    with pytest.raises(ModelError, match=r"^scan: volume = 'ball': unknown; .* rss, lss, pss"):
        make(coordinates, name="scan", volume="ball")


def test_a_polyline_needs_two_points():
    with pytest.raises(ModelError, match=r"cable: .*two points"):
        engine.polyline([[0.0, 0.0, 0.0]], name="cable")


def test_a_mesh_can_be_sent_to_another_process():
    mesh = sphere(1)
    copy = pickle.loads(pickle.dumps(mesh))
    here = translation(3.0)
    expected = engine.distance(mesh, here, mesh, IDENTITY)
    found = engine.distance(copy, here, copy, IDENTITY)
    assert (found.lower, found.upper) == (expected.lower, expected.upper)
    for array in (copy.vertices, copy.faces, copy.centre, *copy._hierarchy.tree):
        assert not array.flags.writeable


@pytest.mark.long
def test_the_engine_works_without_trimesh():
    """Models made from arrays need no file reader. Loading a file imports it."""
    code = (
        "import sys; from proximity_monitor import engine; "
        "engine.points([[0.0, 0.0, 0.0]]); sys.exit('trimesh' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
