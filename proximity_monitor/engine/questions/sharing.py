"""Work shared among threads, which Ctrl-C can stop."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from threading import Event
from typing import TypeVar

Item = TypeVar("Item")
Found = TypeVar("Found")


_NEVER = Event()
"""It is never set: no other thread can stop a thread that works alone."""


def share(
    answer: Callable[[Item, Event], Found], items: Iterable[Item], threads: int
) -> list[Found]:
    """Return `answer` of each item, in order, computed by so many threads.

    Only the main thread receives Ctrl-C, so it waits and does not work. When it is interrupted, or
    an answer raises an error, it sets the event, which the other threads check between slices.
    """
    if threads == 1:
        return [answer(item, _NEVER) for item in items]
    stopped = Event()
    with ThreadPoolExecutor(threads) as pool:
        try:
            waiting = [pool.submit(answer, item, stopped) for item in items]
            return [each.result() for each in waiting]
        except BaseException:
            stopped.set()
            pool.shutdown(wait=False, cancel_futures=True)
            raise
