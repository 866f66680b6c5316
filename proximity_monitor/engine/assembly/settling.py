"""The signs of many distances that a search of the surfaces left open."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from threading import Event
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ..models.model import Model
from ..questions.pair import Pair
from ..questions.result import Distance, Status
from ..questions.sharing import share

_CHUNK = 64
"""Pairs that one thread answers in a row. Each chunk starts with nothing remembered, so the answers
are the same however many threads there are."""

_SLICE_S = 0.02
"""Between two looks whether Ctrl-C was pressed."""

_DECIDING_S = 0.2e-3
"""The same where it is looked at, besides, whether a clearance is decided."""


class Settling:
    """Searches for how deep bodies overlap whose surfaces meet, or one of which is in the other.

    Each takes a memory of its own, which is kept only where a budget cut it.
    """

    __slots__ = ("_cut",)

    def __init__(self) -> None:
        self._cut: dict[Hashable, Pair] = {}

    def begun(self, questions: Sequence[Hashable]) -> NDArray[np.bool_]:
        """In which (k,) of some questions it was cut last."""
        return np.array([each in self._cut for each in questions], np.bool_)

    @property
    def waiting(self) -> bool:
        """Whether it was cut in any."""
        return bool(self._cut)

    def settle(
        self,
        models: Sequence[tuple[Model, Model]],
        poses: NDArray[np.float64],
        wanted: NDArray[np.float64],
        depth_err: float,
        question: Callable[[int], Hashable],
        deadline: float,
        threads: int,
        take: Callable[[int, NDArray[np.float64]], None],
    ) -> None:
        """Search for signed distances, in this order, as far as the deadline allows.

        Some work is done on the first of them whatever the deadline.

        Args:
            models: k pairs.
            poses: (k, 2, 4, 4) model to world.
            wanted: (k, 3) rel_err, abs_err and clearance, as `Assembly.rows` takes them.
            depth_err: as for `engine.signed_distance`.
            question: all that the answer about a pair depends on.
            deadline: of `perf_counter`, or infinity.
            threads: how many share the work.
            take: is given each pair's number and its row (ANSWER,).
        """
        cut, self._cut = self._cut, {}

        def answer(first: int, stopped: Event) -> None:
            pair = None
            for k in range(first, min(first + _CHUNK, len(models))):
                if stopped.is_set() or (k and perf_counter() >= deadline):
                    return
                begun = cut.pop(question(k), None) if cut else None
                if begun is None and (pair is None or (pair.a, pair.b) != models[k]):
                    pair = Pair(*models[k])
                chosen = begun or pair
                found, ended = _ask(chosen, *poses[k], wanted[k], depth_err, deadline, stopped)
                take(k, found.row)
                if not ended:
                    self._cut[question(k)] = chosen
                    pair = None

        share(answer, range(0, len(models), _CHUNK), threads)


def _ask(
    pair: Pair,
    pose_a: NDArray[np.float64],
    pose_b: NDArray[np.float64],
    wanted: NDArray[np.float64],
    depth_err: float,
    deadline: float,
    stopped: Event,
) -> tuple[Distance, bool]:
    """A signed distance, and whether its search came to an end, or decided about the clearance."""
    rel_err, abs_err, clearance = wanted.tolist()
    longest = _SLICE_S if clearance == math.inf else _DECIDING_S
    while True:
        left = max(deadline - perf_counter(), 0.0)
        found = pair.signed_distance(
            pose_a, pose_b,
            rel_err=rel_err, abs_err=abs_err, depth_err=depth_err, budget_s=min(left, longest),
        )  # fmt: skip
        decided = found.lower > clearance or found.upper <= clearance < math.inf
        if decided or found.status is not Status.OUT_OF_TIME:
            return found, True
        if stopped.is_set() or perf_counter() >= deadline:
            return found, False
