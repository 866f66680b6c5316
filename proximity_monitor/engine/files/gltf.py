"""Reader for glTF 2.0, as text (.gltf) and binary (.glb): the triangles of the static scene.

Features that move the triangles (morph targets, skins, animations) or replace them (compression,
instancing) are refused by name. Nodes without a mesh, points, lines and materials are skipped.
"""

from __future__ import annotations

import base64
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import unquote, unquote_to_bytes, urlsplit

import numpy as np
from numpy.typing import NDArray

from .json import json_of
from .triangles import (
    FormatError,
    Ints,
    Part,
    Parts,
    Reals,
    Triangles,
    check_finite,
    fans,
    no_triangles,
    strips,
)

_POINTS_AND_LINES, _TRIANGLES, _STRIP, _FAN = range(4), 4, 5, 6
_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_HARMLESS = (
    "KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_mesh_quantization",
)  # fmt: skip
"""Prefixes of the names of extensions that do not change the geometry, or that are read."""

_Json = Mapping[str, Any]


def read_glb(data: bytes, folder: Path) -> Triangles:
    """Read a GLB file."""
    if data[:4] != b"glTF" or int.from_bytes(data[4:8], "little") != 2:
        raise FormatError("not a GLB file of version 2")
    announced = int.from_bytes(data[8:12], "little")
    if announced != len(data):
        raise FormatError(f"declares {announced} bytes, but has {len(data)}")
    chunks, at = [], 12
    while at < len(data):
        length = int.from_bytes(data[at : at + 4], "little")
        if at + 8 + length > len(data):
            raise FormatError(f"a chunk of {length} bytes extends past the end of the file")
        chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + length]))
        at += 8 + length
    if not chunks or chunks[0][0] != b"JSON":
        raise FormatError("has no JSON chunk")
    return _Document(chunks[0][1], folder, dict(chunks[:0:-1]).get(b"BIN\0")).triangles()


def read_gltf(data: bytes, folder: Path) -> Triangles:
    """Read a glTF file and the buffers that lie beside it."""
    return _Document(data, folder, None).triangles()


