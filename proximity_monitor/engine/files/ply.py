"""Reader for PLY, binary and ASCII: vertices, polygons and triangle strips. The rest is skipped."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .polygons import cut_polygons
from .text import Rows, lines, shown, wholes, without_mark
from .triangles import FormatError, Ints, Reals, Triangles, first, no_triangles, spans, strips

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


class _Column(NamedTuple):
    """The values of a property in all rows, concatenated, and the number of values in each row."""

    values: NDArray
    sizes: Ints


_Columns = dict[str, _Column]
_Table = dict[str, _Columns]
"""The columns, by element name and property name."""


def read_ply(data: bytes, _: Path) -> Triangles:
    """Read a PLY file."""
    data = without_mark(data)
    end = re.search(rb"[\r\n]end_header[ \t]*(\r?\n|\r)", data)
    if not re.match(rb"ply\s", data) or end is None:
        raise FormatError("no header from 'ply' to 'end_header'")
    order, elements = _header(data[: end.start()])
    # If the header's lines end with \r alone, a \n after the last \r is the first byte of the data.
    body = data[end.end() if b"\n" in data[: end.start() + 1] else end.start(1) + 1 :]
    found = _binary(body, elements, order) if order else _ascii(body, elements)
    vertex = found.get("vertex", {})
    if not all(axis in vertex for axis in "xyz"):
        raise FormatError("the vertices have no x, y and z")
    properties = {element.name: element.properties for element in elements}["vertex"]
    lists = [prop.name for prop in properties if prop.name in ("x", "y", "z") and prop.length]
    if lists:
        raise FormatError(f"{lists[0]} of the vertices is a list, expected a number")
    vertices = np.column_stack([vertex[axis].values for axis in "xyz"]).astype(np.float64)
    faces = [no_triangles()]
    for element in elements:
        if element.name in ("face", "tristrips") and element.count:
            faces.append(_triangles(element, found[element.name], vertices))
    return Triangles(vertices, np.concatenate(faces))


def _header(head: bytes) -> tuple[str, list[_Element]]:
    """Return the byte order ("" for ASCII) and the elements."""
    order, elements = None, []
    for number, line in enumerate(head.splitlines()[1:], 2):
        words = line.split()
        key = words[0] if words else b"comment"
        if key == b"format" and len(words) == 3 and order is None:
            order = _ORDERS.get(words[1])
        elif key == b"element" and len(words) == 3 and words[2].isdigit():
            count = int(wholes(words[2:])[0])
            elements.append(_Element(words[1].decode("latin-1"), count, []))
        elif key == b"property" and elements and _types(words):
            length, kind = _types(words)
            elements[-1].properties.append(_Property(words[-1].decode("latin-1"), kind, length))
        elif key not in (b"comment", b"obj_info"):
            raise FormatError(f"line {number}: {shown(line)} is not a valid PLY header line")
    if order is None:
        raise FormatError("the header names no known format")
    for names in [[e.name for e in elements], *([p.name for p in e.properties] for e in elements)]:
        if len(set(names)) < len(names):
            raise FormatError(f"the header uses a name twice: {', '.join(names)}")
    return order, elements


def _types(words: Sequence[bytes]) -> tuple[str, str] | None:
    """Return the numpy types of a list's length ("" for a single value) and of its values.

    Return None if the declaration is malformed.
    """
    if len(words) == 3 and words[1] in _TYPES:
        return "", _TYPES[words[1]]
    if len(words) == 5 and words[1] == b"list" and words[2] in _TYPES and words[3] in _TYPES:
        length = _TYPES[words[2]]
        return None if length[0] == "f" else (length, _TYPES[words[3]])
    return None


def _ascii(body: bytes, elements: list[_Element]) -> _Table:
    """Return the elements of an ASCII file, which has one row per line."""
    rows, _ = lines(body, comments=False)
    announced = sum(element.count for element in elements)
    if len(rows.sizes) != announced:
        raise FormatError(f"the header declares {announced} rows, but {len(rows.sizes)} follow")
    found, begin = {}, 0
    for element in elements:
        found[element.name] = _ascii_columns(rows.cut(begin, begin + element.count), element)
        begin += element.count
    return found


def _ascii_columns(rows: Rows, element: _Element) -> _Columns:
    def place(i: int) -> str:
        return f"{element.name}[{i}]: "

    rows.where = place
    values, starts, sizes = rows.reals(), rows.starts, rows.sizes
    at, ends, columns = starts, starts + sizes, {}
    for prop in element.properties:
        bad = first(at >= ends)
        if bad is not None:
            raise FormatError(f"{place(bad)}{prop.name} is missing")
        lengths = np.ones_like(at)
        if prop.length:
            announced, room = values[at], ends - at - 1
            bad = first(~((announced >= 0) & (announced <= room) & (announced % 1 == 0)))
            if bad is not None:
                counts = f"declares {announced[bad]:g} values, but {room[bad]} follow"
                raise FormatError(f"{place(bad)}{prop.name} {counts}")
            lengths, at = announced.astype(np.int64), at + 1
        columns[prop.name] = _Column(values[spans(at, lengths)], lengths)
        at = at + lengths
    bad = first(at != ends)
    if bad is not None:
        wanted = at[bad] - starts[bad]
        raise FormatError(f"{place(bad)}{sizes[bad]} values, expected {wanted}")
    return columns


def _binary(body: bytes, elements: list[_Element], order: str) -> _Table:
    """Return the elements of a binary file, which follow one another."""
    found, at = {}, 0
    for element in elements:
        rows = _equal_rows(body, at, element, order)
        columns, at = rows or _unequal_rows(body, at, element, order)
        found[element.name] = columns
    if at != len(body):
        raise FormatError(f"{len(body) - at} bytes follow the data that the header declares")
    return found


def _equal_rows(body: bytes, at: int, element: _Element, order: str) -> tuple[_Columns, int] | None:
    """Return the columns and end offset if all rows are as long as the first one; else None."""
    if not element.count:
        return {}, at
    fields, lengths, end = [], {}, at
    for i, prop in enumerate(element.properties):
        size = 1
        if prop.length:
            size, end = _length(body, end, prop, order)
            lengths[f"{i} length"] = size
            fields.append((f"{i} length", order + prop.length))
        fields.append((str(i), order + prop.kind, (size,)))
        end += size * np.dtype(prop.kind).itemsize
    end = at + (end - at) * element.count
    if end > len(body):
        if not lengths:
            raise _truncated(element)
        return None
    rows = np.frombuffer(body, dtype=fields, count=element.count, offset=at)
    if not all((rows[name] == length).all() for name, length in lengths.items()):
        return None
    return {
        prop.name: _Column(
            rows[str(i)].reshape(-1),
            np.full(element.count, lengths.get(f"{i} length", 1), dtype=np.int64),
        )
        for i, prop in enumerate(element.properties)
    }, end


def _unequal_rows(body: bytes, at: int, element: _Element, order: str) -> tuple[_Columns, int]:
    """Return the columns of rows of different lengths, and the end offset."""
    starts: list[list[int]] = [[] for _ in element.properties]
    lengths: list[list[int]] = [[] for _ in element.properties]
    steps = [
        (prop, np.dtype(prop.kind).itemsize, starts[i].append, lengths[i].append)
        for i, prop in enumerate(element.properties)
    ]
    for _ in range(element.count):
        for prop, size, add_start, add_length in steps:
            length = 1
            if prop.length:
                length, at = _length(body, at, prop, order)
            add_start(at)
            add_length(length)
            at += length * size
        if at > len(body):
            raise _truncated(element)
    values, columns = np.frombuffer(body, dtype=np.uint8), {}
    for (prop, size, _, _), begins, counts in zip(steps, starts, lengths, strict=True):
        sizes = np.array(counts, dtype=np.int64)
        taken = values[spans(np.array(begins, dtype=np.int64), sizes * size)]
        columns[prop.name] = _Column(taken.view(order + prop.kind), sizes)
    return columns, at


def _length(body: bytes, at: int, prop: _Property, order: str) -> tuple[int, int]:
    """Return the length of the list at an offset, and the offset of its values."""
    end = at + int(prop.length[1])
    if end > len(body):
        raise FormatError(f"ends before {prop.name}: truncated")
    byteorder = "little" if order == "<" else "big"
    length = int.from_bytes(body[at:end], byteorder, signed=prop.length[0] == "i")
    if not 0 <= length <= len(body):
        raise FormatError(f"{prop.name} has the impossible length {length}")
    return length, end


def _truncated(element: _Element) -> FormatError:
    return FormatError(
        f"ends before the last of {element.count} rows of {element.name!r}: truncated"
    )


def _triangles(element: _Element, columns: _Columns, vertices: Reals) -> Ints:
    """Return the triangles of faces, or of strips; in a row of strips, -1 starts the next strip."""
    named = [
        prop for prop in element.properties
        if prop.name in _CORNERS and prop.length and prop.kind[0] != "f"
    ]  # fmt: skip
    if not named:
        raise FormatError(
            f"element {element.name!r} has no list of whole numbers named vertex_indices"
        )
    values, sizes = columns[named[0].name]
    row_of = np.repeat(np.arange(element.count), sizes)
    bad = first(values != np.trunc(values)) if values.dtype.kind == "f" else None
    if bad is not None:
        raise FormatError(f"{element.name}[{row_of[bad]}]: {values[bad]:g} is not a whole number")
    corners = values.astype(np.int64)
    if element.name == "face":
        return cut_polygons(vertices, corners, sizes, lambda i: f"faces[{i}]: ")
    # A strip ends at the end of its row or at a restart (-1). A row may also end with a restart.
    kept = corners != -1
    strip_of = (np.cumsum(~kept) + row_of)[kept]
    _, begins, lengths = np.unique(strip_of, return_index=True, return_counts=True)
    row = row_of[kept][begins]
    return strips(corners[kept], lengths, len(vertices), lambda i: f"tristrips[{row[i]}]: ")
