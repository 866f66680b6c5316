"""The signed distance where a model is solid: the surfaces' distance, or minus their depth."""

from __future__ import annotations

import math
from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state
from ..kernels.inside.solids import HALF, NOWHERE
from ..models.model import Model
from ..models.solid import sides_of
from .ball import BallSearch, DeepestSearch
from .cores import CoreSearch
from .parts import PartSearch
from .result import STATUSES, Distance, Status
from .rows import distance_of


class SignedSearch:
    """The memory of signed distances of two models, as `Pair` is that of their distances.

    What was found last is looked at first: where the centre of the last ball lies inside both
    models still, their surfaces need not be asked. Else their distance tells whether they meet. If
    they do not, one model may lie inside the other. Then the search for the depth follows.

    Args:
        a: first model.
        b: second model.
        apart: asks for the distance of their surfaces, as `Pair.distance` of a pair of its own.
    """

    __slots__ = (
        "_apart", "_apart_tests", "_asked", "_clear", "_deadline", "_depth", "_deviation",
        "_earlier_tests", "_limits", "_models", "_parts", "_poses", "_regions", "_seeded",
        "_tolerance",
    )  # fmt: skip

    def __init__(self, a: Model, b: Model, apart: Callable[..., Distance]) -> None:
        self._models = a, b
        self._apart = apart
        self._asked: tuple[object, ...] | None = None
        self._clear: tuple | None = None  # how the models were last known to be apart
        self._depth: BallSearch | CoreSearch | None = None

    def __reduce__(self) -> tuple[type[SignedSearch], tuple[Any, ...]]:
        """Of what another is made: its memory is its own."""
        return SignedSearch, (*self._models, self._apart)

    def ask(
        self,
        start: float,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        rel_err: float,
        abs_err: float,
        depth_err: float,
        budget_s: float | None,
    ) -> Distance:
        """Answer at two poses, which are rigid motions; see `engine.signed_distance`.

        A budget began at `start` of perf_counter.
        """
        if not any(model.is_solid for model in self._models):
            self._asked = None
            return self._apart(pose_a, pose_b, rel_err=rel_err, abs_err=abs_err, budget_s=budget_s)
        self._deadline = math.inf if budget_s is None else start + budget_s
        asked = None
        if budget_s is not None:
            asked = pose_a.tobytes(), pose_b.tobytes(), rel_err, abs_err, depth_err, self._shapes()
        fresh = asked is None or asked != self._asked
        self._asked = None
        if fresh:
            self._begin(pose_a, pose_b, rel_err, abs_err, depth_err)
        row = self._answer()
        self._asked = asked
        # Rounding may make a later bound the weaker one; both hold.
        lower, upper = self._limits
        self._limits = max(lower, row[state.LOWER]), min(upper, row[state.UPPER])
        row[state.LOWER], row[state.UPPER] = self._limits
        a, b = self._models
        return distance_of(row, start, None, (type(a), type(b)))

    def _begin(
        self,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        rel_err: float,
        abs_err: float,
        depth_err: float,
    ) -> None:
        """Start a search from what the last one found."""
        a, b = self._models
        self._regions = sides_of(a).region, sides_of(b).region
        solids = a.is_solid, b.is_solid
        if all(
            region.inside == NOWHERE
            for region, solid in zip(self._regions, solids, strict=True)
            if solid
        ):
            kind = CoreSearch
        else:
            kind = BallSearch if all(solids) else DeepestSearch
        if type(self._depth) is not kind:  # other, after a refit
            self._depth = kind(a, b)
        # A deviation changes how deep a point lies in either model by as much, and a ball's
        # diameter by twice that.
        self._deviation = 2.0 * max(a.deviation, b.deviation)
        self._poses = pose_a.copy(), pose_b.copy()
        self._limits = -math.inf, math.inf
        self._tolerance = {"rel_err": rel_err, "abs_err": abs_err}
        self._apart_tests = self._earlier_tests = 0, 0
        self._parts: PartSearch | None = None
        self._seeded = False
        self._depth.begin(*self._poses, depth_err, abs_err)

    def _answer(self) -> NDArray[np.float64]:
        """The row (ANSWER,) of what is known when the search ends, or time is over."""
        depth = self._depth
        depth.seek(self._deadline)
        if depth.found:
            return self._inside(depth.search(self._deadline))
        apart = self._distance()
        decided = apart.lower > 0.0 and self._part_inside(apart)
        if decided is False and apart.lower > 0.0:
            self._clear = *self._relative(), apart.lower, self._shapes()
            return self._with_tests(apart.row.copy(), apart.lower, apart.upper, apart.status)
        ended = False
        if decided or (apart.lower == 0.0 and apart.status is not Status.OUT_OF_TIME):
            if not self._seeded:
                self._seeded = True
                depth.seed_contact(apart.row)
            ended = depth.search(self._deadline)
        if depth.found:
            return self._inside(ended)
        _, deep = depth.bounds
        if apart.lower > 0.0 and deep == 0.0:
            return self._with_tests(apart.row.copy(), apart.lower, apart.upper, apart.status)
        status = Status.INTERSECTING if ended else Status.OUT_OF_TIME
        return self._with_tests(apart.row.copy(), -deep - self._deviation, apart.upper, status)

    def _part_inside(self, apart: Distance) -> bool | None:
        """Whether a part of either model may lie inside the other, off whose surface it is.

        None where time ran out before that was known.
        """
        if HALF in (self._regions[0].inside, self._regions[1].inside):
            return True  # no part is known to lie wholly on one side of what has holes
        if self._still_clear():
            return False
        if self._parts is None:
            self._parts = PartSearch(self._models, self._poses, self._regions)
        found = self._parts.search(apart.lower, self._deadline)
        if found and not self._seeded:
            self._seeded = True
            self._depth.seed_part(*self._parts.found)
        return found

    def _still_clear(self) -> bool:
        """Whether no part got inside since it was known that none was.

        Between the poses of then and now, as b is moved along straight lines in a's frame, the
        surfaces come no nearer by more than it moves: so they never met. The norm of the rotations'
        difference holds for poses that are not quite rigid, too.
        """
        if self._clear is None or self._clear[3] != self._shapes():
            return False
        then, there, clear, _ = self._clear
        turn, place = self._relative()
        b = self._models[1]
        moved = math.sqrt(((place - there) ** 2).sum())
        moved += math.sqrt(((turn - then) ** 2).sum()) * b.radius
        size = abs(place).sum() + abs(there).sum() + sum(model.radius for model in self._models)
        return bool(moved + 1e-12 * size < 0.9 * clear)

    def _relative(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The rotation of b in a's frame, and where the centre of its ball is there."""
        (pose_a, pose_b), b = self._poses, self._models[1]
        turn = pose_a[:3, :3].T @ pose_b[:3, :3]
        place = pose_a[:3, :3].T @ (pose_b[:3, 3] - pose_a[:3, 3]) + turn @ b.centre
        return turn, place

    def _shapes(self) -> tuple[int, ...]:
        """How often the models were refitted."""
        return tuple(model.revision for model in self._models)

    def _distance(self) -> Distance:
        """The distance of the surfaces, sure to tell whether they meet unless time is over."""
        while True:
            left = None
            if self._deadline < math.inf:
                left = max(self._deadline - perf_counter(), 0.0)
            found = self._apart(*self._poses, **self._tolerance, budget_s=left)
            bound_tests, primitive_tests = self._earlier_tests
            bound_tests += found.bound_tests
            primitive_tests += found.primitive_tests
            if found.lower > 0.0 or found.status is not Status.WITHIN_TOLERANCE:
                self._apart_tests = bound_tests, primitive_tests
                return found
            # A tolerance so wide that the surfaces might still meet does not tell the sign. It
            # allows all between 0 and `upper`, hence whatever is found next.
            self._tolerance = {"rel_err": 1.0}
            self._earlier_tests = bound_tests, primitive_tests

    def _inside(self, ended: bool) -> NDArray[np.float64]:
        """The answer where overlap is certain, but for what the models may deviate."""
        depth = self._depth
        shallow, deep = depth.bounds
        row = np.full(state.ANSWER, -1.0)  # its triangles are no hints where to search
        depth.fill(row)
        status = Status.OUT_OF_TIME
        if ended:
            exact = deep - shallow <= depth.slack
            status = Status.EXACT if exact else Status.WITHIN_TOLERANCE
            if self._deviation >= shallow or depth.given_up:
                status = Status.INTERSECTING
        return self._with_tests(row, -deep - self._deviation, self._deviation - shallow, status)

    def _with_tests(
        self, row: NDArray[np.float64], lower: float, upper: float, status: Status
    ) -> NDArray[np.float64]:
        """A row with these bounds, and the tests of the distance; a point's count as either."""
        points = self._depth.points + (self._parts.points if self._parts else 0)
        row[state.LOWER], row[state.UPPER] = lower, upper
        row[state.STATUS] = STATUSES.index(status)
        row[state.TESTS : state.TESTS + 2] = self._apart_tests
        row[state.TESTS : state.TESTS + 2] += points
        return row
