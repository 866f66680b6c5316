"""Reading model files: everything that a format holds arrives."""

from __future__ import annotations

import re

import numpy as np
import pytest
import trimesh
from engine_bodies import rotation
from model_files import (
    BOX,
    FACET,
    MARK,
    OBJ,
    OFF,
    PLY,
    STL,
    VALID,
    binary_ply,
    binary_stl,
    exported,
    triangle_glb,
)

from proximity_monitor import engine


@pytest.fixture
def load(tmp_path):
    """Return a function that loads bytes or text as a file with a given name."""

    def loaded(name, data, **options):
        path = tmp_path / name
        path.write_bytes(data if isinstance(data, bytes) else data.encode())
        return engine.load(path, **options)

    return loaded


def corners(mesh):
    return mesh.vertices[mesh.faces]


@pytest.mark.parametrize("name", VALID)
def test_a_sound_file_is_read(load, name):
    mesh = load(name, VALID[name])
    assert mesh.name == name.split(".")[0]
    assert mesh.faces.max() < len(mesh.vertices)


@pytest.mark.parametrize(
    "name",
    [
        "binary.stl", "ascii.stl", "line.stl", "trailing.stl", "plain.obj", "plain.off", "line.off",
        "little.ply", "ascii.ply", "box.glb", "box.3mf",
    ],
)  # fmt: skip
def test_every_format_holds_the_same_box(load, name):
    mesh = load(name, VALID[name])
    assert len(mesh.vertices) == 8
    assert np.array_equal(corners(mesh), BOX.triangles)


def test_a_path_may_be_a_string_and_the_extension_of_any_case(tmp_path):
    path = tmp_path / "A part.v2.STL"
    path.write_bytes(VALID["binary.stl"])
    assert engine.load(str(path)).name == "A part.v2"


@pytest.mark.parametrize("scale", [0.001, 0.0254, 1e-12, 1e12])
@pytest.mark.parametrize("name", ["binary.stl", "ascii.ply", "box.glb", "plain.dae", "box.3mf"])
def test_the_scale_makes_metres(load, name, scale):
    plain, scaled = load(name, VALID[name]), load(name, VALID[name], scale=scale)
    np.testing.assert_allclose(scaled.vertices, plain.vertices * scale, rtol=1e-15)
    assert np.array_equal(scaled.faces, plain.faces)


@pytest.mark.parametrize("name", ["binary.stl", "box.glb", "plain.dae", "box.3mf"])
def test_the_unit_is_for_files_that_state_none(load, name):
    plain, inches = load(name, VALID[name]), load(name, VALID[name], unit=0.0254)
    states_one = name in ("plain.dae", "box.3mf")
    assert np.array_equal(inches.vertices, plain.vertices * (1.0 if states_one else 0.0254))


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
@pytest.mark.parametrize("key", ["unit", "scale"])
def test_a_scale_that_makes_no_sense(load, key, value):
    with pytest.raises(ValueError, match=rf"{key} = .*: must be finite and above 0"):
        load("part.stl", STL, **{key: value})


@pytest.mark.parametrize("name", [name for name in VALID if name.startswith("marked")])
def test_a_byte_order_mark_is_no_content(load, name):
    marked, plain = load(name, VALID[name]), load(name, VALID[name].removeprefix(MARK))
    assert np.array_equal(corners(marked), corners(plain))


@pytest.mark.parametrize("volume", ["rss", "lss", "pss", "hybrid"])
def test_the_kind_of_volume_can_be_chosen(load, volume):
    assert load("box.stl", VALID["binary.stl"], volume=volume).volume == volume
    assert load("box.stl", VALID["binary.stl"]).volume == "rss"


def test_an_unknown_kind_of_volume_is_refused_by_name(load):
    with pytest.raises(engine.ModelError, match=r"box\.stl: volume = 'ball': unknown; .* rss, lss"):
        load("box.stl", VALID["binary.stl"], volume="ball")


def test_every_digit_of_an_ascii_file_is_kept(load):
    x = 0.1234567890123456789
    for name, text in (
        ("a.stl", STL),
        ("a.obj", OBJ + "f 1 2 3\n"),
        ("a.off", OFF),
        ("a.ply", PLY),
    ):
        mesh = load(name, text.replace("1 0 0", f"{x!r} -1e-300 +7.E2"))
        assert mesh.vertices[1].tolist() == [x, -1e-300, 700.0]


# STL


def test_repeated_vertices_of_stl_are_merged_where_they_are_equal(load):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [1.0 + 2.0**-23, 0, 0]])
    faces = [[2, 0, 1], [1, 3, 2], [4, 3, 2]]
    mesh = load("part.stl", binary_stl(points[faces]))
    assert np.array_equal(corners(mesh), points[faces])
    assert mesh.vertices.tolist() == points[[2, 0, 1, 3, 4]].tolist()
    zero = load("zero.stl", STL.replace("vertex 0 0 0", "vertex -0 0 0"))
    assert len(zero.vertices) == 3


