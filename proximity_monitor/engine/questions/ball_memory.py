"""The memory of a search for a depth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.inside.ball_state import CELL, PIECE, POINT, SEARCH, Ball, ball_table
from ..kernels.inside.solid_table import SOLID_ROWS
from ..models.model import Model
from .memory import Memory
from .search_memory import CellRoom, cells_for

_CELLS = 64
"""Cells that there is room for at first."""

_PARTS = 256
"""Parts of patches and curves that there is room for at first, besides all whole elements."""

_SEEDS = 32
"""The most points that a search may begin with."""

_LEVELS = 8
"""The room of the stack is rounded up to a multiple of so many levels, so that models of most sizes
share one kind of memory."""


def _place(name: str) -> int:
    """Return the place of a field of SEARCH, counted in numbers of eight bytes."""
    return SEARCH.fields[name][1] // 8


SIZE, POINTS = _place("size"), _place("points")
"""Places of the number of cells in the heap, and of the number of points tested."""


class BallKind(NamedTuple):
    """All that the array sizes of a memory depend on."""

    levels: int
    """Levels of the deeper of both hierarchies, rounded up."""
    deepest: bool
    """Whether the search is for the deepest point of a surface, instead of the largest ball."""
    cells: CellRoom | None
    """Room for the cells of that surface; None if its elements are not divided."""

    @classmethod
    def of(cls, a: Model, b: Model, surface: Model | None) -> BallKind:
        """Return the kind of a search over two models; `surface` is the one that is no solid."""
        levels = -(-max(a._hierarchy.depth, b._hierarchy.depth) // _LEVELS) * _LEVELS
        if surface is None:
            return cls(levels, False, None)
        return cls(levels, True, CellRoom.of((surface._hierarchy,), _PARTS))


class BallMemory(Memory):
    """The arrays of a search, with the table by which kernels find them.

    A search that needs room for more cells makes larger arrays of its own.
    """

    __slots__ = ("ball", "counts", "more", "numbers", "solids", "table")

    ball: Ball
    numbers: NDArray[np.float64]
    """(7,) the first fields of `ball.at`, from the radius to what was dropped."""
    counts: NDArray[np.int64]
    """`ball.at` as integers; SIZE and POINTS are places in it. Python takes four times as long to
    read a field of a record."""
    solids: NDArray[np.int64]
    """(2, SOLID_ROWS, 2) room for the tables of two solids."""
    more: tuple[NDArray, ...]
    """The surface's cells, their control points, and the cells of whole elements."""
    table: NDArray[np.int64]

    def __init__(self, kind: BallKind) -> None:
        super().__init__(kind)
        descent = 1 + kind.levels * 15
        points = np.zeros(3, POINT)
        self.ball = Ball(
            np.zeros(1, SEARCH),
            np.zeros((2, 12)),
            np.zeros((_SEEDS, 3)),
            points[:1],
            points[1:2],
            points[2:],
            np.empty(_CELLS),
            np.arange(_CELLS, dtype=np.int32),
            np.empty(_CELLS, PIECE if kind.deepest else CELL),
            np.empty(descent, np.int32),
            np.empty(descent),
        )
        self.numbers = self.ball.at.view(np.float64)[: _place("dropped") + 1]
        self.counts = self.ball.at.view(np.int64)
        self.solids = np.empty((2, SOLID_ROWS, 2), np.int64)
        self.more = cells_for(kind.cells)
        self.table = ball_table(self.ball, self.more)
        self._keep((*self.ball, *self.more), self.ball.at, points)
