"""Many bodies, and the distances of many pairs of them in one call."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from operator import is_not
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .kernels import search as kernel
from .kernels import state as index
from .kernels.state import Tree
from .mesh import TriangleMesh
from .poses import as_poses, check_pose
from .result import PairDistances
from .rows import pair_distances_of
from .run import LONG_SLICE, SLICE, Search, check_tolerance, code_for


class Assembly:
    """Bodies whose distances are asked for together, tick by tick.

    A compiled call goes through the pairs, so that a pair costs no more than its search: some
    microseconds, where a `Pair` costs as much again on top. It belongs to one thread at a time; the
    models may be shared.

    Args:
        models: one mesh a body; bodies may share one. A mesh that is refitted later is seen anew.

    Raises:
        ValueError: there are none.
    """

    def __init__(self, models: Sequence[TriangleMesh]) -> None:
        self.models = tuple(models)
        if not self.models:
            raise ValueError("models: there are none; an assembly needs at least one body")
        self._meshes = tuple({id(model): model for model in self.models}.values())
        self._trees: list[Tree] = []
        self._deepest = max(self._meshes, key=lambda model: model.depth)
        self._searches: list[Search] = []
        self._unusual = code_for(self._meshes)

    def replace(self, body: int, model: TriangleMesh) -> None:
        """Give a body another model; what was found with the old one is no hint any more."""
        models = list(self.models)
        models[body] = model
        self.models = tuple(models)
        self._meshes = tuple({id(each): each for each in models}.values())
        self._unusual = code_for(self._meshes)
        self._trees = []  # the tables are made anew
        if model.depth > self._deepest.depth:
            self._deepest = model
            self._searches.clear()

    def distances(
        self,
        poses: ArrayLike,
        pairs: ArrayLike,
        *,
        rel_err: ArrayLike = 0.0,
        abs_err: ArrayLike = 0.0,
        clearance: ArrayLike | None = None,
        hints: NDArray[np.int32] | None = None,
        budget_s: float | None = None,
        threads: int = 1,
    ) -> PairDistances:
        """Minimum distances of pairs of bodies, in the order given, as far as the budget goes.

        Args:
            poses: (n, 4, 4) model to world of every body, metres.
            pairs: (k, 2) which bodies.
            rel_err: a number or (k,): as for `engine.distance`.
            abs_err: a number or (k,): as for `engine.distance`; metres.
            clearance: a number or (k,) metres: a pair's search ends as soon as it is certain on
                which side of it the distance lies (Larsen et al. 1999, section 3, tolerance
                query): lower > clearance, or upper <= clearance to rounding. None or infinity: it
                goes on.
            hints: (k, 2) `triangles` of an earlier answer about the same pairs, from which the
                search starts; -1 for none.
            budget_s: seconds; pairs that are not reached stay without an answer, the one that is
                cut has certified bounds. None: no limit.
            threads: how many share the work; the answers do not depend on it, but for which of
                them a budget allows.

        Raises:
            ValueError: other shapes, a pair that names no body, a pose of a pair that is no rigid
                motion, a tolerance, clearance or budget that is negative or NaN.
        """
        if budget_s is not None:
            check_tolerance("budget_s", budget_s)
        if threads < 1:
            raise ValueError(f"threads = {threads}: must be at least 1")
        poses = as_poses(poses, "poses")
        if len(poses) != len(self.models):
            raise ValueError(f"{len(poses)} poses of {len(self.models)} bodies")
        chosen = self._checked_pairs(pairs)
        k = len(chosen)
        wanted = np.empty((k, 3))
        tolerances = rel_err, abs_err, np.inf if clearance is None else clearance
        for column, (name, value) in enumerate(
            zip(("rel_err", "abs_err", "clearance"), tolerances, strict=True)
        ):
            wanted[:, column] = value
            if not (wanted[:, column] >= 0.0).all():
                first = int(np.flatnonzero(~(wanted[:, column] >= 0.0))[0])
                check_tolerance(f"{name}[{first}]", float(wanted[first, column]))
        if hints is None:
            hints = np.full((k, 2), -1, np.int32)
        hints = np.require(hints, np.int32, "CAW")  # read-only ones would be compiled for anew
        if hints.shape != (k, 2):
            raise ValueError(f"hints: shape {hints.shape}, expected ({k}, 2)")
        return pair_distances_of(self.rows(poses, chosen, wanted, hints, budget_s, threads))

    def rows(
        self,
        poses: NDArray[np.float64],
        pairs: NDArray[np.int32],
        wanted: NDArray[np.float64],
        hints: NDArray[np.int32],
        budget_s: float | None,
        threads: int,
    ) -> NDArray[np.float64]:
        """As `distances`, of what needs no check; rows (k, ANSWER) as the kernel writes them.

        wanted (k, 3) is rel_err, abs_err and clearance. A pair that is not searched has NaN as
        status.
        """
        deadline = None if budget_s is None else perf_counter() + budget_s
        answers = np.full((len(pairs), index.ANSWER), np.nan)
        answers[:, index.LOWER], answers[:, index.UPPER] = 0.0, np.inf
        threads = max(1, min(threads, len(pairs)))
        self._tabulate(threads)
        if threads == 1:
            self._run(0, 1, poses, pairs, hints, wanted, deadline, answers)
            return answers

        def answer(first: int) -> None:
            self._run(first, threads, poses, pairs, hints, wanted, deadline, answers)

        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(answer, range(threads)))
        return answers

    def _checked_pairs(self, pairs: ArrayLike) -> NDArray[np.int32]:
        given = np.asarray(pairs)
        if given.size == 0:
            return np.empty((0, 2), np.int32)
        if given.ndim != 2 or given.shape[1] != 2 or given.dtype.kind not in "iu":
            raise ValueError(f"pairs: {given.dtype} {given.shape}, expected integers (k, 2)")
        bad = ((given < 0) | (given >= len(self.models))).any(axis=1)
        if bad.any():
            first = int(np.flatnonzero(bad)[0])
            raise ValueError(
                f"pairs[{first}] = {given[first].tolist()}: there are {len(self.models)} bodies, "
                "numbered from 0"
            )
        return np.ascontiguousarray(given, np.int32)

    def _tabulate(self, threads: int) -> None:
        """Have the tables of all bodies as they are now, and a search for each thread."""
        # Of the very hierarchies that the tables hold addresses of, which so stay in memory.
        trees = [mesh._tree for mesh in self._meshes]
        if len(trees) != len(self._trees) or any(map(is_not, trees, self._trees)):
            self._tables = np.stack([model._table for model in self.models])
            self._trees = trees
        while len(self._searches) < threads:
            self._searches.append(Search(self._deepest, self._deepest, coherent=False))

    def _run(
        self,
        first: int,
        every: int,
        poses: NDArray[np.float64],
        pairs: NDArray[np.int32],
        hints: NDArray[np.int32],
        wanted: NDArray[np.float64],
        deadline: float | None,
        answers: NDArray[np.float64],
    ) -> None:
        """Answer for every so many of the pairs from the first on, into `answers`."""
        search = self._searches[first]
        at, fresh = first, True
        while deadline is None or perf_counter() < deadline:
            code, at = kernel.search_pairs(
                self._tables, search.memory, poses, pairs, hints, wanted, at, len(pairs), every,
                LONG_SLICE if deadline is None else SLICE, fresh, answers, self._unusual,
            )  # fmt: skip
            fresh = code == index.CUT_BETWEEN
            if code in (index.BAD_POSE_A, index.BAD_POSE_B):
                body = int(pairs[at, code - index.BAD_POSE_A])
                check_pose(poses[body], f"poses[{body}]")
            if code == index.ENDED:
                break
