"""The memory of searches, which outlives them: the next search of its kind takes it.

To make it anew takes longer than a short search: some fifteen arrays, their table of addresses, and
the system's time to provide each page that is touched first. A search owns its memory from `take`
until it is gone itself, so nothing that can be resumed, or remembers anything, ever shares it. It
is given back by `__del__`: then no answer, no `Pair` and no exception's frame holds the search any
more. Threads need no lock, as each step on a deque is done at once.
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
"""How many memories are kept, the last ones given back, and the bytes that one may take."""


_HUGE = 1 << 22
"""Bytes from which on numpy asks the system for huge pages."""


def room(count: int, kind: DTypeLike = np.float64) -> NDArray:
    """An array (count,) of which the system provides only the pages that are written to.

    A huge page, of 2 MB, is cleared as a whole when it is first touched, and the system may move
    other memory out of its way before: milliseconds, in a call that has a budget.
    """
    dtype = np.dtype(kind)
    size = count * dtype.itemsize
    if size < _HUGE or not hasattr(mmap, "MAP_ANONYMOUS"):
        return np.empty(count, dtype)
    pages = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    if hasattr(mmap, "MADV_NOHUGEPAGE"):
        with suppress(OSError):  # a system without huge pages
            pages.madvise(mmap.MADV_NOHUGEPAGE)
    return np.frombuffer(pages, dtype)


class Memory:
    """What one search at a time writes to. Each kind of search derives a class of its own.

    Args:
        kind: all that its arrays' sizes depend on.
    """

    __slots__ = ("_blank", "_bytes", "kind", "size")

    kind: Hashable
    size: int
    """Bytes."""

    def __init__(self, kind: Hashable) -> None:
        self.kind = kind

    def _keep(self, arrays: tuple[NDArray, ...], *records: NDArray) -> None:
        """Count the arrays' bytes. Let each search begin with the records as they are now."""
        self.size = sum(each.nbytes for each in arrays)
        self._bytes = [memoryview(each.reshape(-1).view(np.uint8)) for each in records]
        self._blank = [bytes(each) for each in self._bytes]

    def clear(self) -> None:
        """Make it as it was at first, as far as a search depends on that."""
        for found, blank in zip(self._bytes, self._blank, strict=True):
            found[:] = blank


Kept = TypeVar("Kept", bound=Memory)


_kept: deque[Memory] = deque(maxlen=_MOST)
"""Memory that no search owns, that given back last first."""


def take(made: type[Kept], kind: Hashable) -> Kept:
    """Memory of that class and kind, which is the caller's until it gives it back."""
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
    """Keep memory that its search needs no more, instead of what was kept for longest."""
    if memory.size <= _LARGEST:
        _kept.appendleft(memory)
