"""The watch over a scene's pairs: time goes where it matters, and every pair has bounds.

Time goes first to pairs whose bounds straddle a threshold, then to those with the nearest lower
bound, then to those not looked at for longest. A pair whose bodies did not move relative to each
other since its search ended costs nothing; a search that ran out of time goes on where it stopped
as long as its bodies stand still. What is not reached keeps its last answer, widened by the motion
since (`bounds`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from proximity_monitor import engine
from proximity_monitor.scene import bounds
from proximity_monitor.scene.state import PairState, PairStatus, PoseSample, Tick

if TYPE_CHECKING:
    from proximity_monitor.scene import Scene, Thresholds


_STATUS = {
    engine.Status.EXACT: PairStatus.EXACT,
    engine.Status.WITHIN_TOLERANCE: PairStatus.WITHIN_TOLERANCE,
    engine.Status.OUT_OF_TIME: PairStatus.BOUNDED,
    engine.Status.INTERSECTING: PairStatus.INTERSECTING,
}


class Monitor:
    """Answers for all watched pairs of a scene, tick by tick, under a time budget."""

    def __init__(
        self,
        scene: Scene,
        models: Mapping[str, engine.TriangleMesh],
        *,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        """Watch `scene`.

        Args:
            scene: bodies and watched pairs.
            models: by body name, in metres.
            clock: seconds, never going back; measures the budget and the ages.
        """
        self._clock = clock
        self._bodies = {body.name: i for i, body in enumerate(scene.bodies)}
        self._moving = [body.name for body in scene.bodies if body.moving]
        self._names = [(pair.a, pair.b) for pair in scene.pairs]
        self._ia = np.array([self._bodies[a] for a, _ in self._names], dtype=np.intp)
        self._ib = np.array([self._bodies[b] for _, b in self._names], dtype=np.intp)
        self._poses = np.tile(np.eye(4), (len(scene.bodies), 1, 1))
        self._version = np.zeros(len(scene.bodies), dtype=np.int64)
        self._known = np.array([not body.moving for body in scene.bodies])
        self._stale = np.array([body.moving for body in scene.bodies])
        for i, body in enumerate(scene.bodies):
            if not body.moving:
                self._poses[i] = engine.check_pose(body.pose, f"pose of {body.name}")

        meshes = [(models[a], models[b]) for a, b in self._names]
        self._pairs = [engine.Pair(a, b) for a, b in meshes]
        self._spheres = bounds.extents(meshes)
        self._answers = bounds.unanswered(
            np.array([a.vertices[a.faces[0, 0]] for a, _ in meshes]).reshape(-1, 3),
            np.array([b.vertices[b.faces[0, 0]] for _, b in meshes]).reshape(-1, 3),
        )
        count = len(meshes)
        self._status = [PairStatus.BOUNDED] * count
        self._done = np.zeros(count, dtype=bool)
        self._seen = np.full((count, 2), -1, dtype=np.int64)  # body versions of the last answer
        self._upper = np.full(count, np.inf)  # upper bound and points of the last answer
        self._points = np.zeros((2, count, 3))
        self._looked = np.full(count, -np.inf)
        self._scene_tolerance = [(pair.rel_err, pair.abs_err) for pair in scene.pairs]
        self.set_thresholds([pair.thresholds for pair in scene.pairs])
        self.set_tolerance()
        self.reset_minima()

    def set_thresholds(self, thresholds: Sequence[Thresholds]) -> None:
        """Take new thresholds, one a pair: they order the searches from the next tick on."""
        self._levels = np.array([(t.warn, t.stop) for t in thresholds]).reshape(-1, 2)

    def set_tolerance(self, rel_err: float | None = None, abs_err: float | None = None) -> None:
        """Take tolerances for all pairs, abs_err in metres; None: each pair's own of the scene."""
        self._tolerance = [
            (own_rel if rel_err is None else rel_err, own_abs if abs_err is None else abs_err)
            for own_rel, own_abs in self._scene_tolerance
        ]
        self._rel, self._abs = np.array(self._tolerance).reshape(-1, 2).T
        self._done[:] = False

    def reset_minima(self) -> None:
        """Forget the smallest clearances of the session."""
        self._min_upper = np.full(len(self._names), np.inf)
        self._min_lower = np.full(len(self._names), np.inf)

    def tick(self, poses: Mapping[str, PoseSample | None], budget_s: float) -> Tick:
        """Answer for the given poses within the budget.

        Args:
            poses: the last good pose of each moving body by name; None or a missing name means that
                the body has no pose yet. Names of other bodies are ignored.
            budget_s: seconds for the whole tick. 0 searches nothing and still certifies
                everything. A search that is running at the end of the budget overruns it by one
                slice at most.

        Raises:
            ValueError: a pose is not finite or not rigid; it names the body, nothing has changed.
        """
        started = self._clock()
        self._take(poses)
        now = bounds.place(self._poses[self._ia], self._poses[self._ib], self._spheres)
        view = self._view(now)
        looked_at = []
        for i in self._order(view):
            left = budget_s - (self._clock() - started)
            if left <= 0.0:
                break
            self._search(i, now, view, left)
            looked_at.append(int(i))
        pairs = self._report(view)
        elapsed = self._clock() - started
        return Tick(pairs, elapsed, budget_s, tuple(looked_at), int(view.wanting.sum()))

    def _take(self, poses: Mapping[str, PoseSample | None]) -> None:
        checked = {}
        for name in self._moving:
            sample = poses.get(name)
            if sample is not None and not (
                self._known[self._bodies[name]]
                and np.array_equal(sample.pose, self._poses[self._bodies[name]])
            ):
                checked[name] = engine.check_pose(sample.pose, f"pose of {name}")
        for name in self._moving:
            i, sample = self._bodies[name], poses.get(name)
            self._known[i] = sample is not None
            self._stale[i] = sample is None or sample.stale
            if name in checked:
                self._poses[i] = checked[name]
                self._version[i] += 1

    def _view(self, now: bounds.Placement) -> _View:
        widened = bounds.widen(self._answers, now, self._spheres)
        lower, upper = widened.lower, widened.upper
        # Bodies that stand still bit by bit keep the very numbers of their answer.
        same = (self._seen == np.stack([self._version[self._ia], self._version[self._ib]], 1)).all(
            1
        )
        lower = np.where(same, self._answers.lower, lower)
        upper = np.where(same, self._upper, upper)
        points = np.where(same[:, None], self._points, (widened.point_a, widened.point_b))
        known = self._known[self._ia] & self._known[self._ib]
        answered = self._done & (same | widened.still)
        tolerated = (self._rel > 0.0) & (upper <= (1.0 + self._rel) * lower)
        tolerated |= (self._abs > 0.0) & (upper - lower <= self._abs)
        return _View(
            lower, upper, points, known, answered, tolerated, known & ~(answered | tolerated)
        )

    def _order(self, view: _View) -> np.ndarray:
        """Return the pairs that want a search, the most urgent first."""
        wanting = np.flatnonzero(view.wanting)
        lower, upper = view.lower[wanting], view.upper[wanting]
        levels = self._levels[wanting]
        straddles = ((lower[:, None] <= levels) & (levels < upper[:, None])).any(axis=1)
        stale = (self._stale[self._ia] | self._stale[self._ib])[wanting]
        return wanting[np.lexsort((self._looked[wanting], lower, ~straddles, stale))]

    def _search(self, i: int, now: bounds.Placement, view: _View, budget_s: float) -> None:
        rel_err, abs_err = self._tolerance[i]
        pose_a, pose_b = now.pose_a[i], now.pose_b[i]
        found = self._pairs[i].distance(
            pose_a, pose_b, rel_err=rel_err, abs_err=abs_err, budget_s=budget_s
        )
        done = found.status is not engine.Status.OUT_OF_TIME
        view.lower[i] = found.lower if done else max(view.lower[i], found.lower)
        if done or found.upper <= view.upper[i]:
            view.upper[i] = found.upper
            view.points[0, i], view.points[1, i] = found.point_a, found.point_b
        self._status[i] = _STATUS[found.status]
        self._done[i] = view.answered[i] = done
        view.wanting[i] = not done

        self._upper[i] = view.upper[i]
        self._points[:, i] = view.points[:, i]
        self._seen[i] = self._version[self._ia[i]], self._version[self._ib[i]]
        self._looked[i] = self._clock()
        kept = self._answers
        kept.lower[i], kept.relative[i] = view.lower[i], now.relative[i]
        kept.size[i], kept.defect[i] = now.size[i], now.defect[i]
        kept.witness_a[i] = bounds.carry_back(pose_a, view.points[0, i])
        kept.witness_b[i] = bounds.carry_back(pose_b, view.points[1, i])

    def _report(self, view: _View) -> tuple[PairState, ...]:
        sure = view.known & ~(self._stale[self._ia] | self._stale[self._ib])
        self._min_upper[sure] = np.minimum(self._min_upper, view.upper)[sure]
        self._min_lower[sure] = np.minimum(self._min_lower, view.lower)[sure]
        ages = np.where(view.answered, 0.0, self._clock() - self._looked)
        nothing = np.full(3, np.nan)
        states = []
        for i, (a, b) in enumerate(self._names):
            known = bool(view.known[i])
            status = PairStatus.UNKNOWN
            if known:
                status = PairStatus.WITHIN_TOLERANCE if view.tolerated[i] else PairStatus.BOUNDED
                status = self._status[i] if view.answered[i] else status
            states.append(
                PairState(
                    a=a,
                    b=b,
                    lower=float(view.lower[i]) if known else float("nan"),
                    upper=float(view.upper[i]) if known else float("nan"),
                    point_a=view.points[0, i] if known else nothing,
                    point_b=view.points[1, i] if known else nothing,
                    status=status,
                    age_s=float(ages[i]),
                    silent=tuple(name for name in (a, b) if self._stale[self._bodies[name]]),
                    session_min=float(self._min_upper[i]),
                    session_min_lower=float(self._min_lower[i]),
                )
            )
        return tuple(states)


class _View(NamedTuple):
    """The pairs during one tick; searches improve the arrays in place."""

    lower: np.ndarray
    upper: np.ndarray
    points: np.ndarray
    """(2, k, 3) world."""
    known: np.ndarray
    answered: np.ndarray
    """The last search ended, and the bodies did not move relative to each other since."""
    tolerated: np.ndarray
    """The bounds satisfy the tolerance already."""
    wanting: np.ndarray
    """Known, and worth a search."""


def simulate(
    scene: Scene,
    models: Mapping[str, engine.TriangleMesh],
    recorded_poses: Iterable[Mapping[str, np.ndarray | None]],
    budget_s: float,
    *,
    clock: Callable[[], float] = time.perf_counter,
) -> list[Tick]:
    """Run a monitor over recorded poses, a tick for each mapping from body name to (4, 4) pose."""
    monitor = Monitor(scene, models, clock=clock)
    return [
        monitor.tick({n: None if p is None else PoseSample(p) for n, p in poses.items()}, budget_s)
        for poses in recorded_poses
    ]
