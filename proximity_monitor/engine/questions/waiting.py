"""The memory for what waits in a search: pairs of leaves, and the cells of divided elements."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.state import CELL, CELL_PAIR, Dividing, SurfaceTree, Waiting
from ..kernels.search.descent import WAITING_ROOM
from ..models.model import Model

_PAIRS, _CELLS, _FEWEST, _BYTES = 1 << 15, 1 << 12, 1 << 8, 1 << 25
"""Pairs of cells that there is room for; cells of a model, at most and at least, and bytes of their
control points between these. Of all that the system provides only the part that is used."""

_ROWS, _RATIONAL_ROWS = 3, 7
"""Rows of a cell's control points: x, y and z; of a rational one, homogeneous ones as well."""


def waiting_for(first: Iterable[Model], second: Iterable[Model]) -> Waiting | Dividing:
    """Memory for searches over any of the first models and any of the second."""
    lanes, bounds = np.empty((WAITING_ROOM, 2), np.int32), np.empty(WAITING_ROOM)
    sides = [_pieces(models) for models in (first, second)]
    if not any(sides):
        return Waiting(lanes, bounds)
    return Dividing(
        lanes, bounds, np.empty(_PAIRS, CELL_PAIR), *_cells(sides[0]), *_cells(sides[1])
    )


def cells_for(surface: Model, parts: int) -> tuple[NDArray, ...]:
    """Room for so many cells of a surface; none if its elements are not divided."""
    return _cells(_pieces([surface]), parts)


def _pieces(models: Iterable[Model]) -> list[NDArray]:
    """The pieces of those models that have any."""
    trees = {id(each._hierarchy): each._hierarchy.tree for each in models}.values()
    return [tree.pieces for tree in trees if isinstance(tree, SurfaceTree)]


def _cells(
    pieces: list[NDArray], parts: int = _CELLS
) -> tuple[NDArray, NDArray[np.float64], NDArray[np.int32]]:
    """So many cells at most besides whole ones, their control points, and these whole ones."""
    if not pieces:
        return np.empty(0, CELL), np.empty(0), np.empty(0, np.int32)
    numbers = max(
        int((np.where(each["rational"] != 0, _RATIONAL_ROWS, _ROWS) * each["room"]).max())
        for each in pieces
    )
    most = max(map(len, pieces))
    # All whole elements must find room besides the parts of some.
    count = min(parts, max(_BYTES // (8 * numbers), _FEWEST)) + most
    return np.empty(count, CELL), np.empty(count * numbers), np.empty(most, np.int32)
