"""Which compiled entry answers a pair of bodies, and the order of pairs of unlike kinds.

Each run of pairs of one kind is a call of a compiled entry, which costs about as much as the search
of a pair of small models. So neighbours in the order that was asked for take their turns by kind.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..models.model import Model
from ..questions.run import entry_for
from ..questions.slices import Run

Plan = tuple[NDArray[np.int64], list[list[Run]]]

_FIRST = 16
"""How many of the pairs that were asked for first take turns by kind; then as many, and then twice
as many as before each time. So a pair has its turn at most twice as late as without this."""
_KNOWN = 64
"""Lists of pairs whose plan is remembered."""


class Runs:
    """The kinds of some bodies' models, and what follows from them for pairs."""

    def __init__(self, models: Sequence[Model]) -> None:
        kinds = {model._hierarchy.tree_kind: model._hierarchy for model in models}
        entries = [entry_for(a, b) for a in kinds.values() for b in kinds.values()]
        self._entries = list(dict.fromkeys(entries))
        kind = [list(kinds).index(model._hierarchy.tree_kind) for model in models]
        which = np.array([self._entries.index(entry) for entry in entries])
        self._which = which.reshape(len(kinds), -1)[np.ix_(kind, kind)]
        self.only = self._entries[0] if len(self._entries) == 1 else None
        """The entry of all pairs, or None where they may be of several kinds."""
        self._known: dict[Hashable, Plan] = {}

    def plan(self, pairs: NDArray[np.int32], every: int, ahead: Sequence[int]) -> Plan:
        """In which order pairs (k, 2) are asked about, and the runs of that order for each thread.

        Of `every` threads each takes every so many pairs. Those at `ahead` go first, and the pair
        that was asked for first has its turn before all others.
        """
        key = pairs.tobytes(), every
        if ahead or (found := self._known.get(key)) is None:
            found = self._planned(pairs, every, ahead)
            if not ahead:  # mostly the pairs are those of the tick before
                if len(self._known) >= _KNOWN:
                    self._known.clear()
                self._known[key] = found
        return found

    def _planned(self, pairs: NDArray[np.int32], every: int, ahead: Sequence[int]) -> Plan:
        asked, count = self._which[tuple(pairs.T)], len(pairs)
        begins = [0, *(_FIRST << np.arange(max(1, count // _FIRST).bit_length()))]
        block = np.searchsorted(begins, np.arange(count), side="right") - 1
        kind = (asked - asked[:1]) % len(self._entries)
        kind = np.where(block % 2, len(self._entries) - 1 - kind, kind)  # there and back
        turn = block * len(self._entries) + kind
        turn[ahead] = -1
        order = np.argsort(turn, kind="stable")
        return order, [self._runs(asked[order], first, every) for first in range(every)]

    def _runs(self, asked: NDArray[np.int64], first: int, every: int) -> list[Run]:
        """Every so many of the pairs from the first on, whose entries `asked` (k,) names."""
        own = asked[first::every]
        ends = [*np.flatnonzero(np.diff(own, prepend=-1)).tolist(), len(own)]
        return [
            (self._entries[own[i]], first + every * i, first + every * (end - 1) + 1)
            for i, end in pairwise(ends)
        ]
