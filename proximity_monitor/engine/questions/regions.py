"""The regions of either model that take part in a manifold: where they are, and what they touch."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.trees import NONE
from ..kernels.surface.regions import describe_parts, join_boxes
from ..kernels.tree.layout import first_of, last_of
from ..models.hierarchy import Hierarchy
from ..models.surface_hierarchy import SurfaceHierarchy

Reals = NDArray[np.float64]
Ranges = NDArray[np.int32]
"""(k, 2) rows of a table of elements, or of parts of them: the first, and one after the last."""


class Regions(ABC):
    """One side of a manifold: a table of elements, and of parts of them, some in a row a region.

    Args:
        hierarchy: of the model.
    """

    elements: NDArray[np.int32]
    """(n,) what they are called outside: triangles' faces; pieces' patches and curves."""
    rectangles: Reals | None
    """(n, 2, 2) lowest and highest u and v of each in its patch; None of a mesh."""

    def __init__(self, hierarchy: Hierarchy) -> None:
        self.hierarchy = hierarchy

    @abstractmethod
    def own(self, numbers: NDArray[np.int32]) -> Ranges:
        """The ranges of parts, by their numbers in a search."""

    @abstractmethod
    def points(self, ranges: Ranges) -> Reals:
        """A point of each region (k, 3), metres; NaN where none is known."""

    @abstractmethod
    def _boxes(self) -> Reals:
        """The box of each row of the table (n, 6), metres: least x, y, z and largest."""

    def under(self, lanes: NDArray[np.int32]) -> Ranges:
        """Ranges of the elements under volumes."""
        children = self.hierarchy.tree.children[lanes]
        leaves = children < 0
        alone = np.stack((first_of.py_func(children), last_of.py_func(children) + 1), axis=1)
        nodes = self.hierarchy.ranges()[np.where(leaves, 0, children)]
        return np.where(leaves[:, None], alone, nodes)

    def boxes(self, ranges: Ranges) -> Reals:
        """The box of each region (k, 6), metres."""
        rows = self._boxes()
        rows = np.concatenate((rows, rows[-1:]))  # the last range may end with the table
        ends = ranges.astype(np.int64).ravel()
        low = np.minimum.reduceat(rows[:, :3], ends)[::2]
        return np.concatenate((low, np.maximum.reduceat(rows[:, 3:], ends)[::2]), axis=1)


class Triangles(Regions):
    """Of a mesh: the table is that of its triangles, none of which is divided."""

    def __init__(self, hierarchy: Hierarchy) -> None:
        super().__init__(hierarchy)
        self.elements, self.rectangles = hierarchy.numbers, None

    def own(self, numbers: NDArray[np.int32]) -> Ranges:
        """Of one triangle each."""
        return _one(numbers)

    def points(self, ranges: Ranges) -> Reals:
        """The first vertex of the first triangle."""
        return self.hierarchy.tree.triangles[ranges[:, 0], :3]

    def _boxes(self) -> Reals:
        corners = self.hierarchy.tree.triangles.reshape(-1, 3, 3)
        return np.concatenate((corners.min(axis=1), corners.max(axis=1)), axis=1)


class SurfaceParts(Regions):
    """Of a surface: the table is that of its whole pieces, and then of parts of pieces.

    Args:
        hierarchy: of the model.
        cells: (m,) CELL, those that a search made.
    """

    def __init__(self, hierarchy: SurfaceHierarchy, cells: NDArray) -> None:
        super().__init__(hierarchy)
        pieces = hierarchy.tree.pieces
        count = len(pieces)
        curved = (pieces["degree_v"] > 0) & (pieces["edge"] == NONE)
        whole = np.stack((np.ones(count), curved.astype(float)), axis=1)
        elements = np.concatenate((np.arange(count, dtype=np.int32), cells["element"]))
        low = np.concatenate((np.zeros((count, 2)), cells["low"]))
        high = np.concatenate((whole, cells["high"]))
        found = np.empty((len(elements), 4))
        self._points, self._found = np.empty((len(elements), 3)), np.empty((len(elements), 6))
        describe_parts(hierarchy.table, elements, low, high, found, self._points, self._found)
        self.elements = hierarchy.numbers[elements]
        self.rectangles = found.reshape(-1, 2, 2)

    def own(self, numbers: NDArray[np.int32]) -> Ranges:
        """Of one part each."""
        return _one(numbers + np.int32(len(self.hierarchy.numbers)))

    def points(self, ranges: Ranges) -> Reals:
        """The middle of the first part, unless trimming loops may have cut it off."""
        return self._points[ranges[:, 0]]

    def _boxes(self) -> Reals:
        return self._found


def regions_of(hierarchy: Hierarchy, cells: NDArray | None) -> Regions:
    """Those of a model, some of whose elements a search has divided into cells."""
    if isinstance(hierarchy, SurfaceHierarchy) and cells is not None:
        return SurfaceParts(hierarchy, cells)
    return Triangles(hierarchy)


def groups_of(sides: tuple[Regions, Regions], ranges: tuple[Ranges, Ranges]) -> list[NDArray]:
    """The pairs of regions (k,), by their places, in groups that certainly do not touch.

    Two pairs are in one group where boxes around their regions, widened by their own lengths, touch
    on both models: what is left around one nearest pair may have gaps as large as its regions.
    """
    boxes = [_widened(side.boxes(own)) for side, own in zip(sides, ranges, strict=True)]
    spread = np.ptp(boxes[0][:, :3], axis=0)
    axis = int(spread.argmax())
    groups = np.empty(len(boxes[0]), np.int64)
    join_boxes(boxes[0], boxes[1], boxes[0][:, axis].argsort(), axis, groups)
    order = groups.argsort(kind="stable")
    return np.split(order, np.flatnonzero(np.diff(groups[order])) + 1)


def _widened(boxes: Reals) -> Reals:
    """Boxes (k, 6) that reach beyond others by the longest of their sides."""
    length = (boxes[:, 3:] - boxes[:, :3]).max(axis=1, keepdims=True)
    return np.concatenate((boxes[:, :3] - length, boxes[:, 3:] + length), axis=1)


def _one(numbers: NDArray[np.int32]) -> Ranges:
    """Ranges of one row each."""
    return np.stack((numbers, numbers + np.int32(1)), axis=1)
