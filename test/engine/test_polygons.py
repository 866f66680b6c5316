"""Polygons that are not convex, in every format that has polygons."""

import time

import numpy as np
import pytest
from model_files import DAE, binary_stl

from proximity_monitor import engine
from proximity_monitor.engine.files.polygons import cut_polygons

ELL = [(3, 0), (3, 1), (1, 1), (1, 3), (0, 3), (0, 0)]
COMB = [
    (0, 0),
    (7, 0),
    (7, 3),
    (6, 3),
    (6, 1),
    (5, 1),
    (5, 3),
    (3, 3),
    (3, 1),
    (1, 1),
    (1, 3),
    (0, 3),
]
STRAIGHT = [(0, 0), (1, 0), (2, 0), (4, 0), (4, 4), (2, 1), (1, 4), (0, 4), (0, 2)]
ARROW = [(-1, 1), (0, 0.2), (1, 1), (0, -1)]


def of_format(kind, points):
    """Return a polygon (n, 3) as a file of the given format."""
    lines = [" ".join(map(repr, map(float, point))) for point in points]
    n, ring = len(points), " ".join(map(str, range(len(points))))
    if kind == "obj":
        return (
            "".join(f"v {line}\n" for line in lines) + f"f {' '.join(map(str, range(1, n + 1)))}\n"
        )
    if kind == "off":
        return f"OFF\n{n} 1 0\n" + "\n".join([*lines, f"{n} {ring}", ""])
    if kind == "ply":
        head = f"ply\nformat ascii 1.0\nelement vertex {n}\n"
        head += "".join(f"property double {axis}\n" for axis in "xyz")
        head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        return head + "\n".join([*lines, f"{n} {ring}", ""])
    start, end = DAE.index("<triangles"), DAE.index("</mesh>")
    body = (
        f'<polylist count="1"><input semantic="VERTEX" source="#v" offset="0"/><vcount>{n}</vcount>'
    )
    text = DAE[:start] + f"{body}<p>{ring}</p></polylist>" + DAE[end:]
    numbers = " ".join(lines)
    text = text.replace("0 0 0 1 0 0 0 2 0 0 0 3", numbers)
    return text.replace('count="12"', f'count="{3 * n}"').replace('count="4"', f'count="{n}"')


@pytest.fixture
def load(tmp_path):
    def read(kind, points):
        file = tmp_path / f"a.{kind}"
        file.write_text(of_format(kind, points))
        return engine.load(file, unit=0.001)

    return read


def placed(flat, turn=0.0):
    """Return a flat polygon placed in space."""
    c, s = np.cos(turn), np.sin(turn)
    points = np.column_stack([flat, np.zeros(len(flat))])
    return points @ np.array([[c, s, 0.0], [-s * c, c * c, s], [s * s, -s * c, c]])


def area_vectors(mesh):
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return 0.5 * np.cross(b - a, c - a)


@pytest.mark.parametrize("kind", ["obj", "off", "ply", "dae"])
@pytest.mark.parametrize("flat", [ELL, COMB, STRAIGHT, ARROW])
def test_a_flat_concave_polygon_is_covered_once(load, kind, flat):
    x, y = np.array(flat, float).T
    area = 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    for first in range(len(flat)):
        for ring in (flat, flat[::-1]):
            mesh = load(kind, placed(ring[first:] + ring[:first], 0.7))
            assert len(mesh.faces) == len(flat) - 2
            found = area_vectors(mesh) * 1e6
            # All triangles face the same way, and their areas add up to the polygon's: no overlap.
            assert np.linalg.norm(found, axis=1).sum() == pytest.approx(area, rel=1e-9)
            assert np.linalg.norm(found.sum(axis=0)) == pytest.approx(area, rel=1e-9)


def test_what_is_outside_of_a_concave_polygon_is_not_touched(load):
    mesh = load("obj", placed(ELL[2:] + ELL[:2]))
    point = engine.points([[0.002, 0.0016, 0.0]])
    found = engine.distance(mesh, np.eye(4), point, np.eye(4))
    assert found.lower == pytest.approx(0.0006, rel=1e-6)


@pytest.mark.parametrize("kind", ["obj", "off", "ply", "dae"])
def test_a_polygon_that_is_far_from_flat_is_refused_whatever_its_first_corner(load, kind):
    for lift in (0.9, 1.5):
        for first in range(4):
            points = placed(ARROW)
            points[1, 2] = lift
            with pytest.raises(engine.ModelError, match="a polygon is far from flat"):
                load(kind, np.roll(points, first, axis=0))


def test_a_polygon_that_crosses_itself_is_refused(load):
    bow = [(0, 0), (4, 4), (4, 0), (0, 3)]
    for first in range(4):
        with pytest.raises(engine.ModelError, match="a polygon crosses itself"):
            load("obj", placed(bow[first:] + bow[:first]))


def test_a_concave_polygon_may_be_rounded_or_bent(load):
    spot = np.random.default_rng(3)
    for digits, size, lift in ((6, 1e-3, 0.0), (3, 1.0, 0.0), (9, 1.0, 0.1)):
        for turn in spot.uniform(0.0, 6.0, 3):
            points = placed(size * np.array(ELL), turn)
            points[:, 2] += lift * spot.uniform(-1.0, 1.0, len(points))
            for first in range(len(points)):
                mesh = load("obj", np.roll(points, first, axis=0).round(digits))
                areas = area_vectors(mesh) @ area_vectors(mesh).sum(axis=0)
                assert len(areas) == 4
                assert areas.min() > 0.0


def test_a_spike_without_area_has_no_plane(load):
    for turn in np.linspace(0.0, 6.0, 9):
        assert len(load("obj", placed([(0, 0), (1, 0.3), (2, 0.6), (1, 0.3)], turn)).faces) == 2


def test_a_concave_polygon_may_have_many_corners():
    angles = np.linspace(0.0, np.pi, 2000)
    flat = np.column_stack([np.cos(angles), np.sin(angles)])
    ring = np.concatenate((1.1 * flat, 0.9 * flat[::-1]))
    points = np.column_stack([ring, np.zeros(len(ring))])
    began = time.perf_counter()
    faces = cut_polygons(points, np.arange(4000), np.array([4000]), str)
    assert time.perf_counter() - began < 5.0
    a, b, c = points[faces].transpose(1, 0, 2)
    assert (np.cross(b - a, c - a)[:, 2] > 0.0).all()


def test_convex_polygons_need_not_be_quite_flat_and_corners_may_be_on_a_line(load):
    bent = placed([(0, 0), (1, 0), (1, 1), (0, 1)])
    bent[2, 2] = 0.3
    assert load("obj", bent).faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    thirds = placed([(0, 0), (0.1, 0.3), (0.2, 0.6), (0.3, 0.9), (1, 1)], 0.3)
    assert len(load("obj", thirds).faces) == 3
    point = np.zeros((5, 3))
    assert len(load("obj", point).faces) == 3


def test_more_of_an_stl_than_is_announced_is_refused(tmp_path):
    triangle = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    data, file = binary_stl(triangle), tmp_path / "a.stl"
    more = binary_stl(triangle + 5.0)[84:]
    for rest in (more, more + b"\n", more + more[:49]):
        file.write_bytes(data + rest)
        with pytest.raises(engine.ModelError, match=r"declares 1 triangles, .* \d more"):
            engine.load(file)
    text = "Schöne Grüße vom Programm, das diese Datei geschrieben hat\r\n".encode()
    for rest in (more[:49], bytes(120), text * 2, text + bytes(60)):
        file.write_bytes(data + rest)
        assert len(engine.load(file).faces) == 1
