"""Runs the search kernel from Python: its memory, its slices, the clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from threading import Event
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index
from ..kernels.base.lazy import failed, raise_failed
from ..kernels.base.state import ANSWER, COLLECTED_FULL, CUT, CUT_BETWEEN, ENDED
from ..kernels.base.tables import state_table
from ..models.model import Model
from ..poses import check_pose
from .memory import give_back, take
from .search_memory import Order, SearchMemory
from .setup import ORDERS, code_of, setup_of
from .slices import slices_until

_BLOCK = 4096
"""Rows of a block of collected pairs. A full block is set aside and never copied again, so a slice
does not take longer when many pairs have been collected."""

_NO_ANSWER = np.empty(0)
_empty = np.empty


def check_model(model: Model, name: str) -> Model:
    """Return the model, if it is one.

    Raises:
        TypeError: it is something else.
    """
    # Asking an abstract class takes as long as a question to two boxes; mostly it is not needed.
    if Model not in type(model).__mro__ and not isinstance(model, Model):
        raise TypeError(
            f"{name}: expected a model (TriangleMesh, or what load, points or polyline return), "
            f"got {'None' if model is None else type(model).__name__}"
        )
    return model


def check_models(models: Iterable[Model]) -> tuple[Model, ...]:
    """Return the models, if all of them are models.

    Raises:
        TypeError: one is something else.
    """
    return tuple(check_model(model, f"models[{i}]") for i, model in enumerate(models))


def least(rows: NDArray[np.float64], slack: float) -> NDArray[np.float64]:
    """Return lower bounds (k,) of cores' distances, metres, of rows (k, 3) of `State.collected`."""
    return rows[:, 2] - np.where(rows[:, 0] >= 0.0, slack, 0.0)


class Cells(NamedTuple):
    """Pairs of parts of elements that may hold the minimum, and the parts."""

    bounds: NDArray[np.float64]
    """(k,) metres; a lower bound of each pair's distance."""
    pairs: NDArray[np.int32]
    """(k, 2) a part of either model; an element of a model without parts."""
    sides: tuple[NDArray, NDArray]
    """(m,) CELL of either model; empty if its elements are not divided."""


class Divided(NamedTuple):
    """The data of `Cells` as a search keeps them; `cells` sorts them out when they are read."""

    pairs: NDArray
    """CELL_PAIR of the kernel's first and second model."""
    sides: tuple[NDArray, NDArray]
    """CELL of the kernel's first model and of its second: those that are in the pairs."""
    marks: tuple[NDArray[np.bool_], NDArray[np.bool_]]
    """Which of the search's cells these are."""
    turned: bool
    """Whether the kernel's first model is the second model of the question."""

    def cells(self) -> Cells:
        """Make the `Cells`."""
        numbers = [
            (mark.cumsum(dtype=np.int32) - 1)[self.pairs[name]] if len(mark) else self.pairs[name]
            for name, mark in zip(("a", "b"), self.marks, strict=True)
        ]
        way = slice(None, None, -1 if self.turned else 1)
        return Cells(self.pairs["bound"], np.stack(numbers[way], axis=1), self.sides[way])


