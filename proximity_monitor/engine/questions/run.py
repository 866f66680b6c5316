"""Running the search kernel from Python: its memory, its slices, the clock."""

from __future__ import annotations

import math
from collections.abc import Iterable
from threading import Event
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index
from ..kernels.base.state import KEPT
from ..kernels.base.tables import table
from ..kernels.search import search as kernel
from ..kernels.search.queue import QUEUE
from ..models.model import Model
from ..models.tree import BOXES
from ..poses import check_pose
from .slices import Slices

Order = Literal["depth_first", "priority", "breadth_first"]
"""In which order a search visits pairs of volumes; the answer is the same."""

_ORDERS = {
    "depth_first": index.DEPTH_FIRST,
    "priority": index.PRIORITY,
    "breadth_first": index.BREADTH_FIRST,
}

_LIST = 1 << 20
"""Pairs that a search level by level has room for, a power of two: 16 MB, of which the system gives
only what is used."""

_COHERENT = 1024
"""Pairs of volumes that are remembered as too far, a power of two: 16 kB."""

_BLOCK = 4096
"""Rows of a block of collected pairs. A full block is set aside and never copied again, so that no
slice takes the longer the more was collected before."""


def code_for(models: Iterable[Model], order: Order = "depth_first") -> int | None:
    """Which code a search between some models needs: `unusual` of `kernels.descent.advance`."""
    usual = order == "depth_first" and not any(model._hierarchy.volume in BOXES for model in models)
    return None if usual else 1


def check_model(model: Model, name: str) -> Model:
    """The model, if it is one.

    Raises:
        TypeError: it is something else.
    """
    if not isinstance(model, Model):
        raise TypeError(
            f"{name}: expected a model (TriangleMesh, or what load, points or polyline return), "
            f"got {'None' if model is None else type(model).__name__}"
        )
    return model


def check_models(models: Iterable[Model]) -> tuple[Model, ...]:
    """The models, if all of them are.

    Raises:
        TypeError: one is something else.
    """
    return tuple(check_model(model, f"models[{i}]") for i, model in enumerate(models))


def least(rows: NDArray[np.float64], slack: float) -> NDArray[np.float64]:
    """Lower bounds (k,) of the distances of cores, metres, of rows (k, 3) of `State.collected`."""
    return rows[:, 2] - np.where(rows[:, 0] >= 0.0, slack, 0.0)


