"""Formats that place their parts (glTF, COLLADA, 3MF) are read as they are, or refused by name."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from model_files import (
    BOX,
    DAE,
    MARK,
    OBJECT,
    embedded,
    glb,
    model_3mf,
    packed,
    triangle_glb,
    triangle_tree,
)

from proximity_monitor import engine
from proximity_monitor.engine import ModelError


@pytest.fixture
def load(tmp_path):
    """Return a function that loads bytes or text as a named file, with other files beside it."""

    def loaded(name, data, **others):
        for other, content in others.items():
            (tmp_path / other).write_bytes(content)
        path = tmp_path / name
        path.write_bytes(data if isinstance(data, bytes) else data.encode())
        return engine.load(path)

    return loaded


@pytest.fixture
def refused(load):
    """Return a function that checks that a file is refused by name, and for the right reason."""

    def checked(name, data, message, **others):
        with pytest.raises(ModelError, match=rf"{re.escape(name)}: .*(?s:{message})"):
            load(name, data, **others)

    return checked


def corners(mesh):
    return mesh.vertices[mesh.faces]


# glTF


def gltf(**more):
    """Return a glTF file whose buffer is embedded."""
    tree, binary = triangle_tree()
    return json.dumps({**embedded(tree, binary), **more})


def test_buffers_may_lie_in_the_file_beside_it_or_in_the_json(load):
    tree, binary = triangle_tree()
    expected = corners(load("a.glb", glb(tree, binary)))
    outside = {**tree, "buffers": [{"byteLength": 36, "uri": "my%20buffer.bin"}]}
    beside = {"my buffer.bin": binary + b"more"}
    escaped = "".join(f"%{byte:02x}" for byte in binary)
    plain = {**tree, "buffers": [{"byteLength": 36, "uri": f"data:application/x,{escaped}"}]}
    for name, data, others in (
        ("b.glb", glb(embedded(tree, binary)), {}),
        ("c.glb", glb(outside), beside),
        ("d.gltf", json.dumps(outside), beside),
        ("e.gltf", json.dumps(embedded(tree, binary)), {}),
        ("f.gltf", MARK + json.dumps(plain).encode(), {}),
    ):
        assert np.array_equal(corners(load(name, data, **others)), expected)


@pytest.mark.parametrize(
    "uri",
    ["../part.bin", "/etc/hostname", "http://example.org/a.bin", "//host/a.bin", "%2e%2e/a.bin"],
)
def test_no_buffer_outside_the_folder_is_opened(load, refused, tmp_path, uri):
    (tmp_path.parent / "part.bin").write_bytes(triangle_tree()[1])
    text = gltf(buffers=[{"byteLength": 36, "uri": uri}])
    refused("a.gltf", text, r"buffers\[0\] refers to .*, outside the file's folder: .*embed it")


def test_a_buffer_may_be_a_link(load, tmp_path):
    """A build may link the files of a folder together."""
    (tmp_path / "stored").mkdir()
    (tmp_path / "stored" / "x.bin").write_bytes(triangle_tree()[1])
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked" / "part.bin").symlink_to(tmp_path / "stored" / "x.bin")
    text = gltf(buffers=[{"byteLength": 36, "uri": "sub/../part.bin"}])
    assert len(load("linked/a.gltf", text).faces) == 1


def test_a_primitive_has_positions(refused):
    text = gltf(meshes=[{"primitives": [{"attributes": {}}]}])
    refused("a.gltf", text, r"meshes\[0\] has a primitive without POSITION")


def test_buffers_that_are_not_there(refused):
    def buffer(**more):
        return gltf(buffers=[{"byteLength": 36, **more}])

    refused("a.gltf", buffer(uri="none.bin"), r"buffers\[0\]: .*none\.bin cannot be read: No such")
    refused(
        "a.gltf", buffer(uri="data:x;base64,A!B="), r"buffers\[0\]: its data is not valid base64"
    )
    refused("a.gltf", buffer(uri="data:x;base64,QUJD"), r"declares 36 bytes, but has 3")
    refused("a.gltf", buffer(), r"buffers\[0\] has neither a uri")
    refused("a.glb", triangle_glb(buffers=[{"byteLength": 36}] * 2, bufferViews=[
        {"buffer": 1, "byteLength": 36}]), r"buffers\[1\] has neither a uri")  # fmt: skip


@pytest.mark.parametrize(
    "more, message",
    [
        ({"nodes": [{"mesh": 0, "skin": 0}]}, r"nodes\[0\] has a skin or morph weights"),
        ({"nodes": [{"mesh": 0, "weights": [0.5]}]}, r"nodes\[0\] has a skin or morph weights"),
        ({"animations": [{"channels": [{}], "samplers": []}]}, "has animations"),
        ({"asset": {"version": "1.0"}}, "version 1.0: only version 2"),
        (
            {"nodes": [{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {}}}]},
            "EXT_mesh_gpu_instancing, which is not supported",
        ),
        ({"extensionsRequired": ["EXT_meshopt_compression"]}, "requires the extension EXT_mesho"),
        ({"nodes": [{"mesh": -1}]}, r"meshes\[-1\] is referenced, but there are 1 meshes"),
        ({"nodes": [{"mesh": True}]}, r"meshes\[True\] is referenced"),
        ({"scene": 1}, r"scenes\[1\] is referenced, but there are 1"),
        ({"nodes": [{"mesh": 0, "rotation": [0, 0, 0, 0]}]}, "rotation must be a quaternion"),
        (
            {"nodes": [{"mesh": 0, "matrix": [1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}]},
            r"a matrix has the last row \[0.5, 0",
        ),
        ({"nodes": [{"mesh": 0, "translation": [0, 0]}]}, "translation must be 3 finite"),
    ],
)
def test_what_would_move_or_replace_the_triangles_is_refused_by_name(refused, more, message):
    refused("a.gltf", gltf(**more), message)


def test_morph_targets_without_weight_move_nothing(load, refused):
    primitive = {"attributes": {"POSITION": 0}, "targets": [{"POSITION": 0}]}
    for weights in ([], [0.0]):
        meshes = [{"primitives": [primitive], "weights": weights}]
        assert len(load("a.gltf", gltf(meshes=meshes)).faces) == 1
    meshes = [{"primitives": [primitive], "weights": [0.0, 0.25]}]
    refused("a.gltf", gltf(meshes=meshes), r"meshes\[0\] has morph weights")


def test_a_node_with_a_camera_keeps_its_mesh(load):
    nodes = [{"camera": 0, "mesh": 0, "children": [1]}, {"mesh": 0, "translation": [0, 0, 5]}]
    text = gltf(nodes=nodes, cameras=[{"type": "orthographic"}])
    assert sorted(load("a.gltf", text).vertices[:, 2]) == [1, 1, 1, 6, 6, 6]


@pytest.mark.parametrize(
    "code, dtype, normalized, divisor",
    [(5120, "i1", True, 127), (5121, "u1", True, 255), (5122, "<i2", True, 32767),
     (5123, "<u2", True, 65535), (5122, "<i2", False, 1)],
)  # fmt: skip
def test_quantised_positions(load, code, dtype, normalized, divisor):
    points = np.array([[0, 0, 0], [100, 0, 0], [0, 50, 7]], dtype)
    padded = np.zeros((3, 4), dtype)
    padded[:, :3] = points
    stride = padded.itemsize * 4
    tree, _ = triangle_tree(
        extensionsRequired=["KHR_mesh_quantization"],
        bufferViews=[{"buffer": 0, "byteLength": 3 * stride, "byteStride": stride}],
        buffers=[{"byteLength": 3 * stride}],
        accessors=[{"bufferView": 0, "componentType": code, "count": 3, "type": "VEC3",
                    "normalized": normalized}],
    )  # fmt: skip
    mesh = load("a.glb", glb(tree, padded.tobytes()))
    np.testing.assert_allclose(corners(mesh)[0], points / divisor, rtol=1e-15)


# COLLADA


def test_the_unit_and_the_nodes_count_but_not_the_up_axis(load):
    mesh = load("base.dae", DAE)
    expected = np.array([[0, 0, 10], [1, 0, 10], [0, 2, 10], [0, 0, 13]])  # lifted by its node
    expected = 0.001 * expected[[[0, 2, 1], [0, 1, 3], [1, 2, 3]]]
    np.testing.assert_allclose(corners(mesh), expected, atol=1e-17)


@pytest.mark.parametrize("unit", ["<unit>mm</unit>", '<unit meter="0.0254"/>'])
def test_a_unit_of_another_program_does_not_count(load, unit):
    extra = f'<extra><technique profile="X">{unit}</technique></extra></COLLADA>'
    expected = load("base.dae", DAE).vertices
    assert np.array_equal(load("base.dae", DAE.replace("</COLLADA>", extra)).vertices, expected)


LIST = DAE[DAE.index('<polylist count="2">') : DAE.index("</mesh>")]
INPUTS = (
    '<input semantic="NORMAL" source="#n" offset="0"/>'
    '<input semantic="VERTEX" source="#v" offset="1"/>'
)


@pytest.mark.parametrize(
    "primitive, faces",
    [
        (f'<polylist count="1">{INPUTS}<vcount>4</vcount><p>9 0 9 1 9 2 9 3</p></polylist>',
         [[0, 1, 2], [0, 2, 3]]),
        (f'<polygons count="2">{INPUTS}<p>9 0 9 1 9 2</p><p>9 3 9 1 9 2</p></polygons>',
         [[0, 1, 2], [3, 1, 2]]),
        (f'<tristrips count="1">{INPUTS}<p>9 0 9 1 9 2 9 3</p></tristrips>',
         [[0, 1, 2], [2, 1, 3]]),
        (f'<trifans count="1">{INPUTS}<p>9 0 9 1 9 2 9 3</p></trifans>', [[0, 1, 2], [0, 2, 3]]),
        (f'<lines count="1">{INPUTS}<p>9 0 9 1</p></lines>', []),
    ],
)  # fmt: skip
def test_every_kind_of_polygons(load, primitive, faces):
    mesh = load("a.dae", DAE.replace(LIST, primitive))
    points = np.array([[0, 0, 10], [1, 0, 10], [0, 2, 10], [0, 0, 13]])
    expected = 0.001 * points[np.array([[0, 2, 1], *faces])]
    np.testing.assert_allclose(corners(mesh), expected, atol=1e-17)


def test_motions_of_nodes_are_applied_in_order_and_mirrors_turned_outside_out(load):
    motions = (
        "<scale>1 1 -2</scale><rotate>0 0 2 90</rotate>"
        "<matrix>1 0 0 5 0 1 0 0 0 0 1 0 0 0 0 1</matrix>"
    )
    node = f'<translate>0 0 10</translate><node id="m">{motions}'
    text = DAE.replace("<translate>0 0 10</translate>", node).replace("</node>", "</node></node>")
    points = np.array([[5, 0, 0], [6, 0, 0], [5, 2, 0], [5, 0, 3]])
    points = points @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]) * [1, 1, -2] + [0, 0, 10]
    expected = 0.001 * points[[[1, 2, 0], [3, 1, 0], [3, 2, 1]]]
    np.testing.assert_allclose(corners(load("a.dae", text)), expected, atol=1e-17)


def test_a_node_may_stand_in_a_library(load):
    library = '<library_nodes><node id="n"><instance_geometry url="#g"/></node></library_nodes>'
    text = DAE.replace("<library_visual_scenes>", f"{library}<library_visual_scenes>")
    text = text.replace('geometry url="#g"/></node></visual', 'node url="#n"/></node></visual')
    assert np.array_equal(corners(load("a.dae", text)), corners(load("b.dae", DAE)))


DAE_FLAWS = {
    "empty": (DAE, "", "is empty"),
    "no scene": (DAE[22:], "<COLLADA/>", "no triangles"),
    "another": ("COLLADA", "html", "not a COLLADA file: .* <html>"),
    "cut": ("</COLLADA>", "", "invalid XML"),
    "unknown polygons": ("polylist", "p", "which is not supported|exactly one VERTEX"),
    "holes": ("<vcount>", "<ph/><vcount>", "polygons with holes"),
    "no geometry": ('url="#g"', 'url="#h"', "refers to '#h': expected one <geometry> .* found 0"),
    "another file": ('url="#g"', 'url="b.dae#g"', "refers to 'b.dae#g'"),
    "skin": (
        "instance_geometry",
        "instance_controller",
        "skins and morph targets are not supported",
    ),
    "animation": (
        "<scene>",
        "<library_animations><animation><channel/></animation></library_animations><scene>",
        "has animations",
    ),
    "brep": ("mesh>", "brep>", "expected <mesh>, found <brep>"),
    "spline": ("mesh>", "spline>", "no triangles"),
    "skew": ("<translate>0 0 10</translate>", "<skew>1 2</skew>", "a node has <skew>"),
    "itself": ("<translate>", '<instance_node url="#n"/><translate>', "contains itself"),
    "corner": ("<p>0 2 1", "<p>0 2 4", r"<triangles>\[0\]: corners \[0, 2, 4\]"),
    "corners": ("<p>0 2 1", "<p>0 2", "<triangles> has 2 corners"),
    "count": ('triangles count="1"', 'triangles count="2"', "declares 2 items, but has 1"),
    "vcount": ("<vcount>3 3", "<vcount>3 2", "has 6 corners, but needs 5"),
    "negative vcount": ("<vcount>3 3", "<vcount>9 -3", "<vcount> has negative numbers"),
    "numbers": ("0 0 0 1 0 0", "0 0 1 0 0", "has 11 numbers, expected 12"),
    "accessor": ('count="4" stride', 'count="5" stride', "fit the 12 numbers"),
    "stride": ('stride="3"', 'stride="2"', "stride 2 and offset .*, the stride at least 3"),
    "nan": ("0 0 0 1 0 0", "0 0 0 NaN 0 0", r"vertices\[1\] = \[nan"),
    "unit": ('meter="0.001"', 'meter="0"', "<unit meter> is 0"),
    "units": (
        '<geometry id="g">',
        '<geometry id="g"><asset><unit meter="1"/></asset>',
        "units of 0.001 m and 1 m",
    ),
    "array": ('source="#a"', 'source="#b"', "<accessor source='#b'> does not refer to"),
    "order": ('name="X"', 'name="Z"', "params .*, expected X, Y and Z"),
    "unnamed": ('<param name="X"', "<param", "params .*, expected X, Y and Z"),
}


@pytest.mark.parametrize("kind", DAE_FLAWS)
def test_flaws_of_collada_are_named(refused, kind):
    old, new, message = DAE_FLAWS[kind]
    text = DAE.replace('<visual_scene id="s"><node>', '<visual_scene id="s"><node id="n">')
    assert old in DAE
    refused("base.dae", new if kind in ("empty", "no scene") else text.replace(old, new), message)


# 3MF


@pytest.mark.parametrize(
    "unit, metres",
    [("", 1e-3), ('unit="inch"', 0.0254), ('unit="micron"', 1e-6), ('unit="foot"', 0.3048)],
)
def test_the_unit_of_3mf_counts(load, unit, metres):
    mesh = load("a.3mf", packed(model_3mf(head=unit)))
    np.testing.assert_allclose(corners(mesh), BOX.triangles * metres, rtol=1e-15)


def test_items_and_components_are_placed(load):
    turn = "0 1 0 -1 0 0 0 0 1 10 0 0"  # rows of a matrix to multiply row vectors from the right
    mirror = "1 0 0 0 1 0 0 0 -1 0 0 0"
    group = (
        f'<object id="2"><components><component objectid="1" transform="{mirror}"/>'
        '<component objectid="1"/></components></object>'
    )
    items = f'<item objectid="2" transform="{turn}"/>'
    mesh = load("a.3mf", packed(model_3mf(OBJECT + group, items)))
    turned = BOX.triangles @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]) + [10, 0, 0]
    np.testing.assert_allclose(corners(mesh)[12:], turned, atol=1e-15)
    np.testing.assert_allclose(corners(mesh)[:12], (turned * [1, 1, -1])[:, ::-1], atol=1e-15)


def test_objects_of_the_same_number_may_lie_in_several_models(load, refused):
    space = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
    link = f'<component xmlns:p="{space}" p:path="/3D/other.model" objectid="1"/>'
    group = f'<object id="1"><components>{link}{link}</components></object>'
    head = f'unit="meter" requiredextensions="p" xmlns:p="{space}"'
    data = packed(model_3mf(group, head=head), other=model_3mf())
    assert np.array_equal(corners(load("a.3mf", data)), np.tile(BOX.triangles, (2, 1, 1)))
    other = packed(model_3mf(group, head=head), other=model_3mf(head='unit="inch"'))
    refused("b.3mf", other, "/3D/other.model has the unit 'inch', but other parts have 'meter'")


BEAMS = "http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02"
MODELS = {
    "unit": (model_3mf(head='unit="mile"'), "unit = 'mile': must be one of micron"),
    "missing": (
        model_3mf(items='<item objectid="7"/>'),
        "object 7 of .* is used, but does not exist",
    ),
    "twice": (model_3mf(OBJECT + OBJECT), "uses an object id twice"),
    "itself": (
        model_3mf('<object id="1"><components><component objectid="1"/></components></object>'),
        "object 1 contains itself",
    ),
    "empty": (model_3mf(items=""), "no triangles"),
    "nothing": (model_3mf('<object id="1"/>'), "object 1 has neither <mesh> nor"),
    "beams": (model_3mf(OBJECT.replace("<mesh>", "<mesh><beamlattice/>")), "a beam lattice"),
    "required": (
        model_3mf(head=f'requiredextensions="b" xmlns:b="{BEAMS}"'),
        "requires the extension '.*beamlattice",
    ),
    "corner": (model_3mf(OBJECT.replace('v1="1"', 'v1="8"', 1)), r"triangles\[0\]: corners \[8"),
    "no y": (model_3mf(OBJECT.replace(' y="', ' w="', 1)), "<vertex> has no y"),
    "motion": (model_3mf(items='<item objectid="1" transform="1 0 0"/>'), "3 numbers, expected 12"),
    "nan": (model_3mf(OBJECT.replace('x="0.5"', 'x="nan"', 1)), r"vertices\[\d\] = \[nan"),
    "xml": (model_3mf()[:-9], "invalid XML"),
    "other": (model_3mf(OBJECT.replace('"model"', '"other"')), "object 1 has the type 'other'"),
    "html": ("<html/>", "expected the root element <model>, found <html>"),
}


@pytest.mark.parametrize("kind", MODELS)
def test_flaws_of_3mf_are_named(refused, kind):
    refused("a.3mf", packed(MODELS[kind][0]), MODELS[kind][1])


def test_an_archive_that_is_none(refused):
    refused("a.3mf", b"PK\3\4 and no more", "invalid ZIP archive")
