"""What is asked about many pairs of bodies, and what to ask next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arguments import as_count, as_indices, as_real, check_tolerance
from ..kernels.assembly import agenda as kernel
from ..kernels.base import state as index
from ..questions.result import Distance
from .answers import Answers
from .assembly import Assembly

_FIRST = {
    "range": np.inf, "looked": -np.inf, "min_upper": np.inf, "min_lower": np.inf, "hint": -1,
}  # fmt: skip
"""What a record begins with that does not begin with zeros."""


class Questions(NamedTuple):
    """What to ask about some entries of an `Agenda`."""

    at: NDArray[np.int64]
    """(m,) which."""
    bodies: NDArray[np.int32]
    """(m, 2)."""
    wanted: NDArray[np.float64]
    """(m, 3) rel_err, abs_err, and the metres on one side of which it suffices to know the
    distance; infinity: it does not."""
    hints: NDArray[np.int32]
    """(m, 2) see `Assembly`."""
    signed: NDArray[np.bool_]
    """(m,) whether the sign of the distance is asked for: one is a solid, and may overlap."""
    how: NDArray[np.int8]
    """(m,) Agenda.TOGETHER, ALONE (it takes long) or INSIDE (by itself, and signed)."""

    def part(self, start: int, end: int) -> Questions:
        """Those of the places from start to before end."""
        return Questions(*(column[start:end] for column in self))


class Agenda:
    """Questions about the rows of a table of answers, moment by moment.

    A moment is `look`, then as often as there is time `order` and `search` or `take`, then
    `report`. Entries are places among the rows that were looked at.

    Args:
        answers: the table.
        assembly: of the same bodies.

    Raises:
        ValueError: they are not as many.

    Attributes:
        book: (m,) one record a row: `range` and `levels` (LEVELS,), metres: a pair is asked about
            as far as its range; `rel_err`, `abs_err` of its distance, or `deciding`: no more is
            asked than on which side of its levels it is; `ignored`: nothing is; all of these are
            for others to write. `min_upper`, `min_lower`: the smallest bounds, metres, of all
            moments at which both poses were certain.
    """

    LEVELS = kernel.LEVELS
    TOGETHER, ALONE, INSIDE = kernel.TOGETHER, kernel.ALONE, kernel.INSIDE
    OVERLAPPING, UNKNOWN = kernel.OVERLAPPING, kernel.UNKNOWN

    def __init__(self, answers: Answers, assembly: Assembly) -> None:
        if len(assembly.models) != len(answers.poses):
            raise ValueError(
                f"assembly: of {len(assembly.models)} bodies, the answers of {len(answers.poses)}"
            )
        self._answers = answers
        self._assembly = assembly
        self.book = np.zeros(0, kernel.QUESTION)
        self._rows = np.empty(0, np.int64)
        self._silent = np.empty(0, np.bool_)
        self._reserve(1)

    def __copy__(self) -> Agenda:
        """Another about the same answers and assembly, with a book of its own."""
        return deepcopy(self, {id(each): each for each in (self._answers, self._assembly)})

    def _reserve(self, count: int) -> None:
        """Have memory for so many entries."""
        self._views = np.zeros(count, kernel.VIEW)
        self._at, self._kind = np.empty((2, count), np.int64)
        self._keys = np.empty((2, count))

    def begin(self, rows: NDArray[np.int64]) -> None:
        """Begin the records of rows (k,)."""
        least = int(rows.max(initial=-1)) + 1
        if least > len(self.book):
            more = np.zeros(max(least, 2 * len(self.book)) - len(self.book), kernel.QUESTION)
            self.book = np.concatenate((self.book, more))
        fresh = np.zeros(1, kernel.QUESTION)
        for name, value in _FIRST.items():
            fresh[name] = value
        self.book[rows] = fresh

    def renew(self, rows: NDArray[np.int64]) -> None:
        """Forget what searches of rows (k,) found: a body of theirs has another model now."""
        self.book["done"][rows] = self.book["hard"][rows] = False
        self.book["hint"][rows] = _FIRST["hint"]

    def look(
        self,
        rows: NDArray[np.int64],
        known: NDArray[np.bool_],
        silent: NDArray[np.bool_],
        distances: bool,
    ) -> None:
        """See what is certain about rows (k,) at the present poses.

        Args:
            rows: the entries from now on.
            known: (n,) the bodies whose pose is.
            silent: (n,) those whose pose is unknown or too old; their pairs come last.
            distances: whether anybody wants numbers; if not, pairs are only decided, but for
                those that are at a level.
        """
        if len(rows) > len(self._views):
            self._reserve(2 * len(rows))
        self._rows = as_indices(rows, "rows")
        known, self._silent = (np.require(each, np.bool_, "CAWE") for each in (known, silent))
        kernel.look(
            *self._answers.bodies, *self._answers.table, known, self._silent, self._rows, self.book,
            bool(distances), self._views,
        )  # fmt: skip

    def order(self) -> NDArray[np.int64]:
        """The entries that want a search, the most urgent first.

        Those come first of which it is open on which side of a level they are, then those with the
        nearest lower bound and at last models that overlap, then those not searched for longest;
        and after all, stale ones.
        """
        count = kernel.wanting(self._rows, self.book, self._views, self._at, self._kind, self._keys)
        if count < 2:
            return self._at[:count].copy()
        lower, looked = self._keys[:, :count]
        return self._at[np.lexsort((looked, lower, self._kind[:count]))]

    def ask(self, at: NDArray[np.int64]) -> Questions:
        """The questions about entries (m,)."""
        at = as_indices(at, "at")
        count = len(at)
        bodies, hints = np.empty((2, count, 2), np.int32)
        wanted, how = np.empty((count, 3)), np.empty(count, np.int8)
        signed = np.empty(count, np.bool_)
        kernel.ask(
            self._rows, self._answers.table[0], self.book, self._views, at, bodies, wanted, hints,
            signed, how,
        )  # fmt: skip
        return Questions(at, bodies, wanted, hints, signed, how)

    def search(
        self, questions: Questions, budget_s: float, threads: int, clock: Callable[[], float]
    ) -> NDArray[np.int64]:
        """Search entries together, in this order; those (m,) that the budget allowed to look at.

        `clock` says when they were.
        """
        found = self._assembly.rows(
            self._answers.poses, questions.bodies, questions.wanted, questions.hints,
            questions.signed, check_tolerance("budget_s", budget_s), as_count(threads, "threads"),
        )  # fmt: skip
        return self._take(questions, found, clock())

    def take(
        self, questions: Questions, found: Sequence[Distance], now_s: float
    ) -> NDArray[np.int64]:
        """Take what searches of entries (m,) by themselves found; returns these.

        It was found with `Pair`, a signed distance for INSIDE, and at `now_s`.
        """
        if len(found) != len(questions.at):
            raise ValueError(f"found: {len(found)} answers to {len(questions.at)} questions")
        rows = np.array([each.row for each in found]).reshape(-1, index.ANSWER)
        return self._take(questions, rows, now_s)

    def _take(
        self, questions: Questions, found: NDArray[np.float64], now_s: float
    ) -> NDArray[np.int64]:
        at = questions.at
        reached = np.empty(len(at), np.bool_)
        poses, versions, _, places = self._answers.bodies
        count = kernel.take(
            poses, versions, places, *self._answers.table, self._rows, self.book, self._views,
            at, questions.wanted, found, as_real(now_s, "now_s"), reached,
        )  # fmt: skip
        return at if count == len(at) else at[reached]

    def report(self, now_s: float) -> tuple[NDArray, int]:
        """What is known of the entries that may be within their range, and how many are open.

        Returns:
            (l,) records: `at` its entry; `bodies` (2,); `lower` and `upper`, metres, NaN where a
            pose is unknown; `points` (2, 3) metres, world, of which `upper` is the distance (where
            it is not negative), and where they lie on the models: `faces` (2,) and `weights`
            (2, 3) of their corners; `status`, a position in `tuple(Status)`, where OUT_OF_TIME
            stands for all bounds that are wider than asked for, or OVERLAPPING or UNKNOWN; `age_s`
            since the numbers were an answer to the present poses; `min_upper` and `min_lower` of
            `book`; `silent` (2,) which pose is. And the number of entries that want a search yet.
        """
        states = np.empty(len(self._rows), kernel.STATE)
        listed, left = kernel.report(
            self._rows, self._answers.table[0], self._answers.bodies[2], self._silent, self.book,
            self._views, as_real(now_s, "now_s"), states,
        )  # fmt: skip
        return states[:listed], left
