"""The signed distance of two solids."""

from __future__ import annotations

from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .kernels import depth as kernel
from .kernels import state
from .mesh import TriangleMesh
from .pair import Pair, check_tolerance
from .poses import check_pose
from .result import Distance, Feature, Status
from .solid import as_solid

_SLICE = 8
"""Points tested between two looks at the clock: some 50 µs, what a budget may be overrun by."""

_LONG_SLICE = 1 << 14
"""Points tested between two returns to Python where there is no budget, so that Ctrl-C is heard."""


def signed_distance(
    a: TriangleMesh,
    pose_a: ArrayLike,
    b: TriangleMesh,
    pose_b: ArrayLike,
    *,
    rel_err: float = 0.0,
    abs_err: float = 0.0,
    budget_s: float | None = None,
) -> Distance:
    """Signed distance of two solids: positive apart, negative where they overlap.

    Where the solids are disjoint it is the minimum distance of their surfaces, as `distance` has
    it. Where they overlap, also where one lies wholly inside the other, it is minus the **depth of
    the deepest vertex**: the largest distance to the other model's surface of any vertex of one
    that lies inside the other. Where surfaces cross although no vertex of either lies inside the
    other, as with crossed bars, the depth and the signed distance are 0. The depth is not the
    shortest motion that would separate the solids.

    A point is inside a solid where the surface's winding number around it is not 0 (Jacobson et al.
    2013, section 3, "Robust inside-outside segmentation using generalized winding numbers"). So
    faces may all point outward or all inward, overlapping parts make a union, and a part turned
    the other way inside another is a cavity. The depth is measured to the surface as it is given:
    to faces within a union as well.

    Args:
        a: first solid: a watertight mesh, see Raises.
        pose_a: (4, 4) model to world, metres.
        b: second solid.
        pose_b: (4, 4) model to world, metres.
        rel_err: stop when the bounds differ by at most rel_err · true distance or depth.
        abs_err: metres; stop when the bounds differ by at most abs_err, whichever is first.
        budget_s: seconds; stop with certified bounds when they are over. None: no limit.

    Returns:
        The bounds, in metres: `lower <= signed distance <= upper`, whatever stopped the search.
        Apart is certain where `lower > 0`, overlap where `upper < 0`; then -upper and -lower bound
        the depth, one witness point is the deepest vertex found and the other its nearest point on
        the other surface. Else they are those of `distance`, and their distance bounds the signed
        one from above.
        `bound_tests` and `primitive_tests` are those of `distance`; every point whose depth was
        tested counts as one of either.
        Status INTERSECTING: the surfaces touch, cross without a vertex inside, or are so close that
        rounding cannot tell; a depth that is known to differ from 0 comes as EXACT,
        WITHIN_TOLERANCE or OUT_OF_TIME.

    Raises:
        ModelError: a mesh that encloses no solid: open edges, faces of unlike orientation, or no
            volume; the message names the mesh and the place.
        ValueError: a pose that is no rigid motion, a tolerance or budget that is negative or NaN.
    """
    start = perf_counter()
    check_tolerance("rel_err", rel_err)
    check_tolerance("abs_err", abs_err)
    if budget_s is not None:
        check_tolerance("budget_s", budget_s)
    pose_a, pose_b = check_pose(pose_a, "pose_a"), check_pose(pose_b, "pose_b")
    deadline = None if budget_s is None else start + budget_s
    search = _DepthSearch(a, b, pose_a, pose_b, rel_err, abs_err)
    decided = search.test_samples(deadline)
    if search.overlapping:
        ended = search.run(deadline)
        return search.answer(ended, start)
    apart = _distance(a, pose_a, b, pose_b, rel_err, abs_err, deadline)
    if apart.lower > 0.0:
        if decided and not search.unsure:
            # The surfaces do not meet and no part of either lies inside the other.
            return _with(apart, apart.lower, apart.upper, apart.status, search.tests, start)
        if not decided:
            return search.merged(apart, Status.OUT_OF_TIME, start)
    elif apart.status is Status.OUT_OF_TIME:
        return search.merged(apart, Status.OUT_OF_TIME, start)
    ended = search.run(deadline)
    if search.overlapping:
        return search.answer(ended, start)
    return search.merged(apart, Status.INTERSECTING if ended else Status.OUT_OF_TIME, start)


def _distance(
    a: TriangleMesh,
    pose_a: NDArray[np.float64],
    b: TriangleMesh,
    pose_b: NDArray[np.float64],
    rel_err: float,
    abs_err: float,
    deadline: float | None,
) -> Distance:
    """`distance`, sure to tell whether the surfaces meet unless time is over."""
    pair = Pair(a, b)
    found = pair.distance(
        pose_a, pose_b, rel_err=rel_err, abs_err=abs_err, budget_s=_left(deadline)
    )
    if found.lower == 0.0 and found.status is Status.WITHIN_TOLERANCE:
        # A tolerance so wide that the surfaces might still meet does not tell the sign. It allows
        # all between 0 and `upper`, hence whatever is found next.
        found = pair.distance(pose_a, pose_b, rel_err=1.0, budget_s=_left(deadline))
    return found


