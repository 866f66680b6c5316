"""Reader for OFF (Geomview): vertices and polygons. Colours, normals and textures are skipped."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from .polygons import cut_polygons
from .text import Rows, lines, wholes
from .triangles import FormatError, Triangles, first, spans

_HEAD = re.compile(rb"(ST)?(C)?(N)?OFF")
_EXTRA = (2, 4, 3)
"""Numbers that ST (texture), C (colour) and N (normal) add to each vertex."""


def read_off(data: bytes, _: Path) -> Triangles:
    """Read an OFF file, with one vertex or face per line, or without regard to lines."""
    rows, numbers = lines(data, comments=True)
    head = _HEAD.fullmatch(rows.words[0]) if rows.words else None
    if not head:
        raise FormatError("does not begin with OFF")
    # The counts follow the header on its line or on the next. Otherwise line breaks mean nothing.
    given = int(rows.sizes[0]) - 1 or int(rows.sizes[1:2].sum())
    begin = 1 + (2 if given == 2 else 3)
    announced = wholes(rows.words[1:begin], lambda i: rows.place(i + 1))[:2].tolist()
    if len(announced) < 2 or min(announced) < 0:
        raise FormatError("the counts of vertices and faces are missing or negative")
    vertex_count, face_count = announced
    words = rows.words[begin:]
    line_of = np.repeat(numbers, rows.sizes)[begin:]
    ends = np.cumsum(rows.sizes)
    sizes = np.diff(ends[ends > begin], prepend=begin)
    if len(sizes) != vertex_count + face_count:
        width = 3 + sum(n for n, word in zip(_EXTRA, head.groups(), strict=True) if word)
        line_count, sizes = len(sizes), _one_behind_the_other(words, *announced, width)
        if sizes is None:
            raise FormatError(
                f"declares {vertex_count} vertices and {face_count} faces, but {line_count} lines "
                "follow, and their numbers do not match if read without line breaks either"
            )
    begins = np.cumsum(sizes) - sizes
    items = Rows(words, sizes, lambda i: f"line {line_of[begins[i]]}: ")
    vertices = items.cut(0, vertex_count).coordinates()
    polygons = items.cut(vertex_count, vertex_count + face_count)
    counts = wholes([polygons.words[i] for i in polygons.starts.tolist()], polygons.where)
    bad = first((counts < 0) | (counts >= polygons.sizes))  # a colour may follow the corners
    if bad is not None:
        found = f"declares {counts[bad]} corners, but has {polygons.sizes[bad] - 1}"
        raise FormatError(f"{polygons.where(bad)}a face {found}")
    which = spans(polygons.starts + 1, counts)
    named = [polygons.words[i] for i in which.tolist()]
    corners = wholes(named, lambda i: polygons.place(which[i]))
    return Triangles(vertices, cut_polygons(vertices, corners, counts, polygons.where))


def _one_behind_the_other(
    words: list[bytes], vertex_count: int, face_count: int, width: int
) -> list[int] | None:
    """Return the number of words of each vertex and face if line breaks mean nothing.

    In such a file, faces cannot have colours. Return None if the words do not fit.
    """
    sizes, at = [width] * min(vertex_count, len(words)), vertex_count * width
    while len(sizes) < vertex_count + face_count and at < len(words) and words[at].isdigit():
        sizes.append(1 + int(words[at]))
        at += sizes[-1]
    return sizes if len(sizes) == vertex_count + face_count and at == len(words) else None
