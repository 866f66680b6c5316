"""Pairs that are searched one by one, because that takes long, with what outlives a call of it."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Hashable
from itertools import combinations_with_replacement, product
from threading import Event
from time import perf_counter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state as index
from ..models.model import Model
from ..questions.ball import solid_kind
from ..questions.pair import Pair
from ..questions.sharing import share
from ..questions.slices import deadline_of

if TYPE_CHECKING:
    from .assembly import Assembly

KEPT = 64
"""How many searches are kept; each takes some tens of kilobytes, and more for solids."""

_CHUNK = 64
"""Pairs that one thread answers in a row. Each chunk starts with nothing remembered, so the answers
are the same however many threads there are."""

_SLICE_S = 0.02
"""Between two looks of one of several threads whether Ctrl-C was pressed: a single one hears it
whenever a kernel returns. Then what the search finds depends on no clock, but for deadlines."""

_DECIDING_S = 0.2e-3
"""The same where it is looked at, besides, whether a signed distance decides a clearance."""

BEGIN_FIRST_S, _BEGIN_S = 2e-4, 1e-4
"""Seconds that it may take to begin a search: with less left, it waits for another call. The first
one of a call takes three times as long as the others, as the processor's caches do not hold what it
needs."""

END_S = 3e-5
"""Seconds that a call takes to end after it has searched for depths."""

_FAR = 8.0
"""At so many radii, the first volumes prove that two bodies are apart."""

_ASK_S, _MOST_ASKED = 1.0, 8
"""Budget of each question that is asked to compile what it needs; and how often it is asked at the
most, as a search has fewer stages whose kernels are compiled one after the other."""


class Single(NamedTuple):
    """A question about one pair."""

    key: Hashable
    """By which its search is kept: all that the answer depends on, or which bodies they are."""
    models: tuple[Model, Model]
    poses: NDArray[np.float64]
    """(2, 4, 4) model to world."""
    wanted: NDArray[np.float64]
    """(3,) rel_err, abs_err and clearance, as `Assembly.rows` takes them."""
    signed: bool
    """Whether the signed distance is asked for."""
    known: NDArray[np.float64] | None = None
    """(ANSWER,) of signed distances: what a search of the surfaces has found, if there was one."""


class LongSearches:
    """Searches of single pairs. Those that were not used for longest are forgotten first.

    Args:
        coherent: whether every search is kept, so that an answer helps the next about the same key;
            else those alone that a deadline cut, so that an answer depends on its question alone.
    """

    def __init__(self, coherent: bool) -> None:
        self._coherent = coherent
        self._kept: OrderedDict[Hashable, Pair] = OrderedDict()

    def resumed(
        self, keys: Callable[[int], Hashable], count: int, possible: Callable[[Hashable], bool]
    ) -> list[int]:
        """The questions of which a search is kept; those that no question resumes are forgotten.

        It is first asked of each whether that is `possible`: to make all keys takes far longer.
        """
        if not self._kept:
            return []
        self._kept = OrderedDict((key, each) for key, each in self._kept.items() if possible(key))
        found: dict[Hashable, int] = {}
        for k in range(count):
            if len(found) == len(self._kept):
                break
            if (key := keys(k)) in self._kept:
                found.setdefault(key, k)
        self._kept = OrderedDict((key, self._kept[key]) for key in found)
        return list(found.values())

    def resume(self, asked: Single) -> None:
        """Let the search about a signed distance count as one that is kept: it has not begun."""
        pair = self._kept[asked.key] = Pair(*asked.models)
        pair.signed_search().known = asked.known

    def prepare(
        self, asked: Single, depth_err: float, deadline: float
    ) -> NDArray[np.float64] | None:
        """Do a part of what it takes to begin a signed distance that is kept, if time is short.

        Returns what is known of it (ANSWER,), as that is work enough; or None if it has begun, or
        there is time until the deadline, of `perf_counter`: then `search` goes on.
        """
        if perf_counter() + _BEGIN_S < deadline:
            return None
        rel_err, abs_err, clearance = asked.wanted.tolist()
        tolerated = _tolerated(clearance, depth_err)
        search = self._kept[asked.key].signed_search()
        return search.prepare(*asked.poses, rel_err, abs_err, tolerated)

    def search(
        self,
        asked: Callable[[int], Single],
        count: int,
        depth_err: float,
        deadline: float,
        threads: int,
    ) -> NDArray[np.float64]:
        """Search pair by pair, in this order, as far as the deadline allows.

        A search that was cut goes on where it stopped. Some work is done on the first pair whatever
        the deadline.

        Args:
            asked: the questions, by number.
            count: how many there are.
            depth_err: as for `engine.signed_distance`; with a clearance only the side of it counts.
            deadline: of `perf_counter`, or infinity.
            threads: how many share the work.

        Returns:
            Rows (count, ANSWER), with NaN as status where the deadline came first.
        """
        rows = np.full((count, index.ANSWER), np.nan)
        kept, step = self._kept, 1 if self._coherent else _CHUNK
        threads = max(1, min(threads, count))
        longest = math.inf if threads == 1 else _SLICE_S

        def answer(first: int, stopped: Event) -> None:
            fresh = None
            for k in range(first, min(first + step, count)):
                if stopped.is_set() or (k and perf_counter() + _BEGIN_S >= deadline):
                    return
                each = asked(k)
                pair = kept.pop(each.key, None)
                if pair is None or (pair.a, pair.b) != each.models:
                    if fresh is None or (fresh.a, fresh.b) != each.models:
                        fresh = Pair(*each.models)
                    pair = fresh
                    if each.known is not None:
                        pair.signed_search().known = each.known
                rows[k], ended = _search(pair, each, depth_err, deadline, longest, stopped)
                if self._coherent or not ended:
                    kept[each.key] = pair
                    fresh = None

        share(answer, range(0, count, step), threads)
        while len(kept) > max(KEPT, threads):
            kept.popitem(last=False)
        return rows


def _search(
    pair: Pair,
    asked: Single,
    depth_err: float,
    deadline: float,
    longest: float,
    stopped: Event,
) -> tuple[NDArray[np.float64], bool]:
    """The row of an answer, and whether its search came to an end or decided the clearance."""
    rel_err, abs_err, clearance = asked.wanted.tolist()
    deciding = clearance < math.inf
    tolerated = _tolerated(clearance, depth_err)
    if deciding and asked.signed:
        longest = _DECIDING_S
    while True:
        now = perf_counter()
        left = max(deadline - now, 0.0)
        budget_s = None if min(left, longest) == math.inf else min(left, longest)
        if asked.signed:
            row = pair.signed_distance(
                *asked.poses, rel_err=rel_err, abs_err=abs_err, depth_err=tolerated,
                budget_s=budget_s,
            ).row  # fmt: skip
        elif deciding:
            row = pair.within(*asked.poses, clearance, budget_s=budget_s).row
        else:
            row = pair.distance(
                *asked.poses, rel_err=rel_err, abs_err=abs_err, budget_s=budget_s
            ).row
        if row[index.LOWER] > clearance or (deciding and row[index.UPPER] <= clearance):
            return row, True
        if row[index.STATUS] != index.OUT_OF_TIME:
            if not asked.signed or tolerated == depth_err:
                return row, True
            tolerated = depth_err  # only a larger ball is more than models deviate by
        if stopped.is_set() or perf_counter() >= deadline_of(now, left):
            return row, False


def _tolerated(clearance: float, depth_err: float) -> float:
    """What the depth may err by: models that overlap are nearer than any clearance."""
    return math.inf if clearance < math.inf else depth_err


def prepare(assembly: Assembly) -> None:
    """Run every kind of search once, those of an assembly's bodies too, to compile them."""
    models = assembly.models
    near, far = np.eye(4), np.eye(4)
    far[0, 3] = _FAR * max(float(np.linalg.norm(m.centre)) + m.radius for m in models)
    kinds = [model._hierarchy.tree_kind for model in models]
    apart = np.arange(len(models))[:, None, None] * (far - near) + near
    one_each = {
        (kinds[i], kinds[j]): (i, j) for i in range(len(models)) for j in range(i + 1, len(models))
    }
    of_all = {"clearance": 0.0, "signed": True, "budget_s": _ASK_S}
    for pair in one_each.values() or [(0, 0)]:
        _compile(assembly.distances, apart, [pair], **of_all)
    # One solid of meshes, one of surfaces and one of revolution, where there are any.
    solids = {solid_kind(m): m for m in reversed(models) if m.is_solid}
    chosen = next(iter(solids.values()), models[0])
    roughly = {"rel_err": 0.5, "budget_s": _ASK_S}
    _compile(Pair(chosen, chosen).distance, near, far, **roughly)
    # Depths have kernels of their own, for each pair of kinds, and those of surfaces others yet.
    surfaces = {k: m for k, m in zip(kinds, models, strict=True) if not m.is_solid}
    for solid, other in combinations_with_replacement(solids.values(), 2):
        pair = Pair(solid, other)
        _compile(pair.signed_distance, near, far, **roughly)
        _compile(pair.signed_distance, near, near, depth_err=math.inf, budget_s=_ASK_S)
    for solid, surface in product(solids.values(), surfaces.values()):
        ask = Pair(solid, surface).signed_distance
        _compile(ask, near, near, depth_err=math.inf, budget_s=_ASK_S)


def _compile(ask: Callable[..., object], *poses: object, **options: object) -> None:
    """Ask until nothing is compiled any more: that uses up a budget before all has been needed."""
    for _ in range(_MOST_ASKED):
        begun = perf_counter()
        ask(*poses, **options)
        if perf_counter() - begun < 2.0 * _ASK_S:
            break