def test_vertices_that_are_nearly_equal_stay_apart(load):
    twice = STL + STL.replace("1 0 0", "1.00000000000001 0 0")
    mesh = load("part.stl", twice)
    assert len(mesh.faces) == 2
    assert len(mesh.vertices) == 4


def test_an_ascii_stl_may_hold_several_solids(load):
    mesh = load("part.stl", f"{STL}\nSOLID\n{FACET.upper()}ENDSOLID\nsolid empty\nendsolid empty\n")
    assert len(mesh.faces) == 2


def test_an_ascii_stl_may_be_named_like_its_statements(load):
    text = STL.replace("part\n", "facet endsolidly solid\n")
    assert len(load("part.stl", text + text.replace("\n", "\r")).faces) == 2
    line = " ".join(f"{STL} {STL}".split())
    assert len(load("part.stl", line).faces) == 2


@pytest.mark.parametrize(
    "name", ["my endsolid part", "endsolid", "facet normal x", "a facet normal 0", "solid endsolid"]
)
@pytest.mark.parametrize("closing", ["", "part"])
def test_words_of_the_format_may_be_in_the_name_of_a_solid(load, name, closing):
    named = STL.replace("solid part", f"solid {name}", 1).replace("endsolid part", "endsolid NAME")
    named = named.replace("NAME", closing and name)
    empty = f"solid {name}\nendsolid {name}\n"
    text = named + empty + named.replace("\n", "\r\n")
    assert len(load("part.stl", text).faces) == 2


def test_a_long_ascii_stl_is_read_in_blocks(load, monkeypatch):
    monkeypatch.setattr("proximity_monitor.engine.files.stl._BLOCK", 100)
    mesh = load("part.stl", VALID["ascii.stl"])
    assert np.array_equal(corners(mesh), BOX.triangles)


def test_a_binary_stl_may_begin_like_an_ascii_one(load):
    data = b"solid made by a CAD program".ljust(80) + VALID["binary.stl"][80:]
    assert len(load("part.stl", data).faces) == 12


def test_degenerate_triangles_are_kept(load):
    shapes = np.array([[[0, 0, 0]] * 3, [[1, 0, 0], [2, 0, 0], [2, 0, 0]]], dtype=float)
    assert np.array_equal(corners(load("a.stl", binary_stl(shapes))), shapes)
    assert len(load("a.obj", OBJ + "f 1 1 1\nf 1 2 2\nf 1 2 3\nf 3 2 1\nf 1 2 3\n").faces) == 5
    assert load("a.off", OFF.replace("3 0 1 2", "3 1 1 2")).faces.tolist() == [[1, 1, 2]]
    assert load("a.ply", PLY.replace("3 0 1 2", "3 1 1 2")).faces.tolist()[0] == [1, 1, 2]
    assert load("a.glb", triangle_glb(indices=[0, 0, 0, 0, 1, 1])).faces.tolist()[0] == [0, 0, 0]


# OBJ


def test_relative_indices_of_obj_count_from_the_vertices_so_far(load):
    mesh = load("part.obj", f"{OBJ}f -3 -2 -1\n{OBJ.replace(' 0 0', ' 0 5')}f -3 -2 -1\nf 1 2 3\n")
    assert mesh.faces.tolist() == [[0, 1, 2], [3, 4, 5], [0, 1, 2]]


def test_what_else_an_obj_may_hold(load):
    text = (
        "# a comment\nmtllib none.mtl\no thing\n  v 0 0 0 # the first\nv\t1 0 0 1.0\n"
        "v 0 1 0 0.5 0.5 0.5\nvn 0 0 1\nvt 0 0\ng some\ns off\nusemtl b\n"
        "f 1/1/1 2//1 3\nl 1 2\np 1\nusemtl a\nf\t3/1 \\\n 2 1\r\n"
    )
    assert load("part.obj", text).faces.tolist() == [[0, 1, 2], [2, 1, 0]]


def test_a_comment_does_not_go_on_in_the_next_line(load):
    mesh = load("part.obj", "# C:\\parts\\\n" + OBJ + "f 1 2 3 # \\\nf 3 2 1\n")
    assert mesh.faces.tolist() == [[0, 1, 2], [2, 1, 0]]


def test_lines_that_only_go_on_are_none(load):
    assert load("part.obj", OBJ + "\\\n\\\nf 1 2 3\n").faces.tolist() == [[0, 1, 2]]


