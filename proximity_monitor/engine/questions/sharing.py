"""Work that threads share, and that Ctrl-C ends."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from threading import Event
from typing import TypeVar

Item = TypeVar("Item")
Found = TypeVar("Found")


def share(
    answer: Callable[[Item, Event], Found], items: Iterable[Item], threads: int
) -> list[Found]:
    """What `answer` gives for each item, in their order, from so many threads.

    Only the main thread hears Ctrl-C, so it waits and does not work. When it is interrupted, or one
    of the answers is an error, the event is set that all the others look at between two slices.
    """
    stopped = Event()
    if threads == 1:
        return [answer(item, stopped) for item in items]
    with ThreadPoolExecutor(threads) as pool:
        try:
            waiting = [pool.submit(answer, item, stopped) for item in items]
            return [each.result() for each in waiting]
        except BaseException:
            stopped.set()
            pool.shutdown(wait=False, cancel_futures=True)
            raise
