"""The signed distance where a model is solid: the surfaces' distance, or minus their depth."""

from __future__ import annotations

import math
from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import state
from ..kernels.inside import depth as kernel
from ..kernels.inside import probe
from ..kernels.inside.contain import FEW
from ..kernels.inside.solids import HALF, NOWHERE
from ..models.model import Model
from ..models.solid import sides_of
from ..models.tree import Tree
from .overlap import overlap
from .result import STATUSES, Distance, Status
from .slices import Slices


class SignedSearch:
    """The memory of signed distances of two models, as `Pair` is that of their distances.

    Args:
        a: first model.
        b: second model.
        apart: asks for the distance of their surfaces, as `Pair.distance` of a pair of its own.
    """

    __slots__ = (
        "_apart", "_apart_tests", "_asked", "_by_vertices", "_deadline", "_depth",
        "_earlier_tests", "_limits", "_models", "_poses", "_regions", "_revisions", "_tolerance",
    )  # fmt: skip

    def __init__(self, a: Model, b: Model, apart: Callable[..., Distance]) -> None:
        self._models = a, b
        self._apart = apart
        self._asked: tuple[object, ...] | None = None
        models = self._models
        # Each lane and each vertex enters the heap at most once.
        cores = [model._hierarchy for model in models]
        room = sum(len(core.tree.children) + 3 * len(core.faces) for core in cores)
        descent = 1 + max(core.depth for core in cores) * 15
        self._depth = kernel.Depth(
            np.zeros((2, 12)),
            np.zeros(kernel.REALS),
            np.zeros(kernel.COUNTS, np.int64),
            np.empty(room),
            np.empty((room, 3), np.int32),
            probe.Probe(
                np.zeros(1),
                np.zeros(probe.COUNTS, np.int64),
                np.empty(descent, np.int32),
                np.empty(descent),
                np.full(probe.MEMOS, probe.NOBODY),
                np.empty((probe.MEMOS, 6)),
            ),
        )
        self._revisions = -1, -1

    def __reduce__(self) -> tuple[type[SignedSearch], tuple[Any, ...]]:
        """Of what another is made: its memory is its own."""
        return SignedSearch, (*self._models, self._apart)

    def ask(
        self,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        rel_err: float,
        abs_err: float,
        budget_s: float | None,
    ) -> Distance:
        """The answer at two poses, which are rigid motions; see `engine.signed_distance`."""
        if not any(model.is_solid for model in self._models):
            self._asked = None
            return self._apart(pose_a, pose_b, rel_err=rel_err, abs_err=abs_err, budget_s=budget_s)
        start = perf_counter()
        self._deadline = math.inf if budget_s is None else start + budget_s
        asked = None
        if budget_s is not None:
            revisions = tuple(model.revision for model in self._models)
            asked = (pose_a.tobytes(), pose_b.tobytes(), rel_err, abs_err, revisions)
        fresh = asked is None or asked != self._asked
        self._asked = None
        if fresh:
            self._begin(pose_a, pose_b, rel_err, abs_err)
        row = self._answer()
        cores = [model._hierarchy for model in self._models]
        offset = any(core.swept_radius + core.deviation > 0.0 for core in cores)
        if offset and not row[state.LOWER] > 0.0:
            overlap(cores, self._poses, row, int(self._depth.counts[kernel.MODEL]))
        self._asked = asked
        # Rounding may make a later bound the weaker one; both hold.
        lower, upper = self._limits
        self._limits = max(lower, row[state.LOWER]), min(upper, row[state.UPPER])
        row[state.LOWER], row[state.UPPER] = self._limits
        a, b = self._models
        return Distance(row, perf_counter() - start, None, (type(a), type(b)))

    def _begin(
        self,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        rel_err: float,
        abs_err: float,
    ) -> None:
        """Start a search from what the last one found."""
        a, b = self._models
        self._regions = sides_of(a).region, sides_of(b).region
        revisions = a.revision, b.revision
        if revisions != self._revisions:
            self._revisions = revisions
            self._depth.probe.keys[:] = probe.NOBODY  # found on surfaces that are no more
            if NOWHERE in self._insides:  # what was deepest may have been inside what is none now
                self._depth.reals[kernel.DEEPEST] = -math.inf
        self._poses = pose_a.copy(), pose_b.copy()
        self._limits = -math.inf, math.inf
        self._tolerance = {"rel_err": rel_err, "abs_err": abs_err}
        self._apart_tests = self._earlier_tests = 0, 0
        (a_inside, b_inside), (region_a, region_b) = self._insides, self._regions
        parts = len(region_a.samples) if b_inside else 0
        parts += len(region_b.samples) if a_inside else 0
        # A sample does not tell the side of its part where the other has holes, and of thousands of
        # parts, as points are, volumes tell more at once: then the sign comes by the vertices.
        self._by_vertices = HALF in self._insides or parts > FEW
        if self._by_vertices:
            abs_err = 0.0  # with it a vertex that decides on the sign might be left out
        kernel.begin_depth(
            *self._trees, *self._regions, *self._poses, rel_err, abs_err, self._depth
        )
        if parts > FEW:
            self._depth.counts[kernel.SAMPLED] = parts

    @property
    def _trees(self) -> tuple[Tree, Tree]:
        """The hierarchies as they are now."""
        a, b = self._models
        return a._hierarchy.tree, b._hierarchy.tree

    @property
    def _insides(self) -> tuple[int, int]:
        """Where the models have an inside."""
        return self._regions[0].inside, self._regions[1].inside

    def _answer(self) -> NDArray[np.float64]:
        """The row (ANSWER,) of what is known when the search ends, or time is over."""
        decided = self._test_samples() and not self._by_vertices
        if self._overlapping:
            return self._inside(self._search(samples_alone=False))
        apart = self._distance()
        if apart.lower > 0.0 and decided and not self._depth.counts[kernel.UNSURE]:
            # The surfaces do not meet and no part of either lies inside the other.
            return self._outside(apart, apart.lower, apart.status)
        certain = apart.lower > 0.0 or apart.status is not Status.OUT_OF_TIME
        ended = certain and self._search(samples_alone=False)
        if self._overlapping:
            return self._inside(ended)
        _, depth = self._bounds()
        if apart.lower > 0.0 and depth == 0.0:
            return self._outside(apart, apart.lower, apart.status)
        status = Status.INTERSECTING if ended else Status.OUT_OF_TIME
        return self._outside(apart, 0.0 - depth, status)

    @property
    def _overlapping(self) -> bool:
        """Whether a vertex of one mesh certainly lies inside the other."""
        return bool(self._depth.reals[kernel.DEEPEST] > self._depth.reals[kernel.SLACK])

    def _test_samples(self) -> bool:
        """Test one vertex of each connected part of what may lie inside; False where time ran out.

        A part that does not meet a closed surface lies wholly on the side of that vertex.
        """
        if self._depth.counts[kernel.SIZE] == 0 and self._depth.reals[kernel.DROPPED] == 0.0:
            return True  # the balls around the models do not meet, or neither has an inside
        return self._search(samples_alone=True)

    def _search(self, samples_alone: bool) -> bool:
        """Search for the deepest vertex until the end, or until the deadline: then False."""
        # At least one slice: whoever asks again and again comes to an end.
        slices = Slices(None if self._deadline == math.inf else self._deadline)
        while True:
            code = kernel.search_depth(
                *self._trees, *self._regions, self._depth, samples_alone, slices.steps,
            )  # fmt: skip
            if code == state.ENDED:
                return True
            if slices.over():
                return False

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

    def _bounds(self, weights: NDArray[np.float64] | None = None) -> tuple[float, float]:
        """Certified bounds of the depth; writes the weights (3,) of the deepest vertex's foot."""
        weights = np.zeros(3) if weights is None else weights
        return kernel.deepest(*self._trees, self._depth, weights)

    def _outside(self, apart: Distance, lower: float, status: Status) -> NDArray[np.float64]:
        """The answer where overlap is not certain: that of `distance` with another lower bound."""
        return self._with_tests(apart.row.copy(), lower, apart.upper, status)

    def _inside(self, ended: bool) -> NDArray[np.float64]:
        """The answer where overlap is certain."""
        weights, corner = np.zeros(3), np.zeros(3)
        shallow, deep = self._bounds(weights)
        counts = self._depth.counts
        deeper, other = int(counts[kernel.MODEL]), 1 - int(counts[kernel.MODEL])
        triangle, which = divmod(int(counts[kernel.VERTEX]), 3)
        corner[which] = 1.0
        bodies = self._models
        weights_of, triangles = np.empty((2, 3)), np.empty(2, np.int64)
        weights_of[deeper], weights_of[other] = corner, weights
        triangles[deeper], triangles[other] = triangle, counts[kernel.TRIANGLE]
        row = np.full(state.ANSWER, -1.0)  # its triangles are no hints where to search
        for k, (body, pose) in enumerate(zip(bodies, self._poses, strict=True)):
            core = body._hierarchy
            face = core.numbers[triangles[k]]
            local = weights_of[k] @ core.vertices[core.faces[face]]
            at = (state.POINT_A, state.POINT_B)[k]
            row[at : at + 3] = pose[:3, :3] @ local + pose[:3, 3]
            at = (state.FEATURE_A, state.FEATURE_B)[k]
            row[at : at + 3], row[at + 3] = weights_of[k], face
            row[(state.RADIUS_A, state.RADIUS_B)[k]] = core.swept_radius
        status = Status.OUT_OF_TIME
        if ended:
            exact = deep - shallow <= 4.0 * self._depth.reals[kernel.SLACK]
            status = Status.EXACT if exact else Status.WITHIN_TOLERANCE
        return self._with_tests(row, -deep, -shallow, status)

    def _with_tests(
        self, row: NDArray[np.float64], lower: float, upper: float, status: Status
    ) -> NDArray[np.float64]:
        """A row with these bounds, and the tests of the distance; a point's count as either."""
        points = int(self._depth.probe.counts[probe.TESTS])
        row[state.LOWER], row[state.UPPER] = lower, upper
        row[state.STATUS] = STATUSES.index(status)
        row[state.TESTS : state.TESTS + 2] = self._apart_tests
        row[state.TESTS : state.TESTS + 2] += points
        return row
