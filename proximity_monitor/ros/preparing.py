"""Reports progress while a node gets ready, which takes a minute if kernels must be compiled.

Getting ready keeps the main thread busy, so another thread reports. Signals do not interrupt the
reporting thread, because they come to the main thread only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread

PERIOD_S = 1.0


@contextmanager
def saying(say: Callable[[], None]) -> Iterator[None]:
    """Call `say` from another thread, at once and then every second, until the context ends."""
    over = Event()

    def run() -> None:
        say()
        while not over.wait(PERIOD_S):
            say()

    thread = Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
