"""Distances of one pair of models at many poses, in one call."""

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
"""Poses that one thread answers in sequence. Each chunk starts without memory of earlier poses, so
the answers are the same for any number of threads."""


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
    """Return the minimum distances of two models at many poses.

    A search starts from the result at the pose before. So poses along a path are cheaper than the
    same poses shuffled.

    Args:
        a: first model.
        poses_a: (k, 4, 4) model to world, metres.
        b: second model.
        poses_b: (k, 4, 4) model to world, metres.
        rel_err: as for `distance`.
        abs_err: as for `distance`; metres.
        clearance: metres; as for `within`, a search ends as soon as it is certain on which side of
            the clearance the distance lies, and `Distances.within` tells which. With 0, as for
            `collide`, it ends when it is certain whether the models touch or cross. None: it goes
            on to the tolerance.
        signed: whether to return signed distances, as `signed_distance` does.
        depth_err: of signed distances, as for `signed_distance`.
        budget_s: seconds. Poses that are not reached have no answer, and those whose search is cut
            have certified bounds. The next call starts a cut search afresh; an `Assembly` would
            continue it. None: no limit. A few microseconds of work are always done.
        order: as for `distance`; for the study of searches. Signed distances are always searched
            depth first.
        threads: how many threads share the work. Their number changes no answer, only which poses a
            budget reaches.

    Raises:
        TypeError: a or b is no model, or a tolerance, clearance or budget is no real number.
        ValueError: an argument has another shape, a pose is no rigid motion (the message names it),
            a tolerance, clearance or budget is negative or NaN, or another order is given for
            signed distances.
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
        raise ValueError(f"poses_a has {count} poses, but poses_b has {len(many_b)}")
    check_model(a, "a")
    check_model(b, "b")
    earliest = Search(a, b, order)  # refuses an unknown order before any thread starts
    if signed and order != "depth_first":
        raise ValueError(f"order = {order!r}: must be 'depth_first' for signed distances")
    if signed and count:
        return _Poses((a,) * count + (b,) * count).distances(
            np.concatenate((many_a, many_b)), np.arange(2 * count).reshape(2, -1).T,
            rel_err=rel_err, abs_err=abs_err, clearance=clearance, signed=True,
            depth_err=depth_err, budget_s=budget_s, threads=threads,
        )  # fmt: skip
    rows = no_answers(count)
    # The same query as those of `within` and `collide`.
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
    """An assembly of 2 k bodies: the first model at k poses, then the second model at k poses."""

    def _pose_name(self, body: int) -> str:
        half = len(self.models) // 2
        return f"poses_{'ba'[body < half]}[{body % half}]"