def test_a_face_may_stand_before_its_vertices(load):
    assert load("part.obj", "f 1 2 3\n" + OBJ).faces.tolist() == [[0, 1, 2]]


def test_names_in_any_encoding(load):
    text = OBJ + "o M\u00fcller\u2028\u0085\ng \u96f6\u4ef6\nf 1 2 3\n"
    for encoding in ("utf-8", "utf-16-le"):
        data = (
            text.encode(encoding) if encoding == "utf-8" else OBJ.encode() + b"o \xff\xfe\nf 1 2 3"
        )
        assert len(load("part.obj", data).faces) == 1


# Polygons


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("count", ["u1", "i4"])
@pytest.mark.parametrize(
    "polygons",
    [
        [[0, 1, 2], [1, 3, 2]],
        [[0, 1, 3, 2], [4, 5, 7, 6]],
        [[0, 1, 3, 2, 4]],
        [[0, 1, 2], [0, 1, 3, 2], [0, 1, 3, 2, 4], [5, 6, 7]],
        [[0, 1, 3, 2], [0, 1, 2], [0, 1, 3, 2, 4]],
    ],
)
def test_polygons_become_fans_in_the_order_of_the_file(load, polygons, order, count):
    expected = [[p[0], p[i], p[i + 1]] for p in polygons for i in range(1, len(p) - 1)]
    mesh = load("part.ply", binary_ply(polygons, order, count))
    assert mesh.faces.tolist() == expected
    assert np.array_equal(mesh.vertices, BOX.vertices)
    vertices = "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in BOX.vertices.tolist())
    faces = "".join(f"{len(p)} {' '.join(map(str, p))}\n" for p in polygons)
    assert load("a.off", f"OFF\n8 {len(polygons)} 0\n{vertices}{faces}").faces.tolist() == expected
    lines = "".join(f"v {line}\n" for line in vertices.splitlines())
    lines += "".join(f"f {' '.join(str(i + 1) for i in p)}\n" for p in polygons)
    assert load("a.obj", lines).faces.tolist() == expected
    head = PLY.split("end_header")[0].replace("vertex 4", "vertex 8").replace("float", "double")
    head = head.replace("face 2", f"face {len(polygons)}")
    assert load("b.ply", f"{head}end_header\n{vertices}{faces}").faces.tolist() == expected


# OFF and PLY


def test_comments_blank_lines_and_colours_of_off(load):
    text = (
        "# made by hand\n\nCOFF 3 1 3\n# corners\n"
        "0 0 0 1 1 1\n\n1 0 0 1 1 1 # x\n0 1 0 0 0 0\n3 0 1 2 7"
    )
    mesh = load("part.off", text)
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert mesh.faces.tolist() == [[0, 1, 2]]


def test_ply_of_other_line_ends_and_with_more_properties(load):
    text = PLY.replace("z\n", "z\nproperty uchar red\nproperty float s\nproperty float t\n")
    text = text.replace(" 0\n", " 0 255 0.5 0.5\n").replace("vertex_indices", "vertex_index")
    assert load("part.ply", text.replace("\n", "\r\n")).faces.tolist() == [[0, 1, 2], [1, 3, 2]]


def test_data_behind_a_header_of_bare_returns_may_begin_with_any_byte(load):
    head, _, _ = PLY.replace("ascii", "binary_little_endian").partition("0 0 0\n")
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], "<f4")
    points[0, 0] = np.frombuffer(b"\n\0\x80\x3f", "<f4")[0]
    faces = b"\x03" + np.arange(3, dtype="<i4").tobytes()
    data = head.replace("\n", "\r").encode() + points.tobytes() + 2 * faces
    assert load("part.ply", data).vertices[0, 0] == points[0, 0]


@pytest.mark.parametrize("head, width", [("OFF", 3), ("NOFF", 6), ("COFF", 7), ("STCNOFF", 12)])
@pytest.mark.parametrize("between", [" ", "\n", "\n\n# a comment\n\t"])
def test_the_items_of_off_may_stand_anyhow(load, head, width, between):
    rows = [[*point, *range(width - 3)] for point in BOX.vertices.tolist()]
    rows += [[3, *face] for face in BOX.faces.tolist()]
    text = between.join(str(word) for row in [[head, 8, 12, 0], *rows] for word in row)
    assert np.array_equal(corners(load("part.off", text)), BOX.triangles)
    pairs = [f"{a} {b}" for a, b in zip(*(iter(map(str, rows)),) * 2, strict=True)]
    text = f"{head} 8 12 0\n" + re.sub(r"[\[\],]", "", "\n".join(pairs))
    assert np.array_equal(corners(load("part.off", text)), BOX.triangles)


