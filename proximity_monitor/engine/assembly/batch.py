"""One pair of models at many poses, in one call."""

from __future__ import annotations

import math
from threading import Event
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import as_count, check_tolerance
from ..models.model import Model
from ..poses import as_poses
from ..questions.result import Distances
from ..questions.run import Order, Search, check_model
from ..questions.sharing import share
from ..questions.slices import deadline_of
from .answers import no_answers
from .assembly import Assembly

_CHUNK = 256
"""Poses that one thread answers in a row. Each chunk starts without a remembered pair, so the
answers are the same however many threads there are."""


def distances(
    a: Model,
    poses_a: ArrayLike,
    b: Model,
    poses_b: ArrayLike,
    *,
    rel_err: float = 0.0,
    abs_err: float = 0.0,
    clearance: float | None = None,
    signed: bool = False,
    depth_err: float = 0.01,
    budget_s: float | None = None,
    order: Order = "depth_first",
    threads: int = 1,
) -> Distances:
    """Minimum distances at many poses, in one call.

    Successive poses help each other, so a path is cheaper than the same poses shuffled.

    Args:
        a: first model.
        poses_a: (k, 4, 4) model to world, metres.
        b: second model.
        poses_b: (k, 4, 4) model to world, metres.
        rel_err: as for `distance`.
        abs_err: as for `distance`; metres.
        clearance: metres; as `within`, a search ends as soon as it is certain on which side of it
            the distance lies, and `Distances.within` tells. With 0, as `collide`, it ends when it
            is certain whether the models touch or cross. None: it goes on.
        signed: whether to give signed distances, as `signed_distance` does.
        depth_err: of signed distances, as for `signed_distance`.
        budget_s: seconds; poses that are not reached have no answer, and those that are cut have
            certified bounds. The next call begins these anew, where an `Assembly` would go on.
            None: no limit. Some microseconds' work is always done.
        order: as for `distance`; for the study of searches. Signed distances are always searched
            depth first.
        threads: how many threads share the work. They change no answer, only which poses a budget
            reaches.

    Raises:
        TypeError: a model that is none, a tolerance, clearance or budget that is no real number.
        ValueError: other shapes, a pose that is no rigid motion (naming it), a tolerance, clearance
            or budget that is negative or NaN, another order of signed distances.
    """
    start = perf_counter()
    rel_err = check_tolerance("rel_err", rel_err)
    abs_err = check_tolerance("abs_err", abs_err)
    clearance = math.inf if clearance is None else check_tolerance("clearance", clearance)
    deadline = deadline_of(start, budget_s)
    threads = as_count(threads, "threads")
    many_a, many_b = as_poses(poses_a, "poses_a"), as_poses(poses_b, "poses_b")
    count = len(many_a)
    if count != len(many_b):
        raise ValueError(f"{count} poses_a but {len(many_b)} poses_b")
    check_model(a, "a")
    check_model(b, "b")
    earliest = Search(a, b, order)  # refuses an unknown order before any thread starts
    if signed and order != "depth_first":
        raise ValueError(f"order = {order!r}: signed distances are searched 'depth_first' alone")
    if signed and count:
        return _Poses((a,) * count + (b,) * count).distances(
            np.concatenate((many_a, many_b)), np.arange(2 * count).reshape(2, -1).T,
            rel_err=rel_err, abs_err=abs_err, clearance=clearance, signed=True,
            depth_err=depth_err, budget_s=budget_s, threads=threads,
        )  # fmt: skip
    rows = no_answers(count)
    # As `within` and `collide` ask it.
    stop = 0.0 if clearance == math.inf else clearance
    limit = math.nextafter(clearance, math.inf)

    def answer(first: int, stopped: Event) -> None:
        if first and deadline is not None and perf_counter() >= deadline:
            return
        part = slice(first, first + _CHUNK)
        search = Search(a, b, order) if first else earliest
        search.run(
            many_a[part].reshape(-1, 4), many_b[part].reshape(-1, 4),
            rel_err=rel_err, abs_err=abs_err, stop=stop, limit=limit, deadline=deadline,
            first=first, stopped=stopped, answers=rows[part],
        )  # fmt: skip

    share(answer, range(0, count, _CHUNK), threads)
    return Distances(rows)


class _Poses(Assembly):
    """One body at k poses and then another one at k poses: 2 k bodies."""

    def _pose_name(self, body: int) -> str:
        half = len(self.models) // 2
        return f"poses_{'ba'[body < half]}[{body % half}]"
