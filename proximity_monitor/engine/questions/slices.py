"""How much work a kernel may do before Python looks at the clock again."""

from __future__ import annotations

import math
from collections.abc import Callable
from threading import Event
from time import perf_counter
from typing import SupportsFloat

import numpy as np
from numpy.typing import NDArray

from ..arguments import check_tolerance
from ..kernels.base.lazy import failed, raise_failed
from ..kernels.base.state import BAD_POSE_A, BAD_POSE_B, CUT, ENDED

Run = tuple[Callable, int, int]
"""The entry for some queries, the first of these, and one after the last."""
Settle = Callable[[int, int, int], int]
"""Makes signed answers from those from the first number up to before the second, in so many steps;
see `settle_signs`. It returns the number of the first answer that is not settled."""

LONG = 1 << 18
"""Steps between two returns to Python if there is no budget, so that Ctrl-C is noticed."""

_FIRST = 64
"""Steps of the first slice, some 10 µs, because the time of a step is not known yet."""
_SOON_S, _FEW = 2e-5, 8
"""With less time left, seconds, the first slice has so few steps, because a step between curved
models takes some ten times as long as between meshes."""
_LEAST, _MOST = 32, 1 << 14
"""Least and most steps of any other slice."""
_SHARE = 3.0
"""A slice takes a third of the time that is left, provided its steps take as long as the last ones
did. So a search looks at the clock some ten times in a budget, and is late only if steps suddenly
take three times as long."""
_FASTER = 0.5
"""Steps are never expected to take less than this share of the time that the last ones took. Some
slices end at once, or do only the cheapest kind of work. That tells little about the next slice,
and must not make it long."""


_END, _LONGEST_END_S = 0.02, 1e-4
"""Share of a budget that is kept for the end of a call, and the most of it, seconds. A search of
milliseconds drives Python out of the processor's caches, so that the end of the call takes up to
ten times as long as after a short search."""


def deadline_of(start: float, budget_s: SupportsFloat | None) -> float | None:
    """Return when a call has to end its work, if its budget began at `start` of perf_counter.

    Raises:
        TypeError: the budget is no real number.
        ValueError: the budget is negative or NaN.
    """
    if budget_s is None:
        return None
    budget_s = check_tolerance("budget_s", budget_s)
    return start + budget_s - min(_END * budget_s, _LONGEST_END_S)


class Slices:
    """The slices of a search until a deadline: `steps` is how many steps the next one may take.

    Args:
        deadline: a time of perf_counter; None or infinity for none.
    """

    __slots__ = ("_begun", "_deadline", "_pace", "steps")

    def __init__(self, deadline: float | None) -> None:
        self._deadline = None if deadline == math.inf else deadline
        self._begun = perf_counter()
        self._pace = 0.0  # seconds that a step took
        self.steps = LONG
        if self._deadline is not None:
            self.steps = _FIRST if self._deadline - self._begun > _SOON_S else _FEW

    def over(self, alike: bool = True) -> bool:
        """Look at the clock; return whether no time is left for another slice.

        If the last slice was not `alike`, its steps do not tell how long the next one's take.
        """
        if self._deadline is None:
            return False
        now, pace = perf_counter(), self._pace
        if alike:
            pace = max((now - self._begun) / self.steps, _FASTER * pace)
        left = self._deadline - now
        if left <= _LEAST * pace:
            return True
        self._begun, self._pace = now, pace
        self.steps = max(_LEAST, min(int(left / (_SHARE * pace)), _MOST))
        return False


ENDLESS = Slices(None)
"""Slices without a deadline. They remember nothing, so all searches may share them."""


def slices_until(deadline: float | None) -> Slices:
    """Return slices that begin now."""
    return ENDLESS if deadline is None or deadline == math.inf else Slices(deadline)


def answer_in_slices(
    runs: list[Run],
    tables: NDArray[np.int64],
    memory: NDArray[np.int64],
    fresh: bool,
    poses: NDArray[np.float64],
    queries: NDArray[np.int64],
    stride: int,
    deadline: float | None,
    stopped: Event | None,
    answers: NDArray[np.float64],
    settle: Settle | None,
) -> tuple[int, int]:
    """Answer one thread's share of the queries into `answers`; return the code and where it ended.

    Args:
        runs: the runs of its queries.
        tables: the tables of the bodies' models.
        memory: the table of a search's memory.
        fresh: whether to begin the first query; otherwise continue it.
        poses: (n, 4, 4) model to world of every body, metres.
        queries: the table of all queries.
        stride: how many threads share the queries; the next query of this thread is so many on.
        deadline: a time of perf_counter, or None.
        stopped: an event that ends the search when it is set, or None.
        answers: (k, ANSWER), written.
        settle: makes answers signed once they are found, or None.
    """
    stacked, flat = poses.reshape(-1, 4), answers.ravel()
    slices = slices_until(deadline)
    code, at = ENDED, 0
    for entry, at, last in runs:
        while True:
            done = at
            code, at = entry(
                tables,
                memory,
                stacked,
                stacked,
                queries,
                at,
                last,
                stride,
                slices.steps,
                fresh,
                flat,
            )
            if failed:
                raise_failed()
            fresh = code != CUT
            if code in (BAD_POSE_A, BAD_POSE_B):
                return code, at
            found = at + (code == CUT)
            done = found if settle is None else settle(done, found, slices.steps)
            over = slices.over()
            while done < found:
                done = settle(done, found, 0 if over else slices.steps)
                over = over or slices.over(alike=False)
            if over or (stopped is not None and stopped.is_set()):
                return code, at
            if code == ENDED:
                break
    return code, at
