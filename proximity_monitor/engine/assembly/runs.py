"""Which compiled entry answers which of the pairs that are asked about."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..models.model import Model
from ..questions.run import entry_for

_KNOWN = 64
"""How many answers are remembered."""


class Run(NamedTuple):
    """Pairs, one after the other, that one entry answers."""

    entry: Callable
    first: int
    end: int
    """One after the last."""


class Runs:
    """The runs of pairs of bodies.

    Args:
        models: of the bodies.
    """

    def __init__(self, models: Sequence[Model]) -> None:
        trees = [model._hierarchy.tree_kind for model in models]
        kinds = dict(zip(trees, models, strict=True))
        entries = [entry_for(a, b) for a in kinds.values() for b in kinds.values()]
        self._entries = list(dict.fromkeys(entries))
        numbers = [list(kinds).index(tree) for tree in trees]
        by_kind = np.array([self._entries.index(entry) for entry in entries])
        self._which = by_kind.reshape(len(kinds), -1)[np.ix_(numbers, numbers)]
        self._known: dict[Hashable, list[Run]] = {}

    def of(self, pairs: NDArray[np.int32], first: int, every: int) -> list[Run]:
        """Every so many pairs from the first on, in runs."""
        if len(self._entries) == 1:
            return [Run(self._entries[0], first, len(pairs))]
        key = pairs.tobytes(), first, every  # mostly those of the tick before
        found = self._known.get(key)
        if found is None:
            asked = self._which[tuple(pairs[first::every].T)]
            begins = np.flatnonzero(np.diff(asked, prepend=-1)).tolist()
            ends = [*begins[1:], len(asked)]
            found = [
                Run(self._entries[asked[i]], first + every * i, first + every * (end - 1) + 1)
                for i, end in zip(begins, ends, strict=True)
            ]
            if len(self._known) >= _KNOWN:
                self._known.clear()
            self._known[key] = found
        return found
