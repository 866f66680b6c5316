"""An assembly of many bodies, which finds the distances of many pairs in one call."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from itertools import chain
from operator import is_not
from threading import Event
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import as_count, as_integers, check_tolerance
from ..kernels.assembly.questions import QUERY_NUMBERS, begin_questions, signs_open
from ..kernels.base import state as index
from ..kernels.inside.contain import Insides, settle_signs
from ..kernels.surface.contain import MixedInsides
from ..models.hierarchy import Hierarchy
from ..models.model import Model
from ..models.solid import insides_of
from ..poses import as_poses, check_pose
from ..questions.result import Distances
from ..questions.run import Search, check_models
from ..questions.setup import bind
from ..questions.sharing import share
from ..questions.signed import HAND_OVER_S
from ..questions.slices import Run, Settle, answer_in_slices, deadline_of
from .answers import no_answers
from .long_searches import BEGIN_FIRST_S, LongSearches, Single
from .query import Query, checked_pairs, checked_tolerances
from .runs import Runs

_NO_HINTS = np.empty((0, 2), np.int32)


class Assembly:
    """Bodies whose distances are asked for together, tick by tick.

    One compiled call searches all pairs, so a pair costs only its search: a few microseconds. A
    call of `Pair` takes about as long again on top of its search. Only one thread may use an
    assembly at a time; its models may be shared. A copied or unpickled assembly has its own memory.

    Args:
        models: one per body; bodies may share one. The assembly notices when a model is deformed.

    Raises:
        TypeError: an element of `models` is no model.
        ValueError: `models` is empty.
    """

    def __init__(self, models: Sequence[Model]) -> None:
        self.models = check_models(models)
        if not self.models:
            raise ValueError("models: must not be empty; an assembly needs at least one body")
        self._shapes = tuple({id(model): model for model in self.models}.values())
        self._hierarchies: list[Hierarchy] = []
        self._deepest = max(self._shapes, key=lambda model: model._hierarchy.depth)
        self._searches: list[Search] = []
        self._insides: Insides | MixedInsides | None = None
        self._cut: dict[
            Hashable, Search
        ] = {}  # searches that were cut, by the keys of their queries
        self._depths = LongSearches(coherent=False)

    def __reduce__(self) -> tuple[type[Assembly], tuple[Any, ...]]:
        """Pickle the models alone: kernels use the memory of this assembly by its address."""
        return type(self), (self.models,)

    def replace(self, body: int, model: Model) -> None:
        """Give a body another model; hints of answers with the old model become invalid."""
        models = list(self.models)
        models[body] = model
        self.models = tuple(models)
        self._shapes = tuple({id(each): each for each in models}.values())
        self._hierarchies = []  # so that the tables are made again
        self._insides = None
        self._cut.clear()
        self._depths = LongSearches(coherent=False)
        self._deepest = max(self._shapes, key=lambda model: model._hierarchy.depth)
        self._searches.clear()  # their memory was allocated for the old models

    def distances(
        self,
        poses: ArrayLike,
        pairs: ArrayLike,
        *,
        rel_err: ArrayLike = 0.0,
        abs_err: ArrayLike = 0.0,
        clearance: ArrayLike | None = None,
        signed: bool = False,
        depth_err: float = 0.01,
        hints: NDArray[np.int32] | None = None,
        budget_s: float | None = None,
        threads: int = 1,
    ) -> Distances:
        """Return the minimum distances of pairs of bodies, searched in order, within a budget.

        If models are of several kinds, pairs are searched in blocks: the first 16, the next 16,
        then 32, 64 and so on. Within a block, they are grouped by kind. The first pair goes first.

        Args:
            poses: (n, 4, 4) model to world of every body, metres.
            pairs: (k, 2) the bodies' indices.
            rel_err: a number or (k,): as for `engine.distance`.
            abs_err: a number or (k,): as for `engine.distance`; metres.
            clearance: a number or (k,) metres: a pair's search ends as soon as it is certain on
                which side of the clearance the distance lies (Larsen et al. 1999, section 3,
                tolerance query): lower > clearance, or upper <= clearance to rounding.
                `Distances.within` tells the two apart. With 0, it tells which pairs collide. None
                or infinity: the search goes on to the tolerance.
            signed: whether to return signed distances, as `engine.signed_distance` does. Pairs that
                are apart then cost little more, overlapping ones about a millisecond. If `upper`
                has decided a clearance, `lower` may be -infinity.
            depth_err: of signed distances, as for `engine.signed_distance`.
            hints: (k, 2) the `hints` of an earlier answer about the same pairs, from which the
                search starts; -1 for none.
            budget_s: seconds. Pairs that are not reached have no answer, and the pair whose search
                is cut has certified bounds. Every call makes some progress. If the next call begins
                with the remaining pairs, it continues the cut search. None: no limit.
            threads: how many threads share the work. Their number changes no answer, only which
                pairs a budget reaches, and how tight the bounds of a signed distance are if a
                clearance ended its search.

        Raises:
            TypeError: a tolerance, clearance or budget is no real number.
            ValueError: an argument has another shape, a pair names no body, a pose of a pair is no
                rigid motion, or a tolerance, clearance or budget is negative or NaN.
        """
        start = perf_counter()
        deadline = deadline_of(start, budget_s)
        depth_err = check_tolerance("depth_err", depth_err)
        threads = as_count(threads, "threads")
        poses = as_poses(poses, "poses")
        if len(poses) != len(self.models):
            raise ValueError(
                f"poses: {len(poses)} poses for {len(self.models)} bodies; give one for each"
            )
        # If signed distances are asked for, only pairs with a solid have them.
        solid = np.array([model.is_solid if signed else False for model in self.models])
        chosen, of_solids = checked_pairs(pairs, solid)
        k = len(chosen)
        near = np.inf if clearance is None else clearance
        wanted = checked_tolerances({"rel_err": rel_err, "abs_err": abs_err, "clearance": near}, k)
        if hints is not None:
            hints = as_integers(hints, "hints", 2)
            if len(hints) != k:
                raise ValueError(f"hints: shape {hints.shape}, expected ({k}, 2)")
        query = Query(poses, chosen, wanted, hints, of_solids)
        if not signed:
            return Distances(self.rows(query, deadline, threads))
        return Distances(self._signed_rows(query, depth_err, deadline, threads))

    def rows(self, query: Query, deadline: float | None, threads: int) -> NDArray[np.float64]:
        """Do as `distances`, without checks; return rows (k, ANSWER) as the kernel writes them.

        A pair that is not searched has NaN as status. The deadline is a time of `perf_counter`.
        """
        count = len(query.pairs)
        threads = max(1, min(threads, count))
        self._tabulate(threads)
        if (entry := self._runs.only) is not None:
            runs = [[(entry, first, count)] for first in range(threads)]
            return self._answer(query, runs, deadline, threads)
        order, runs = self._runs.plan(query.pairs, threads, self._begun(query))
        found = np.empty((count, index.ANSWER))
        found[order] = self._answer(query.part(order), runs, deadline, threads)
        return found

    def _answer(
        self, query: Query, runs: list[list[Run]], deadline: float | None, threads: int
    ) -> NDArray[np.float64]:
        """Do as `rows`, given the runs of each thread."""
        for entry, *_ in chain.from_iterable(runs):
            bind(entry, self._runs.profile, deadline is not None)
        poses, pairs, wanted, hints, signed = query
        count = len(pairs)
        queries = np.empty(2 + count * QUERY_NUMBERS, np.int64)
        answers = np.empty((count, index.ANSWER))
        known = _NO_HINTS if hints is None else hints
        solids = begin_questions(pairs, wanted, known, signed, queries, answers)
        table = queries[:2].reshape(1, 2)
        searches = self._allot(threads, query)
        settle = self._settle_signs(query, solids, answers, threads)

        def answer(first: int, stopped: Event | None) -> None:
            search, fresh = searches[first]
            code, at = answer_in_slices(
                runs[first], self._tables, search.memory, fresh, poses, table, threads, deadline,
                stopped, answers, settle,
            )  # fmt: skip
            if code in (index.BAD_POSE_A, index.BAD_POSE_B):
                body = int(pairs[at, code - index.BAD_POSE_A])
                check_pose(poses[body], self._pose_name(body))
            if code == index.CUT:
                self._cut[self._key(query, at)] = search

        if threads == 1:
            answer(0, None)
        else:
            share(answer, range(threads), threads)
        return answers

    def _signed_rows(
        self, query: Query, depth_err: float, deadline: float | None, threads: int
    ) -> NDArray[np.float64]:
        """Do as `rows`, with the signed distances of bodies that may overlap, if time allows."""
        poses, pairs, wanted, _, signed = query
        if deadline is not None:
            deadline -= 2.0 * HAND_OVER_S  # as much again as for the answer about one pair

        def key(k: int) -> Hashable:
            return self._key(query, k), depth_err

        def unmoved(known: Any) -> bool:
            a, b, at_a, at_b = known[0][:4]
            return poses[a].tobytes() == at_a and poses[b].tobytes() == at_b

        def single(k: int) -> Single:
            models = tuple(self.models[body] for body in pairs[k].tolist())
            known = None if math.isnan(answers[k, index.STATUS]) else answers[k].copy()
            return Single(key(k), models, poses[pairs[k]], wanted[k], True, known)

        def depths(chosen: Sequence[int]) -> None:
            found = self._depths.search(
                lambda i: single(chosen[i]), len(chosen), depth_err, end, threads
            )
            reached = np.flatnonzero(~np.isnan(found[:, index.STATUS]))
            answers[np.asarray(chosen)[reached]] = found[reached]

        end = math.inf if deadline is None else deadline
        begun = self._depths.resumed(key, len(pairs), unmoved)
        if begun:
            answers = no_answers(len(pairs))
            answers[signed, index.LOWER] = -np.inf
        if 0 in begun:
            if (known := self._depths.prepare(single(0), depth_err, end)) is not None:
                answers[0] = known
                return answers
            depths([0])
            if perf_counter() >= end:
                return answers
        if begun:
            rest = np.ones(len(pairs), np.bool_)
            rest[begun] = False
            answers[rest] = self.rows(query.part(rest), deadline, threads)
        else:
            answers = self.rows(query, deadline, threads)
        in_time = perf_counter() + BEGIN_FIRST_S < end
        open_ = np.empty(len(answers) if in_time else min(len(answers), 1), np.bool_)
        count = signs_open(answers, wanted, open_)
        if in_time:
            chosen = {*begun, *(open_.nonzero()[0].tolist() if count else ())}
        else:  # the next call begins with the first pair's depth: every search ends
            chosen = {0} if count else set()
        if 0 in begun:
            chosen.discard(0)  # it was searched above
        # A search of the surfaces that was cut must end before that of the depth.
        left = [k for k in sorted(chosen) if not (self._cut and key(k)[0] in self._cut)]
        if left and in_time:
            depths(left)
        elif left:
            self._depths.resume(single(0))
        return answers

    def _pose_name(self, body: int) -> str:
        """Return the name of a body's pose in errors."""
        return f"poses[{body}]"

    def _tabulate(self, threads: int) -> None:
        """Make a search per thread, and the tables of the bodies' shapes if these have changed."""
        # The tables hold addresses into the hierarchies, so keep these very objects in memory.
        now = [model._hierarchy for model in self._shapes]
        if len(now) != len(self._hierarchies) or any(map(is_not, now, self._hierarchies)):
            self._tables = np.stack([model._hierarchy.table for model in self.models])
            self._hierarchies = now
            self._insides = None
            self._runs = Runs(self.models)
        while len(self._searches) < threads:
            both = (self._deepest,) * 2
            self._searches.append(Search(*both, coherent=False, among=self.models))

    def _key(self, query: Query, k: int) -> Hashable:
        """Return everything that the answer about a pair depends on, as a key."""
        a, b = query.pairs[k].tolist()
        models, poses = self.models, query.poses
        return (
            a, b, poses[a].tobytes(), poses[b].tobytes(), query.wanted[k].tobytes(),
            models[a].revision, models[b].revision,
        )  # fmt: skip

    def _allot(self, threads: int, query: Query) -> list[tuple[Search, bool]]:
        """Return a search for each thread, and whether the search starts fresh.

        A search that was cut continues if the thread's first query is the one it was cut in.
        """
        free, cut = self._searches[:], self._cut
        self._cut = {}
        found = []
        for k in range(min(threads, len(query.pairs)) if cut else 0):
            search = cut.get(self._key(query, k))
            found.append(search if search in free else None)
            if found[-1] is not None:
                free.remove(search)
        found += [None] * (threads - len(found))
        return [(free.pop(), True) if search is None else (search, False) for search in found]

    def _begun(self, query: Query) -> list[int]:
        """Return the indices of the pairs in whose queries searches were cut."""
        found = []
        for key in self._cut:
            (same,) = np.nonzero((query.pairs == key[:2]).all(axis=1))
            found += [k for k in same if self._key(query, k) == key]
        return found

    def _settle_signs(
        self, query: Query, solids: int, answers: NDArray[np.float64], stride: int
    ) -> Settle | None:
        """Return a function that turns a thread's answers into signed ones; None if no `solids`.

        `solids` is the number of answers to be signed. A thread has every `stride`-th answer.
        """
        if not solids:
            return None
        if self._insides is None:
            self._insides = insides_of(self.models)
        poses, pairs, wanted, _, signed = query
        insides, room = self._insides, 1 + 15 * self._deepest._hierarchy.depth
        progress = np.zeros((stride, 2, 2), np.int64)  # one per thread
        scratch = np.empty((stride, 2, 2, room), np.int32)

        def settle(first: int, last: int, steps: int) -> int:
            return settle_signs(
                insides, poses, pairs, wanted, signed, first, last, stride, steps,
                progress[first % stride], scratch[first % stride], answers,
            )  # fmt: skip

        return settle
