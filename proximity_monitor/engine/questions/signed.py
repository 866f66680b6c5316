"""The signed distance of models if one is a solid: the surfaces' distance, or minus the depth."""

from __future__ import annotations

import math
from collections.abc import Callable
from time import perf_counter
from typing import TYPE_CHECKING, Any

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
from .slices import deadline_of

if TYPE_CHECKING:
    from .pair import Pair

_WIDEST, _EXACT = {"rel_err": 1.0}, {"rel_err": 0.0}
"""Tolerances of the surfaces' distance, if that of the query does not tell the sign."""

_NO_HINTS = np.full(state.ANSWER, -1.0)
"""An answer that names no triangles as hints where to search."""

_STAGE_S = 2e-5
"""Seconds that the first slice of a stage takes. If less time is left, the next call begins the
stage."""

HAND_OVER_S = 1.5e-5
"""Seconds that a call takes to make its answer after a search."""

Stage = Callable[["SignedSearch"], "Stage | None"]
"""Does at least one slice of work. Returns the next stage; itself if time ran out; None at the end.
"""


class SignedSearch:
    """The search for signed distances of two models and its memory, as `Pair` is for distances.

    A search has these stages. First it tries the centre of the last ball. If that still lies inside
    both models, it finds the depth at once, and their surfaces need not be compared. Otherwise it
    finds the distance of the surfaces. If they do not meet, it looks for a part of one model inside
    the other. If the models overlap, it searches for the depth; if it then finds no overlap, it
    completes the distance. A search that was cut goes on in the same stage.

    Args:
        a: first model.
        b: second model.
        apart: a pair for this search alone, which finds the distance of the surfaces.
    """

    __slots__ = (
        "_apart", "_apart_tests", "_asked", "_clear", "_deadline", "_depth", "_deviation",
        "_earlier_tests", "_found", "_inside_other", "_known", "_limits", "_models", "_parts",
        "_poses", "_regions", "_stage", "_taken", "_tolerance", "known",
    )  # fmt: skip

    known: NDArray[np.float64] | None
    """(ANSWER,) what the caller knows about the surfaces at the poses of the next question, from
    another search. If it is set, this search begins where that one ended."""

    def __init__(self, a: Model, b: Model, apart: Pair) -> None:
        self._models = a, b
        self._apart = apart
        self._asked: tuple[object, ...] | None = None
        self._clear: tuple | None = None  # poses, lower bound, shapes when last known to be apart
        self._depth: BallSearch | CoreSearch | None = None
        self.known = None

    def __reduce__(self) -> tuple[type[SignedSearch], tuple[Any, ...]]:
        """Make another search with an empty memory."""
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
        a, b = self._models
        if not (a.is_solid or b.is_solid):
            self._asked = None
            return self._apart.distance(
                pose_a, pose_b, rel_err=rel_err, abs_err=abs_err, budget_s=budget_s
            )
        deadline = deadline_of(start - HAND_OVER_S, budget_s)
        self._deadline = math.inf if deadline is None else deadline
        asked = None
        if budget_s is not None:
            asked = self._question(pose_a, pose_b, rel_err, abs_err, depth_err)
            pose_a, pose_b = pose_a.copy(), pose_b.copy()  # for the next call
        fresh = asked is None or asked != self._asked
        self._asked = None
        if fresh:
            self._begin(pose_a, pose_b, rel_err, abs_err, depth_err)
        # If there is an answer already and no time is left, beginning is enough work.
        late = fresh and self._known is not None and perf_counter() >= self._deadline
        row = self._answer(not late and self._search())
        self._asked = asked
        # Rounding may make a later bound weaker than an earlier one; both hold.
        if self._limits is not None:
            lower, upper = self._limits
            row[state.LOWER] = max(lower, row[state.LOWER])
            row[state.UPPER] = min(upper, row[state.UPPER])
        if asked is not None:
            self._limits = row[state.LOWER], row[state.UPPER]
        return distance_of(row, start, None, (type(a), type(b)))

    def prepare(
        self, pose_a: NDArray[np.float64], pose_b: NDArray[np.float64], *errors: float
    ) -> NDArray[np.float64] | None:
        """Do a part of the work to begin with what is `known`: all of it may exceed a budget.

        `errors` are rel_err, abs_err and depth_err of the next question. Returns what is known
        (ANSWER,); or None if nothing is left to prepare, so that `ask` can go on.
        """
        asked = self._question(pose_a, pose_b, *errors)
        row = self.known
        if row is None or asked == self._asked:
            return None
        if self._depth is None:
            self._take_memory()
        elif not self._apart.take_memory():
            self._begin(pose_a.copy(), pose_b.copy(), *errors)
            self._asked = asked
        return row

    def _question(
        self, pose_a: NDArray[np.float64], pose_b: NDArray[np.float64], *errors: float
    ) -> tuple[object, ...]:
        """Return everything that an answer depends on."""
        return pose_a.tobytes(), pose_b.tobytes(), errors, self._shapes()

    def _take_memory(self) -> BallSearch | CoreSearch:
        """Return the search for the depth of the models as they are now.

        A refit may call for another kind of search.
        """
        a, b = self._models
        hierarchies = a._hierarchy, b._hierarchy
        if self._depth is not None and hierarchies == self._taken:
            return self._depth
        # A deviation changes the depth of a point in its model by as much, and the diameter of a
        # ball by twice that.
        self._deviation = 2.0 * max(a.deviation, b.deviation)
        self._regions = sides_of(a).region, sides_of(b).region
        # Which of them have a volume around which no ball is swept.
        solids = a.is_solid, b.is_solid
        hollow = [
            solid and region.inside != NOWHERE
            for region, solid in zip(self._regions, solids, strict=True)
        ]
        if True not in hollow:
            kind = CoreSearch
        elif all(solids):
            kind = BallSearch
        else:
            kind = DeepestSearch
        if type(self._depth) is not kind:
            self._depth = kind(a, b)
        self._taken = hierarchies  # last: Ctrl-C may come at any moment
        return self._depth

    def _begin(
        self,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        rel_err: float,
        abs_err: float,
        depth_err: float,
    ) -> None:
        """Start a search from what the last one found."""
        depth = self._take_memory()
        self._poses = pose_a, pose_b
        self._limits: tuple[float, float] | None = None
        self._tolerance = {"rel_err": rel_err, "abs_err": abs_err}
        self._apart_tests = self._earlier_tests = 0, 0
        self._known, self.known = self.known, None
        if self._known is not None:
            tests, pair = self._known[state.TESTS :], self._known[state.TREE_A :]
            self._apart_tests = self._earlier_tests = int(tests[0]), int(tests[1])
            self._apart.begin_at((int(pair[0]), int(pair[1])))
        self._found: Distance | None = None
        self._inside_other: bool | None = None
        self._parts: PartSearch | None = None
        depth.begin(*self._poses, depth_err, abs_err)
        self._stage: Stage | None = SignedSearch._try_last_ball

    def _search(self) -> bool:
        """Search until the end or the deadline; return whether the search has ended."""
        while self._stage is not None:
            stage = self._stage
            self._stage = stage(self)
            if self._stage is stage:
                return False
            if self._stage is not None and perf_counter() + _STAGE_S >= self._deadline:
                return False
        return True

    def _try_last_ball(self) -> Stage | None:
        """Find the depth if the centre of the last ball, or the middle, is still in both models."""
        ended = self._depth.seek(self._deadline)
        if self._depth.found:
            return None if ended else SignedSearch._find_depth
        return SignedSearch._compare_surfaces if ended else SignedSearch._try_last_ball

    def _compare_surfaces(self) -> Stage | None:
        """Find how far the surfaces are apart."""
        apart = self._distance()
        if apart.lower > 0.0 and self._inside_other is None:
            return SignedSearch._look_inside
        if apart.status is Status.OUT_OF_TIME:
            return SignedSearch._compare_surfaces
        if apart.lower > 0.0:
            return None
        self._depth.seed_contact(apart.row)
        return SignedSearch._find_depth

    def _look_inside(self) -> Stage | None:
        """Find whether a part of one model is inside the other; the surfaces are apart."""
        apart = self._found
        inside = self._inside_other = self._part_inside(apart)
        if inside is None:
            return SignedSearch._look_inside
        if not inside:
            cut = apart.status is Status.OUT_OF_TIME
            return SignedSearch._compare_surfaces if cut else None
        # If a surface has holes, no part is searched for: nothing tells where its inside may be.
        if self._parts is not None and self._parts.part is not None:
            self._depth.seed_part(*self._parts.part)
        elif self._parts is not None:
            self._depth.seed_contact(apart.row)
        return SignedSearch._find_depth

    def _find_depth(self) -> Stage | None:
        if not self._depth.search(self._deadline):
            return SignedSearch._find_depth
        return None if self._depth.found else SignedSearch._finish_distance

    def _finish_distance(self) -> Stage | None:
        """Complete the distance of the surfaces: no overlap was found, so it is the answer."""
        if self._found is None or self._found.status is Status.OUT_OF_TIME:
            found = self._distance()
            return SignedSearch._finish_distance if found.status is Status.OUT_OF_TIME else None
        return None

    def _answer(self, ended: bool) -> NDArray[np.float64]:
        """Make the row (ANSWER,) of what is known now."""
        depth = self._depth
        if depth.found:
            return self._inside(ended)
        deep = depth.depth().deep
        if self._found is None and self._known is not None:
            row, upper = self._known.copy(), float(self._known[state.UPPER])
            return self._with_tests(row, -deep - self._deviation, upper, Status.OUT_OF_TIME)
        apart = self._found or self._distance()
        if apart.lower > 0.0 and (self._inside_other is False or deep == 0.0):
            if self._inside_other is False:
                a, b = self._poses
                self._clear = (a.copy(), b.copy()), apart.lower, self._shapes()
            return self._with_tests(apart.row.copy(), apart.lower, apart.upper, apart.status)
        status = Status.INTERSECTING if ended else Status.OUT_OF_TIME
        return self._with_tests(apart.row.copy(), -deep - self._deviation, apart.upper, status)

    def _part_inside(self, apart: Distance) -> bool | None:
        """Find whether a part of either model may lie inside the other; their surfaces are apart.

        Returns None if time ran out before that was known.
        """
        if HALF in (self._regions[0].inside, self._regions[1].inside):
            return True  # a part need not lie wholly on one side of a surface with holes
        if self._still_clear():
            return False
        if self._parts is None:
            self._parts = PartSearch(self._models, self._poses, self._regions)
        return self._parts.search(apart.lower, self._deadline)

    def _still_clear(self) -> bool:
        """Return whether no part can have got inside since it was known that none was.

        Let the points of b move along straight lines in a's frame, from the pose then to the pose
        now. The surfaces come nearer by no more than b moves, so they never met on the way. The
        norm of the difference of the rotations also holds for poses that are not quite rigid.
        """
        if self._clear is None or self._clear[2] != self._shapes():
            return False
        poses, clear, _ = self._clear
        b = self._models[1]
        then, there = _relative(*poses, b.centre)
        turn, place = _relative(*self._poses, b.centre)
        moved = math.dist(place, there) + math.dist(turn, then) * b.radius
        size = sum(map(abs, (*place, *there))) + sum(model.radius for model in self._models)
        return moved + 1e-12 * size < 0.9 * clear

    def _shapes(self) -> tuple[int, ...]:
        """Return how often each model was refitted."""
        return tuple(model.revision for model in self._models)

    def _distance(self) -> Distance:
        """Find the surfaces' distance, well enough to tell whether they meet, if time allows."""
        while True:
            left = None
            if self._deadline < math.inf:
                left = max(self._deadline - perf_counter(), 0.0)
            found = self._apart.distance(*self._poses, **self._tolerance, budget_s=left)
            bound_tests, primitive_tests = self._earlier_tests
            bound_tests += found.bound_tests
            primitive_tests += found.primitive_tests
            told = found.lower > 0.0 or found.status is not Status.WITHIN_TOLERANCE
            if told or self._tolerance is _EXACT:
                self._apart_tests = bound_tests, primitive_tests
                self._found = found
                return found
            # The tolerance is so wide that the surfaces might still meet, so the sign is unknown.
            # It allows everything from 0 to `upper`, hence also what the next search finds. If the
            # models may deviate by about as much as they are apart, only the exact distance tells.
            self._tolerance = _EXACT if self._tolerance is _WIDEST else _WIDEST
            self._earlier_tests = bound_tests, primitive_tests

    def _inside(self, ended: bool) -> NDArray[np.float64]:
        """Make the row for models that certainly overlap, apart from their deviations."""
        depth = self._depth
        shallow, deep, exact, close = depth.depth()
        row = _NO_HINTS.copy()
        depth.fill(row)
        status = Status.OUT_OF_TIME
        if ended:
            status = Status.EXACT if exact else Status.WITHIN_TOLERANCE
            if self._deviation >= shallow or not close:
                status = Status.INTERSECTING
        return self._with_tests(row, -deep - self._deviation, self._deviation - shallow, status)

    def _with_tests(
        self, row: NDArray[np.float64], lower: float, upper: float, status: Status
    ) -> NDArray[np.float64]:
        """Write these bounds and the test counts into the row; a tested point counts in both."""
        points = self._depth.points + (self._parts.points if self._parts else 0)
        bound_tests, primitive_tests = self._apart_tests
        row[state.LOWER], row[state.UPPER] = lower, upper
        row[state.STATUS] = STATUSES.index(status)
        row[state.TESTS], row[state.TESTS + 1] = bound_tests + points, primitive_tests + points
        return row


def _relative(
    pose_a: NDArray[np.float64], pose_b: NDArray[np.float64], centre: NDArray[np.float64]
) -> tuple[list[float], list[float]]:
    """Return the rotation of b in a's frame, by rows, and the position of b's centre there.

    Python's own numbers are used: for so few, numpy takes three times as long.
    """
    *a, (ax, ay, az) = zip(*pose_a.tolist()[:3], strict=True)  # the columns
    *b, (bx, by, bz) = zip(*pose_b.tolist()[:3], strict=True)
    dx, dy, dz = bx - ax, by - ay, bz - az
    p, q, r = centre.tolist()
    turn: list[float] = []
    place: list[float] = []
    for x, y, z in a:
        row = [x * i + y * j + z * k for i, j, k in b]
        turn += row
        place.append(x * dx + y * dy + z * dz + row[0] * p + row[1] * q + row[2] * r)
    return turn, place
