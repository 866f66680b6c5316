"""Sequences whose items are made when they are looked at."""

from __future__ import annotations

import operator
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from typing import TypeVar, overload

Item = TypeVar("Item")


class LazySequence(Sequence[Item]):
    """A sequence that knows its length, and how to make any of its items."""

    __slots__ = ()

    @abstractmethod
    def _made(self, places: range) -> Iterator[Item]:
        """The items at these places, which all exist."""

    @overload
    def __getitem__(self, at: int) -> Item: ...

    @overload
    def __getitem__(self, at: slice) -> tuple[Item, ...]: ...

    def __getitem__(self, at: int | slice) -> Item | tuple[Item, ...]:
        """One item, or those of a slice."""
        if isinstance(at, slice):
            return tuple(self._made(range(*at.indices(len(self)))))
        place, count = operator.index(at), len(self)
        if not -count <= place < count:
            raise IndexError(f"{place} of {count}")
        (item,) = self._made(range(place % count, place % count + 1))
        return item

    def __iter__(self) -> Iterator[Item]:
        """All items, one by one."""
        return self._made(range(len(self)))
