"""The queries about many pairs of bodies, tick by tick, and the order of their searches.

A level is a distance that a pair is judged against. Pairs whose bounds straddle a level are
searched first. Then the pair with the least lower bound goes first, and of equal ones the pair with
the oldest search. If models overlap, the sign is found first, with whatever bounds of the depth
come with it; the depth is refined when all else is answered. A pair costs nothing if its bodies did
not move relative to each other since its search ended.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from copy import deepcopy
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.assembly import schedule as kernel
from ..kernels.base import state as index
from ..models.model import Model
from .answers import Answers
from .assembly import Assembly
from .long_searches import LongSearches, Single, prepare
from .query import Query

REMEMBERED = 100_000
"""How many pairs without a row keep their smallest bounds. The oldest are forgotten first."""

_FIRST = {
    "range": np.inf, "searched_s": -np.inf, "answered_s": -np.inf, "min_upper": np.inf,
    "min_lower": np.inf, "hint": -1,
}  # fmt: skip
"""The fields of a new record that do not begin with zero."""


class Queries(NamedTuple):
    """The queries about m entries of a `Schedule`."""

    at: NDArray[np.int64]
    """(m,) the entries."""
    bodies: NDArray[np.int32]
    """(m, 2) the bodies of each entry's pair."""
    wanted: NDArray[np.float64]
    """(m, 3) rel_err, abs_err, and a clearance in metres. The search may end when it is certain on
    which side of the clearance the distance lies; infinity: it goes on to the tolerance."""
    hints: NDArray[np.int32]
    """(m, 2) see `Assembly`."""
    signed: NDArray[np.bool_]
    """(m,) whether the sign is asked for: a body is a solid, and the bodies may overlap."""
    how: NDArray[np.int8]
    """(m,) Schedule.TOGETHER, ALONE (the search takes long) or INSIDE (alone, and signed)."""

    def part(self, start: int, end: int) -> Queries:
        """Return the queries from `start` to before `end`."""
        return Queries(*(column[start:end] for column in self))


