"""Model files of every format, as bytes."""

from __future__ import annotations

import base64
import io
import json
import zipfile

import numpy as np
import trimesh

BOX = trimesh.creation.box((1.0, 2.0, 3.0))
"""12 triangles and 8 vertices. All coordinates are exact in float32 and have few digits."""

FACET = (
    "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
)
STL = f"solid part\n{FACET}endsolid part\n"
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
OFF = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
PLY = (
    "ply\nformat ascii 1.0\ncomment by hand\nelement vertex 4\nproperty float x\nproperty float y\n"
    "property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n0 1 0\n1 1 0\n3 0 1 2\n3 1 3 2\n"
)


def exported(kind: str, mesh: trimesh.Trimesh | trimesh.Scene = BOX, **options: str) -> bytes:
    """Return a mesh in the given format, written by trimesh."""
    data = mesh.export(file_type=kind, **options)
    return data if isinstance(data, bytes) else data.encode()


def binary_stl(corners: np.ndarray) -> bytes:
    """Return triangles (m, 3, 3) as a binary STL file."""
    facets = np.zeros(len(corners), dtype=[("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    facets["v"] = corners
    return bytes(80) + len(corners).to_bytes(4, "little") + facets.tobytes()


def binary_ply(polygons: list[list[int]], order: str = "<", count: str = "u1") -> bytes:
    """Return a PLY file of polygons on BOX's vertices, with flags, colours and lists to skip."""
    name = {"<": "little", ">": "big"}[order]
    length = {"u1": "uchar", "i4": "int"}[count]
    head = (
        f"ply\nformat binary_{name}_endian 1.0\nelement vertex 8\nproperty uchar flag\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(polygons)}\nproperty short flag\n"
        f"property list {length} uint vertex_indices\nproperty uchar red\n"
        "element other 2\nproperty list uchar float values\nend_header\n"
    ).encode()
    vertices = np.zeros(8, dtype=[("flag", "u1"), ("x", f"{order}f8", 3)])
    vertices["x"] = BOX.vertices
    faces = b"".join(
        np.array([7], f"{order}i2").tobytes()
        + np.array([len(polygon)], order + count).tobytes()
        + np.array(polygon, f"{order}u4").tobytes()
        + b"\xff"
        for polygon in polygons
    )
    others = b"\x02" + np.ones(2, f"{order}f4").tobytes() + b"\x00"
    return head + vertices.tobytes() + faces + others


def glb(tree: dict, binary: bytes = b"") -> bytes:
    """Return a GLB file of a JSON chunk and a binary chunk."""
    text = json.dumps(tree).encode()
    chunks = b""
    for kind, content, fill in ((b"JSON", text, b" "), (b"BIN\0", binary, b"\0")):
        if content:
            content += fill * (-len(content) % 4)
            chunks += len(content).to_bytes(4, "little") + kind + content
    return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks


def triangle_tree(
    mode: int = 4, corners: int = 3, indices: list[int] | None = None, **more
) -> tuple[dict, bytes]:
    """Return JSON and buffer of a glTF mesh of vertices (i, i², 1); `more` replaces JSON parts."""
    i = np.arange(corners)
    positions = np.column_stack((i, i * i, np.ones(corners))).astype("<f4").tobytes()
    primitive: dict = {"attributes": {"POSITION": 0}, "mode": mode}
    accessors = [{"bufferView": 0, "componentType": 5126, "count": corners, "type": "VEC3"}]
    views = [{"buffer": 0, "byteLength": len(positions)}]
    binary = positions
    if indices is not None:
        primitive["indices"] = 1
        accessors += [
            {"bufferView": 1, "componentType": 5123, "count": len(indices), "type": "SCALAR"}
        ]
        views += [{"buffer": 0, "byteOffset": len(binary), "byteLength": 2 * len(indices)}]
        binary += np.array(indices, dtype="<u2").tobytes()
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(binary)}],
    }
    return {**tree, **more}, binary


def triangle_glb(*args, **more) -> bytes:
    """Return `triangle_tree` as a GLB file."""
    return glb(*triangle_tree(*args, **more))


def embedded(tree: dict, binary: bytes) -> dict:
    """Return the JSON of a glTF file whose buffer is a data: URI."""
    uri = "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
    return {**tree, "buffers": [{"byteLength": len(binary), "uri": uri}]}


DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><created>2020-01-01</created><modified>2020-01-01</modified>
    <unit meter="0.001" name="millimetre"/><up_axis>Y_UP</up_axis></asset>
  <library_geometries><geometry id="g"><mesh>
    <source id="p"><float_array id="a" count="12">0 0 0 1 0 0 0 2 0 0 0 3</float_array>
      <technique_common><accessor source="#a" count="4" stride="3">
        <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
      </accessor></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <triangles count="1" material="missing"><input semantic="VERTEX" source="#v" offset="0"/>
      <p>0 2 1</p></triangles>
    <polylist count="2"><input semantic="VERTEX" source="#v" offset="0"/>
      <vcount>3 3</vcount><p>0 1 3 1 2 3</p></polylist>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s"><node>
    <translate>0 0 10</translate><instance_geometry url="#g"/></node></visual_scene>
  </library_visual_scenes>
  <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>
"""
"""Three faces of a tetrahedron, moved up by 10 units."""

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
OBJECT = (
    '<object id="1" type="model"><mesh><vertices>'
    + "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in BOX.vertices.tolist())
    + "</vertices><triangles>"
    + "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in BOX.faces.tolist())
    + "</triangles></mesh></object>"
)


def model_3mf(
    objects: str = OBJECT, items: str = '<item objectid="1"/>', head: str = 'unit="meter"'
) -> str:
    """Return the model part of a 3MF file, as XML."""
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><model {head} xmlns="{CORE}">'
        f"<resources>{objects}</resources><build>{items}</build></model>"
    )


def packed(model: str, **others: str) -> bytes:
    """Return a 3MF file of a model and of further models, stored as `3D/<name>.model`."""
    rels = (
        '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
        '<Relationship Target="/3D/3dmodel.model" Id="rel0" '
        'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>'
    )
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("_rels/.rels", rels)
        archive.writestr("3D/3dmodel.model", model)
        for name, text in others.items():
            archive.writestr(f"3D/{name}.model", text)
    return buffer.getvalue()


MARK = b"\xef\xbb\xbf"
"""The byte order mark that some editors write before UTF-8 text."""

VALID = {
    "binary.stl": exported("stl"),
    "ascii.stl": exported("stl_ascii"),
    "solids.stl": (STL + STL.replace("0 1 0", "0 1 5")).encode(),
    "plain.obj": exported("obj"),
    "relative.obj": (OBJ + "f -3/1 -2//1 -1\nusemtl x\nf 1 2 3\n" + OBJ + "f -3 -2 -1\n").encode(),
    "plain.off": exported("off"),
    "colours.off": OFF.replace("0 1 2\n", "0 1 2 255 0 0 # red\n").encode(),
    "little.ply": exported("ply"),
    "ascii.ply": exported("ply", encoding="ascii"),
    "by_hand.ply": PLY.encode(),
    "big.ply": binary_ply([[0, 1, 2], [1, 3, 2]], ">"),
    "polygons.ply": binary_ply([[0, 1, 2], [1, 3, 2, 0], [0, 1, 3, 2, 4]]),
    "box.glb": exported("glb"),
    "strip.glb": triangle_glb(5, 5),
    "fan.glb": triangle_glb(6, 5),
    "data.glb": glb(embedded(*triangle_tree())),
    "data.gltf": json.dumps(embedded(*triangle_tree(4, 4, [3, 1, 0]))).encode(),
    "plain.dae": DAE.encode(),
    "box.3mf": packed(model_3mf()),
    "line.stl": b" ".join(exported("stl_ascii").split()),
    "trailing.stl": exported("stl") + b"made by a CAD program",
    "marked.stl": MARK + STL.encode(),
    "marked.obj": MARK + OBJ.encode() + b"f 1 2 3\n",
    "marked.off": MARK + OFF.encode(),
    "returns.ply": PLY.replace("\n", "\r").encode(),
    "marked.ply": MARK + PLY.encode(),
    "line.off": b" ".join(exported("off").split()),
    "strips.ply": PLY.replace("face 2", "tristrips 2")
    .replace("3 0 1 2\n3 1 3 2", "4 0 1 2 3\n7 0 1 2 -1 1 3 2")
    .encode(),
}
"""Valid files by name; the extension gives the format."""
