"""What a GLB file must hold to be complete before trimesh reads it.

trimesh 5.2 skips triangle fans in silence, reads compressed and sparse accessors as zeros, ignores
the scale of normalised ones, and loses nodes that carry a camera. Such files are refused.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from .formats import FormatError, Plain

_JSON, _BIN = b"JSON", b"BIN\0"
_TRIANGLES, _STRIP = 4, 5
_FLOAT = 5126
_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, _FLOAT: 4}
_NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_")
"""Beginnings of the names of extensions that leave the geometry alone."""

_Json = Mapping[str, Any]


def plain_glb(data: bytes) -> Plain:
    """A GLB file, whose scene is counted."""
    tree, size = _chunks(data)
    for name in tree.get("extensionsRequired", []):
        if not name.startswith(_HARMLESS):
            raise FormatError(f"requires the extension {name}, which is not read")
    for i, buffer in enumerate(tree.get("buffers", [])):
        if i > 0 or "uri" in buffer:
            raise FormatError(f"buffers[{i}] lies outside the file: embed it")
        if not 0 <= buffer["byteLength"] <= size:
            raise FormatError(f"buffers[0] has {buffer['byteLength']} bytes, the file {size} of it")
    views = tree.get("bufferViews", [])
    for i, view in enumerate(views):
        start, length = view.get("byteOffset", 0), view["byteLength"]
        if view["buffer"] != 0 or not 0 <= start <= start + length <= size:
            raise FormatError(f"bufferViews[{i}] reaches beyond its buffer")
    accessors = tree.get("accessors", [])
    for i, accessor in enumerate(accessors):
        _check_accessor(f"accessors[{i}]", accessor, views)
    meshes = [
        sum(_primitive(f"meshes[{i}]", each, accessors) for each in mesh["primitives"])
        for i, mesh in enumerate(tree.get("meshes", []))
    ]
    return Plain(data, "glb", _scene(tree, meshes))


def _chunks(data: bytes) -> tuple[_Json, int]:
    """The JSON of the file, and the size of its binary chunk."""
    if data[:4] != b"glTF" or int.from_bytes(data[4:8], "little") != 2:
        raise FormatError("does not begin as a GLB file of version 2")
    announced = int.from_bytes(data[8:12], "little")
    if announced != len(data):
        raise FormatError(f"announces {announced} bytes, but has {len(data)}")
    chunks, at = [], 12
    while at < len(data):
        length = int.from_bytes(data[at : at + 4], "little")
        if at + 8 + length > len(data):
            raise FormatError(f"a chunk of {length} bytes reaches beyond the end")
        chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + length]))
        at += 8 + length
    if not chunks or chunks[0][0] != _JSON:
        raise FormatError("has no JSON")
    tree = json.loads(chunks[0][1])
    if not isinstance(tree, dict):
        raise FormatError("its JSON is no object")
    return tree, next((len(content) for kind, content in chunks[1:] if kind == _BIN), 0)


def _check_accessor(name: str, accessor: _Json, views: Sequence[_Json]) -> None:
    """An accessor's values must be there, and lie within its view."""
    if "bufferView" not in accessor or "sparse" in accessor:
        raise FormatError(f"{name} is compressed or sparse, which is not read")
    view = views[accessor["bufferView"]]
    item = _BYTES[accessor["componentType"]] * _NUMBERS[accessor["type"]]
    start, count = accessor.get("byteOffset", 0), accessor["count"]
    stride = view.get("byteStride", item)
    if start < 0 or count < 1 or stride < item:
        raise FormatError(f"{name} is malformed")
    if start + (count - 1) * stride + item > view["byteLength"]:
        raise FormatError(f"{name} reaches beyond its view")


def _primitive(name: str, primitive: _Json, accessors: Sequence[_Json]) -> int:
    """Number of triangles of a primitive; points and lines have none."""
    mode = primitive.get("mode", _TRIANGLES)
    if 0 <= mode < _TRIANGLES:
        return 0
    if mode not in (_TRIANGLES, _STRIP):
        raise FormatError(f"{name} has primitives of mode {mode}, which are not read")
    position = accessors[primitive["attributes"]["POSITION"]]
    if position["type"] != "VEC3" or position["componentType"] != _FLOAT:
        raise FormatError(f"{name} has positions that are not three floats, which are not read")
    listed = accessors[primitive["indices"]] if "indices" in primitive else position
    corners = listed["count"]
    if mode == _STRIP:
        return max(corners - 2, 0)
    if corners % 3:
        raise FormatError(f"{name} has {corners} corners, which make no triangles")
    return corners // 3


def _scene(tree: _Json, meshes: Sequence[int]) -> int:
    """Number of triangles in the scene that is shown."""
    nodes, scenes = tree.get("nodes", []), tree.get("scenes", [])
    if not scenes:
        return 0
    waiting = list(scenes[tree.get("scene", 0)].get("nodes", []))
    seen: set[int] = set()
    count = 0
    while waiting:
        i = waiting.pop()
        if i in seen:
            raise FormatError(f"nodes[{i}] has two parents")
        seen.add(i)
        node = nodes[i]
        if "camera" in node and ("mesh" in node or "children" in node):
            raise FormatError(f"nodes[{i}] is a camera with a mesh or children, which is not read")
        if "mesh" in node:
            count += meshes[node["mesh"]]
        waiting += node.get("children", [])
    return count
