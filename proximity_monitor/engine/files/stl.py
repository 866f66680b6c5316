"""Reader for STL, binary and ASCII."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np

from .text import reals, shown, without_mark
from .triangles import FormatError, Reals, Triangles, check_finite, no_triangles

_BINARY = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_FACET = tuple(
    b"facet normal 0 0 0 outer loop vertex 0 0 0 vertex 0 0 0 vertex 0 0 0 endloop endfacet".split()
)
_KEYWORDS = [i for i, word in enumerate(_FACET) if word.isalpha()]
_COORDINATES = [8, 9, 10, 12, 13, 14, 16, 17, 18]
_BLOCK = 1 << 22
"""Bytes of text that are split into words at once. The words take ten times as much memory."""

_SOLID = re.compile(rb"\s*solid\b")
_FURTHER = re.compile(rb"\s*(facet|endsolid)\b")
_NEXT_SOLID, _NEXT_ENDSOLID = re.compile(rb"\ssolid\b"), re.compile(rb"\sendsolid\b")
_WORD_FACET = re.compile(rb"\sfacet\s")
_OPEN_FACET = re.compile(rb"\sfacet\s+normal(?:\s+\S+){3}\s+outer\s")
_ENDSOLID = re.compile(rb"endsolid\b")
_LINE_END = re.compile(rb"[\r\n]|\Z")


def read_stl(data: bytes, _: Path) -> Triangles:
    """Read an STL file, and merge equal vertices, which STL repeats for each triangle.

    After its triangles, a binary file may hold text, zeros, or fewer bytes than one triangle has.
    Any other bytes mean that it holds more triangles than it announces; it is refused.
    """
    text = without_mark(data)
    count = int.from_bytes(data[80:84], "little")
    size = 84 + 50 * count
    if len(data) < 84 or len(data) < size:
        if text[:512].lstrip()[:5].lower() == b"solid" and b"\0" not in text:
            return _merged(_ascii(text.lower()))
        if len(data) < 84:
            raise FormatError(f"{len(data)} bytes, but a binary STL has at least 84")
        raise FormatError(
            f"a binary STL of {count} triangles has {size} bytes, but this file has {len(data)}"
        )
    rest = len(data) - size
    if rest >= 50 and not _is_text(data[size:].strip(b"\0")):
        raise FormatError(
            f"the header declares {count} triangles, but the file has room for {rest // 50} more"
        )
    facets = np.frombuffer(data, dtype=_BINARY, count=count, offset=84)
    return _merged(facets["corners"].reshape(-1, 3).astype(np.float64))


def _is_text(data: bytes) -> bool:
    try:
        text = data.decode()
    except UnicodeDecodeError:
        return False
    return all(each.isprintable() or each.isspace() for each in text)


def _ascii(text: bytes) -> Reals:
    """Return the corners (3 m, 3) of all solids in an ASCII file."""
    parts, at = [np.empty((0, 9))], 0
    while solid := _SOLID.match(text, at):
        start = _name_end(text, solid.end())
        end = text.find(b"endsolid", start)
        stop = end if end >= 0 else len(text)
        parts += [_facets(text, *block) for block in _blocks(text, start, stop)]
        if end < 0:
            raise FormatError("ends before 'endsolid': truncated")
        if not (closing := _ENDSOLID.match(text, end)):
            at = end
            break
        at = _closing_end(text, closing.end())
    rest = re.compile(rb"\S+").search(text, at)
    if rest:
        raise FormatError(f"{_line(text, rest.start())}found {shown(rest[0])}, expected 'solid'")
    return np.concatenate(parts).reshape(-1, 3)


def _name_end(text: bytes, at: int) -> int:
    """Return where the name of a solid ends.

    The name runs to the end of its line, whatever words are in it, with two exceptions. It ends
    before a facet that opens on the same line. It ends before an `endsolid` on the same line if
    neither a facet nor an `endsolid` follows the line.
    """
    line_end = _LINE_END.search(text, at).start()
    facet = _facet_in(text, at, line_end)
    if facet is not None:
        return facet
    closing = None if _FURTHER.match(text, line_end) else _NEXT_ENDSOLID.search(text, at, line_end)
    return closing.start() if closing else line_end


def _closing_end(text: bytes, at: int) -> int:
    """Return where the name after an `endsolid` ends.

    It ends with its line, or before a `solid` on the same line that opens a facet there.
    """
    line_end = _LINE_END.search(text, at).start()
    facet = _facet_in(text, at, line_end)
    solid = None if facet is None else _NEXT_SOLID.search(text, at, facet)
    return solid.start() if solid else line_end


def _facet_in(text: bytes, at: int, line_end: int) -> int | None:
    """Return where the first facet in the rest of a line starts; None if there is none."""
    words = (word.start() for word in _WORD_FACET.finditer(text, at, line_end))
    return next((start for start in words if _OPEN_FACET.match(text, start)), None)


def _blocks(text: bytes, start: int, stop: int) -> Iterator[tuple[int, int]]:
    """Yield the start and end of blocks of whole facets."""
    while start < stop:
        cut = text.find(b"endfacet", start + _BLOCK, stop)
        cut = stop if cut < 0 else cut + len(b"endfacet")
        yield start, cut
        start = cut


def _facets(text: bytes, start: int, stop: int) -> Reals:
    """Return the coordinates (m, 9) of a block of facets."""
    words, size = text[start:stop].split(), len(_FACET)

    def where(i: int) -> str:
        word = next(islice(re.compile(rb"\S+").finditer(text, start, stop), i, None))
        return _line(text, word.start())

    wrong = [
        next(i for i in range(key, len(words), size) if words[i] != _FACET[key])
        for key in _KEYWORDS
        if not {*words[key::size]} <= {_FACET[key]}
    ]
    if wrong:
        wanted = shown(_FACET[min(wrong) % size])
        raise FormatError(f"{where(min(wrong))}found {shown(words[min(wrong)])}, expected {wanted}")
    if len(words) % size:
        raise FormatError("ends within a facet, before 'endsolid': truncated")
    columns = [
        reals(words[key::size], lambda i, key=key: where(i * size + key)) for key in _COORDINATES
    ]
    return np.stack(columns, axis=1)


def _line(text: bytes, at: int) -> str:
    return f"line {len(text[: at + 1].splitlines())}: "


def _merged(corners: Reals) -> Triangles:
    """Merge equal corners (3 m, 3) of triangles; the vertices keep the order of appearance."""
    if not len(corners):
        return Triangles(corners, no_triangles())
    check_finite(corners)  # before merging, so that an error gives the index in the file
    order = np.lexsort(corners.T)  # stable: equal corners keep their order of appearance
    ranked = corners[order]
    starts = np.concatenate(([True], (ranked[1:] != ranked[:-1]).any(axis=1)))
    firsts = order[starts]
    rank = np.argsort(np.argsort(firsts))
    merged = np.empty(len(corners), dtype=np.int64)
    merged[order] = rank[np.cumsum(starts) - 1]
    return Triangles(corners[np.sort(firsts)], merged.reshape(-1, 3))
