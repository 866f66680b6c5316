"""Searches of single pairs that take long: they are kept and go on in the next call."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Sequence
from threading import Event
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..models.model import Model
from ..questions.pair import Pair
from ..questions.result import Distance, Status
from ..questions.sharing import share

if TYPE_CHECKING:
    from .assembly import Assembly

KEPT = 64
"""How many searches are kept; each takes some tens of kilobytes, and more for solids."""

_SLICE_S = 0.2e-3
"""How long a search goes on between two checks whether its clearance is decided."""

_FAR = 8.0
"""At so many radii, the first volumes prove that two bodies are apart."""


class LongSearches:
    """Searches pair by pair over the models (n,) of some bodies.

    A search that was cut goes on where it stopped while its bodies stand still. Those that were not
    used for longest are forgotten first.
    """

    def __init__(self, models: Sequence[Model]) -> None:
        self._models = tuple(models)
        self._kept: OrderedDict[int, Pair] = OrderedDict()  # by a * n + b

    def prepare(self, assembly: Assembly) -> None:
        """Run every kind of search once, those of the bodies' assembly too, to compile them."""
        near, far = np.eye(4), np.eye(4)
        far[0, 3] = _FAR * max(float(np.linalg.norm(m.centre)) + m.radius for m in self._models)
        chosen = next((i for i, model in enumerate(self._models) if model.is_solid), 0)
        poses = np.tile(far, (len(self._models), 1, 1))
        poses[chosen] = near
        other = (chosen + 1) % len(poses)
        assembly.distances(poses, [[chosen, other]], clearance=0.0, signed=True, budget_s=1.0)
        pair = Pair(self._models[chosen], self._models[chosen])
        pair.distance(near, far, rel_err=0.5, budget_s=1.0, order="priority")
        if pair.a.is_solid:
            pair.signed_distance(near, far, rel_err=0.5, budget_s=1.0)
            # Depths have kernels of their own, a surface's others than a solid's.
            pair.signed_distance(near, near, depth_err=math.inf, budget_s=1.0)
            surface = next((each for each in self._models if not each.is_solid), None)
            if surface is not None:
                part = Pair(pair.a, surface)
                part.signed_distance(near, near, depth_err=math.inf, budget_s=1.0)

    def replace(self, body: int, model: Model) -> None:
        """Give a body another model; the searches of its pairs are forgotten."""
        self._models = (*self._models[:body], model, *self._models[body + 1 :])
        for key in [key for key in self._kept if body in divmod(key, len(self._models))]:
            del self._kept[key]

    def search(
        self,
        poses: NDArray[np.float64],
        bodies: Sequence[tuple[int, int]],
        wanted: Sequence[tuple[float, float, float]],
        signed: Sequence[bool],
        budget_s: float,
        threads: int,
    ) -> list[Distance]:
        """Search k pairs, `threads` of them side by side, each within the budget.

        Args:
            poses: (n, 4, 4) model to world.
            bodies: k pairs.
            wanted: (k, 3) rel_err, abs_err and clearance, as `Assembly.rows` takes them.
            signed: k of them; whether the signed distance is asked for.
            budget_s: seconds for each.
            threads: how many share the work.
        """
        pairs = [self._pair(a, b, threads) for a, b in bodies]

        def answer(k: int, stopped: Event) -> Distance:
            a, b = bodies[k]
            return _search(pairs[k], poses[a], poses[b], wanted[k], signed[k], budget_s)

        return share(answer, range(len(pairs)), min(threads, len(pairs)))

    def _pair(self, a: int, b: int, threads: int) -> Pair:
        key = a * len(self._models) + b
        pair = self._kept.get(key)
        if pair is None:
            pair = Pair(self._models[a], self._models[b])
        self._kept[key] = pair
        self._kept.move_to_end(key)
        if len(self._kept) > max(KEPT, threads):
            self._kept.popitem(last=False)
        return pair


def _search(
    pair: Pair,
    pose_a: NDArray[np.float64],
    pose_b: NDArray[np.float64],
    wanted: tuple[float, float, float],
    signed: bool,
    budget_s: float,
) -> Distance:
    """Search until the clearance is decided or, if it is infinite, the tolerance is met."""
    rel_err, abs_err, clearance = wanted
    ask: Callable[..., Distance] = pair.distance
    how: dict[str, object] = {"rel_err": rel_err, "abs_err": abs_err}
    if signed:
        ask = pair.signed_distance
    else:
        how["order"] = "priority"
    if clearance == math.inf:
        return ask(pose_a, pose_b, budget_s=budget_s, **how)
    deadline = perf_counter() + budget_s
    while True:
        left = max(deadline - perf_counter(), 0.0)
        found = ask(pose_a, pose_b, budget_s=min(left, _SLICE_S), **how)
        decided = found.lower > clearance or found.upper <= clearance
        if decided or found.status is not Status.OUT_OF_TIME or left <= _SLICE_S:
            return found
