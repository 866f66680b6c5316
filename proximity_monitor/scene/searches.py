"""Asks the engine about pairs of bodies, and keeps what is not finished."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from proximity_monitor import engine

KEPT = 64
"""So many unfinished searches are kept; each takes some tens of kilobytes, and more for solids."""

_SLICE_S = 0.2e-3
"""How long a search goes on before it is looked at whether a threshold is decided."""

_FAR = 8.0
"""So many radii apart, two bodies are bounded by their first volumes."""


class Question(NamedTuple):
    """One pair to search alone."""

    a: int
    b: int
    signed: bool
    rel_err: float
    abs_err: float
    level: float
    """Metres; the search may end when it is known on which side of it the distance is. inf: when
    the tolerance is met."""


class Searches:
    """Searches over the bodies of a scene."""

    def __init__(self, models: Sequence[engine.Model], threads: int) -> None:
        """Get ready for the models (n,) of the bodies, and for so many threads."""
        if threads < 1:
            raise ValueError(f"threads = {threads}: must be at least 1")
        self.threads = threads
        self._models = tuple(models)
        self.assembly = engine.Assembly(models)
        self._kept: OrderedDict[int, engine.Pair] = OrderedDict()  # by key, see `forget`
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def prepare(self) -> None:
        """Run every kind of search once, so that no tick has to compile it."""
        near, far = self._apart()
        poses = np.tile(near, (len(self._models), 1, 1))
        poses[-1] = far
        last = len(self._models) - 1
        self.assembly.distances(poses, [[0, last]], clearance=0.0, budget_s=1.0)
        first = self._models[0]
        engine.Pair(first, first).distance(near, far, rel_err=0.5, budget_s=1.0, order="priority")
        solid = next((model for model in self._models if model.is_solid), None)
        if solid is not None:
            pair = engine.Pair(solid, solid)
            pair.signed_distance(near, far, rel_err=0.5, budget_s=1.0)
            pair.signed_distance(near, near, budget_s=0.0)  # has kernels of its own

    def replace(self, body: int, model: engine.Model) -> None:
        """Give a body another model; what was not finished about its pairs is forgotten."""
        self._models = (*self._models[:body], model, *self._models[body + 1 :])
        self.assembly.replace(body, model)
        for key in [key for key in self._kept if body in divmod(key, len(self._models))]:
            del self._kept[key]

    def _apart(self) -> tuple[np.ndarray, np.ndarray]:
        """Two poses (4, 4) at which any two of the models are far apart."""
        far = np.eye(4)
        far[0, 3] = _FAR * max(float(np.linalg.norm(m.centre)) + m.radius for m in self._models)
        return np.eye(4), far

    def close(self) -> None:
        """Forget what is not finished, and end the threads."""
        self._kept.clear()
        if self._pool is not None:
            self._pool.shutdown()

    def forget(self, keys: np.ndarray) -> None:
        """Forget what is not finished about pairs that are no more.

        A key is the first body's index times the number of bodies, plus the second's.
        """
        for key in keys.tolist():
            self._kept.pop(key, None)

    def alone(
        self, poses: np.ndarray, asked: engine.Questions, budget_s: float
    ) -> list[engine.Distance]:
        """Search at most `threads` pairs side by side, each of them within the budget.

        A search that was cut goes on where it stopped if its bodies stand still.
        """
        questions = [
            Question(a, b, how == engine.Agenda.INSIDE, *wanted)
            for (a, b), how, wanted in zip(
                asked.bodies.tolist(), asked.how.tolist(), asked.wanted.tolist(), strict=True
            )
        ]
        pairs = [self._pair(each) for each in questions]

        def ask(k: int) -> engine.Distance:
            return _ask(pairs[k], questions[k], poses, budget_s)

        if self._pool is None or len(questions) == 1:
            return [ask(k) for k in range(len(questions))]
        return list(self._pool.map(ask, range(len(questions))))

    def _pair(self, question: Question) -> engine.Pair:
        key = question.a * len(self._models) + question.b
        pair = self._kept.get(key)
        if pair is None:
            pair = engine.Pair(self._models[question.a], self._models[question.b])
        self._kept[key] = pair
        self._kept.move_to_end(key)
        if len(self._kept) > max(KEPT, self.threads):
            self._kept.popitem(last=False)
        return pair


def _ask(
    pair: engine.Pair, question: Question, poses: np.ndarray, budget_s: float
) -> engine.Distance:
    ask: Callable[..., engine.Distance] = pair.distance
    how = {"rel_err": question.rel_err, "abs_err": question.abs_err}
    if question.signed:
        ask = pair.signed_distance
    else:
        how["order"] = "priority"
    pose_a, pose_b = poses[question.a], poses[question.b]
    if question.level == np.inf:
        return ask(pose_a, pose_b, budget_s=budget_s, **how)
    deadline = time.perf_counter() + budget_s
    while True:
        left = max(deadline - time.perf_counter(), 0.0)
        found = ask(pose_a, pose_b, budget_s=min(left, _SLICE_S), **how)
        decided = found.lower > question.level or found.upper <= question.level
        if decided or found.status is not engine.Status.OUT_OF_TIME or left <= _SLICE_S:
            return found
