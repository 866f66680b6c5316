"""The memory of searches. It outlives its search, and the next search of the same kind takes it.

Making new memory takes longer than a short search: some fifteen arrays, their table of addresses,
and the system's time to provide each page on first touch. A search owns its memory from `take`
until the search is deleted, so searches that can be resumed, or remember anything, never share it.
The search's `__del__` gives the memory back: by then no answer, no `Pair` and no frame of an
exception holds the search any more. Threads need no lock, because each deque operation is atomic.
"""

from __future__ import annotations

import mmap
from collections import deque
from collections.abc import Hashable
from contextlib import suppress
from typing import TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

_MOST, _LARGEST = 8, 1 << 24
"""How many memories are kept (those given back last), and the most bytes that one may take."""


_HUGE = 1 << 22
"""Size in bytes from which on numpy asks the system for huge pages."""


def room(count: int, kind: DTypeLike = np.float64) -> NDArray:
    """Make an array (count,) of which the system provides only the pages that are written to.

    Its pages are not huge. The system clears a huge page, of 2 MB, as a whole on first touch, and
    may move other memory out of its way before: milliseconds, in a call that has a budget.
    """
    dtype = np.dtype(kind)
    size = count * dtype.itemsize
    if size < _HUGE or not hasattr(mmap, "MAP_ANONYMOUS"):
        return np.empty(count, dtype)
    pages = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    if hasattr(mmap, "MADV_NOHUGEPAGE"):
        with suppress(OSError):  # the system has no huge pages
            pages.madvise(mmap.MADV_NOHUGEPAGE)
    return np.frombuffer(pages, dtype)


class Memory:
    """Arrays that one search at a time writes to. Each kind of search derives its own class.

    Args:
        kind: all that the sizes of the arrays depend on.
    """

    __slots__ = ("_records", "kind", "size")

    kind: Hashable
    size: int
    """Bytes."""

    def __init__(self, kind: Hashable) -> None:
        self.kind = kind

    def _keep(self, arrays: tuple[NDArray, ...], *records: NDArray) -> None:
        """Count the bytes of the arrays. Let each search begin with the records as they are now."""
        self.size = sum(each.nbytes for each in arrays)
        views = [memoryview(each.reshape(-1).view(np.uint8)) for each in records]
        self._records = [(view, bytes(view)) for view in views]

    def clear(self) -> None:
        """Restore the first state, as far as a search depends on it."""
        for found, blank in self._records:
            found[:] = blank


Kept = TypeVar("Kept", bound=Memory)


_kept: deque[Memory] = deque(maxlen=_MOST)
"""Memory that no search owns; the one given back last comes first."""


def take(made: type[Kept], kind: Hashable) -> Kept:
    """Return memory of this class and kind; the caller owns it until it gives it back."""
    for memory in [*_kept]:  # a list: making a tuple may collect garbage, which gives back memory
        if memory.kind == kind and type(memory) is made:
            try:
                _kept.remove(memory)
            except ValueError:  # another thread was faster
                continue
            memory.clear()
            return memory
    return made(kind)


def give_back(memory: Memory) -> None:
    """Keep memory that its search no longer needs, in place of the memory kept longest."""
    if memory.size <= _LARGEST:
        _kept.appendleft(memory)
