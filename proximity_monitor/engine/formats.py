"""What an STL, OBJ or OFF file must hold to be complete, and the plain form that trimesh gets.

trimesh 5.2 loads what it can of a damaged file, in silence, and misreads some sound ones: OBJ's
relative indices (it counts them from the end of the file) and indented lines (it skips them), the
comments of OFF (it reads the lines before them twice), several solids in one ASCII STL (it merges
vertices within 1e-8). So each file is walked first. A flaw is a `FormatError`; what is handed on
holds vertices and triangles alone, in the file's order, and is a binary PLY but for binary STL.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike


class FormatError(ValueError):
    """A file is incomplete or inconsistent; the message says where."""


class Plain(NamedTuple):
    """A file that is proven complete: what trimesh gets, in which format, and what it must find."""

    data: bytes
    kind: str
    triangles: int


def as_ply(vertices: ArrayLike, triangles: ArrayLike) -> Plain:
    """A binary PLY file of vertices (n, 3) and triangles (m, 3)."""
    corners = np.asarray(triangles, dtype="<i4").reshape(-1, 3)
    points = np.asarray(vertices, dtype="<f8").reshape(-1, 3)
    faces = np.empty(len(corners), dtype=[("length", "u1"), ("corners", "<i4", 3)])
    faces["length"], faces["corners"] = 3, corners
    head = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(points)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    return Plain(head.encode() + points.tobytes() + faces.tobytes(), "ply", len(faces))


def shown(word: bytes) -> str:
    """A word of a file as messages print it."""
    return repr(word[:40].decode("ascii", "backslashreplace"))


def real(word: bytes) -> float:
    """The number that a word is."""
    try:
        return float(word)
    except ValueError:
        raise FormatError(f"{shown(word)} is no number") from None


def integer(word: bytes) -> int:
    """The whole number that a word is."""
    try:
        return int(word)
    except ValueError:
        raise FormatError(f"{shown(word)} is no whole number") from None


def fan(polygon: Sequence[int], vertex_count: int) -> list[tuple[int, int, int]]:
    """The triangles of a polygon, whose corners are counted from 0."""
    if len(polygon) < 3:
        raise FormatError(f"a face with {len(polygon)} corners")
    if min(polygon) < 0 or max(polygon) >= vertex_count:
        raise FormatError(
            f"corners {list(polygon[:8])}: not all are vertices; there are {vertex_count}, "
            "numbered from 0"
        )
    return [(polygon[0], polygon[i], polygon[i + 1]) for i in range(1, len(polygon) - 1)]


class _Lines:
    """The words of each line that holds more than a comment; as a context, it names the line."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self.number = 0

    def __iter__(self) -> Iterator[list[bytes]]:
        for line in self._data.splitlines():
            self.number += 1
            words = line.split(b"#", 1)[0].split()
            if words:
                yield words

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, FormatError):
            raise FormatError(f"line {self.number}: {error}") from None


def _vertex(words: Sequence[bytes]) -> list[float]:
    """The coordinates with which a line begins."""
    if len(words) < 3:
        raise FormatError(f"a vertex with {len(words)} coordinates")
    return [real(word) for word in words][:3]  # all are read: a damaged colour is damage


def plain_stl(data: bytes) -> Plain:
    """An STL file, binary or ASCII."""
    count = int.from_bytes(data[80:84], "little")
    if len(data) >= 84 and len(data) == 84 + 50 * count:
        return Plain(data, "stl", count)
    if data[:512].lstrip()[:5].lower() == b"solid" and b"\0" not in data:
        return _ascii_stl(data)
    if len(data) < 84:
        raise FormatError(f"{len(data)} bytes are less than the header of a binary STL")
    raise FormatError(
        f"a binary STL of {count} triangles has {84 + 50 * count} bytes, this file {len(data)}"
    )


_FACET = (b"facet", b"outer", b"vertex", b"vertex", b"vertex", b"endloop", b"endfacet")


def _ascii_stl(data: bytes) -> Plain:
    vertices: list[list[float]] = []
    at = -1  # which word of a facet comes next; -1 outside a solid
    with _Lines(data) as lines:
        for key, *words in lines:
            key = key.lower()
            if key == (b"solid" if at == -1 else _FACET[at]):
                if key == b"vertex":
                    vertices.append(_vertex(words))
                at = (at + 1) % len(_FACET)
            elif at == 0 and key == b"endsolid":
                at = -1
            else:
                wanted = b"solid" if at == -1 else _FACET[at]
                raise FormatError(f"{shown(key)} where {shown(wanted)} should stand")
    if at != -1:
        raise FormatError("ends before 'endsolid': truncated")
    return as_ply(vertices, np.arange(len(vertices)))


_OBJ_OTHERS = frozenset(
    b"vt vn vp l p o g s mg usemtl mtllib usemap maplib lod bevel c_interp d_interp shadow_obj "
    b"trace_obj ctech stech cstype deg bmat step curv curv2 surf parm trim hole scrv sp end con "
    b"call csh".split()
)
"""Statements of OBJ that make no triangles. Any other word is a sign of damage."""


def plain_obj(data: bytes) -> Plain:
    """The vertices and faces of an OBJ file, with absolute indices."""
    vertices: list[list[float]] = []
    polygons: list[tuple[int, list[int]]] = []
    triangles: list[tuple[int, int, int]] = []
    with _Lines(data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")) as lines:
        for key, *words in lines:
            if key == b"v":
                vertices.append(_vertex(words))
            elif key == b"f":
                indices = [integer(word.split(b"/", 1)[0]) for word in words]
                # Below zero they count back from the last vertex so far; zero is none.
                polygon = [i - 1 if i >= 0 else len(vertices) + i for i in indices]
                polygons.append((lines.number, polygon))
            elif key not in _OBJ_OTHERS:
                raise FormatError(f"{shown(key)} is no OBJ statement")
        for number, polygon in polygons:  # now that all vertices are known
            lines.number = number
            triangles += fan(polygon, len(vertices))
    return as_ply(vertices, triangles)


def plain_off(data: bytes) -> Plain:
    """The vertices and faces of an OFF file, without comments and colours."""
    triangles: list[tuple[int, int, int]] = []
    with _Lines(data) as lines:
        rows = iter(lines)
        head, *counts = next(rows, [b""])
        if not re.fullmatch(rb"(ST)?C?N?OFF", head):
            raise FormatError("does not begin with OFF")
        # They stand on the line of the header or on the next.
        announced = [integer(word) for word in (counts or next(rows, []))[:2]]
        if len(announced) < 2 or min(announced) < 0:
            raise FormatError("the numbers of vertices and faces are missing")
        vertices = [_vertex(row) for row in islice(rows, announced[0])]
        face_count = 0
        for size, *corners in islice(rows, announced[1]):
            if not 0 <= integer(size) <= len(corners):
                raise FormatError(f"a face with {len(corners)} of {integer(size)} corners")
            polygon = [integer(corner) for corner in corners[: integer(size)]]
            triangles += fan(polygon, announced[0])
            face_count += 1
        found = [len(vertices), face_count]
        if found != announced or next(rows, None):
            more = "" if found != announced else ", and then more"
            raise FormatError(
                f"{announced[0]} vertices and {announced[1]} faces are announced, one a line, but "
                f"{found[0]} and {found[1]} follow{more}"
            )
    return as_ply(vertices, triangles)
