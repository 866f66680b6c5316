"""Searches that take long: pairs are searched one by one, and searches are kept between calls."""

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
from ..kernels.base.cache import KernelCache
from ..models.model import Model
from ..questions.ball import solid_kind
from ..questions.pair import Pair
from ..questions.sharing import share
from ..questions.slices import deadline_of

if TYPE_CHECKING:
    from .assembly import Assembly

KEPT = 64
"""How many searches are kept. Each takes some tens of kilobytes, more for solids."""

_CHUNK = 64
"""Pairs that one thread answers in sequence. Each chunk starts without memory of earlier pairs, so
the answers are the same for any number of threads."""

_SLICE_S = 0.02
"""Seconds between two checks for Ctrl-C by one of several threads. A single thread needs no slices,
as it hears Ctrl-C whenever a kernel returns. So its result depends on no clock but a deadline."""

_DECIDING_S = 0.2e-3
"""Seconds between two checks whether the bounds of a signed distance decide a clearance."""

BEGIN_FIRST_S, _BEGIN_S = 2e-4, 1e-4
"""Seconds that a search may take to begin: the first search of a call, and each later one. If less
time is left, the search waits for another call. The first one takes three times as long, because
the processor's caches do not hold what it needs."""

_FAR = 8.0
"""At a distance of this many radii, the first bounding volumes prove that two bodies are apart."""

_ASK_S, _MOST_ASKED = 1.0, 8
"""Budget (seconds) of a query that is asked to compile its kernels, and how often it is asked at
most. A search has fewer stages whose kernels are compiled one after the other."""


class Single(NamedTuple):
    """A query about one pair."""

    key: Hashable
    """The key under which the search is kept: all that the answer depends on, or the bodies."""
    models: tuple[Model, Model]
    poses: NDArray[np.float64]
    """(2, 4, 4) model to world."""
    wanted: NDArray[np.float64]
    """(3,) rel_err, abs_err and clearance, as `Assembly.rows` takes them."""
    signed: bool
    """Whether the signed distance is asked for."""
    known: NDArray[np.float64] | None = None
    """(ANSWER,) for a signed distance: the answer of an earlier search of the surfaces, if any."""


class LongSearches:
    """Searches of single pairs. The least recently used ones are forgotten first.

    Args:
        coherent: True: every search is kept, so that an answer speeds up the next one with the same
            key. False: only searches that a deadline cut are kept, so that an answer depends only
            on its query.
    """

    def __init__(self, coherent: bool) -> None:
        self._coherent = coherent
        self._kept: OrderedDict[Hashable, Pair] = OrderedDict()

    def resumed(
        self, keys: Callable[[int], Hashable], count: int, possible: Callable[[Hashable], bool]
    ) -> list[int]:
        """Return the numbers of the queries whose search is kept; forget all other searches.

        `keys` makes the key of a query. `possible` first discards kept keys that no query can
        have, because making the keys of all queries takes far longer.
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

    def resume(self, query: Single) -> None:
        """Keep a search of a signed distance that has not begun, for the next call to begin it."""
        pair = self._kept[query.key] = Pair(*query.models)
        pair.signed_search().known = query.known

    def prepare(
        self, query: Single, depth_err: float, deadline: float
    ) -> NDArray[np.float64] | None:
        """If time is short, do a part of the work of beginning a kept search of a signed distance.

        Return the known answer (ANSWER,) if a part was done: that is work enough for this call.
        Return None if the search has begun, or there is time until the deadline (of
        `perf_counter`): then call `search`.
        """
        if perf_counter() + BEGIN_FIRST_S < deadline:
            return None
        rel_err, abs_err, clearance = query.wanted.tolist()
        tolerated = _tolerated(clearance, depth_err)
        search = self._kept[query.key].signed_search()
        return search.prepare(*query.poses, rel_err, abs_err, tolerated)

    def search(
        self,
        query: Callable[[int], Single],
        count: int,
        depth_err: float,
        deadline: float,
        threads: int,
    ) -> NDArray[np.float64]:
        """Search pair by pair, in order, until the deadline.

        A search that was cut continues where it stopped. Some work is always done on the first
        pair, even after the deadline.

        Args:
            query: returns a query by its number.
            count: the number of queries.
            depth_err: as for `engine.signed_distance`. With a clearance, a search ends as soon as
                its side is certain.
            deadline: a time of `perf_counter`, or infinity.
            threads: how many threads share the work.

        Returns:
            Rows (count, ANSWER). The status is NaN if the deadline came before the search.
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
                each = query(k)
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
    query: Single,
    depth_err: float,
    deadline: float,
    longest: float,
    stopped: Event,
) -> tuple[NDArray[np.float64], bool]:
    """Return the row of an answer, and whether its search ended or decided the clearance."""
    rel_err, abs_err, clearance = query.wanted.tolist()
    deciding = clearance < math.inf
    tolerated = _tolerated(clearance, depth_err)
    if deciding and query.signed:
        longest = _DECIDING_S
    while True:
        now = perf_counter()
        left = max(deadline - now, 0.0)
        budget_s = None if min(left, longest) == math.inf else min(left, longest)
        if query.signed:
            row = pair.signed_distance(
                *query.poses, rel_err=rel_err, abs_err=abs_err, depth_err=tolerated,
                budget_s=budget_s,
            ).row  # fmt: skip
        elif deciding:
            row = pair.within(*query.poses, clearance, budget_s=budget_s).row
        else:
            row = pair.distance(
                *query.poses, rel_err=rel_err, abs_err=abs_err, budget_s=budget_s
            ).row
        if row[index.LOWER] > clearance or (deciding and row[index.UPPER] <= clearance):
            return row, True
        if row[index.STATUS] != index.OUT_OF_TIME:
            if not query.signed or tolerated == depth_err:
                return row, True
            tolerated = depth_err  # the ball found is within the deviations: look for a larger one
        if stopped.is_set() or perf_counter() >= deadline_of(now, left):
            return row, False


def _tolerated(clearance: float, depth_err: float) -> float:
    """Return the tolerance of the depth: infinite if any overlap decides the clearance."""
    return math.inf if clearance < math.inf else depth_err


def prepare(assembly: Assembly) -> None:
    """Run every kind of search that an assembly's bodies need once, to compile it."""
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
    # One solid of each kind that the bodies have: of a mesh, of surfaces, of revolution.
    solids = {solid_kind(m): m for m in reversed(models) if m.is_solid}
    chosen = next(iter(solids.values()), models[0])
    roughly = {"rel_err": 0.5, "budget_s": _ASK_S}
    _compile(Pair(chosen, chosen).distance, near, far, **roughly)
    # Searches for depths have their own kernels for each pair of kinds of solids, and others for
    # each pair of a solid and a surface.
    surfaces = {k: m for k, m in zip(kinds, models, strict=True) if not m.is_solid}
    for solid, other in combinations_with_replacement(solids.values(), 2):
        pair = Pair(solid, other)
        _compile(pair.signed_distance, near, far, **roughly)
        _compile(pair.signed_distance, near, near, depth_err=math.inf, budget_s=_ASK_S)
    for solid, surface in product(solids.values(), surfaces.values()):
        ask = Pair(solid, surface).signed_distance
        _compile(ask, near, near, depth_err=math.inf, budget_s=_ASK_S)


def _compile(ask: Callable[..., object], *poses: object, **options: object) -> None:
    """Ask until all kernels that the query needs are there.

    Compiling uses up the budget before the query needs all of them, so ask it again.
    """
    for _ in range(_MOST_ASKED):
        before = KernelCache.obtained
        ask(*poses, **options)
        if KernelCache.obtained == before:
            break
