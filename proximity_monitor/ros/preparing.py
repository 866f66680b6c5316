"""What a node says while it gets ready, which takes a minute where kernels are compiled.

Getting ready keeps the main thread busy, so another one speaks. It is not interrupted by signals,
which come to the main thread alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread

PERIOD_S = 1.0


@contextmanager
def saying(say: Callable[[], None]) -> Iterator[None]:
    """Call `say` at once, and again each second, from another thread while this is entered."""
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
