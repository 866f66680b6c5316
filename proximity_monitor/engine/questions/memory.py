"""The memory of searches, which outlives them: the next search of its kind takes it.

To make it anew takes longer than a short search: some fifteen arrays, their table of addresses, and
the system's time to provide each page that is touched first. A search owns its memory from `take`
until it is gone itself, so nothing that can be resumed, or remembers anything, ever shares it. It
is given back by `__del__`: then no answer, no `Pair` and no exception's frame holds the search any
more. Threads need no lock, as each step on a deque is done at once.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable
from typing import ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

_MOST = 16
"""Memories that are kept, the last ones given back."""

_MOST_BYTES = 1 << 26
"""How much all these may take."""


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


class _Pool:
    """Memory that no search owns."""

    kept: ClassVar[deque[Memory]] = deque(maxlen=_MOST)


def take(made: type[Kept], kind: Hashable) -> Kept:
    """Memory of that class and kind, which is the caller's until it gives it back."""
    for memory in tuple(_Pool.kept):
        if memory.kind == kind and type(memory) is made:
            try:
                _Pool.kept.remove(memory)
            except ValueError:  # another thread was faster
                continue
            memory.clear()
            return memory
    return made(kind)


def give_back(memory: Memory) -> None:
    """Keep memory that its search needs no more; what was kept for longest may make room for it."""
    _Pool.kept.append(memory)
    while sum([each.size for each in tuple(_Pool.kept)]) > _MOST_BYTES:
        try:
            _Pool.kept.popleft()
        except IndexError:
            return
