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
from ..kernels.base.state import BAD_POSE_A, BAD_POSE_B, CUT, ENDED

Run = tuple[Callable, int, int]
"""The entry of some queries, the first of them, and one after the last."""
Settle = Callable[[int, int, int], int]
"""Makes answers, from one to before another, signed ones; see `settle_signs`. It takes so many
steps, and returns to where it came."""

LONG = 1 << 18
"""Steps between two returns to Python if there is no budget, so that Ctrl-C is heard."""

_FIRST = 64
"""Steps of the first slice, some 10 µs, as the time that a step takes is not known yet."""
_LEAST, _MOST = 32, 1 << 14
_SOON_S = 2e-5
"""With less time left, seconds, the first slice has no more than the least of steps: where models
are curved a step takes some ten times as long as between meshes."""
_SHARE = 3.0
"""A slice takes a third of the time that is left, provided its steps take as long as the last ones
did. So a search looks at the clock some ten times in a budget, and is late only where steps
suddenly take three times as long."""
_FASTER = 0.5
"""Steps are never expected to take less than this share of the time that the last ones took. Some
slices are over at once, or meet nothing but the cheapest of their work: that tells little about the
next slice, which may not become long because of it."""


_END, _LONGEST_END_S = 0.02, 1e-4
"""Share of a budget that is kept for the end of a call, and the most of it, seconds. A search of
milliseconds drives Python out of the processor's caches, so that its end takes up to ten times as
long as after a short one."""


def deadline_of(start: float, budget_s: SupportsFloat | None) -> float | None:
    """When the work of a call has to end whose budget began at `start` of perf_counter.

    Raises:
        TypeError: a budget that is no real number.
        ValueError: a budget that is negative or NaN.
    """
    if budget_s is None:
        return None
    budget_s = check_tolerance("budget_s", budget_s)
    return start + budget_s - min(_END * budget_s, _LONGEST_END_S)


class Slices:
    """The slices of a search until a deadline: `steps` is the number that the next one may take.

    Args:
        deadline: of perf_counter; None or infinity for none.
    """

    __slots__ = ("_begun", "_deadline", "_pace", "steps")

    def __init__(self, deadline: float | None) -> None:
        self._deadline = None if deadline == math.inf else deadline
        self._begun = perf_counter()
        self._pace = 0.0  # seconds that a step took
        self.steps = LONG
        if self._deadline is not None:
            self.steps = _FIRST if self._deadline - self._begun > _SOON_S else _LEAST

    def over(self, alike: bool = True) -> bool:
        """Look at the clock: whether no time is left for another slice.

        Unless the last one was `alike`, it does not tell how long the steps of the next one take.
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
    """Slices that begin now."""
    return ENDLESS if deadline is None else Slices(deadline)


def answer_in_slices(
    runs: list[Run],
    tables: NDArray[np.int64],
    memory: NDArray[np.int64],
    fresh: bool,
    poses: NDArray[np.float64],
    asked: NDArray[np.int64],
    every: int,
    deadline: float | None,
    stopped: Event | None,
    answers: NDArray[np.float64],
    settle: Settle | None,
) -> tuple[int, int]:
    """Answer every so many of the queries, in runs, into `answers`; how it ended, and where.

    Args:
        runs: of these queries.
        tables: of the bodies' models.
        memory: that of a search.
        fresh: whether it begins with the first query, or goes on with that.
        poses: (n, 4, 4) model to world of every body, metres.
        asked: the table of all queries.
        every: how many threads share them.
        deadline: of perf_counter.
        stopped: ends the search when it is set.
        answers: (k, ANSWER) written.
        settle: called with what was answered.
    """
    stacked, flat = poses.reshape(-1, 4), answers.ravel()
    slices = slices_until(deadline)
    code, at = ENDED, 0
    for entry, at, last in runs:
        while True:
            done = at
            code, at = entry(
                tables, memory, stacked, stacked, asked, at, last, every, slices.steps, fresh, flat
            )
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
