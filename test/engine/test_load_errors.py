"""Files that are no models: each is refused by name, and no part of it is loaded."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from model_files import (
    BOX,
    DAE,
    FACET,
    OBJ,
    OFF,
    PLY,
    STL,
    VALID,
    binary_ply,
    binary_stl,
    embedded,
    exported,
    glb,
    model_3mf,
    packed,
    triangle_glb,
    triangle_tree,
)

from proximity_monitor import engine
from proximity_monitor.engine import ModelError
from proximity_monitor.engine.models.tree import check_tree

NAN, INF = float("nan"), float("inf")


def facets(value):
    corners = np.zeros((3, 3, 3))
    corners[1, 2, 0] = value
    return binary_stl(corners)


def accessor(**more):
    return [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", **more}]


EXTENSIONS = sorted({name.split(".")[1] for name in VALID})
CUBE = VALID["little.ply"]
BODY = CUBE.index(b"end_header\n") + 11
TWO_CORNERS = binary_ply([[0, 1, 2], [3, 4]])

BAD = {
    # STL
    "cut": ("a.stl", VALID["binary.stl"][:-1], "12 triangles has 684 bytes, but this file has 683"),
    "header": ("a.stl", VALID["binary.stl"][:84], "684 bytes, but this file has 84"),
    "half a header": ("a.stl", VALID["binary.stl"][:50], "50 bytes, but a binary STL"),
    "too few": ("a.stl", VALID["binary.stl"] + b"\1" * 100, "12 triangles, .* room for 2 more"),
    "no triangles": ("a.stl", binary_stl(np.empty((0, 3, 3))), "no triangles"),
    "nan": ("a.stl", facets(NAN), r"vertices\[5\] = \[nan, 0.0, 0.0\]: .*finite \(1 such"),
    "inf": ("a.stl", facets(-INF), r"vertices\[5\] = \[-inf"),
    "solid": ("a.stl", b"solid x".ljust(80) + VALID["binary.stl"][80:-9], "684 bytes"),
    "no endsolid": ("a.stl", STL[: STL.index("endsolid")], "ends before 'endsolid': truncated"),
    "endsoli": ("a.stl", STL[: STL.index("endsolid") + 7], "line 9: found 'endsoli', exp"),
    "in a facet": ("a.stl", STL[: STL.index("endfacet")], "before 'endsolid': truncated"),
    "in a number": ("a.stl", STL[: STL.index("1 0\nendloop")], "within a facet, .* truncated"),
    "one number less": ("a.stl", STL.replace("1 0 0", "1 0"), "line 6: found '0', expected 'v"),
    "before a solid": ("a.stl", STL + "solids\n", "line 10: found 'solids', expected 'solid'"),
    "two corners": ("a.stl", STL.replace("vertex 1 0 0\n", ""), "line 6: found 'endloop', "),
    "four corners": ("a.stl", STL.replace("vertex 1 0 0\n", 2 * "vertex 1 0 0\n"), "line 7: foun"),
    "no number": ("a.stl", STL.replace("1 0 0", "1 x 0"), "line 5: 'x' is not a number"),
    "empty solid": ("a.stl", "solid a\nendsolid a\n", "no triangles"),
    "ascii nan": ("a.stl", STL.replace("1 0 0", "1 nan 0"), r"vertices\[1\] = \[1.0, nan, 0.0\]"),
    "second solid": ("a.stl", STL + "solid b\n" + FACET, "ends before 'endsolid'"),
    "nan in the second": ("a.stl", STL + STL.replace("1 0 0", "inf 0 0"), r"vertices\[4\] = \[inf"),
    "text": ("a.stl", "This is a letter, not a model." * 10, "a binary STL of"),
    # OBJ
    "name": ("a.obj", OBJ + "usemtl a\\\nf 1 2 3\nf 1 2 3\n", r"line 4: the name ends with"),
    "one corner": ("a.obj", OBJ + "f 1 2 3\nf 1\n", "line 5: a face has 1 corners"),
    "no corner": ("a.obj", OBJ + "f 1 2 3\nf", "line 5: a face has 0 corners"),
    "beyond": ("a.obj", OBJ + "f 1 2 3\nf 1 2 4\n", "line 5: corners .* there are 3"),
    "zero": ("a.obj", OBJ + "f 0 1 2\n", "line 4: corners .* there are 3"),
    "before the first": ("a.obj", OBJ + "f -4 1 2\n", "line 4: corners .* there are 3"),
    "in a vertex": ("a.obj", "f 1 2 3\n" + OBJ[:-3], "line 4: a vertex has 2 coordinates"),
    "no index": ("a.obj", OBJ + "f 1 2 x\n", "line 4: 'x' is not a whole number"),
    "half an index": ("a.obj", OBJ + "f 1 2 3.5\n", "line 4: '3.5' is not a whole number"),
    "in a word": ("a.obj", OBJ + "f 1 2 3\nusemt", "line 5: 'usemt' is not an OBJ statement"),
    "surface": ("a.obj", OBJ + "f 1 2 3\nsurf 0 1 0 1 1 2 3\n", "line 5: 'surf' is not supported"),
    "other file": ("a.obj", OBJ + "f 1 2 3\ncall b.obj\n", "line 5: 'call' is not supported"),
    "bad coordinate": ("a.obj", OBJ.replace("1 0 0", "1 0 0 y") + "f 1 2 3", "line 2: 'y' is no"),
    "obj nan": ("a.obj", OBJ.replace("1 0 0", "nan 0 0") + "f 1 2 3", r"vertices\[1\] = \[nan"),
    "unused nan": ("a.obj", OBJ + "v 0 0 inf\nf 1 2 3", r"vertices\[3\] = \[0.0, 0.0, inf\]"),
    "vertices alone": ("a.obj", OBJ, "no triangles"),
    "points": ("a.obj", OBJ + "p 1 2 3\nl 1 2 3\n", "no triangles"),
    # OFF
    "off cut": ("a.off", OFF[:-8], "declares 3 vertices and 1 faces, but 3 lines"),
    "off in a face": ("a.off", OFF[:-3], "line 6: a face declares 3 corners, but has 2"),
    "off vertices": ("a.off", OFF[:20], "declares 3 vertices and 1 faces, but 2 lines"),
    "off more": ("a.off", OFF + "3 0 1 2\n", "declares 3 vertices and 1 faces, but 5 lines"),
    "off counts": ("a.off", "OFF\n", "counts of vertices and faces are missing"),
    "off negative": ("a.off", OFF.replace("3 1 0", "-3 1 0"), "counts of vertices and faces"),
    "off beyond": ("a.off", OFF.replace("0 1 2\n", "0 1 3\n"), r"line 6: corners \[0, 1, 3\]"),
    "off below": ("a.off", OFF.replace("0 1 2\n", "0 1 -1\n"), r"line 6: corners \[0, 1, -1\]"),
    "off edge": ("a.off", OFF.replace("3 0 1 2", "2 0 1"), "line 6: a face has 2 corners"),
    "off nan": ("a.off", OFF.replace("1 0 0", "1 0 -inf"), r"vertices\[1\] = \[1.0, 0.0, -inf\]"),
    "off binary": ("a.off", OFF.replace("OFF", "OFF BINARY"), "'BINARY' is not a whole number"),
    "off 4d": ("a.off", OFF.replace("OFF", "4OFF"), "does not begin with OFF"),
    "off cloud": ("a.off", "OFF\n1 0 0\n0 0 0\n", "no triangles"),
    # PLY
    "ply cut": ("a.ply", PLY[:-9], "declares 6 rows, but 5 follow"),
    "ply in a face": ("a.ply", PLY[:-3], r"face\[1\]: vertex_indices declares 3 values, but 2"),
    "ply in a vertex": ("a.ply", PLY.replace("1 1 0", "1 1"), r"vertex\[3\]: z is missing"),
    "ply more": ("a.ply", PLY + "3 0 1 2\n", "declares 6 rows, but 7 follow"),
    "ply wide": ("a.ply", PLY.replace("1 1 0", "1 1 0 0"), r"vertex\[3\]: 4 values, expected 3"),
    "ply number": ("a.ply", PLY.replace("1 1 0", "1 # 0"), r"vertex\[3\]: '#' is not a number"),
    "ply nan": ("a.ply", PLY.replace("1 1 0", "1 1 nan"), r"vertices\[3\] = \[1.0, 1.0, nan\]"),
    "ply beyond": ("a.ply", PLY.replace("1 3 2", "1 4 2"), r"faces\[1\]: corners \[1, 4, 2\]"),
    "ply below": ("a.ply", PLY.replace("1 3 2", "1 -1 2"), r"faces\[1\]: corners \[1, -1, 2\]"),
    "ply edge": ("a.ply", PLY.replace("3 1 3 2", "2 1 3"), r"faces\[1\]: a face has 2 corners"),
    "ply header": ("a.ply", PLY[: PLY.index("end_h")], "no header from 'ply' to 'end_header'"),
    "ply type": ("a.ply", PLY.replace("float z", "flat z"), "line 7: 'property flat z' is not"),
    "ply element": ("a.ply", PLY.replace("vertex 4", "vertex -4"), "line 4: 'element vertex -4'"),
    "ply order": ("a.ply", PLY.replace("ascii", "middle"), "names no known format"),
    "ply list": (
        "a.ply",
        PLY.replace("float z", "list uchar float z").replace(" 0\n", " 1 0\n"),
        "z of the vertices is a list, expected a number",
    ),
    "ply no z": ("a.ply", PLY.replace("float z", "float w"), "no x, y and z"),
    "ply twice": ("a.ply", PLY.replace("float z", "float x"), "uses a name twice: x, y, x"),
    "ply no list": ("a.ply", PLY.replace("vertex_indices", "edges"), "no list of whole numbers"),
    "ply floats": ("a.ply", PLY.replace("uchar int", "uchar float"), "no list of whole numbers"),
    "ply half": ("a.ply", CUBE[:-1], "ends before the last of 12 rows of 'face'|truncated"),
    "ply no body": ("a.ply", CUBE[:BODY], "ends before the last of 8 rows of 'vertex': truncated"),
    "ply few": ("a.ply", CUBE[: BODY + 40], "the last of 8 rows of 'vertex': truncated"),
    "ply extra": ("a.ply", CUBE + b"\0", "1 bytes follow the data that the header declares"),
    "ply two corners": ("a.ply", TWO_CORNERS, r"faces\[1\]: a face has 2 corners"),
    "ply far": ("a.ply", binary_ply([[0, 1, 2], [0, 1, 8]]), r"faces\[1\]: corners \[0, 1, 8\]"),
    "ply huge": ("a.ply", CUBE.replace(b"vertex 8", b"vertex 4000000000"), "truncated"),
    "ply cloud": ("a.ply", exported("ply", trimesh.PointCloud(np.eye(3))), "no triangles"),
    # GLB
    "glb cut": ("a.glb", VALID["box.glb"][:-1], "declares [0-9]+ bytes, but has [0-9]+"),
    "glb head": ("a.glb", VALID["box.glb"][:12], "declares [0-9]+ bytes, but has 12"),
    "glb chunk": ("a.glb", triangle_glb()[:8] + b"\x14\0\0\0\xff\0\0\0JSON", "chunk of 255 bytes"),
    "glb version": ("a.glb", b"glTF\1\0\0\0" + triangle_glb()[8:], "GLB file of version 2"),
    "gltf key twice": ("a.gltf", b'{"asset": {}, "asset": {}}', "the key 'asset' appears twice"),
    "glb no json": ("a.glb", b"glTF\2\0\0\0\x0c\0\0\0", "has no JSON chunk"),
    "glb list": ("a.glb", glb([1]), "its JSON is not an object"),
    "glb bad json": ("a.glb", triangle_glb().replace(b'{"asset', b"{,asset"), "invalid JSON"),
    "glb buffer": (
        "a.glb",
        triangle_glb(buffers=[{"byteLength": 99}]),
        "declares 99 bytes, but has 36",
    ),
    "glb view": ("a.glb", triangle_glb(bufferViews=[{"buffer": 0, "byteLength": 40}]), "past its"),
    "glb accessor": ("a.glb", triangle_glb(accessors=accessor(count=4)), "past its buffer view"),
    "glb offset": ("a.glb", triangle_glb(accessors=accessor(byteOffset=4)), "past its buffer view"),
    "glb negative": ("a.glb", triangle_glb(accessors=accessor(count=-1)), "count at least 1"),
    "glb sparse": ("a.glb", triangle_glb(accessors=accessor(sparse={})), "compressed or sparse"),
    "glb extension": ("a.glb", triangle_glb(extensionsRequired=["KHR_draco"]), "requires the ext"),
    "glb mode": ("a.glb", triangle_glb(7, 5), "primitives of mode 7, which glTF does not define"),
    "glb four": ("a.glb", triangle_glb(4, 4), "4 corners, not a multiple of 3"),
    "glb far": ("a.glb", triangle_glb(indices=[0, 1, 3]), r"faces\[0\]: corners \[0, 1, 3\]"),
    "glb loop": ("a.glb", triangle_glb(nodes=[{"children": [0], "mesh": 0}]), "two parents"),
    "glb nan": ("a.glb", triangle_glb(nodes=[{"mesh": 0, "scale": [NAN, 1, 1]}]), "NaN is not a"),
    "glb no scene": ("a.glb", triangle_glb(scenes=[]), "no triangles"),
    "glb points": ("a.glb", triangle_glb(0), "no triangles"),
    "glb cloud": ("a.glb", exported("glb", trimesh.Scene(trimesh.PointCloud(np.eye(3)))), "no tri"),
}


def refused(path, message=""):
    """Check that a file is refused by a ModelError that begins with its path; return the error."""
    with pytest.raises(ModelError) as caught:
        engine.load(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: ")
    assert re.search(message, text), text
    return caught.value


@pytest.mark.parametrize("kind", BAD)
def test_a_flaw_is_named(tmp_path, kind):
    name, data, message = BAD[kind]
    (tmp_path / name).write_bytes(data if isinstance(data, bytes) else data.encode())
    refused(tmp_path / name, message)


@pytest.mark.parametrize("extension", EXTENSIONS)
@pytest.mark.parametrize("data", [b"", b"\0", b"\n", bytes(range(256)) * 9, b"{}", b"\xff" * 200])
def test_empty_files_and_garbage(tmp_path, extension, data):
    path = tmp_path / f"part.{extension}"
    path.write_bytes(data)
    refused(path, "" if data else "is empty")


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_a_file_of_another_format(tmp_path, extension):
    for name, data in VALID.items():
        if not name.endswith(extension):
            path = tmp_path / f"{name.replace('.', '_')}.{extension}"
            path.write_bytes(data)
            refused(path)


def test_a_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nowhere\.stl: there is no such file"):
        engine.load(tmp_path / "nowhere.stl")
    with pytest.raises(FileNotFoundError, match=r"nowhere\.doc"):
        engine.load(tmp_path / "nowhere.doc")


def test_a_directory(tmp_path):
    (tmp_path / "parts.stl").mkdir()
    with pytest.raises(IsADirectoryError, match=r"parts.stl: is a directory"):
        engine.load(tmp_path / "parts.stl")


@pytest.mark.parametrize("name", ["part.iges", "part", "part.stl.txt", ".stl"])
def test_an_unknown_extension(tmp_path, name):
    (tmp_path / name).write_bytes(VALID["binary.stl"])
    refused(tmp_path / name, r"unknown extension .*\.stl, \.obj, .*\.3mf")


def test_paths_that_cannot_be(tmp_path):
    (tmp_path / "part.stl").write_bytes(VALID["binary.stl"])
    for path in (tmp_path / "part.stl" / "inner.stl", tmp_path / "a\0b.stl"):
        assert refused(path, "cannot be read").__cause__ is not None


def test_a_scale_that_makes_vertices_infinite(tmp_path):
    (tmp_path / "part.stl").write_bytes(facets(1e30))
    with pytest.raises(ModelError, match=r"part.stl: vertices\[1\] = \[inf"):
        engine.load(tmp_path / "part.stl", scale=1e300)


NOT_A_NUMBER = ["1_0", "0x1", "\u0661", "1,0", "1.#INF", "--1", "1d0", "1e", "+", "infinit"]
NUMBERS = {
    "stl": (STL, "vertex 1 0 0", "vertex {} 0 0"),
    "obj": (OBJ + "f 1 2 3\n", "v 1 0 0", "v {} 0 0"),
    "obj colour": (OBJ + "f 1 2 3\n", "v 1 0 0", "v 1 0 0 {} 1 1"),
    "obj last": (OBJ + "f 1 2 3\n", "v 1 0 0", "v 1 0 {}"),
    "obj index": (OBJ + "f 1 2 3\n", "f 1", "f {}/1/1"),
    "off": (OFF, "1 0 0", "{} 0 0"),
    "off last": (OFF, "1 0 0", "1 0 {}"),
    "off count": (OFF, "3 1 0", "3 1 {}"),
    "off size": (OFF, "3 0 1 2", "{} 0 1 2"),
    "off index": (OFF, "3 0 1 2", "3 0 {} 2"),
    "ply": (PLY, "1 0 0", "{} 0 0"),
    "ply index": (PLY, "3 0 1 2", "3 0 {} 2"),
    "ply size": (PLY, "3 0 1 2", "{} 0 1 2"),
    "ply count": (PLY, "vertex 4", "vertex {}"),
    "dae": (DAE, "0 0 0 1 0 0", "0 0 0 {} 0 0"),
    "dae index": (DAE, "<p>0 2 1", "<p>0 2 {}"),
    "dae count": (DAE, '"12"', '"{}"'),
    "dae unit": (DAE, 'meter="0.001"', 'meter="{}"'),
    "dae motion": (DAE, "0 0 10", "0 0 {}"),
    "3mf": (model_3mf(), 'x="0.5"', 'x="{}"'),
    "3mf index": (model_3mf(), 'v1="1"', 'v1="{}"'),
    "3mf motion": (model_3mf(items=f'<item objectid="1" transform="{"1 " * 11}7"/>'), "7", "{}"),
    "gltf": (json.dumps(embedded(*triangle_tree())), '"count": 3', '"count": {}'),
    "gltf string": (json.dumps(embedded(*triangle_tree())), '"count": 3', '"count": "{}"'),
}


@pytest.mark.parametrize("kind", NUMBERS)
def test_what_python_alone_takes_for_a_number_is_none(tmp_path, kind):
    text, old, new = NUMBERS[kind]
    path = tmp_path / f"part.{kind.split()[0]}"
    for word in ["2", *NOT_A_NUMBER] if kind in ("off", "obj") else NOT_A_NUMBER:
        assert old in text
        changed = text.replace(old, new.format(word), 1)
        path.write_bytes(packed(changed) if kind.startswith("3mf") else changed.encode())
        if word == "2":
            assert engine.load(path).vertices[1, 0] == 2.0
        else:
            refused(path)


def test_what_a_reader_says_is_kept_as_the_cause(tmp_path):
    name, data, _ = BAD["glb bad json"]
    (tmp_path / name).write_bytes(data)
    assert isinstance(refused(tmp_path / name).__cause__, ValueError)


@pytest.mark.parametrize("name", ["binary.stl", "big.ply", "polygons.ply", "strip.glb", "box.3mf"])
def test_every_truncation_of_a_binary_file_is_found(tmp_path, name):
    path = tmp_path / name
    for size in range(1, len(VALID[name]), 3 if name == "box.3mf" else 1):
        path.write_bytes(VALID[name][:size])
        refused(path)


@pytest.mark.parametrize("name", ["solids.stl", "marked.off", "by_hand.ply", "data.gltf"])
def test_every_truncation_of_an_ascii_file_is_found(tmp_path, name):
    """The cut comes before the last number: a shorter number or no line end is not noticeable."""
    path, last = tmp_path / name, VALID[name].rstrip()
    ends = {"solids.stl": last.rindex(b"\n") + 9 if b"\n" in last else 0, "data.gltf": len(last)}
    whole = range(STL.index("endsolid") + 8, len(STL) + 1)  # the first of two solids
    for size in range(1, ends.get(name, len(last) - len(last.split()[-1]) + 1)):
        if name != "solids.stl" or size not in whole:
            path.write_bytes(last[:size])
            refused(path)
    path.write_bytes(last)
    assert len(engine.load(path).faces) in (1, 2)


def test_a_truncated_obj_has_whole_faces_alone(tmp_path):
    """OBJ announces no counts. A cut between lines cannot be seen, but one within a line can."""
    path, data = tmp_path / "part.obj", VALID["plain.obj"]
    for size in range(1, len(data)):
        path.write_bytes(data[:size])
        try:
            mesh = engine.load(path)
        except ModelError:
            continue
        assert len(mesh.vertices) == 8
        assert np.array_equal(mesh.vertices[mesh.faces][:-1], BOX.triangles[: len(mesh.faces) - 1])


damage = st.one_of(
    st.tuples(st.just("cut"), st.integers(0, 2**20), st.just(0)),
    st.tuples(st.just("flip"), st.integers(0, 2**20), st.integers(0, 7)),
    st.tuples(st.just("write"), st.integers(0, 2**20), st.integers(0, 255)),
    st.tuples(st.just("drop"), st.integers(0, 2**20), st.integers(1, 60)),
    st.tuples(st.just("repeat"), st.integers(0, 2**20), st.integers(1, 60)),
)


def broken(data, steps):
    """Return damaged bytes. A GLB's length is often corrected, so that readers get further."""
    result = bytearray(data)
    for kind, where, what in steps:
        where %= len(result) or 1
        if kind == "cut":
            del result[where:]
        elif kind == "flip" and result:
            result[where] ^= 1 << what
        elif kind == "write" and result:
            result[where] = what
        elif kind == "drop":
            del result[where : where + what]
        elif kind == "repeat":
            result[where:where] = result[where : where + what]
    if result[:4] == b"glTF" and len(result) % 2:
        result[8:12] = len(result).to_bytes(4, "little")
    return bytes(result)


@pytest.mark.long
@settings(
    max_examples=600, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.sampled_from(sorted(VALID)), st.lists(damage, min_size=1, max_size=4))
def test_a_damaged_file_is_a_sound_model_or_a_model_error(tmp_path, name, steps):
    path = tmp_path / name
    path.write_bytes(broken(VALID[name], steps))
    try:
        mesh = engine.load(path)
    except ModelError as error:
        assert str(error).startswith(f"{path}: ")
        return
    assert np.isfinite(mesh.vertices).all()
    assert mesh.faces.min() >= 0
    assert mesh.faces.max() < len(mesh.vertices)
    check_tree(mesh._hierarchy.tree)


@settings(
    max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.sampled_from(EXTENSIONS), st.binary(max_size=400))
def test_random_bytes_are_a_model_error(tmp_path, extension, data):
    path = tmp_path / f"part.{extension}"
    path.write_bytes(data)
    refused(path)
