"""All contacts of two models of which at least one is a parametric surface.

If models touch, the search for all pairs that may be nearest ends with pairs of pieces that their
control points do not separate. The same search then answers a query about each such pair alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index
from ..kernels.base.tables import table
from ..kernels.base.trees import NONE, SurfaceTree
from ..kernels.tree.layout import first_of, last_of
from ..models.hierarchy import Hierarchy
from .contact_surface import contacts_of
from .contacts import Met, Touching, no_contacts
from .run import Cells, Search

Reals = NDArray[np.float64]
Pairs = NDArray[np.int64]


_PART_S = 5e-5
"""Seconds that one part of the preparations may take."""

_HALF = 32
"""Bits for the number of an element in a key."""


class Prepared(NamedTuple):
    """Queries about pairs of elements, and the search that answers them."""

    queries: NDArray
    """(k,) QUERY."""
    table: NDArray[np.int64]
    """Their table."""
    search: Search


class PieceSearch:
    """Decides which pairs of elements touch, in slices.

    Args:
        search: one that has collected all pairs that may touch, and has ended.
        poses: of both models, (4, 4), model to world.
    """

    __slots__ = ("_fresh", "_parts", "_poses", "_prepared", "_row", "answers")

    answers: Reals
    """(k, ANSWER), one about each pair; empty before the preparations are done."""

    def __init__(self, search: Search, poses: tuple[Reals, Reals]) -> None:
        self._poses = poses[0].copy(), poses[1].copy()
        self.answers, self._row, self._fresh = np.empty((0, index.ANSWER)), 0, True
        self._parts = _prepare(search)
        self._prepared: Prepared | None = None

    def run(self, deadline: float | None) -> bool:
        """Go on until a deadline, of perf_counter; return whether all pairs are answered.

        At least one part of the preparations is done in each call, but none in the first one if the
        search for the pairs has used up the time.
        """
        for part in self._parts:
            if part is not None:
                self._prepared = part
                self.answers = np.empty((len(part.queries), index.ANSWER))
            if deadline is not None and perf_counter() + _PART_S >= deadline:
                return False
        prepared, count = self._prepared, len(self.answers)
        if self._row < count:
            code, self._row = prepared.search.run_queries(
                prepared.table, count, self._row, *self._poses, deadline, self._fresh, self.answers
            )
            self._fresh = code == index.CUT_BETWEEN
        return self._row == count

    def met(self, first: Met) -> MetPieces:
        """Return the contacts so far; `first` is what the search for the pairs knows."""
        return MetPieces(first, self.answers[: self._row].copy())


# This is no method of `PieceSearch`: a search and its generator would refer to each other, and an
# abandoned search would keep its memory until Python collects garbage.
def _prepare(search: Search) -> Iterator[Prepared | None]:
    """Prepare the queries in parts; yield before each, as it may take longer than a budget.

    The last that it yields is what it has prepared.
    """
    yield None
    divided = search.divided()
    yield None
    keys = _keys(*_of_leaves(search))
    if divided is not None:
        cells = divided.cells()
        yield None
        near = cells.pairs[cells.bounds <= search.progress["limit"]]
        yield None
        keys = np.concatenate((keys, _keys(*_elements_of(near, cells, search))))
    yield None
    keys = np.unique(keys)
    yield None
    queries = np.zeros(len(keys), index.QUERY)
    queries["bodies"], queries["alone"] = (0, 1), 1
    queries["nearest"][:, 0], queries["nearest"][:, 1] = keys >> _HALF, keys % (1 << _HALF)
    queries["limit"], queries["param_err"] = math.ulp(0.0), math.inf
    yield None
    asked = table((queries,))
    yield None
    yield Prepared(queries, asked, Search(*search.models, coherent=False))


@dataclass(frozen=True, slots=True)
class MetPieces:
    """The pieces that touch or cross, from the answers about each pair of them.

    As for triangles (`Met`), points and normals are made when they are read.
    """

    first: Met
    """What the search for all pairs knows."""
    answers: Reals
    """(k, ANSWER), one about each pair of elements."""

    @property
    def touching(self) -> bool:
        """Whether the nearest elements found touch or cross, or rounding hides whether they do."""
        return self.first.touching

    @property
    def decided(self) -> bool:
        """Whether it is known for every pair whether it touches."""
        return bool(self._are_decided(self._touching()).all())

    def contacts(self) -> Touching:
        """Return one contact for each two pieces that touch, or for which this is not decided."""
        rows = self._touching()
        rows = rows[(~self._are_decided(rows)).argsort(kind="stable")]
        if self.touching:  # these are known before their pair is answered
            rows = np.concatenate((rows, self.first.row[None]))
        keys = np.stack([self._pieces(rows, side) for side in range(2)], axis=1)
        _, kept = np.unique(keys, axis=0, return_index=True)
        slack = float(self.first.progress["slack"])
        if not len(kept):
            return no_contacts()
        return contacts_of(rows[kept], self.first.hierarchies, self.first.poses, slack)

    def _touching(self) -> Reals:
        return self.answers[self.answers[:, index.LOWER] == 0.0]

    @staticmethod
    def _are_decided(rows: Reals) -> NDArray[np.bool_]:
        return rows[:, index.STATUS] != index.OUT_OF_TIME

    def _pieces(self, rows: Reals, side: int) -> Pairs:
        """Return the pieces or triangles of the nearest points; for an edge, the piece it is on."""
        elements = rows[:, (index.TREE_A, index.TREE_B)[side]].astype(np.int64)
        tree = self.first.hierarchies[side].tree
        if not isinstance(tree, SurfaceTree):
            return elements
        pieces = tree.pieces[elements]
        return np.where(pieces["edge"] == NONE, elements, pieces["face"])


def _keys(one: Pairs, other: Pairs) -> Pairs:
    """Return a number for each pair of elements; numpy sorts these far faster than rows."""
    return (one << _HALF) + other


def _elements_of(near: NDArray[np.int32], cells: Cells, search: Search) -> Iterator[Pairs]:
    """Yield the elements of a, then those of b, in tree order, of the near pairs of cells."""
    for parts, own, model in zip(near.T, cells.sides, search.models, strict=True):
        divided = isinstance(model._hierarchy.tree, SurfaceTree)
        yield (own["element"][parts] if divided else parts).astype(np.int64)


def _of_leaves(search: Search) -> Pairs:
    """Return the elements of a and b in the pairs of leaves for whose cells there was no room."""
    a, b = (model._hierarchy for model in search.models)
    found = [
        (i, j)
        for block in search.collected()
        for one, other in ~block[:, :2].astype(np.int64)
        for i in _under(a, one)
        for j in _under(b, other)
    ]
    return np.array(found, np.int64).reshape(-1, 2).T


def _under(hierarchy: Hierarchy, lane: int) -> Iterator[int]:
    """Return the elements of a leaf."""
    child = int(hierarchy.tree.children[lane])
    return iter(range(first_of.py_func(child), last_of.py_func(child) + 1))