class Schedule:
    """The queries about the rows of a table of answers, tick by tick.

    A tick is a call of `update`, then of `search`, then of `report`. An entry is the position of
    a row among those given to `update`. Rows and bodies are given as numpy arrays of any integer
    type, flags as arrays of bool.

    Args:
        answers: the table.
        assembly: the assembly of the same bodies.

    Raises:
        ValueError: the two have different numbers of bodies.

    Attributes:
        records: (m,) one per row. The caller writes these fields: `range` and `levels` (LEVELS,) in
            metres: a pair is searched only while it may be within its range; `rel_err` and
            `abs_err`, the tolerance of its distance; `deciding`: only the side of its levels is
            asked for; `ignored`: nothing is asked for. The caller reads these: `min_upper` and
            `min_lower`, the smallest bounds (metres) of all ticks at which both poses were
            certain.
    """

    LEVELS = kernel.LEVELS
    TOGETHER, ALONE, INSIDE = kernel.TOGETHER, kernel.ALONE, kernel.INSIDE
    OVERLAPPING, UNKNOWN = kernel.OVERLAPPING, kernel.UNKNOWN

    def __init__(self, answers: Answers, assembly: Assembly) -> None:
        if len(assembly.models) != len(answers.poses):
            raise ValueError(
                f"assembly: has {len(assembly.models)} bodies, but the answers are about "
                f"{len(answers.poses)}"
            )
        self._answers = answers
        self._assembly = assembly
        self._long = LongSearches(coherent=True)
        self._minima: dict[int, tuple[float, float]] = {}  # of pairs without a row, by key
        self.records = np.zeros(0, kernel.RECORD)
        self._rows = np.empty(0, np.int64)
        self._silent = np.empty(0, np.bool_)
        self._reserve(1)

    def __copy__(self) -> Schedule:
        """Return a copy that shares the answers and the assembly, and has its own records."""
        shared = self._answers, self._assembly, *self._assembly.models
        return deepcopy(self, {id(each): each for each in shared})

    def _reserve(self, count: int) -> None:
        """Allocate memory for `count` entries."""
        self._views = np.zeros(count, kernel.VIEW)
        self._at, self._kind = np.empty((2, count), np.int64)
        self._keys = np.empty((2, count))

    def prepare(self) -> None:
        """Run every kernel of a tick once, so that no tick has to compile a kernel."""
        nothing, nobody = np.empty(0, np.int64), np.zeros(len(self._answers.poses), np.bool_)
        self.update(nothing, nobody, nobody, True)
        self.order()
        self.commit(self.queries(nothing), np.empty((0, index.ANSWER)), 0.0)
        self.report(0.0)
        prepare(self._assembly)

    def begin(self, rows: NDArray[np.int64]) -> None:
        """Begin the records of rows (k,). A pair that had a row before keeps its minima."""
        least = int(rows.max(initial=-1)) + 1
        if least > len(self.records):
            more = np.zeros(max(least, 2 * len(self.records)) - len(self.records), kernel.RECORD)
            self.records = np.concatenate((self.records, more))
        fresh = np.zeros(1, kernel.RECORD)
        for name, value in _FIRST.items():
            fresh[name] = value
        self.records[rows] = fresh
        if self._minima:
            keys = self._answers.pairs(rows) @ (len(self._answers.poses), 1)
            for key, row in zip(keys.tolist(), rows.tolist(), strict=True):
                if key in self._minima:
                    record = self.records[row]
                    record["min_upper"], record["min_lower"] = self._minima.pop(key)

    def end(self, keys: NDArray[np.int64], rows: NDArray[np.int64]) -> None:
        """Keep the minima of pairs whose rows (k,) were dropped.

        A key is the first body's index times the number of bodies, plus the second body's index.
        """
        left = self.records[rows]
        known = np.isfinite(left["min_lower"])
        minima = left[known][["min_upper", "min_lower"]].tolist()
        self._minima.update(zip(keys[known].tolist(), minima, strict=True))
        while len(self._minima) > REMEMBERED:
            del self._minima[next(iter(self._minima))]

    def reset_minima(self) -> None:
        """Forget the smallest bounds of all pairs."""
        self._minima.clear()
        self.records["min_upper"] = self.records["min_lower"] = np.inf

    def replace(self, body: int, model: Model, rows: NDArray[np.int64]) -> None:
        """Give a body another model; forget what searches found about its pairs' rows (k,)."""
        self._assembly.replace(body, model)
        self.records["done"][rows] = self.records["hard"][rows] = False
        self.records["hint"][rows] = _FIRST["hint"]

    def update(
        self,
        rows: NDArray[np.int64],
        known: NDArray[np.bool_],
        silent: NDArray[np.bool_],
        distances: bool,
    ) -> None:
        """Begin a tick: find what is certain about rows (k,) at the present poses.

        Args:
            rows: the rows, whose positions are the entries from now on.
            known: (n,) whether each body's pose is known.
            silent: (n,) whether each body's pose is unknown or too old; its pairs come last.
            distances: whether anybody wants distances. If not, only the side of the levels is
                searched for, except for pairs that are certainly within a level.
        """
        if len(rows) > len(self._views):
            self._reserve(2 * len(rows))
        self._rows = np.require(rows, np.int64, "CAWE")
        known, self._silent = (np.require(each, np.bool_, "CAWE") for each in (known, silent))
        kernel.update(
            *self._answers.bodies, self._answers.table, known, self._silent, self._rows,
            self.records, bool(distances), self._views,
        )  # fmt: skip

    def order(self) -> NDArray[np.int64]:
        """Return the entries that need a search, the most urgent first.

        Entries whose side of a level is open come first. Both groups are sorted by lower bound;
        models that certainly overlap, of which only the depth is open, come last in their group.
        Equal entries are in the order of their last searches, oldest first. Stale entries come
        after all others.
        """
        count = kernel.pending(
            self._rows, self.records, self._views, self._at, self._kind, self._keys
        )
        if count < 2:
            return self._at[:count].copy()
        lower, searched_s = self._keys[:, :count]
        return self._at[np.lexsort((searched_s, lower, self._kind[:count]))]

    def queries(self, at: NDArray[np.int64]) -> Queries:
        """Return the queries about entries (m,)."""
        at = np.require(at, np.int64, "CAWE")
        count = len(at)
        bodies, hints = np.empty((2, count, 2), np.int32)
        wanted, how = np.empty((count, 3)), np.empty(count, np.int8)
        signed = np.empty(count, np.bool_)
        kernel.query(
            self._rows, self._answers.table, self.records, self._views, at, bodies, wanted,
            hints, signed, how,
        )  # fmt: skip
        return Queries(at, bodies, wanted, hints, signed, how)

    def search(self, deadline: float, clock: Callable[[], float], threads: int = 1) -> list[int]:
        """Search until every query is answered or the deadline has come.

        A pair whose search takes long gets half of the remaining time while other pairs wait. It
        gets more when they have had their turn.

        Args:
            deadline: seconds of the clock.
            clock: returns the present time, to tell when a search ended.
            threads: how many threads share the searches.

        Returns:
            The entries that were searched, in the order of their first search.
        """
        searched: dict[int, None] = {}
        while clock() < deadline and len(todo := self.order()):
            queries = self.queries(todo)
            for start, end in _turns(queries.how != self.TOGETHER, threads):
                left = deadline - clock()
                if left <= 0.0:
                    return list(searched)
                part = queries.part(start, end)
                together = part.how[0] == self.TOGETHER
                if together:
                    reached = self.search_together(part, left, threads, clock)
                else:
                    share = left if len(part.at) == len(todo) else left / 2.0
                    reached = self._search_singly(part, share, threads, clock)
                searched.update(dict.fromkeys(reached.tolist()))
                if together:
                    break  # order again: signs that are still open go before depths to refine
        return list(searched)

    def search_together(
        self, queries: Queries, budget_s: float, threads: int, clock: Callable[[], float]
    ) -> NDArray[np.int64]:
        """Search entries in one call, in order; return the entries that the budget reached."""
        query = Query(
            self._answers.poses, queries.bodies, queries.wanted, queries.hints, queries.signed
        )
        found = self._assembly.rows(query, perf_counter() + float(budget_s), threads)
        return self.commit(queries, found, clock())

    def _search_singly(
        self, queries: Queries, budget_s: float, threads: int, clock: Callable[[], float]
    ) -> NDArray[np.int64]:
        """Do as `search_together`, but search each entry by itself."""
        models, poses = self._assembly.models, self._answers.poses

        def single(k: int) -> Single:
            a, b = bodies = tuple(queries.bodies[k].tolist())
            signed = queries.how[k] == self.INSIDE
            return Single(bodies, (models[a], models[b]), poses[[a, b]], queries.wanted[k], signed)

        deadline = perf_counter() + float(budget_s)
        found = self._long.search(single, len(queries.at), kernel.DEPTH_ERR, deadline, threads)
        return self.commit(queries, found, clock())

    def commit(
        self, queries: Queries, found: NDArray[np.float64], now_s: float
    ) -> NDArray[np.int64]:
        """Store the rows (m, ANSWER) that searches found at `now_s`; return the entries reached.

        The rows are from `Assembly.rows` or from `Pair`. For INSIDE they are signed distances.
        """
        at = queries.at
        if len(found) != len(at):
            raise ValueError(f"found: {len(found)} answers, expected {len(at)}, one for each query")
        reached = np.empty(len(at), np.bool_)
        poses, versions, _, places = self._answers.bodies
        count = kernel.commit(
            poses, versions, places, self._answers.table, self._rows, self.records, self._views,
            at, queries.wanted, found, float(now_s), reached,
        )  # fmt: skip
        return at if count == len(at) else at[reached]

    def report(self, now_s: float) -> tuple[NDArray, int]:
        """Return what is known of the entries that may be within range, and how many are open.

        Returns:
            (l,) records, and the number of entries that still need a search. The fields are: `at`,
            the entry; `bodies` (2,); `lower` and `upper`, metres, NaN if a pose is unknown;
            `points` (2, 3) metres, world: their distance is `upper` unless that is negative;
            `elements` (2,) and `parameters` (2, 3): where the points lie on the models; `status`, a
            position in `tuple(Status)` (OUT_OF_TIME stands for all bounds wider than asked for), or
            OVERLAPPING or UNKNOWN; `age_s`, seconds since the numbers were an answer to the present
            poses; `min_upper` and `min_lower` as in `records`; `silent` (2,), whether each body's
            pose is unknown or too old.
        """
        listed = np.empty(len(self._rows), kernel.LISTED)
        count, left = kernel.report(
            self._rows, self._answers.table, self._answers.bodies[2], self._silent, self.records,
            self._views, float(now_s), listed,
        )  # fmt: skip
        return listed[:count], left


def _turns(alone: NDArray[np.bool_], threads: int) -> Iterator[tuple[int, int]]:
    """Yield start and end of the queries of each call.

    Consecutive queries that are not `alone` (m,) share a call; those that are, go in groups of
    `threads`.
    """
    ends = [0, *(np.flatnonzero(alone[1:] != alone[:-1]) + 1).tolist(), len(alone)]
    for start, end in itertools.pairwise(ends):
        step = threads if alone[start] else end - start
        for first in range(start, end, step):
            yield first, min(first + step, end)