class _Document:
    """The JSON of a file, with its buffers."""

    def __init__(self, text: bytes, folder: Path, chunk: bytes | None) -> None:
        self._tree = json_of(text)
        if not isinstance(self._tree, dict):
            raise FormatError("its JSON is not an object")
        version = self._tree.get("asset", {}).get("version")
        if not str(version).startswith("2."):
            raise FormatError(f"has the glTF version {version}: only version 2 is supported")
        for name in self._tree.get("extensionsRequired", []):
            if not name.startswith(_HARMLESS):
                raise FormatError(f"requires the extension {name}, which is not supported")
        if any(each.get("channels") for each in self._tree.get("animations", [])):
            raise FormatError("has animations, which are not supported: export a static scene")
        self._folder = folder
        self._chunk = chunk
        self._buffers: dict[int, bytes] = {}

    def triangles(self) -> Triangles:
        """Return all triangles, in the frame of the scene."""
        parts = Parts()
        if not self._tree.get("scenes"):
            raise FormatError("has no scene, so no triangles are shown")
        scene = self._item("scenes", self._tree.get("scene", 0))
        waiting = [(i, np.eye(4)) for i in scene.get("nodes", [])]
        seen: set[int] = set()
        meshes: dict[int, list[Part]] = {}
        while waiting:
            i, above = waiting.pop()
            node, name = self._item("nodes", i), f"nodes[{i}]"
            if i in seen:
                raise FormatError(f"{name} has two parents")
            seen.add(i)
            if "skin" in node or any(node.get("weights", [])):
                raise FormatError(f"{name} has a skin or morph weights: apply them before export")
            if "EXT_mesh_gpu_instancing" in node.get("extensions", {}):
                raise FormatError(f"{name} has EXT_mesh_gpu_instancing, which is not supported")
            matrix = above @ _matrix(node, name)
            if "mesh" in node:
                mesh = node["mesh"]
                if mesh not in meshes:
                    meshes[mesh] = self._mesh(mesh)
                for vertices, faces in meshes[mesh]:
                    parts.add(vertices, faces, matrix)
            waiting += [(child, matrix) for child in node.get("children", [])]
        return parts.joined()

    def _item(self, kind: str, i: object) -> _Json:
        """Return entry i of one of the document's top-level lists."""
        items = self._tree.get(kind, [])
        if type(i) is not int or not 0 <= i < len(items):
            raise FormatError(
                f"{kind}[{i}] is referenced, but there are {len(items)} {kind}, numbered from 0"
            )
        return items[i]

    def _mesh(self, i: int) -> list[Part]:
        """Return the vertices and faces of each primitive of a mesh."""
        mesh, name = self._item("meshes", i), f"meshes[{i}]"
        if any(mesh.get("weights", [])):
            raise FormatError(f"{name} has morph weights: apply them before export")
        found = []
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", _TRIANGLES)
            if mode in _POINTS_AND_LINES:
                continue
            if "POSITION" not in primitive["attributes"]:
                raise FormatError(f"{name} has a primitive without POSITION")
            vertices = self._accessor(primitive["attributes"]["POSITION"], 3).astype(np.float64)
            check_finite(vertices)
            corners = np.arange(len(vertices))
            if "indices" in primitive:
                corners = self._accessor(primitive["indices"], 1).reshape(-1).astype(np.int64)
            found.append((vertices, _faces(mode, corners, len(vertices), name)))
        return found

    def _accessor(self, i: int, width: int) -> NDArray:
        """Return the numbers (n, width) of an accessor."""
        accessor, name = self._item("accessors", i), f"accessors[{i}]"
        if "bufferView" not in accessor or "sparse" in accessor:
            raise FormatError(f"{name} is compressed or sparse, which is not supported")
        view = self._item("bufferViews", accessor["bufferView"])
        data = self._buffer(view["buffer"])
        begin, length = view.get("byteOffset", 0), view["byteLength"]
        if not 0 <= begin <= begin + length <= len(data):
            raise FormatError(f"bufferViews[{accessor['bufferView']}] extends past its buffer")
        kind = np.dtype(_TYPES.get(accessor["componentType"], "V1"))
        start, count = accessor.get("byteOffset", 0), accessor["count"]
        row = width * kind.itemsize
        stride = view.get("byteStride", row)
        is_index = width == 1
        if _WIDTHS.get(accessor["type"]) != width or kind.kind not in ("u" if is_index else "fiu"):
            wanted = "unsigned whole numbers" if is_index else "rows of three coordinates"
            raise FormatError(f"{name}: expected {wanted}")
        if start < 0 or count < 1 or stride < row:
            raise FormatError(
                f"{name}: byteOffset must be at least 0, count at least 1, and byteStride at "
                f"least {row}"
            )
        if start + (count - 1) * stride + row > length:
            raise FormatError(f"{name} extends past its buffer view")
        values = np.ndarray((count, width), kind, data, begin + start, (stride, kind.itemsize))
        if accessor.get("normalized") and kind.kind != "f":
            return np.maximum(values / np.iinfo(kind).max, -1.0)
        return values

    def _buffer(self, i: int) -> bytes:
        """Return the bytes of a buffer, from a URI or from the binary chunk."""
        if i in self._buffers:
            return self._buffers[i]
        buffer, name = self._item("buffers", i), f"buffers[{i}]"
        if "uri" in buffer:
            data = self._fetched(buffer["uri"], name)
        elif i == 0 and self._chunk is not None:
            data = self._chunk
        else:
            raise FormatError(f"{name} has neither a uri nor a binary chunk")
        if not 0 <= buffer["byteLength"] <= len(data):
            raise FormatError(f"{name} declares {buffer['byteLength']} bytes, but has {len(data)}")
        self._buffers[i] = data[: buffer["byteLength"]]
        return self._buffers[i]

    def _fetched(self, uri: str, name: str) -> bytes:
        """Return the bytes that a URI holds or names; open no file outside the model's folder."""
        if uri.startswith("data:"):
            kind, _, content = uri.partition(",")
            if not kind.endswith(";base64"):
                return unquote_to_bytes(content)
            try:
                return base64.b64decode(unquote_to_bytes(content), validate=True)
            except ValueError as error:
                raise FormatError(f"{name}: its data is not valid base64: {error}") from None
        parts = urlsplit(uri)
        # Check the URI alone: symbolic links in the folder are trusted like the folder itself.
        inner = os.path.normpath(unquote(parts.path))
        file = self._folder / inner
        outside = os.path.isabs(inner) or Path(inner).parts[:1] == ("..",)
        if parts.scheme or parts.netloc or outside:
            raise FormatError(
                f"{name} refers to {uri[:80]!r}, outside the file's folder: move it into that "
                "folder, or embed it"
            )
        try:
            return file.read_bytes()
        except OSError as error:
            raise FormatError(f"{name}: {file} cannot be read: {error.strerror}") from None


def _faces(mode: int, corners: Ints, count: int, name: str) -> Ints:
    """Return the triangles (m, 3) of a primitive."""
    size = np.array([len(corners)])
    if mode == _TRIANGLES:
        if len(corners) % 3:
            raise FormatError(f"{name} has {len(corners)} corners, not a multiple of 3")
        size = np.full(len(corners) // 3, 3)
        return fans(corners, size, count, lambda i: f"{name}: faces[{i}]: ")
    if mode not in (_STRIP, _FAN):
        raise FormatError(f"{name} has primitives of mode {mode}, which glTF does not define")
    if len(corners) < 3:
        return no_triangles()
    return (strips if mode == _STRIP else fans)(corners, size, count, lambda _: f"{name}: ")


def _matrix(node: _Json, name: str) -> Reals:
    """Return the transform (4, 4) of a node: its matrix, or its translation, rotation and scale."""
    given = {
        key: np.array(node.get(key, default), dtype=np.float64)
        for key, default in (
            ("matrix", np.eye(4).ravel()), ("translation", (0, 0, 0)),
            ("rotation", (0, 0, 0, 1)), ("scale", (1, 1, 1)),
        )
    }  # fmt: skip
    for key, size in (("matrix", 16), ("translation", 3), ("rotation", 4), ("scale", 3)):
        if given[key].shape != (size,) or not np.isfinite(given[key]).all():
            raise FormatError(f"{name}: {key} must be {size} finite numbers")
    x, y, z, w = given["rotation"]
    length = x * x + y * y + z * z + w * w
    if not length > 0.0:
        raise FormatError(f"{name}: rotation must be a quaternion other than 0")
    s = 2.0 / length
    rotation = np.array(
        [
            [1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
            [s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)],
            [s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation * given["scale"], given["translation"]
    return matrix @ given["matrix"].reshape(4, 4).T