class Search:
    """The memory of a search over two models, and its last answers.

    Kernels find that memory by its addresses. So a copy, and what pickle makes of it, is another
    search of the models, which begins with the nearest triangles of this one.

    Args:
        a: first model.
        b: second model.
        order: in which order pairs of volumes are visited.
        coherent: whether successive poses are near each other, of these two models alone: what is
            known from the last serves the next.
        nearest: the triangles, in tree order, to begin with.

    Raises:
        TypeError: a model that is none.
        ValueError: there is no such order.
    """

    __slots__ = (
        "_blocks", "_unusual", "answers", "counts", "kinds", "memory", "models", "order", "reals",
        "state",
    )  # fmt: skip

    def __init__(
        self,
        a: Model,
        b: Model,
        order: Order = "depth_first",
        coherent: bool = True,
        nearest: tuple[int, int] = (0, 0),
    ) -> None:
        if order not in _ORDERS:
            raise ValueError(f"order = {order!r}: known are {', '.join(map(repr, _ORDERS))}")
        self.models = check_model(a, "a"), check_model(b, "b")
        self.kinds = type(a), type(b)
        self.order = order
        self._unusual = code_for((a, b), order)
        # Opening a volume replaces one pair by at most sixteen, once for each level of either
        # model; a priority queue that is full besides leaves all its pairs below. A list of levels
        # is full while there is still room for a search depth first (see levels.py).
        levels = a._hierarchy.depth + b._hierarchy.depth
        capacity = 1 + levels * (15 if order == "depth_first" else 15 + QUEUE)
        if order == "breadth_first":
            capacity = _LIST
        self.reals = np.zeros(index.REALS)
        self.counts = np.zeros(index.COUNTS, np.int64)
        self.counts[index.ORDER] = _ORDERS[order]
        self.counts[index.TRIANGLE_A : index.TRIANGLE_B + 1] = nearest
        self.counts[index.FULL] = capacity - 15 * levels - 16
        no_corners = np.empty((0, KEPT), np.int32)
        self._keep(
            index.State(
                np.zeros((2, 12)),
                self.reals,
                self.counts,
                np.empty((capacity, 2), np.int32),
                np.empty(capacity),
                np.zeros(levels + 1, np.int64),
                np.empty((0, 3)),
                no_corners,
                no_corners,
                np.full(_COHERENT if coherent else 0, -1),
                np.zeros(_COHERENT if coherent else 0),
            )
        )
        self.answers = np.empty(0)
        self._blocks: list[NDArray[np.float64]] = []

    @property
    def coherent(self) -> bool:
        """Whether it remembers volumes."""
        return len(self.state.keys) > 0

    @property
    def nearest(self) -> tuple[int, int]:
        """The nearest triangles of the last answer, in tree order."""
        a, b = self.counts[index.TRIANGLE_A : index.TRIANGLE_B + 1].tolist()
        return a, b

    def __reduce__(self) -> tuple[type[Search], tuple[Any, ...]]:
        """Of what another is made."""
        return Search, (*self.models, self.order, self.coherent, self.nearest)

    def _keep(self, state: index.State) -> None:
        """Take the arrays of a search, and make the table by which kernels find them."""
        # The new table is there before the old arrays are gone: Ctrl-C may come at any moment.
        memory = table(state)
        self.state, self.memory = state, memory

    def run(
        self,
        poses_a: NDArray[np.float64],
        poses_b: NDArray[np.float64],
        *,
        rel_err: float = 0.0,
        abs_err: float = 0.0,
        stop: float = 0.0,
        limit: float = math.inf,
        deadline: float | None = None,
        fresh: bool = True,
        collect: bool = False,
        first: int | None = None,
        stopped: Event | None = None,
        answers: NDArray[np.float64] | None = None,
    ) -> int:
        """Answer at k poses, one below the other (4 k, 4), into `answers` (k ANSWER,), or new ones.

        Goes on with the search of the last run where not `fresh`. With `collect`, for one pose
        alone, it collects every pair that may be as near as the upper bound, and ends only when it
        has them all. `first` is the number of the first pose among many, for messages about one of
        them. Returns ENDED, or CUT where the deadline (of perf_counter) came first, though after
        one slice at least; or another code where `stopped` was set meanwhile.

        Raises:
            ValueError: a pose that is no rigid motion.
        """
        a, b = self.models
        a, b = a._hierarchy, b._hierarchy
        if collect:
            stop = -math.inf
        tables = a.table, b.table
        if collect:
            tables = a.table_of_all, b.table_of_all
        collected = bool(len(self.state.collected))
        if collect != collected and not (a.distinct is a.tree and b.distinct is b.tree):
            self.state.keys.fill(-1)  # too far were those pairs that it looked at
        if collect != collected or (collect and fresh):
            # An answer may still hold the rows of the last search.
            self._blocks = []
            self._keep(self.state._replace(collected=np.empty((_BLOCK if collect else 0, 3))))
        if fresh and self.order == "breadth_first":
            corners = a.spread_corners(), b.spread_corners()
            self._keep(self.state._replace(spread_a=corners[0], spread_b=corners[1]))
        count = len(poses_a) // 4
        if answers is None:
            answers = np.empty(count * index.ANSWER)
        self.answers = answers
        row = 0
        # At least one slice: whoever asks again and again comes to an end.
        slices = Slices(deadline)
        while True:
            code, row = kernel.search(
                *tables, self.memory, poses_a, poses_b, row, count,
                rel_err, abs_err, stop, limit, slices.steps, fresh, answers, self._unusual,
            )  # fmt: skip
            if code == index.COLLECTED_FULL:
                self._make_room()
                code = index.CUT
            if code not in (index.CUT, index.CUT_BETWEEN):
                break
            if slices.over():
                break
            if stopped is not None and stopped.is_set():
                break
            fresh = code == index.CUT_BETWEEN
        if code in (index.BAD_POSE_A, index.BAD_POSE_B):
            letter, poses = ("a", poses_a) if code == index.BAD_POSE_A else ("b", poses_b)
            name = f"pose_{letter}" if first is None else f"poses_{letter}[{first + row}]"
            check_pose(poses[4 * row : 4 * row + 4], name)
        return code

    def _make_room(self) -> None:
        """Set the full block aside, less what matters no longer, and begin another."""
        rows = self.state.collected[: self.counts[index.COLLECTED]]
        rows = rows[least(rows, self.reals[index.SLACK]) <= self.reals[index.LIMIT]]
        room = np.empty((_BLOCK, 3))
        # The number last: Ctrl-C may come at any moment, and no row may be missing.
        self._blocks.append(rows)
        self._keep(self.state._replace(collected=room))
        self.counts[index.COLLECTED] = 0

    def collected(self) -> tuple[NDArray[np.float64], ...]:
        """The rows of `State.collected` so far, in blocks that no search writes to any more."""
        return *self._blocks, self.state.collected[: self.counts[index.COLLECTED]]

    def pending(self) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
        """The pairs of volumes not yet looked into: their lanes (k, 2) and lower bounds (k,)."""
        ring = self.order == "breadth_first"
        first = self.counts[index.BASE] if ring else 0
        where = np.arange(first, self.counts[index.DEPTH]) % len(self.state.bounds)
        return self.state.stack[where], self.state.bounds[where]
