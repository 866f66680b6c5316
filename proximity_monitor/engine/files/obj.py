"""Reader for Wavefront OBJ: vertices and polygons. Points, curves and materials are skipped."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .polygons import cut_polygons
from .text import Rows, shown, wholes, without_comment, without_mark
from .triangles import FormatError, Triangles

_OTHERS = frozenset(
    b"vt vn vp l p o g s mg usemtl mtllib usemap maplib lod bevel c_interp d_interp shadow_obj "
    b"trace_obj ctech stech cstype deg bmat step curv curv2 parm trim hole scrv sp end con".split()
)
"""Statements that make no triangles and are skipped. An unknown word is a sign of damage."""
_NAMES = frozenset(b"o g usemtl mtllib usemap maplib".split())
"""Statements that end with a name. A backslash at the end may be part of it, so it is refused."""
_NOT_READ = frozenset(b"surf call csh bsp bzp cdc cdp res".split())
"""Statements that make other kinds of surfaces, or import them. They are refused."""


def read_obj(data: bytes, _: Path) -> Triangles:
    """Read an OBJ file; indices may be absolute, or count back from the last vertex so far."""
    vertices: list[bytes] = []
    widths: list[int] = []
    vertex_lines: list[int] = []
    corners: list[bytes] = []
    sizes: list[int] = []
    so_far: list[int] = []  # number of vertices before each face; relative indices count from it
    face_lines: list[int] = []
    begun = b""
    for number, line in enumerate(without_mark(data).splitlines(), 1):
        if line.endswith(b"\\") and b"#" not in line:  # the statement continues on the next line
            if (begun + line).split(None, 1)[0] in _NAMES:
                raise FormatError(
                    f"line {number}: the name ends with \\, which may belong to the name or "
                    "continue the line: rename it"
                )
            begun += line[:-1] + b" "
            continue
        if begun:
            line, begun = begun + line, b""
        key, *words = without_comment(line).split() or (b"",)
        if key == b"v":
            vertices += words
            widths.append(len(words))
            vertex_lines.append(number)
        elif key == b"f":
            corners += [word.split(b"/", 1)[0] for word in words] if b"/" in line else words
            sizes.append(len(words))
            so_far.append(len(widths))
            face_lines.append(number)
        elif key in _NOT_READ:
            raise FormatError(
                f"line {number}: {shown(key)} is not supported: export triangles instead"
            )
        elif key and key not in _OTHERS:
            raise FormatError(f"line {number}: {shown(key)} is not an OBJ statement")
    if begun:
        raise FormatError("ends within a statement: truncated")
    points = Rows(vertices, widths, lambda i: f"line {vertex_lines[i]}: ").coordinates()
    polygons = Rows(corners, sizes, lambda i: f"line {face_lines[i]}: ")
    named = wholes(corners, polygons.place)
    # OBJ counts vertices from 1. An index of 0 becomes -1, which `cut_polygons` refuses.
    base = np.where(named < 0, np.repeat(np.array(so_far, dtype=np.int64), polygons.sizes), -1)
    faces = cut_polygons(points, named + base, polygons.sizes, polygons.where)
    return Triangles(points, faces)
