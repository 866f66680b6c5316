"""The watch over a scene's pairs: time goes where it matters, and every pair has bounds.

Time goes first to pairs whose bounds straddle a threshold, then to those with the nearest lower
bound, then to those not looked at for longest. A pair whose bodies did not move relative to each
other since its search ended costs nothing, one that is farther apart than its range is not even
met; a search that ran out of time goes on where it stopped as long as its bodies stand still. What
is not reached keeps its last answer, widened by the motion since (`engine.Answers`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from proximity_monitor import engine
from proximity_monitor.scene.books import Books
from proximity_monitor.scene.near import NearPairs
from proximity_monitor.scene.placing import Placing
from proximity_monitor.scene.searches import Question, Searches
from proximity_monitor.scene.state import PairStates, PoseSample, Tick
from proximity_monitor.scene.view import View

if TYPE_CHECKING:
    from proximity_monitor.scene import Scene, Thresholds


_ONCE_S = 50e-6
"""By how much more a tick's end may be taken to last after one that lasted longer."""


class Monitor:
    """Answers for all watched pairs of a scene, tick by tick, under a time budget."""

    def __init__(
        self,
        scene: Scene,
        models: Mapping[str, engine.TriangleMesh],
        *,
        threads: int = 1,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        """Watch `scene`; everything that is done but once, such as compiling, is done here.

        Args:
            scene: bodies and watched pairs.
            models: by body name, in metres.
            threads: how many share the searches of a tick; what they find does not depend on it,
                but for which of them the budget allows.
            clock: seconds, never going back; measures the budget and the ages.

        Raises:
            engine.ModelError: a body is `solid`, but its model encloses none; it names the body.
            ValueError: no thread at all.
        """
        self._clock = clock
        self._pairs = scene.pairs
        self._placing = placing = Placing(scene.bodies, models)
        self._near = NearPairs(scene.pairs, placing.answers, placing.solid)
        self._books = Books(scene.pairs, self._near, placing.solid)
        self._searches = Searches(placing.names, placing.models, threads)
        self._searches.check_solids(np.flatnonzero(placing.solid).tolist())
        self._searches.prepare()
        self._compile()
        self._ignored = np.empty(0, np.int64)
        self._searched_s = self._closing_s = 0.0

    def _compile(self) -> None:
        """Run the kernels that no search runs, so that the first tick need not compile them."""
        two, none = np.arange(2), np.empty(0, np.int64)
        engine.BroadPhase().near(np.zeros((2, 3)), np.ones(2), np.ones(2, bool), two)
        answers = self._placing.answers
        answers.move(none, np.empty((0, 4, 4)))
        answers.carried(none)
        answers.keep(none, np.empty((0, 2)), np.empty((0, 2, 3)))

    def set_thresholds(self, thresholds: Sequence[Thresholds]) -> None:
        """Take new thresholds, one a pair: they order the searches from the next tick on.

        A pair's range counts as warn + hysteresis where that is more.
        """
        self._books.set_thresholds(thresholds)

    def set_tolerance(self, rel_err: float | None = None, abs_err: float | None = None) -> None:
        """Take tolerances for all pairs, abs_err in metres; None: each pair's own of the scene."""
        self._books.set_tolerance(rel_err, abs_err)

    def set_vertices(self, name: str, vertices: np.ndarray) -> None:
        """Take the vertices (n, 3) of a deforming body: metres, model frame.

        The body's model is refitted, for every body that shares it. Bounds stay certified: each
        distance changes by no more than the largest displacement of a vertex.

        Raises:
            KeyError: there is no such body.
            engine.ModelError: see `engine.TriangleMesh.refit`, then nothing has changed; or a
                `solid` body's model encloses a solid no more.
        """
        changed = self._placing.refit(name, vertices)
        self._searches.check_solids(body for body in changed if self._placing.solid[body])

    def ignore(self, pairs: Collection[int]) -> None:
        """Neither search nor list these pairs, positions among the scene's, from now on."""
        self._ignored = np.array(sorted(pairs), dtype=np.int64)

    def reset_minima(self) -> None:
        """Forget the smallest clearances of the session."""
        self._books.reset_minima()

    def close(self) -> None:
        """End the threads, and forget searches that are not finished."""
        self._searches.close()

    def tick(
        self,
        poses: Mapping[str, PoseSample | None],
        budget_s: float,
        *,
        distances: bool = True,
    ) -> Tick:
        """Answer for the given poses within the budget.

        Args:
            poses: the last good pose of each moving body by name; None or a missing name means that
                the body has no pose yet. Names of other bodies are ignored.
            budget_s: seconds for the whole tick. 0 searches nothing and still certifies
                everything. A search that is running at the end of the budget overruns it by one
                slice at most.
            distances: whether anybody wants the distances; if not, all pairs are only decided
                against their thresholds, which is cheaper.

        Raises:
            ValueError: a pose is not finite or not rigid; it names the body, nothing has changed.
        """
        started = self._clock()
        placing = self._placing
        moved = placing.take(poses)
        change = self._near.update(placing.known, placing.silent, moved)
        self._searches.forget(change.left_rows)
        self._books.update(change)
        view = View(self._near, placing, self._books, self._ignored, distances)
        # What closes the tick is set aside beforehand, as long as it takes.
        deadline = started + budget_s - min(self._closing_s, budget_s / 2.0)
        self._searched_s = self._clock()
        looked_at = self._search(view, deadline)
        tick = self._report(view, looked_at, started, budget_s)
        # The longest lately, what a search overran included; but where the machine was busy
        # elsewhere, once is no measure.
        closing_s = started + tick.elapsed_s - min(self._searched_s, deadline)
        closing_s = min(closing_s, self._closing_s + _ONCE_S)
        self._closing_s = max(closing_s, 0.9 * self._closing_s)
        return tick

    def _search(self, view: View, deadline: float) -> list[int]:
        """Search pairs until all is known or the time is over; those that were, in their order.

        A pair that takes long gets half of the time that is left as long as others want some too,
        and more of it when they had their turn.
        """
        looked: dict[int, None] = {}
        while self._clock() < deadline and len(todo := view.order()):
            alone = view.alone(todo)
            start = 0
            while start < len(todo):
                left = deadline - self._clock()
                if left <= 0.0:
                    return list(looked)
                same = np.flatnonzero(alone[start:] != alone[start])
                end = start + int(same[0]) if len(same) else len(todo)
                if alone[start]:
                    end = min(end, start + self._searches.threads)
                    share = left if start == 0 and end == len(todo) else left / 2.0
                    self._ask_alone(view, todo[start:end], share)
                    looked.update(dict.fromkeys(todo[start:end].tolist()))
                else:
                    found = self._ask_many(view, todo[start:end], left)
                    looked.update(dict.fromkeys(found.tolist()))
                start = end
        return list(looked)

    def _ask_many(self, view: View, at: np.ndarray, budget_s: float) -> np.ndarray:
        """Search pairs together; those that were reached."""
        level, (rel_err, abs_err) = view.level(at), view.tolerance(at)
        bodies = np.stack((self._near.a[at], self._near.b[at]), axis=1)
        found = self._searches.many(
            self._placing.answers.poses, bodies, rel_err, abs_err, level, view.hints(at), budget_s
        )
        self._searched_s = self._clock()
        hit = found.searched
        at = at[hit]
        bounds = np.stack((found.lower[hit], found.upper[hit]), axis=1)
        points = np.stack((found.points_a[hit], found.points_b[hit]), axis=1)
        view.take(at, level[hit], bounds, points, found.status[hit], self._searched_s)
        view.note_hints(at, found.triangles[hit])
        return at

    def _ask_alone(self, view: View, at: np.ndarray, budget_s: float) -> None:
        """Search pairs side by side, each in a thread."""
        level, (rel_err, abs_err) = view.level(at), view.tolerance(at)
        signed = view.signed(at)
        rows, a, b = self._near.rows[at], self._near.a[at], self._near.b[at]
        questions = [
            Question(*each)
            for each in zip(
                rows.tolist(), a.tolist(), b.tolist(), signed.tolist(),
                rel_err.tolist(), abs_err.tolist(), level.tolist(), strict=True,
            )
        ]  # fmt: skip
        found = self._searches.alone(self._placing.answers.poses, questions, budget_s)
        self._searched_s = self._clock()
        bounds = np.array([(each.lower, each.upper) for each in found])
        points = np.array([(each.point_a, each.point_b) for each in found])
        status = np.array([_STATUS[each.status] for each in found])
        view.take(at, level, bounds, points, status, self._searched_s)

    def _report(self, view: View, looked_at: list[int], started: float, budget_s: float) -> Tick:
        near, books = self._near, self._books.table
        rows = near.rows
        sure = rows[view.known & ~view.stale]
        for name, bound in (("min_upper", view.upper), ("min_lower", view.lower)):
            books[name][sure] = np.minimum(books[name][sure], bound[view.known & ~view.stale])
        ages = np.where(view.answered, 0.0, self._clock() - books["looked"][rows])
        ages[looked_at] = 0.0
        at = np.flatnonzero(view.listed())
        unknown = ~view.known[at]
        lower, upper, points = view.lower[at], view.upper[at], view.points[at]
        lower[unknown], upper[unknown], points[unknown] = np.nan, np.nan, np.nan
        bodies = np.stack((near.a[at], near.b[at]), axis=1)
        pairs = PairStates(
            names=self._placing.names,
            positions=near.positions[at],
            bodies=bodies,
            lower=lower,
            upper=upper,
            points=points,
            status=view.status()[at],
            age_s=ages[at],
            silent=self._placing.silent[bodies],
            session_min=books["min_upper"][rows[at]],
            session_min_lower=books["min_lower"][rows[at]],
        )
        return Tick(
            pairs,
            elapsed_s=self._clock() - started,
            budget_s=budget_s,
            looked_at=tuple(near.positions[looked_at].tolist()),
            left=int(view.wanting.sum()),
            far=len(self._pairs) - len(self._ignored) - len(at) - near.unsure,
            beyond=near.beyond,
            unsure=near.unsure,
        )


_STATUS = {status: code for code, status in enumerate(engine.Status)}


def simulate(
    scene: Scene,
    models: Mapping[str, engine.TriangleMesh],
    recorded_poses: Iterable[Mapping[str, np.ndarray | None]],
    budget_s: float,
    *,
    threads: int = 1,
    distances: bool = True,
    clock: Callable[[], float] = time.perf_counter,
) -> list[Tick]:
    """Run a monitor over recorded poses, a tick for each mapping from body name to (4, 4) pose."""
    monitor = Monitor(scene, models, threads=threads, clock=clock)
    try:
        return [
            monitor.tick(
                {n: None if p is None else PoseSample(p) for n, p in poses.items()},
                budget_s,
                distances=distances,
            )
            for poses in recorded_poses
        ]
    finally:
        monitor.close()