@pytest.mark.parametrize("order", ["", "<", ">"])
def test_strips_of_ply(load, order):
    """Strips end with their row or with -1. The triangles that join two strips are left out."""
    mesh = load("a.ply", VALID["strips.ply"] if not order else strips_ply(order))
    assert mesh.faces.tolist() == [[0, 1, 2], [2, 1, 3], [0, 1, 2], [1, 3, 2]]
    text = VALID["strips.ply"].decode().replace("4 0 1 2 3", "8 0 1 2 2 1 1 3 2")
    assert load("a.ply", text).faces.tolist() == [[0, 1, 2], [3, 1, 2], [0, 1, 2], [1, 3, 2]]


def strips_ply(order):
    """Return VALID["strips.ply"] as a binary file."""
    name = {"<": "little", ">": "big"}[order]
    head = VALID["strips.ply"].decode().split("end_header")[0]
    head = head.replace("ascii", f"binary_{name}_endian") + "end_header\n"
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], f"{order}f4").tobytes()
    rows = [[0, 1, 2, 3], [0, 1, 2, -1, 1, 3, 2]]
    strips = [bytes([len(row)]) + np.array(row, f"{order}i4").tobytes() for row in rows]
    return head.encode() + points + b"".join(strips)


# GLB


def test_geometries_are_merged_with_their_transforms(load):
    rng = np.random.default_rng(1)
    ball = trimesh.creation.icosphere(1)
    motions = [np.eye(4) for _ in range(3)]
    for motion in motions[:2]:
        motion[:3, :3], motion[:3, 3] = rotation(rng), rng.normal(size=3)
    motions[1][:3, 3] += 1e-9  # so small that a reader might ignore it
    motions[2] = np.diag([1.0, 2.0, -3.0, 1.0])
    scene = trimesh.Scene()
    scene.add_geometry(BOX, node_name="a", geom_name="box", transform=motions[0])
    scene.add_geometry(ball, node_name="b", parent_node_name="a", transform=motions[1])
    scene.graph.update("c", "b", matrix=motions[2], geometry="box")
    mesh = load("scene.glb", exported("glb", scene))
    placed = [
        (BOX, motions[0]),
        (ball, motions[0] @ motions[1]),
        (BOX, motions[0] @ motions[1] @ motions[2]),
    ]
    expected = np.concatenate(
        [part.triangles @ motion[:3, :3].T + motion[:3, 3] for part, motion in placed]
    )
    assert len(mesh.faces) == 12 + 80 + 12
    found, wanted = (np.sort(x.mean(axis=1), axis=0) for x in (corners(mesh), expected))
    assert found == pytest.approx(wanted, abs=1e-6)  # the ball's vertices are float32 in the file
    # A mirror image must not turn inside out: the signed volumes add up.
    volume = np.linalg.det(corners(mesh)).sum() / 6.0
    assert volume == pytest.approx(6.0 + ball.volume + 6.0 * 6.0, rel=1e-6)


def test_points_and_curves_beside_triangles_are_left_out(load):
    """The glTF modes are points, lines, a loop, a strip of lines, and triangles."""
    primitives = [{"attributes": {"POSITION": 0}, "mode": mode} for mode in range(5)]
    mesh = load("mixed.glb", triangle_glb(corners=6, meshes=[{"primitives": primitives}]))
    assert mesh.faces.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert len(mesh.vertices) == 6
    text = f"{OBJ}v 9 9 9\nl 1 4\np 4\nf 1 2 3\n"
    assert load("mixed.obj", text).faces.tolist() == [[0, 1, 2]]


def test_strips_and_unindexed_triangles(load):
    strip = load("a.glb", triangle_glb(5, 5))
    assert strip.faces.tolist() == [[0, 1, 2], [2, 1, 3], [2, 3, 4]]
    joined = load("e.glb", triangle_glb(5, 6, [0, 1, 2, 2, 3, 3, 4, 5]))
    assert joined.faces.tolist() == [[0, 1, 2], [4, 3, 5]]
    fan = load("d.glb", triangle_glb(6, 5))
    assert fan.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4]]
    assert load("b.glb", triangle_glb(4, 6)).faces.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert load("c.glb", triangle_glb(4, 4, [3, 1, 0])).faces.tolist() == [[3, 1, 0]]


def test_a_mesh_that_stands_in_two_places(load):
    nodes = [{"mesh": 0}, {"mesh": 0, "translation": [0, 0, 5]}, {"mesh": 0}]
    mesh = load("a.glb", triangle_glb(scenes=[{"nodes": [0, 1]}], nodes=nodes))
    assert sorted(mesh.vertices[:, 2].tolist()) == [1, 1, 1, 6, 6, 6]
    assert sorted(corners(mesh).mean(axis=(1, 2)).tolist()) == pytest.approx([11 / 9, 26 / 9])
