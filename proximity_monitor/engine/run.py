"""Running the search kernel from Python: its memory, its slices, the clock."""

from __future__ import annotations

import math
from time import perf_counter
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .kernels import search as kernel
from .kernels import state as index
from .kernels.queue import QUEUE
from .mesh import TriangleMesh
from .poses import check_pose

Order = Literal["depth_first", "priority"]
"""In which order a search visits pairs of volumes; the answer is the same."""

_ORDERS = {"depth_first": index.DEPTH_FIRST, "priority": index.PRIORITY}

_SLICE = 256
"""Steps between two looks at the clock, some 30 µs: what a budget may be overrun by. With 64 a
search under a budget takes half as long again."""

_LONG_SLICE = 1 << 18
"""Steps between two returns to Python where there is no budget, so that Ctrl-C is heard."""


class Search:
    """The memory of a search over two models, and of its answers to so many questions.

    Args:
        a: first model.
        b: second model.
        order: in which order pairs of volumes are visited.
        rows: how many poses are asked about in one run.

    Raises:
        ValueError: there is no such order.
    """

    __slots__ = ("_models", "answers", "counts", "order", "reals", "state", "tests", "triangles")

    def __init__(
        self, a: TriangleMesh, b: TriangleMesh, order: Order = "depth_first", rows: int = 1
    ) -> None:
        if order not in _ORDERS:
            raise ValueError(f"order = {order!r}: known are {', '.join(map(repr, _ORDERS))}")
        self._models = a, b
        self.order = order
        # Opening a volume replaces one pair by at most sixteen, once for each level of either
        # model; a priority queue that is full besides leaves all its pairs below.
        levels = a.depth + b.depth
        capacity = 1 + levels * (15 if order == "depth_first" else 15 + QUEUE)
        self.reals = np.zeros(index.REALS)
        self.counts = np.zeros(index.COUNTS, np.int64)
        self.counts[index.ORDER] = _ORDERS[order]
        self.state = index.State(
            np.zeros((2, 12)),
            self.reals,
            self.counts,
            np.zeros((capacity, 2), np.int32),
            np.zeros(capacity),
            np.zeros(levels + 1, np.int64),
            np.zeros((0, 2), np.int32),
        )
        self.answers = np.empty((rows, index.ANSWER))
        self.triangles = np.empty((rows, 2), np.int32)
        self.tests = np.empty((rows, 2), np.int64)

    def run(
        self,
        poses_a: NDArray[np.float64],
        poses_b: NDArray[np.float64],
        *,
        rel_err: float = 0.0,
        abs_err: float = 0.0,
        stop: float = 0.0,
        limit: float = math.inf,
        deadline: float | None = None,
        fresh: bool = True,
        first: int | None = None,
    ) -> int:
        """Answer at poses (rows, 4, 4), into `answers`, `triangles` and `tests`.

        Goes on with the search of the last run where not `fresh`. `first` is the number of the
        first pose among many, for messages about one of them. Returns ENDED, CUT where the
        deadline (of perf_counter) came first, or CONTACTS_FULL.

        Raises:
            ValueError: a pose that is no rigid motion.
        """
        a, b = self._models
        steps = _LONG_SLICE
        if deadline is not None:
            steps = _SLICE if perf_counter() < deadline else 0
        row = 0
        while True:
            code, row = kernel.search(
                *a._tree, *b._tree, *self.state, poses_a, poses_b, row, len(poses_a),
                rel_err, abs_err, stop, limit, steps, fresh,
                self.answers, self.triangles, self.tests,
            )  # fmt: skip
            if code != index.CUT:
                break
            if deadline is not None and perf_counter() >= deadline:
                break
            fresh = False
        if code in (index.BAD_POSE_A, index.BAD_POSE_B):
            letter, poses = ("a", poses_a) if code == index.BAD_POSE_A else ("b", poses_b)
            name = f"pose_{letter}" if first is None else f"poses_{letter}[{first + row}]"
            check_pose(poses[row], name)
        return code

    def contacts(
        self, poses_a: NDArray[np.float64], poses_b: NDArray[np.float64]
    ) -> NDArray[np.int32]:
        """Every pair of triangles (k, 2), in tree order, whose contact cannot be excluded.

        Leaves the number of tests in `tests`. Poses (1, 4, 4).
        """
        found = []
        room = np.zeros((1024, 2), np.int32)
        nothing, self.state = self.state, self.state._replace(contacts=room)
        code = index.CONTACTS_FULL
        while code == index.CONTACTS_FULL:
            self.counts[index.CONTACTS] = 0
            code = self.run(poses_a, poses_b, stop=-math.inf, limit=math.ulp(0.0), fresh=not found)
            found.append(room[: self.counts[index.CONTACTS]].copy())
        self.state = nothing
        return np.concatenate(found)


def check_tolerance(name: str, value: float) -> None:
    """Raise ValueError unless `value` is a number that is not negative (infinity is allowed)."""
    if not value >= 0.0:
        raise ValueError(f"{name} = {value!r}: must be a number that is not negative")