class Search:
    """The memory of a search over two models, and its last answer.

    For some kinds of models, a kernel takes the second model as its first (see entries.py). Then
    the memory is about b and a. The methods and the answers are always about a and b.

    Kernels find the memory by its addresses. So a copy, pickled or not, is another search over the
    models; it begins with the nearest triangles of this one.

    Args:
        a: first model.
        b: second model.
        order: the order in which pairs of volumes are visited.
        coherent: whether successive poses of these two models are near each other, so that what
            one search finds out serves the next.
        nearest: the elements, in tree order, to begin with.
        among: other models, no deeper than the two, about which an entry may be called with the
            same memory.

    Raises:
        ValueError: there is no such order.
    """

    __slots__ = (
        "_blocks", "_code", "_collecting", "_elements", "_entry", "_known", "_own", "_turned",
        "_wanted", "answer", "kinds", "memory", "models", "order", "progress", "state",
    )  # fmt: skip

    def __init__(
        self,
        a: Model,
        b: Model,
        order: Order = "depth_first",
        coherent: bool = True,
        nearest: tuple[int, int] = (0, 0),
        among: Sequence[Model] = (),
    ) -> None:
        if order not in ORDERS:
            raise ValueError(f"order = {order!r}: must be one of {', '.join(map(repr, ORDERS))}")
        self.models = a, b
        self.kinds = type(a), type(b)
        self.order = order
        setup = setup_of(a._hierarchy.traits, b._hierarchy.traits, order, coherent, among)
        self._entry, self._elements, self._turned, kind = setup
        self._code: Callable | None = None  # of the entry that the next run calls, if known
        self._own = own = take(SearchMemory, kind)
        self._wanted: tuple[float, ...] = ()  # the numbers of its query
        self._known: tuple[NDArray[np.int64] | None, ...] = (None, None)
        self.progress, self.state, self.memory = own.progress, own.state, own.table
        self.begin_at(nearest)
        self.answer = _NO_ANSWER  # (ANSWER,) the last one about a single pose
        self._blocks: list[NDArray[np.float64]] = []
        self._collecting = False

    def __del__(self, give_back: Callable[[SearchMemory], None] = give_back) -> None:
        """Give the memory back; this may happen in any thread and while the program ends."""
        if hasattr(self, "_own"):  # else __init__ failed
            give_back(self._own)

    @property
    def coherent(self) -> bool:
        """Whether it remembers volumes."""
        return len(self.state.far) > 0

    @property
    def nearest(self) -> tuple[int, int]:
        """The nearest elements of the last answer, in tree order."""
        return self._as_asked(int(self.progress["element_a"]), int(self.progress["element_b"]))

    def begin_at(self, nearest: tuple[int, int]) -> None:
        """Let the next search begin at two elements, in tree order."""
        self._own.begin_at(self._as_asked(*nearest))

    @property
    def motions(self) -> NDArray[np.float64]:
        """(2, 12) the motion from b to a, and the one from a to b; see State."""
        return self.state.motions[:: -1 if self._turned else 1]

    def _as_asked(self, one: Any, other: Any) -> tuple[Any, Any]:
        """Bring two things in the order of the kernel's models into that of a and b, or back."""
        return (other, one) if self._turned else (one, other)

    def __reduce__(self) -> tuple[type[Search], tuple[Any, ...]]:
        """Make another search that begins with the nearest triangles of this one."""
        return Search, (*self.models, self.order, self.coherent, self.nearest)

    def _keep(self, state: index.State) -> None:
        """Take the arrays of a search, and make the table by which kernels find them."""
        # Make the new table before the old arrays are gone: Ctrl-C may come at any moment.
        memory = state_table(state)
        self.state, self.memory = state, memory

    def run(
        self,
        poses_a: NDArray[np.float64],
        poses_b: NDArray[np.float64],
        rel_err: float = 0.0,
        abs_err: float = 0.0,
        stop: float = 0.0,
        limit: float = math.inf,
        deadline: float | None = None,
        fresh: bool = True,
        collect: bool = False,
        param_err: float = math.inf,
        *,
        first: int | None = None,
        stopped: Event | None = None,
        answers: NDArray[np.float64] | None = None,
    ) -> int:
        """Answer at k poses, stacked (4 k, 4), and write into `answers` (k, ANSWER).

        Without `answers`, the answer about a single pose is `self.answer`.

        Unless `fresh`, continue the search of the last run. With `collect`, which takes one pose,
        collect every pair that may be as near as the upper bound, and end only when all are
        collected; divide parts of surfaces until none is longer than `param_err` in u or v. `first`
        is the number of the first pose among many, for error messages. At least one slice is
        searched. Returns ENDED if all are answered. Otherwise the deadline (of perf_counter) came
        first or `stopped` was set; then it returns the code of the last slice, such as CUT.

        Raises:
            ValueError: a pose is no rigid motion.
        """
        a, b = self.models
        a, b = a._hierarchy, b._hierarchy
        if collect:
            stop, table_a, table_b = -math.inf, a.table_of_all, b.table_of_all
        else:
            table_a, table_b = a.table, b.table
        own, (known_a, known_b) = self._own, self._known
        if table_a is not known_a or table_b is not known_b:  # a model was deformed
            models = own.models
            models[0], models[1] = self._known = table_a, table_b
        if collect != self._collecting:
            self._begin_to_collect(collect)
        if fresh:
            self._blocks = []
            if self.order == "breadth_first":
                self._take_corners()
        count = len(poses_a) // 4
        # Make no view of a single row: each view takes a tenth of a microsecond.
        self.answer = flat = _empty(ANSWER) if answers is None else answers.ravel()
        wanted = rel_err, abs_err, stop, limit, param_err
        if wanted != self._wanted:
            numbers = own.numbers
            numbers[0], numbers[1], numbers[2], numbers[3], numbers[4] = wanted
            self._wanted = wanted
        call = self._code
        if call is None:
            call = self._code = code_of(self._elements if collect else self._entry)
        row = 0
        # Search at least one slice, so that repeated calls come to an end.
        slices = slices_until(deadline)
        while True:
            code, row = call(
                own.models, self.memory, poses_a, poses_b, own.queries, row, count, 1, slices.steps,
                fresh, flat,
            )  # fmt: skip
            if failed:
                raise_failed()
            if code == ENDED:
                return code
            if code == COLLECTED_FULL:
                self._make_room()
                code = CUT
            if code not in (CUT, CUT_BETWEEN):
                break
            if slices.over():
                break
            if stopped is not None and stopped.is_set():
                break
            fresh = code == CUT_BETWEEN
        if code in (index.BAD_POSE_A, index.BAD_POSE_B):
            letter, poses = ("a", poses_a) if code == index.BAD_POSE_A else ("b", poses_b)
            name = f"pose_{letter}" if first is None else f"poses_{letter}[{first + row}]"
            check_pose(poses[4 * row : 4 * row + 4], name)
        return code

    def _begin_to_collect(self, collect: bool) -> None:
        """Make room for collected pairs, or none; both kinds of searches may be about other trees.

        Their remembered volumes and their entries differ, too.
        """
        a, b = (model._hierarchy for model in self.models)
        if not (a.distinct is a.tree and b.distinct is b.tree):
            self.state.far["key"] = index.NO_KEY  # the remembered pairs are of the other tree
        self._collecting, self._code = collect, None
        self._keep(self.state._replace(collected=np.empty((_BLOCK if collect else 0, 3))))

    def _take_corners(self) -> None:
        """Give a search level by level the vertices that it keeps of each node."""
        a, b = (model._hierarchy for model in self.models)
        pairs, bounds, *_ = self.state.open
        corners = self._as_asked(a.spread_corners(), b.spread_corners())
        self._keep(self.state._replace(open=index.BreadthFirst(pairs, bounds, *corners)))

    def run_queries(
        self,
        queries: NDArray[np.int64],
        count: int,
        row: int,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        deadline: float | None,
        fresh: bool,
        answers: NDArray[np.float64],
    ) -> tuple[int, int]:
        """Answer the queries from `row` on, of a table of `count`, at one pair of poses, in slices.

        Unless `fresh`, continue the search about the first of them. Returns ENDED and `count`; or
        another code, and the number of the first query that is not answered yet.
        """
        a, b = self.models
        models = self._own.models
        models[0], models[1] = self._known = a._hierarchy.table_of_all, b._hierarchy.table_of_all
        slices = slices_until(deadline)
        flat = answers.ravel()
        call = code_of(self._elements)
        while True:
            code, row = call(
                models, self.memory, pose_a, pose_b, queries, row, count, 1, slices.steps, fresh,
                flat,
            )  # fmt: skip
            if failed:
                raise_failed()
            if code == index.ENDED or slices.over():
                return code, row
            fresh = code == index.CUT_BETWEEN

    def _make_room(self) -> None:
        """Set aside the rows of the full block that still matter, and empty the block."""
        progress = self.progress
        rows = self.state.collected[: progress["collected"]]
        rows = rows[least(rows, progress["slack"]) <= progress["limit"]]
        # Reset the number last: Ctrl-C may come at any moment, and no row may be lost.
        self._blocks.append(rows)
        progress["collected"] = 0

    def progress_now(self) -> np.void:
        """Return the PROGRESS of the search at this moment: a copy that no search writes to."""
        return _copy(self.state.progress)[0]

    def collected(self) -> tuple[NDArray[np.float64], ...]:
        """Return the rows of `State.collected` so far, in blocks that no search writes to again."""
        blocks = *self._blocks, self.state.collected[: self.progress["collected"]].copy()
        return tuple(each[:, (1, 0, 2)] for each in blocks) if self._turned else blocks

    def divided(self) -> Divided | None:
        """Copy the pairs of cells that may hold the minimum; return None if nothing is divided."""
        waiting = self.state.waiting
        if not isinstance(waiting, (index.Dividing, index.Turning)):
            return None
        progress, pairs = self.progress, waiting.pairs
        heap, aside = pairs[: progress["dividing"]], pairs[len(pairs) - int(progress["aside"]) :]
        pairs = np.frombuffer(heap.tobytes() + aside.tobytes(), pairs.dtype)
        cells_a, mark_a = _taken(waiting.cells_a[: progress["cells_a"]], pairs["a"])
        cells_b, mark_b = _taken(waiting.cells_b[: progress["cells_b"]], pairs["b"])
        return Divided(pairs, (cells_a, cells_b), (mark_a, mark_b), self._turned)

    def pending(self) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
        """Return the pairs of volumes not yet opened: their lanes (k, 2) and lower bounds (k,)."""
        state, progress = self.state, self.progress
        lanes, lower, *_ = state.waiting
        waiting, ends = int(progress["waiting"]), int(progress["open"])
        pairs, bounds, *_ = state.open
        if self.order == "breadth_first":  # a ring
            where = np.arange(progress["base"], ends) % len(bounds)
            open_pairs, open_bounds = pairs[where], bounds[where]
        else:
            put_off = len(bounds) - max(int(progress["put_off"]), 0)
            open_pairs = np.concatenate((pairs[:ends], pairs[put_off:]))
            open_bounds = np.concatenate((bounds[:ends], bounds[put_off:]))
        found = np.concatenate((open_pairs, lanes[:waiting]))
        return (
            found[:, ::-1] if self._turned else found,
            np.concatenate((open_bounds, lower[:waiting])),
        )


def _copy(records: NDArray) -> NDArray:
    """Copy one-dimensional records; numpy's own copy goes by field and takes ten times as long."""
    return np.frombuffer(records.tobytes(), records.dtype)


def _taken(cells: NDArray, numbers: NDArray[np.int32]) -> tuple[NDArray, NDArray[np.bool_]]:
    """Copy the cells with these numbers, each once; return them and which they are.

    A search may have made a hundred times as many. Without cells, a number names an element.
    """
    mark = np.zeros(len(cells), np.bool_)
    if len(cells):
        mark[numbers] = True
    return cells.view(f"V{cells.itemsize}")[mark].view(cells.dtype), mark
