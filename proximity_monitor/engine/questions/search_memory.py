"""The memory of a search for a distance: open pairs, waiting pairs, and what it remembers."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index
from ..kernels.base.state import (
    CELL,
    CELL_PAIR,
    FAR,
    KEPT,
    MINIMUM,
    NO_KEY,
    RING,
    Dividing,
    Turning,
    Waiting,
)
from ..kernels.base.tables import MODEL_ROWS, state_table, table
from ..kernels.base.trees import ARC, RevolutionTree
from ..kernels.revolution.front import FRONT
from ..kernels.revolution.minima import MINIMA
from ..kernels.search.descent import WAITING_ROOM
from ..kernels.search.queue import QUEUE
from ..kernels.search.stack import PUT_OFF
from ..models.hierarchy import Hierarchy
from ..models.model import Model
from .memory import Memory, room

Order = Literal["depth_first", "priority", "breadth_first"]
"""The order in which a search visits pairs of volumes; the answer is the same."""

_LIST = 1 << 20
"""Pairs that a search level by level has room for, a power of two: 16 MB, of which the system
provides only the pages that are used."""

_FAR, _MOST_FAR, _LARGE = 1 << 10, 1 << 13, 1 << 12
"""Slots for pairs of volumes that are remembered as too far, powers of two: those in use at first,
32 kB, and those that there is room for if a model has _LARGE elements or more, 256 kB. Searches
of smaller models are short, and there may be many of them."""

_LEVELS = 16
"""The room of the stack is rounded up to a multiple of so many levels, so that models of most sizes
share one kind of memory."""

_PAIRS, _CELLS, _FEWEST, _BYTES = 1 << 15, 1 << 12, 1 << 8, 1 << 25
"""Room for pairs of cells; room for parts of a model's elements, at most and at least; and bytes of
their control points, which decide between the two. The system provides only the pages in use."""


_RINGS, _ARCS = 1 << 15, 1 << 12
"""Room for pairs of rings, and for arcs of either model besides those of its tree."""


class CellRoom(NamedTuple):
    """How much memory the cells of a model take, if its elements are divided."""

    cells: int
    width: int
    """Numbers that the control points of a cell take."""
    whole: int
    """How many of the cells may be whole elements."""

    @classmethod
    def of(cls, hierarchies: Iterable[Hierarchy], parts: int = _CELLS) -> CellRoom | None:
        """Return room for the cells of any one model: all whole elements, and up to `parts` parts.

        Returns None if no elements are divided.
        """
        divided = [each for each in hierarchies if each.cell_width]
        if not divided:
            return None
        width = max([each.cell_width for each in divided])
        return _room(width, max([len(each.numbers) for each in divided]), parts)


@lru_cache(maxsize=256)  # equal rooms are then one object, which is compared at once
def _room(width: int, whole: int, parts: int) -> CellRoom:
    # All whole elements must find room besides the parts.
    return CellRoom(min(parts, max(_BYTES // (8 * width), _FEWEST)) + whole, width, whole)


def cells_for(wanted: CellRoom | None) -> tuple[NDArray, NDArray[np.float64], NDArray[np.int32]]:
    """Make room for cells, for their control points, and for the cell of each whole element."""
    if wanted is None:
        return np.empty(0, CELL), np.empty(0), np.empty(0, np.int32)
    cells, width, whole = wanted
    return room(cells, CELL), room(cells * width), room(whole, np.int32)


Traits = tuple[type, type, int, int, int]
"""See `Hierarchy.traits`."""


class SearchKind(NamedTuple):
    """All that the array sizes of a search depend on."""

    order: Order
    far: int
    """Slots for pairs that are remembered as too far, 0 if none is."""
    levels: int
    """Levels of both models together, rounded up."""
    pairs: int
    """Pairs of volumes that may be open."""
    cells_a: CellRoom | None
    cells_b: CellRoom | None
    rings: bool
    """Whether there is room for the rings of solids of revolution."""

    @classmethod
    def of(
        cls, first: Traits, second: Traits, order: Order, coherent: bool, among: Iterable[Model]
    ) -> SearchKind:
        """Return the kind of a search over two models by traits, or over any two of `among`."""
        kind_a, _, depth_a, width_a, count_a = first
        kind_b, _, depth_b, width_b, count_b = second
        levels = -(-(depth_a + depth_b) // _LEVELS) * _LEVELS
        # Opening a volume replaces one pair by at most sixteen, once for each level of either
        # model. A priority queue that is full leaves all its pairs below, too.
        pairs = 1 + levels * 15 + PUT_OFF if order == "depth_first" else 1 + levels * (15 + QUEUE)
        if order == "breadth_first":
            pairs = _LIST
        far = _MOST_FAR if max(count_a, count_b) >= _LARGE else _FAR
        far = far if coherent else 0
        if among:
            either = CellRoom.of([model._hierarchy for model in among])
            rings = any(model._hierarchy.tree_kind is RevolutionTree for model in among)
            return cls(order, far, levels, pairs, either, either, rings)
        cells_a = _room(width_a, count_a, _CELLS) if width_a else None
        cells_b = _room(width_b, count_b, _CELLS) if width_b else None
        rings = kind_a is RevolutionTree and kind_b is RevolutionTree
        return cls(order, far, levels, pairs, cells_a, cells_b, rings)


class SearchMemory(Memory):
    """The arrays of a search, with the tables by which kernels find them."""

    __slots__ = ("models", "numbers", "progress", "queries", "query", "state", "table")

    kind: SearchKind
    models: NDArray[np.int64]
    """(2, MODEL_ROWS, 2) room for the tables of two models."""
    numbers: memoryview
    """The five real numbers of the single query, which is about bodies 0 and 1."""
    queries: NDArray[np.int64]
    """The table of that query."""
    progress: np.void
    """`State.progress`."""
    state: index.State
    table: NDArray[np.int64]
    """The table of the state."""

    def __init__(self, kind: SearchKind) -> None:
        super().__init__(kind)
        self.query = np.zeros(1, index.QUERY)
        self.query["bodies"], self.query["nearest"] = (0, 1), index.KEEP
        self.queries = table((self.query,))
        self.numbers = memoryview(self.query.view(np.float64))[-5:]
        self.models = np.empty((2, MODEL_ROWS, 2), np.int64)
        order, far_slots, levels, capacity, *cells, rings = kind
        # All that is not blank after a search, in one piece, which is cleared in one go.
        used = np.zeros(index.PROGRESS.itemsize + 2 * 12 * 8, np.uint8)
        record = used[: index.PROGRESS.itemsize].view(index.PROGRESS)
        motions = used[index.PROGRESS.itemsize :].view(np.float64).reshape(2, 12)
        # A list of levels counts as full while a search depth first still fits (search/levels.py).
        record["full"] = capacity - 15 * levels - 16
        self.progress = record[0]
        pairs, bounds = room(2 * capacity, np.int32).reshape(-1, 2), room(capacity)
        no_corners = np.empty((0, KEPT), np.int32)
        open_pairs: tuple[NDArray, ...] = index.DepthFirst(pairs, bounds)
        if order == "priority":
            open_pairs = index.Priority(pairs, bounds, np.empty(levels + 1, np.int64))
        elif order == "breadth_first":
            open_pairs = index.BreadthFirst(pairs, bounds, no_corners, no_corners)
        waiting: tuple[NDArray, ...] = Waiting(
            np.empty((WAITING_ROOM, 2), np.int32), np.empty(WAITING_ROOM)
        )
        if cells != [None, None]:
            waiting = Dividing(
                *waiting, room(_PAIRS, CELL_PAIR), *cells_for(cells[0]), *cells_for(cells[1])
            )
        if rings:
            waiting = Turning(
                *waiting, room(_RINGS, RING), room(_RINGS, np.int32), room(_ARCS, ARC),
                room(_ARCS, ARC), room(MINIMA, MINIMUM), room(2 * FRONT, RING),
            )  # fmt: skip
        far = room(far_slots, FAR)
        far["key"][:_FAR] = NO_KEY
        record["far_slots"] = _FAR
        self.state = index.State(motions, record, open_pairs, waiting, np.empty((0, 3)), far)
        self.table = state_table(self.state)
        self._keep((*open_pairs, *waiting, far), used)

    def clear(self) -> None:
        """Restore the first state, as `Memory.clear` does, and forget what was too far."""
        super().clear()
        if self.kind.far:
            self.state.far["key"][:_FAR] = NO_KEY

    def begin_at(self, nearest: tuple[int, int]) -> None:
        """Let the first search begin at two elements, in tree order."""
        if nearest != (0, 0):
            self.progress["element_a"], self.progress["element_b"] = nearest
            self.progress["distance"] = math.inf  # their last distance is not known
