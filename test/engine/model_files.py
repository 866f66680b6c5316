"""Model files of every format, as bytes."""

from __future__ import annotations

import json

import numpy as np
import trimesh

BOX = trimesh.creation.box((1.0, 2.0, 3.0))
"""12 triangles, 8 vertices, all of them exact in float32 and in few digits."""

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
    """A mesh as trimesh writes it."""
    data = mesh.export(file_type=kind, **options)
    return data if isinstance(data, bytes) else data.encode()


def binary_stl(corners: np.ndarray) -> bytes:
    """Triangles (m, 3, 3) as a binary STL."""
    facets = np.zeros(len(corners), dtype=[("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    facets["v"] = corners
    return bytes(80) + len(corners).to_bytes(4, "little") + facets.tobytes()


def binary_ply(polygons: list[list[int]], order: str = "<", count: str = "u1") -> bytes:
    """The vertices of BOX and polygons, with a flag in front of each and a colour behind it."""
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
    """A GLB file of a JSON and a binary chunk."""
    text = json.dumps(tree).encode()
    chunks = b""
    for kind, content, fill in ((b"JSON", text, b" "), (b"BIN\0", binary, b"\0")):
        if content:
            content += fill * (-len(content) % 4)
            chunks += len(content).to_bytes(4, "little") + kind + content
    return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks


def triangle_glb(
    mode: int = 4, corners: int = 3, indices: list[int] | None = None, **more
) -> bytes:
    """A GLB file of one mesh with vertices (i, i², 1); `more` replaces parts of its JSON."""
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
    return glb({**tree, **more}, binary)


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
    "polygons.ply": binary_ply([[0, 1, 2], [1, 3, 2, 0], [0, 1, 2, 3, 4]]),
    "box.glb": exported("glb"),
    "strip.glb": triangle_glb(5, 5),
}
"""Sound files by name; the extension says the format."""
