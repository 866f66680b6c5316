"""Time questions side by side: the askers take turns, block by block of steps."""

from __future__ import annotations

import gc
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from time import thread_time
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Query = Callable[[], Any]
Asker = Callable[[Sequence[int]], list[Query]]
"""Returns the queries of a block of steps; to make them is not timed."""

Key = TypeVar("Key", bound=Hashable)


@dataclass
class Timed:
    """The queries of one asker: seconds of processor time each, and the answers."""

    seconds: list[float] = field(default_factory=list)
    answers: list[Any] = field(default_factory=list)

    def of(self, name: str) -> NDArray[Any]:
        """Return an attribute of all answers, (queries, ...)."""
        return np.array([getattr(answer, name) for answer in self.answers])


def blocks(steps: int, length: int, count: int) -> list[range]:
    """Return at most `count` blocks of `length` steps, spread evenly over all `steps`."""
    starts = np.arange(0, steps, length)
    chosen = np.linspace(0, len(starts) - 1, min(count, len(starts))).round().astype(int)
    return [range(start, min(start + length, steps)) for start in starts[chosen]]


def take_turns(
    askers: Mapping[Key, Asker], turns: Sequence[Sequence[int]], advance: Callable[[float], None]
) -> dict[Key, Timed]:
    """Ask everything block by block; each block begins with another asker.

    So a disturbance of the machine affects all askers. The data that an asker leaves in the
    processor's caches would affect the next one. Therefore each asker begins a block by repeating
    the last question of the block before, untimed; that changes nothing that its pair remembers.
    Times are processor time of this thread, which other programs do not lengthen.

    Args:
        askers: by the key that their result gets.
        turns: the steps of each block.
        advance: called after each block with the block's share of the work.
    """
    for ask in askers.values():  # compiles, and brings the models into memory
        _warm(ask, turns[-1])
    results: dict[Key, Timed] = {key: Timed() for key in askers}
    order = list(askers)
    for turn, steps in enumerate(turns):
        first = turn % len(order)
        for key in order[first:] + order[:first]:
            _warm(askers[key], turns[turn - 1])
            _time(askers[key](steps), results[key])
        advance(1.0 / len(turns))
    return results


def _warm(ask: Asker, steps: Sequence[int]) -> None:
    """Ask the last question of a block, untimed."""
    for query in ask(steps[-1:]):
        query()


def _time(queries: list[Query], into: Timed) -> None:
    gc.disable()
    try:
        for query in queries:
            start = thread_time()
            answer = query()
            into.seconds.append(thread_time() - start)
            into.answers.append(answer)
    finally:
        gc.enable()


def summary(timed: Timed, kept: NDArray[np.bool_] | None = None) -> dict[str, float]:
    """Return the columns that every part has: times in microseconds, mean numbers of tests.

    Args:
        timed: the queries.
        kept: (queries,) which of them count; None: all.
    """
    keep = np.ones(len(timed.seconds), bool) if kept is None else kept
    times = 1e6 * np.array(timed.seconds)[keep]
    low, median, high = np.percentile(times, (25, 50, 75)) if keep.any() else [np.nan] * 3
    return {
        "queries": int(keep.sum()),
        "median_us": float(median),
        "low_us": float(low),
        "high_us": float(high),
        "mean_us": float(times.mean()),
        "bound_tests": float(timed.of("bound_tests")[keep].mean()),
        "primitive_tests": float(timed.of("primitive_tests")[keep].mean()),
    }
