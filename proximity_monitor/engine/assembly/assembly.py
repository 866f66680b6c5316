"""Many bodies, and the distances of many pairs of them in one call."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
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
from ..questions.sharing import share
from ..questions.slices import Run, Settle, answer_in_slices, deadline_of
from .answers import no_answers
from .asked import Asked, checked_pairs, checked_tolerances
from .long_searches import BEGIN_FIRST_S, END_S, LongSearches, Single
from .runs import Runs

_NO_HINTS = np.empty((0, 2), np.int32)


class Assembly:
    """Bodies whose distances are asked for together, tick by tick.

    One compiled call goes through all pairs, so a pair costs no more than its search: some
    microseconds, to which a `Pair` adds as much again. An assembly belongs to one thread at a time;
    its models may be shared. A copy, and what comes out of a pickle, has memory of its own.

    Args:
        models: one a body; bodies may share one. A model that is deformed later is seen anew.

    Raises:
        TypeError: one that is no model.
        ValueError: there are none.
    """

    def __init__(self, models: Sequence[Model]) -> None:
        self.models = check_models(models)
        if not self.models:
            raise ValueError("models: there are none; an assembly needs at least one body")
        self._shapes = tuple({id(model): model for model in self.models}.values())
        self._hierarchies: list[Hierarchy] = []
        self._deepest = max(self._shapes, key=lambda model: model._hierarchy.depth)
        self._searches: list[Search] = []
        self._insides: Insides | MixedInsides | None = None
        self._cut: dict[Hashable, Search] = {}  # by the question that they were asked
        self._depths = LongSearches(coherent=False)

    def __reduce__(self) -> tuple[type[Assembly], tuple[Any, ...]]:
        """Make another one: kernels find the memory of this one by its addresses."""
        return type(self), (self.models,)

    def replace(self, body: int, model: Model) -> None:
        """Give a body another model; hints of answers with the old one are void."""
        models = list(self.models)
        models[body] = model
        self.models = tuple(models)
        self._shapes = tuple({id(each): each for each in models}.values())
        self._hierarchies = []  # the tables are made anew
        self._insides = None
        self._cut.clear()
        self._depths = LongSearches(coherent=False)
        self._deepest = max(self._shapes, key=lambda model: model._hierarchy.depth)
        self._searches.clear()  # their memory is that for the models before

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
        """Minimum distances of pairs of bodies, in the given order, within a budget.

        Where models are of several kinds, pairs that follow each other take turns by kind: the
        first 16, the next 16, then 32, 64 and so on. The first pair goes first.

        Args:
            poses: (n, 4, 4) model to world of every body, metres.
            pairs: (k, 2) which bodies.
            rel_err: a number or (k,): as for `engine.distance`.
            abs_err: a number or (k,): as for `engine.distance`; metres.
            clearance: a number or (k,) metres: a pair's search ends as soon as it is certain on
                which side of it the distance lies (Larsen et al. 1999, section 3, tolerance query):
                lower > clearance, or upper <= clearance to rounding; `Distances.within` tells them
                apart. With 0 they tell which pairs collide. None or infinity: it goes on.
            signed: whether to give signed distances, as `engine.signed_distance` does. Pairs that
                are apart then cost little more, overlapping ones about a millisecond. If `upper`
                has decided about a clearance, `lower` may be -infinity.
            depth_err: of signed distances, as for `engine.signed_distance`.
            hints: (k, 2) `hints` of an earlier answer about the same pairs, from which the
                search starts; -1 for none.
            budget_s: seconds; pairs that are not reached have no answer, and the one that is cut
                has certified bounds. Every call makes some progress: if the next call begins with
                the pairs that are left, it goes on where it was cut. None: no limit.
            threads: how many share the work. They change no answer, only which pairs a budget
                reaches, and how close the bounds of a signed distance are if a clearance ended its
                search.

        Raises:
            TypeError: a tolerance, clearance or budget that is no real number.
            ValueError: other shapes, a pair that names no body, a pose of a pair that is no rigid
                motion, a tolerance, clearance or budget that is negative or NaN.
        """
        start = perf_counter()
        deadline = deadline_of(start, budget_s)
        depth_err = check_tolerance("depth_err", depth_err)
        threads = as_count(threads, "threads")
        poses = as_poses(poses, "poses")
        if len(poses) != len(self.models):
            raise ValueError(f"{len(poses)} poses of {len(self.models)} bodies")
        # Where signed distances are asked for, they are those of pairs with a solid.
        solid = np.array([model.is_solid if signed else False for model in self.models])
        chosen, of_solids = checked_pairs(pairs, solid)
        k = len(chosen)
        near = np.inf if clearance is None else clearance
        wanted = checked_tolerances({"rel_err": rel_err, "abs_err": abs_err, "clearance": near}, k)
        if hints is not None:
            hints = as_integers(hints, "hints", 2)
            if len(hints) != k:
                raise ValueError(f"hints: shape {hints.shape}, expected ({k}, 2)")
        asked = Asked(poses, chosen, wanted, hints, of_solids)
        if not signed:
            return Distances(self.rows(asked, deadline, threads))
        return Distances(self._signed_rows(asked, depth_err, deadline, threads))

    def rows(self, asked: Asked, deadline: float | None, threads: int) -> NDArray[np.float64]:
        """As `distances` without checks; returns rows (k, ANSWER) as the kernel writes them.

        A pair that is not searched has NaN as status. The deadline is one of perf_counter.
        """
        count = len(asked.pairs)
        threads = max(1, min(threads, count))
        self._tabulate(threads)
        if (entry := self._runs.only) is not None:
            runs = [[(entry, first, count)] for first in range(threads)]
            return self._answer(asked, runs, deadline, threads)
        order, runs = self._runs.plan(asked.pairs, threads, self._begun(asked))
        found = np.empty((count, index.ANSWER))
        found[order] = self._answer(asked.part(order), runs, deadline, threads)
        return found

    def _answer(
        self, asked: Asked, runs: list[list[Run]], deadline: float | None, threads: int
    ) -> NDArray[np.float64]:
        """As `rows`, in runs for each thread."""
        poses, pairs, wanted, hints, signed = asked
        count = len(pairs)
        queries = np.empty(2 + count * QUERY_NUMBERS, np.int64)
        answers = np.empty((count, index.ANSWER))
        known = _NO_HINTS if hints is None else hints
        solids = begin_questions(pairs, wanted, known, signed, queries, answers)
        table = queries[:2].reshape(1, 2)
        searches = self._allot(threads, asked)
        settle = self._settle_signs(asked, solids, answers, threads)

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
                self._cut[self._question(asked, at)] = search

        if threads == 1:
            answer(0, None)
        else:
            share(answer, range(threads), threads)
        return answers

    def _signed_rows(
        self, asked: Asked, depth_err: float, deadline: float | None, threads: int
    ) -> NDArray[np.float64]:
        """As `rows`, with the signed distances of bodies that may overlap, as far as time goes."""
        poses, pairs, wanted, _, signed = asked

        def question(k: int) -> Hashable:
            return self._question(asked, k), depth_err

        def unmoved(known: Any) -> bool:
            a, b, at_a, at_b = known[0][:4]
            return poses[a].tobytes() == at_a and poses[b].tobytes() == at_b

        def single(k: int) -> Single:
            models = tuple(self.models[body] for body in pairs[k].tolist())
            known = None if math.isnan(answers[k, index.STATUS]) else answers[k].copy()
            return Single(question(k), models, poses[pairs[k]], wanted[k], True, known)

        def depths(chosen: Sequence[int] | NDArray[np.int64]) -> None:
            found = self._depths.search(
                lambda i: single(chosen[i]), len(chosen), depth_err, end - END_S, threads
            )
            reached = np.flatnonzero(~np.isnan(found[:, index.STATUS]))
            answers[np.asarray(chosen)[reached]] = found[reached]

        end = math.inf if deadline is None else deadline
        begun = self._depths.resumed(question, len(pairs), unmoved)
        if begun:
            answers = no_answers(len(pairs))
            answers[signed, index.LOWER] = -np.inf
        if 0 in begun:
            if (known := self._depths.prepare(single(0), depth_err, end)) is not None:
                answers[0] = known
                return answers
            depths([0])
            if perf_counter() + END_S >= end:
                return answers
        if begun:
            rest = np.ones(len(pairs), np.bool_)
            rest[begun] = False
            answers[rest] = self.rows(asked.part(rest), deadline, threads)
        else:
            answers = self.rows(asked, deadline, threads)
        in_time = perf_counter() + BEGIN_FIRST_S < end
        open_ = np.empty(len(answers) if in_time else min(len(answers), 1), np.bool_)
        count = signs_open(answers, wanted, open_)
        if not (count or begun):
            return answers
        if begun:
            open_[[k for k in begun if k < len(open_)]] = True
        if self._cut:  # there the search of the surfaces must end first
            open_ &= [not (each and question(k)[0] in self._cut) for k, each in enumerate(open_)]
        open_[:1] &= 0 not in begun
        (chosen,) = open_.nonzero()
        if in_time and len(chosen):
            depths(chosen)
        elif len(chosen):  # the next call begins with it, so that all come to an end
            self._depths.resume(single(0))
        return answers

    def _pose_name(self, body: int) -> str:
        """The name of a body's pose in errors."""
        return f"poses[{body}]"

    def _tabulate(self, threads: int) -> None:
        """Make the tables of all bodies as they are now, and a search for each thread."""
        # Of the very hierarchies that the tables hold addresses of, which so stay in memory.
        now = [model._hierarchy for model in self._shapes]
        if len(now) != len(self._hierarchies) or any(map(is_not, now, self._hierarchies)):
            self._tables = np.stack([model._hierarchy.table for model in self.models])
            self._hierarchies = now
            self._insides = None
            self._runs = Runs(self.models)
        while len(self._searches) < threads:
            both = (self._deepest,) * 2
            self._searches.append(Search(*both, coherent=False, among=self.models))

    def _question(self, asked: Asked, k: int) -> Hashable:
        """Everything that the answer about a pair depends on."""
        a, b = asked.pairs[k].tolist()
        models, poses = self.models, asked.poses
        return (
            a, b, poses[a].tobytes(), poses[b].tobytes(), asked.wanted[k].tobytes(),
            models[a].revision, models[b].revision,
        )  # fmt: skip

    def _allot(self, threads: int, asked: Asked) -> list[tuple[Search, bool]]:
        """A search for each thread, and whether it begins anew.

        It goes on where it was cut if the thread's first question is the one that it was cut in.
        """
        free, cut = self._searches[:], self._cut
        self._cut = {}
        found = []
        for k in range(min(threads, len(asked.pairs)) if cut else 0):
            search = cut.get(self._question(asked, k))
            found.append(search if search in free else None)
            if found[-1] is not None:
                free.remove(search)
        found += [None] * (threads - len(found))
        return [(free.pop(), True) if search is None else (search, False) for search in found]

    def _begun(self, asked: Asked) -> list[int]:
        """The questions that searches were cut in."""
        found = []
        for question in self._cut:
            (same,) = np.nonzero((asked.pairs == question[:2]).all(axis=1))
            found += [k for k in same if self._question(asked, k) == question]
        return found

    def _settle_signs(
        self, asked: Asked, solids: int, answers: NDArray[np.float64], every: int
    ) -> Settle | None:
        """What makes every so many answers signed ones, if `solids` of them are to be."""
        if not solids:
            return None
        if self._insides is None:
            self._insides = insides_of(self.models)
        poses, pairs, wanted, _, signed = asked
        insides, room = self._insides, 1 + 15 * self._deepest._hierarchy.depth
        progress = np.zeros((every, 2, 2), np.int64)  # for each thread
        scratch = np.empty((every, 2, 2, room), np.int32)

        def settle(first: int, last: int, steps: int) -> int:
            return settle_signs(
                insides, poses, pairs, wanted, signed, first, last, every, steps,
                progress[first % every], scratch[first % every], answers,
            )  # fmt: skip

        return settle
