"""The compiled entry that answers each pair of bodies, and the order of pairs of different kinds.

Each run of pairs of one kind is one call of a compiled entry. A call costs about as much as the
search of a pair of small models. So the pairs of a block, which are neighbours in the given order,
are grouped by kind.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..kernels.base.trees import RevolutionTree
from ..models.model import Model
from ..questions.setup import entry_for
from ..questions.slices import Run

Plan = tuple[NDArray[np.int64], list[list[Run]]]

_FIRST = 16
"""Size of the first block and of the second one; each further block is twice as large as the one
before. So after the first block, grouping makes a pair's turn at most twice as late."""
_KNOWN = 64
"""Number of lists of pairs whose plans are remembered."""


class Runs:
    """The entries for pairs of some bodies, by the kinds of their models, and plans of runs."""

    def __init__(self, models: Sequence[Model]) -> None:
        kinds = {model._hierarchy.tree_kind: model._hierarchy for model in models}
        entries = [entry_for(a, b) for a in kinds.values() for b in kinds.values()]
        self._entries = list(dict.fromkeys(entries))
        kind = [list(kinds).index(model._hierarchy.tree_kind) for model in models]
        which = np.array([self._entries.index(entry) for entry in entries])
        self._which = which.reshape(len(kinds), -1)[np.ix_(kind, kind)]
        self.profile = RevolutionTree in kinds
        """Whether a model may be a solid of revolution."""
        self.only = self._entries[0] if len(self._entries) == 1 else None
        """The entry of all pairs, or None if pairs may be of several kinds."""
        self._known: dict[Hashable, Plan] = {}

    def plan(self, pairs: NDArray[np.int32], stride: int, ahead: Sequence[int]) -> Plan:
        """Return the order in which to search pairs (k, 2), and each thread's runs in that order.

        There are `stride` threads; each takes every `stride`-th pair. The pairs at `ahead` go
        first. Of all others, the first pair given goes first.
        """
        key = pairs.tobytes(), stride
        if ahead or (found := self._known.get(key)) is None:
            found = self._planned(pairs, stride, ahead)
            if not ahead:  # the pairs are mostly the same as in the tick before
                if len(self._known) >= _KNOWN:
                    self._known.clear()
                self._known[key] = found
        return found

    def _planned(self, pairs: NDArray[np.int32], stride: int, ahead: Sequence[int]) -> Plan:
        which, count = self._which[tuple(pairs.T)], len(pairs)
        begins = [0, *(_FIRST << np.arange(max(1, count // _FIRST).bit_length()))]
        block = np.searchsorted(begins, np.arange(count), side="right") - 1
        kind = (which - which[:1]) % len(self._entries)
        # Every other block has the kinds in reverse order, so that runs join across blocks.
        kind = np.where(block % 2, len(self._entries) - 1 - kind, kind)
        turn = block * len(self._entries) + kind
        turn[ahead] = -1
        order = np.argsort(turn, kind="stable")
        return order, [self._runs(which[order], first, stride) for first in range(stride)]

    def _runs(self, which: NDArray[np.int64], first: int, stride: int) -> list[Run]:
        """Return the runs of every `stride`-th pair from `first` on; `which` (k,): the entries."""
        own = which[first::stride]
        ends = [*np.flatnonzero(np.diff(own, prepend=-1)).tolist(), len(own)]
        return [
            (self._entries[own[i]], first + stride * i, first + stride * (end - 1) + 1)
            for i, end in pairwise(ends)
        ]
