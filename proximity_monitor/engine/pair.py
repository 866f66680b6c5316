"""Two models whose last answer is remembered: frame-to-frame coherence and resumable searches."""

from __future__ import annotations

import math
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from .kernels import search as kernel
from .kernels import state
from .mesh import TriangleMesh
from .poses import as_pose, check_pose
from .result import Clearance, Collision, Distance, Feature, Status

_SLICE = 256
"""Steps between two looks at the clock, some 30 µs: what a budget may be overrun by. With 64 a
search under a budget takes half as long again."""

_LONG_SLICE = 1 << 18
"""Steps between two returns to Python where there is no budget, so that Ctrl-C is heard."""

_TINY = math.ulp(0.0)


class Pair:
    """Two models that are asked about again and again.

    The nearest triangles of one call are tried first in the next (Larsen et al. 1999, section
    6.2), and a search that ran out of time is continued where the same question is asked again.
    A Pair belongs to one thread at a time; the models may be shared.

    Args:
        a: the first model.
        b: the second model.
    """

    __slots__ = ("_answer", "_asked", "_state", "a", "b")

    def __init__(self, a: TriangleMesh, b: TriangleMesh) -> None:
        self.a = a
        self.b = b
        self._state = new_state(a, b)
        self._answer = np.zeros(state.ANSWER)
        self._asked: tuple[bytes, bytes, float, float] | None = None

    def distance(
        self,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        *,
        rel_err: float = 0.0,
        abs_err: float = 0.0,
        budget_s: float | None = None,
    ) -> Distance:
        """Minimum distance at two poses; see `engine.distance`."""
        start = perf_counter()
        check_tolerance("rel_err", rel_err)
        check_tolerance("abs_err", abs_err)
        if budget_s is not None:
            check_tolerance("budget_s", budget_s)
        pose_a, pose_b = as_pose(pose_a, "pose_a"), as_pose(pose_b, "pose_b")
        if budget_s is None:
            code = self._run(pose_a, pose_b, rel_err, abs_err, 0.0, math.inf, None, True)
            self._asked = None
        else:
            asked = (pose_a.tobytes(), pose_b.tobytes(), rel_err, abs_err)
            fresh = asked != self._asked
            self._asked = None
            deadline = start + budget_s
            code = self._run(pose_a, pose_b, rel_err, abs_err, 0.0, math.inf, deadline, fresh)
            self._asked = asked
        answer, counts = self._answer.copy(), self._state.counts
        weights = self._state.reals[state.WEIGHTS_A :].copy()
        return Distance(
            float(answer[0]),
            float(answer[1]),
            answer[2:5],
            answer[5:8],
            Feature(int(self.a._face_of[counts[state.TRIANGLE_A]]), weights[:3]),
            Feature(int(self.b._face_of[counts[state.TRIANGLE_B]]), weights[3:]),
            self._status(code),
            int(counts[state.BOUND_TESTS]),
            int(counts[state.PRIMITIVE_TESTS]),
            perf_counter() - start,
        )

    def _status(self, code: int) -> Status:
        """Why a distance search that returned `code` stopped."""
        certain = self._state.reals[state.DISTANCE] - self._state.reals[state.SLACK]
        if certain <= 0.0:
            return Status.INTERSECTING
        if code == state.CUT:
            return Status.OUT_OF_TIME
        if self._state.reals[state.LIMIT] < certain:
            return Status.WITHIN_TOLERANCE
        return Status.EXACT

    def within(
        self, pose_a: NDArray[np.float64], pose_b: NDArray[np.float64], clearance: float
    ) -> Clearance:
        """Whether the surfaces may be as near as `clearance`; see `engine.within`."""
        check_tolerance("clearance", clearance)
        pose_a, pose_b = as_pose(pose_a, "pose_a"), as_pose(pose_b, "pose_b")
        self._asked = None
        beyond = math.nextafter(clearance, math.inf)
        self._run(pose_a, pose_b, 0.0, 0.0, clearance, beyond, None, True)
        answer, counts = self._answer.copy(), self._state.counts
        lower = float(answer[state.LOWER])
        return Clearance(
            lower <= clearance,
            lower,
            float(answer[state.UPPER]),
            answer[2:5],
            answer[5:8],
            int(counts[state.BOUND_TESTS]),
            int(counts[state.PRIMITIVE_TESTS]),
        )

    def collide(
        self,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        *,
        all_contacts: bool = False,
    ) -> Collision:
        """Whether the surfaces touch or cross; see `engine.collide`."""
        pose_a, pose_b = as_pose(pose_a, "pose_a"), as_pose(pose_b, "pose_b")
        self._asked = None
        self._run(pose_a, pose_b, 0.0, 0.0, 0.0, _TINY, None, True)
        counts = self._state.counts
        colliding = bool(self._answer[state.LOWER] == 0.0)
        point = self._answer[2:5].copy()
        tests = counts[state.BOUND_TESTS], counts[state.PRIMITIVE_TESTS]
        contacts = counts[None, state.TRIANGLE_A : state.TRIANGLE_B + 1][: int(colliding)]
        if colliding and all_contacts:
            contacts, more = self._all_contacts(pose_a, pose_b)
            tests = tests[0] + more[0], tests[1] + more[1]
        faces = np.stack((self.a._face_of[contacts[:, 0]], self.b._face_of[contacts[:, 1]]), axis=1)
        return Collision(colliding, faces, point, int(tests[0]), int(tests[1]))

    def _all_contacts(
        self, pose_a: NDArray[np.float64], pose_b: NDArray[np.float64]
    ) -> tuple[NDArray[np.int32], tuple[int, int]]:
        """Every pair of triangles in contact, in tree order; and the tests that it took."""
        found = []
        gathering = self._state._replace(contacts=np.zeros((1024, 2), np.int32))
        code, fresh = state.CONTACTS_FULL, True
        while code in (state.CONTACTS_FULL, state.CUT):
            gathering.counts[state.CONTACTS] = 0
            code = kernel.search(
                self.a._tree, self.b._tree, gathering, pose_a, pose_b, 0.0, 0.0, -math.inf, _TINY,
                _LONG_SLICE, fresh, self._answer,
            )  # fmt: skip
            found.append(gathering.contacts[: gathering.counts[state.CONTACTS]].copy())
            fresh = False
        counts = gathering.counts
        return np.concatenate(found), (counts[state.BOUND_TESTS], counts[state.PRIMITIVE_TESTS])

    def _run(
        self,
        pose_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        rel_err: float,
        abs_err: float,
        stop: float,
        limit: float,
        deadline: float | None,
        fresh: bool,
    ) -> int:
        """Run the search in slices until it ends or the deadline is near."""
        steps = _LONG_SLICE if deadline is None else _SLICE
        if deadline is not None and not perf_counter() < deadline:
            steps = 0
        while True:
            code = kernel.search(
                self.a._tree, self.b._tree, self._state, pose_a, pose_b,
                rel_err, abs_err, stop, limit, steps, fresh, self._answer,
            )  # fmt: skip
            if code == state.BAD_POSE_A:
                check_pose(pose_a, "pose_a")
            if code == state.BAD_POSE_B:
                check_pose(pose_b, "pose_b")
            if code != state.CUT:
                return code
            if deadline is not None and perf_counter() >= deadline:
                return code
            fresh = False


def new_state(a: TriangleMesh, b: TriangleMesh) -> state.State:
    """An empty search over two models, whose stack is as deep as a descent can ever need."""
    # Opening a volume replaces one pair by at most sixteen, once for each level of either model.
    capacity = 1 + (a.depth + b.depth) * 15
    return state.State(
        np.zeros((2, 12)),
        np.zeros(state.REALS),
        np.zeros(state.COUNTS, np.int64),
        np.zeros((capacity, 2), np.int32),
        np.zeros(capacity),
        np.zeros((0, 2), np.int32),
    )


def check_tolerance(name: str, value: float) -> None:
    """Raise ValueError unless `value` is a number that is not negative (infinity is allowed)."""
    if not value >= 0.0:
        raise ValueError(f"{name} = {value!r}: must be a number that is not negative")
