"""The memory for what waits in a search: pairs of leaves, and the cells of divided elements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.state import CELL, CELL_PAIR, Dividing, SurfaceTree, Waiting
from ..kernels.search.descent import WAITING_ROOM
from ..models.hierarchy import Hierarchy

_PAIRS, _CELLS, _FEWEST, _BYTES = 1 << 15, 1 << 12, 1 << 8, 1 << 25
"""Pairs of cells that there is room for; cells of a model, at most and at least, and bytes of their
control points between these. Of all that the system provides only the part that is used."""

_ROWS, _RATIONAL_ROWS = 3, 7
"""Rows of a cell's control points: x, y and z; of a rational one, homogeneous ones as well."""


def waiting_for(a: Hierarchy, b: Hierarchy) -> Waiting | Dividing:
    """Memory for a search over two hierarchies, or any that need no more."""
    lanes, bounds = np.empty((WAITING_ROOM, 2), np.int32), np.empty(WAITING_ROOM)
    if not any(isinstance(each.tree, SurfaceTree) for each in (a, b)):
        return Waiting(lanes, bounds)
    return Dividing(lanes, bounds, np.empty(_PAIRS, CELL_PAIR), *cells_of(a), *cells_of(b))


def cells_of(
    hierarchy: Hierarchy, most: int = _CELLS
) -> tuple[NDArray, NDArray[np.float64], NDArray[np.int32]]:
    """Room for so many cells at most, their control points, and the cells of whole elements.

    Of elements that are not divided there is none.
    """
    tree = hierarchy.tree
    if not isinstance(tree, SurfaceTree):
        return np.empty(0, CELL), np.empty(0), np.empty(0, np.int32)
    rows = np.where(tree.pieces["rational"] != 0, _RATIONAL_ROWS, _ROWS)
    numbers = int((rows * tree.pieces["room"]).max())
    # All whole elements must find room besides the parts of some.
    count = min(most, max(_BYTES // (8 * numbers), _FEWEST)) + len(tree.pieces)
    return np.empty(count, CELL), np.empty(count * numbers), np.empty(len(tree.pieces), np.int32)
