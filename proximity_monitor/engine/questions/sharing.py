"""Work shared among threads, which Ctrl-C ends."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from threading import Event
from typing import TypeVar

Item = TypeVar("Item")
Found = TypeVar("Found")


_NEVER = Event()
"""It is never set: a thread that works alone has nobody who could stop it."""


def share(
    answer: Callable[[Item, Event], Found], items: Iterable[Item], threads: int
) -> list[Found]:
    """Return `answer` of each item, in their order, computed by so many threads.

    Only the main thread hears Ctrl-C, so it waits and does not work. When it is interrupted, or an
    answer raises an error, it sets the event, which all the others check between two slices.
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
