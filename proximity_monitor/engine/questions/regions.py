"""The regions of either model that take part in a manifold: their boxes, and which may touch."""

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
"""(k, 2) rows of a table of elements and parts of elements: the first, and one after the last."""


class Regions(ABC):
    """One side of a manifold: a table of elements and parts; a region is a range of its rows.

    Args:
        hierarchy: of the model.
    """

    elements: NDArray[np.int32]
    """(n,) the number of each row outside: a triangle's face; a piece's patch or curve."""
    rectangles: Reals | None
    """(n, 2, 2) lowest and highest u and v of each row in its patch; None for a mesh."""

    def __init__(self, hierarchy: Hierarchy) -> None:
        self.hierarchy = hierarchy

    @abstractmethod
    def own(self, numbers: NDArray[np.int32]) -> Ranges:
        """Return the ranges of parts, given their numbers in a search."""

    @abstractmethod
    def points(self, ranges: Ranges) -> Reals:
        """Return a point of each region (k, 3), metres; NaN if none is known."""

    @abstractmethod
    def _boxes(self) -> Reals:
        """Return the box of each row of the table (n, 6), metres: least x, y, z and largest."""

    def under(self, lanes: NDArray[np.int32]) -> Ranges:
        """Return the ranges of the elements under volumes."""
        children = self.hierarchy.tree.children[lanes]
        leaves = children < 0
        alone = np.stack((first_of.py_func(children), last_of.py_func(children) + 1), axis=1)
        nodes = self.hierarchy.ranges()[np.where(leaves, 0, children)]
        return np.where(leaves[:, None], alone, nodes)

    def boxes(self, ranges: Ranges) -> Reals:
        """Return the box of each region (k, 6), metres."""
        rows = self._boxes()
        rows = np.concatenate((rows, rows[-1:]))  # the last range may end with the table
        ends = ranges.astype(np.int64).ravel()
        low = np.minimum.reduceat(rows[:, :3], ends)[::2]
        return np.concatenate((low, np.maximum.reduceat(rows[:, 3:], ends)[::2]), axis=1)


class Triangles(Regions):
    """The regions of a mesh. The table holds its triangles, none of which is divided."""

    def __init__(self, hierarchy: Hierarchy) -> None:
        super().__init__(hierarchy)
        self.elements, self.rectangles = hierarchy.numbers, None

    def own(self, numbers: NDArray[np.int32]) -> Ranges:
        """Return ranges of one triangle each."""
        return _one(numbers)

    def points(self, ranges: Ranges) -> Reals:
        """Return the first vertex of the first triangle."""
        return self.hierarchy.tree.triangles[ranges[:, 0], :3]

    def _boxes(self) -> Reals:
        corners = self.hierarchy.tree.triangles.reshape(-1, 3, 3)
        return np.concatenate((corners.min(axis=1), corners.max(axis=1)), axis=1)


class SurfaceParts(Regions):
    """The regions of a surface. The table holds its whole pieces, and then parts of pieces.

    Args:
        hierarchy: of the model.
        cells: (m,) CELL, the parts that a search made.
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
        """Return ranges of one part each."""
        return _one(numbers + np.int32(len(self.hierarchy.numbers)))

    def points(self, ranges: Ranges) -> Reals:
        """Return the middle of the first part; NaN if trimming loops may have cut it off."""
        return self._points[ranges[:, 0]]

    def _boxes(self) -> Reals:
        return self._found


def regions_of(hierarchy: Hierarchy, cells: NDArray | None) -> Regions:
    """Return the regions of a model; `cells` are those into which a search divided its elements."""
    if isinstance(hierarchy, SurfaceHierarchy) and cells is not None:
        return SurfaceParts(hierarchy, cells)
    return Triangles(hierarchy)


def groups_of(sides: tuple[Regions, Regions], ranges: tuple[Ranges, Ranges]) -> list[NDArray]:
    """Return the positions of the pairs of regions, in groups that certainly do not touch.

    Two pairs are in one group if the boxes around their regions, each widened by its own length,
    touch on both models. The regions left around one nearest pair may have gaps of their own size.
    """
    boxes = [_widened(side.boxes(own)) for side, own in zip(sides, ranges, strict=True)]
    spread = np.ptp(boxes[0][:, :3], axis=0)
    axis = int(spread.argmax())
    groups = np.empty(len(boxes[0]), np.int64)
    join_boxes(boxes[0], boxes[1], boxes[0][:, axis].argsort(), axis, groups)
    order = groups.argsort(kind="stable")
    return np.split(order, np.flatnonzero(np.diff(groups[order])) + 1)


def _widened(boxes: Reals) -> Reals:
    """Return boxes (k, 6), each widened on all sides by the length of its longest side."""
    length = (boxes[:, 3:] - boxes[:, :3]).max(axis=1, keepdims=True)
    return np.concatenate((boxes[:, :3] - length, boxes[:, 3:] + length), axis=1)


def _one(numbers: NDArray[np.int32]) -> Ranges:
    """Return ranges of one row each."""
    return np.stack((numbers, numbers + np.int32(1)), axis=1)