def _left(deadline: float | None) -> float | None:
    return None if deadline is None else max(deadline - perf_counter(), 0.0)


def _with(
    apart: Distance, lower: float, upper: float, status: Status, tests: int, start: float
) -> Distance:
    """An answer of `distance` with other bounds and with the tests of points added."""
    return Distance(
        lower, upper, apart.point_a, apart.point_b, apart.feature_a, apart.feature_b, status,
        apart.bound_tests + tests, apart.primitive_tests + tests, perf_counter() - start,
    )  # fmt: skip


class _DepthSearch:
    """The search for the deepest vertex of either solid inside the other."""

    def __init__(
        self,
        a: TriangleMesh,
        b: TriangleMesh,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        rel_err: float,
        abs_err: float,
    ) -> None:
        self._bodies = a, b
        self._poses = pose_a, pose_b
        self._trees = a._tree, b._tree
        self._solids = as_solid(a), as_solid(b)
        # Each lane and each vertex enters the heap at most once.
        room = sum(len(tree.children) + 3 * len(tree.triangles) for tree in self._trees)
        descent = 1 + max(a.depth, b.depth) * 15
        self._state = kernel.Depth(
            np.zeros((2, 12)),
            np.zeros(kernel.REALS),
            np.zeros(kernel.COUNTS, np.int64),
            np.empty(room),
            np.empty((room, 3), np.int32),
            np.empty(descent, np.int32),
            np.empty(descent),
        )
        kernel.begin_depth(
            *self._trees, *self._solids, pose_a, pose_b, rel_err, abs_err, self._state
        )

    @property
    def overlapping(self) -> bool:
        """Whether a vertex of one solid certainly lies inside the other."""
        return bool(self._state.reals[kernel.DEEPEST] > self._state.reals[kernel.SLACK])

    @property
    def unsure(self) -> bool:
        """Whether a tested vertex is as good as on the other surface."""
        return bool(self._state.counts[kernel.UNSURE] > 0)

    @property
    def tests(self) -> int:
        """Points tested."""
        return int(self._state.counts[kernel.TESTS])

    def test_samples(self, deadline: float | None) -> bool:
        """Test one vertex of each connected part of either solid; False where time ran out.

        A part whose surface does not meet the other's lies wholly on the side of that vertex.
        """
        if self._state.counts[kernel.SIZE] == 0 and self._state.reals[kernel.DROPPED] == 0.0:
            return True  # the balls around the solids do not meet
        for model, solid in enumerate(self._solids):
            for first in range(0, len(solid.samples), _SLICE):
                if deadline is not None and perf_counter() >= deadline:
                    return False
                some = solid.samples[first : first + _SLICE]
                kernel.search_depth(*self._trees, *self._solids, self._state, some, model, 0)
        return True

    def run(self, deadline: float | None) -> bool:
        """Search until the end, or until the deadline: then False."""
        steps = _LONG_SLICE if deadline is None else _SLICE
        if deadline is not None and perf_counter() >= deadline:
            steps = 0
        while True:
            code = kernel.search_depth(
                *self._trees, *self._solids, self._state, self._solids[0].samples[:0], 0, steps
            )
            if code == state.ENDED:
                return True
            if deadline is not None and perf_counter() >= deadline:
                return False

    def merged(self, apart: Distance, status: Status, start: float) -> Distance:
        """The answer where overlap is not certain: what is known of depth and distance together."""
        _, depth = kernel.deepest(*self._trees, self._state, np.zeros(3))
        if depth == 0.0 and apart.lower > 0.0:
            return _with(apart, apart.lower, apart.upper, apart.status, self.tests, start)
        return _with(apart, min(-depth, 0.0) + 0.0, apart.upper, status, self.tests, start)

    def answer(self, ended: bool, start: float) -> Distance:
        """The answer where overlap is certain."""
        weights, corner = np.zeros(3), np.zeros(3)
        shallow, deep = kernel.deepest(*self._trees, self._state, weights)
        counts = self._state.counts
        deeper, other = int(counts[kernel.MODEL]), 1 - int(counts[kernel.MODEL])
        triangle, which = divmod(int(counts[kernel.VERTEX]), 3)
        corner[which] = 1.0
        features: list[Feature | None] = [None, None]
        features[deeper] = Feature(int(self._bodies[deeper]._face_of[triangle]), corner)
        nearest = int(counts[kernel.TRIANGLE])
        features[other] = Feature(int(self._bodies[other]._face_of[nearest]), weights)
        points = []
        for body, pose, feature in zip(self._bodies, self._poses, features, strict=True):
            local = feature.barycentric @ body.vertices[body.faces[feature.triangle]]
            points.append(pose[:3, :3] @ local + pose[:3, 3])
        status = Status.OUT_OF_TIME
        if ended:
            exact = deep - shallow <= 4.0 * self._state.reals[kernel.SLACK]
            status = Status.EXACT if exact else Status.WITHIN_TOLERANCE
        return Distance(
            -deep, -shallow, *points, *features, status,
            self.tests, self.tests, perf_counter() - start,
        )  # fmt: skip
