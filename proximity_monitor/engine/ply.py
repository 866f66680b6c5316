"""What a PLY file must hold to be complete, and the plain form that trimesh gets.

trimesh 5.2 takes fewer faces than the header announces, drops those with two corners, and cannot
read binary faces of different sizes. So the elements are walked first, and handed on as positions
and triangles alone.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .formats import FormatError, Plain, as_ply, fan, integer, real, shown

_TYPES = {
    b"char": "i1", b"uchar": "u1", b"short": "i2", b"ushort": "u2", b"int": "i4", b"uint": "u4",
    b"float": "f4", b"double": "f8", b"int8": "i1", b"uint8": "u1", b"int16": "i2",
    b"uint16": "u2", b"int32": "i4", b"uint32": "u4", b"int64": "i8", b"uint64": "u8",
    b"float16": "f2", b"float32": "f4", b"float64": "f8",
}  # fmt: skip
_ORDERS = {b"ascii": "", b"binary_little_endian": "<", b"binary_big_endian": ">"}
_CORNERS = ("vertex_indices", "vertex_index")


class _Property(NamedTuple):
    name: str
    kind: str  # numpy type
    length: str  # numpy type of a list's length; "" for a single value


class _Element(NamedTuple):
    name: str
    count: int
    properties: list[_Property]


def plain_ply(data: bytes) -> Plain:
    """The vertices and faces of a PLY file, as a binary one."""
    end = re.search(rb"^end_header[ \t]*\r?\n", data, re.MULTILINE)
    if not re.match(rb"ply\s", data) or end is None:
        raise FormatError("no header from 'ply' to 'end_header'")
    order, elements = _header(data[: end.start()])
    body = data[end.end() :]
    columns = _binary(body, elements, order) if order else _ascii(body, elements)
    vertex, face = columns.get("vertex", {}), columns.get("face", {})
    if not vertex or not face:
        return Plain(data, "ply", 0)
    if not all(axis in vertex for axis in "xyz"):
        raise FormatError("the vertices have no x, y and z")
    corners = [
        face[prop.name]
        for element in elements
        for prop in element.properties
        if element.name == "face" and prop.name in _CORNERS and prop.length and prop.kind[0] != "f"
    ]
    if not corners:
        raise FormatError("the faces have no list of whole vertex_indices")
    vertices = np.column_stack([vertex[axis] for axis in "xyz"])
    return as_ply(vertices, _triangles(corners[0], len(vertices)))


def _header(head: bytes) -> tuple[str, list[_Element]]:
    """Byte order ("" for ASCII) and elements."""
    order, elements = None, []
    for number, line in enumerate(head.splitlines()[1:], 2):
        words = line.split()
        key = words[0] if words else b"comment"
        if key == b"format" and len(words) == 3 and order is None:
            order = _ORDERS.get(words[1])
        elif key == b"element" and len(words) == 3 and words[2].isdigit():
            elements.append(_Element(words[1].decode("latin-1"), int(words[2]), []))
        elif key == b"property" and elements and all(word in _TYPES for word in _types(words)):
            kinds = [_TYPES[word] for word in _types(words)]
            name = words[-1].decode("latin-1")
            length = kinds[0] if len(kinds) == 2 else ""
            elements[-1].properties.append(_Property(name, kinds[-1], length))
        elif key not in (b"comment", b"obj_info"):
            raise FormatError(f"line {number}: {shown(line)} is no line of a PLY header")
    if order is None:
        raise FormatError("the header names no format that is known")
    for names in [[e.name for e in elements], *([p.name for p in e.properties] for e in elements)]:
        if len(set(names)) < len(names):
            raise FormatError(f"the header gives a name twice among {', '.join(names)}")
    return order, elements


def _types(words: Sequence[bytes]) -> Sequence[bytes]:
    """The words of a property line that name types; one that names none where it is malformed."""
    if len(words) == 3:
        return words[1:2]
    return words[2:4] if len(words) == 5 and words[1] == b"list" else (b"",)


_Columns = dict[str, dict[str, Sequence]]
"""Element, property, rows. The rows of a list are arrays (a table where all are as long)."""


def _ascii(body: bytes, elements: list[_Element]) -> _Columns:
    """The elements of an ASCII file, one row a line."""
    rows = [words for line in body.splitlines() if (words := line.split())]
    announced = sum(element.count for element in elements)
    if len(rows) != announced:
        raise FormatError(f"the header announces {announced} rows, but {len(rows)} follow")
    columns: _Columns = {}
    first = 0
    for element in elements:
        table: dict[str, list] = {prop.name: [] for prop in element.properties}
        for number, words in enumerate(rows[first : first + element.count]):
            try:
                _ascii_row(words, element, table)
            except FormatError as error:
                raise FormatError(f"{element.name}[{number}]: {error}") from None
        columns[element.name] = table if element.count else {}
        first += element.count
    return columns


def _ascii_row(words: list[bytes], element: _Element, table: dict[str, list]) -> None:
    at = 0
    for prop in element.properties:
        if at >= len(words):
            raise FormatError(f"{prop.name} is missing")
        if prop.length:
            length = integer(words[at])
            values = words[at + 1 : at + 1 + max(length, 0)]
            if len(values) != length:
                raise FormatError(f"{prop.name} has {len(values)} of {length} values")
            read = real if prop.kind[0] == "f" else integer
            table[prop.name].append([read(value) for value in values])
            at += 1 + length
        else:
            table[prop.name].append(real(words[at]))
            at += 1
    if at != len(words):
        raise FormatError(f"{len(words)} values where {at} should stand")


def _binary(body: bytes, elements: list[_Element], order: str) -> _Columns:
    """The elements of a binary file, one behind the other."""
    columns: _Columns = {}
    at = 0
    for element in elements:
        columns[element.name] = {}
        if element.count == 0:
            continue
        table, end = _table(body, at, element, order)
        if table is None:
            table, end = _ragged(body, at, element, order)
        columns[element.name], at = table, end
    if at != len(body):
        raise FormatError(f"{len(body) - at} bytes follow what the header announces")
    return columns


def _table(
    body: bytes, at: int, element: _Element, order: str
) -> tuple[dict[str, NDArray] | None, int]:
    """The rows of an element as long as its first, and where they end; None where they differ."""
    fields: list[tuple] = []
    lengths = {}
    row = at
    for prop in element.properties:
        if prop.length:
            length, row = _list_length(body, row, prop, order)
            lengths[prop.name] = length
            fields += [(f"{prop.name} length", order + prop.length)]
            fields += [(prop.name, order + prop.kind, (length,))]
            row += length * np.dtype(prop.kind).itemsize
        else:
            fields += [(prop.name, order + prop.kind)]
            row += np.dtype(prop.kind).itemsize
    end = at + element.count * (row - at)
    if end <= len(body):
        rows = np.frombuffer(body, dtype=fields, count=element.count, offset=at)
        if all((rows[f"{name} length"] == length).all() for name, length in lengths.items()):
            return {prop.name: rows[prop.name] for prop in element.properties}, end
    elif not lengths:
        raise _truncated(element)
    return None, at


def _ragged(
    body: bytes, at: int, element: _Element, order: str
) -> tuple[dict[str, list[NDArray]], int]:
    """The rows of an element one by one, and where they end."""
    table: dict[str, list] = {prop.name: [] for prop in element.properties}
    for _ in range(element.count):
        for prop in element.properties:
            length = 1
            if prop.length:
                length, at = _list_length(body, at, prop, order)
            end = at + length * np.dtype(prop.kind).itemsize
            if end > len(body):
                raise _truncated(element)
            table[prop.name].append(np.frombuffer(body, order + prop.kind, length, at))
            at = end
    return table, at


def _list_length(body: bytes, at: int, prop: _Property, order: str) -> tuple[int, int]:
    """Length of the list at an offset, and where its values begin."""
    size = np.dtype(prop.length).itemsize
    if at + size > len(body):
        raise FormatError(f"ends before {prop.name}: truncated")
    length = int(np.frombuffer(body, order + prop.length, 1, at)[0])
    if not 0 <= length <= len(body):
        raise FormatError(f"{prop.name} of length {length}")
    return length, at + size


def _truncated(element: _Element) -> FormatError:
    return FormatError(f"ends before the {element.count} of {element.name} are complete: truncated")


def _triangles(polygons: Sequence, vertex_count: int) -> NDArray[np.int64]:
    """The polygons as triangles (m, 3)."""
    if isinstance(polygons, np.ndarray) and polygons.ndim == 2 and polygons.shape[1] == 3:
        bad = ~((polygons >= 0) & (polygons < vertex_count)).all(axis=1)
        if not bad.any():
            return polygons.astype(np.int64)
    triangles: list[tuple[int, int, int]] = []
    for number, polygon in enumerate(polygons):
        try:
            triangles += fan([int(corner) for corner in polygon], vertex_count)
        except FormatError as error:
            raise FormatError(f"faces[{number}]: {error}") from None
    return np.array(triangles, dtype=np.int64)
