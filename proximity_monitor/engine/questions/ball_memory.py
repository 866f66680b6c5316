"""The memory of a search for a depth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.inside.ball_state import CELL, PIECE, POINT, SEARCH, Ball, ball_table
from ..models.model import Model
from .memory import Memory
from .search_memory import CellRoom, cells_for

_CELLS = 64
"""The number of cells that there is room for at first."""

_PARTS = 256
"""The number of cells of patches and curves that there is room for at first, besides whole ones."""

_SEEDS = 32
"""The most points that a search may begin with."""

_LEVELS = 8
"""The stack has room for a multiple of so many levels: that serves models of most sizes."""


class BallKind(NamedTuple):
    """All that the sizes of the arrays depend on."""

    levels: int
    """Of the deeper model."""
    deepest: bool
    """Whether the deepest point of a surface is searched for, instead of the largest ball."""
    cells: CellRoom | None
    """For the cells of that surface."""

    @classmethod
    def of(cls, a: Model, b: Model, surface: Model | None) -> BallKind:
        """The kind of a search over two models, one of which may be a surface."""
        levels = -(-max(a._hierarchy.depth, b._hierarchy.depth) // _LEVELS) * _LEVELS
        if surface is None:
            return cls(levels, False, None)
        return cls(levels, True, CellRoom.of((surface._hierarchy,), _PARTS))


class BallMemory(Memory):
    """The arrays of a search, with the table by which kernels find them.

    A search that needs more cells takes others of its own.
    """

    __slots__ = ("ball", "more", "table")

    ball: Ball
    more: tuple[NDArray, ...]
    """Cells of the surface."""
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
        self.more = cells_for(kind.cells)
        self.table = ball_table(self.ball, self.more)
        self._keep((*self.ball, *self.more), self.ball.at, points)
