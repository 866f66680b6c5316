"""The common result of the triangle readers, and helpers for fans, strips and placed parts."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]
Ints = NDArray[np.int64]
Part = tuple[Reals, Ints]
"""Vertices (n, 3) and faces (m, 3)."""


class FormatError(ValueError):
    """A file is incomplete, inconsistent or not supported. The message says where."""


class Triangles(NamedTuple):
    """The content of a model file."""

    vertices: Reals
    """(n, 3), in the file's unit of length."""
    faces: Ints
    """(m, 3) indices of vertices."""
    unit: float | None = None
    """Metres per unit of length that the file states; None if it states none."""


Where = Callable[[int], str]
"""Returns the place of item i for a message, such as "line 7: "."""


def first(bad: NDArray[np.bool_]) -> int | None:
    """Return the index of the first true entry; None if there is none."""
    return int(np.argmax(bad)) if bad.any() else None


def spans(starts: Ints, lengths: Ints) -> Ints:
    """Return the indices start, start + 1, ... of each span, concatenated."""
    skipped = starts - (np.cumsum(lengths) - lengths)
    return np.repeat(skipped, lengths) + np.arange(int(lengths.sum()))


def check_finite(vertices: Reals) -> None:
    """Refuse vertices (n, 3) that are not finite; the error gives the first one's index."""
    bad = ~np.isfinite(vertices).all(axis=1)
    which = first(bad)
    if which is not None:
        raise FormatError(
            f"vertices[{which}] = {vertices[which].tolist()}: every coordinate must be finite "
            f"({int(bad.sum())} such vertices)"
        )


def check_corners(corners: Ints, sizes: Ints, count: int, where: Where) -> None:
    """Refuse faces with fewer than three corners, and corners outside the `count` vertices."""
    bad = first(sizes < 3)
    if bad is not None:
        raise FormatError(f"{where(bad)}a face has {sizes[bad]} corners, expected at least 3")
    bad = first((corners < 0) | (corners >= count))
    if bad is not None:
        ends = np.cumsum(sizes)
        face = int(np.searchsorted(ends, bad, side="right"))
        listed = corners[ends[face] - sizes[face] : ends[face]][:8].tolist()
        raise FormatError(
            f"{where(face)}corners {listed}: not all are vertices; there are {count} vertices, "
            "numbered from 0"
        )


def fans(corners: Ints, sizes: Ints, count: int, where: Where) -> Ints:
    """Cut polygons into fans from their first corner, as triangles (m, 3).

    Concave polygons need `cut_polygons`.

    Args:
        corners: (k,) indices of vertices, one polygon after the other.
        sizes: how many corners each polygon has.
        count: how many vertices there are.
        where: names the place of a polygon.
    """
    check_corners(corners, sizes, count, where)
    if (sizes == 3).all():
        return corners.reshape(-1, 3)
    starts = np.cumsum(sizes) - sizes
    second = spans(starts + 1, sizes - 2)
    return corners[np.stack((np.repeat(starts, sizes - 2), second, second + 1), axis=1)]


def strips(corners: Ints, sizes: Ints, count: int, where: Where) -> Ints:
    """Cut strips into triangles (m, 3); every other triangle is reversed to keep one orientation.

    Triangles that name a vertex twice are skipped: they only connect one strip to the next, and
    the line between the two strips is no part of the surface.
    """
    check_corners(corners, sizes, count, where)
    at = spans(np.cumsum(sizes) - sizes, sizes - 2)
    odd = spans(np.zeros_like(sizes), sizes - 2) % 2
    triangles = corners[np.stack((at + odd, at + 1 - odd, at + 2), axis=1)]
    a, b, c = triangles.T
    return triangles[(a != b) & (b != c) & (c != a)]


def no_triangles() -> Ints:
    """Return an empty array of triangles (0, 3)."""
    return np.empty((0, 3), dtype=np.int64)


class Parts:
    """Gathers the parts of an assembly, placed in its frame."""

    def __init__(self) -> None:
        self._vertices = [np.empty((0, 3))]
        self._faces = [no_triangles()]
        self._count = 0

    def add(self, vertices: Reals, faces: Ints, matrix: Reals) -> None:
        """Add a part, moved by a 4×4 matrix; if the matrix mirrors it, reverse its faces."""
        if not len(faces):
            return
        if matrix[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
            raise FormatError(
                f"a matrix has the last row {matrix[3].tolist()}, expected [0, 0, 0, 1]"
            )
        with np.errstate(all="ignore"):  # vertices that are not finite are refused after reading
            self._vertices.append(vertices @ matrix[:3, :3].T + matrix[:3, 3])
            mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
        self._faces.append((faces[:, ::-1] if mirrored else faces) + self._count)
        self._count += len(vertices)

    def joined(self, unit: float | None = None) -> Triangles:
        """Return all parts as one."""
        return Triangles(np.concatenate(self._vertices), np.concatenate(self._faces), unit)
