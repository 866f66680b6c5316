"""The watch over a scene's pairs: time goes where it matters, and every pair has bounds.

Time goes first to pairs whose bounds straddle a threshold, then to those with the nearest lower
bound, then to those not looked at for longest. A pair whose bodies did not move relative to each
other since its search ended costs nothing, one that is farther apart than its range is not even
met; a search that ran out of time goes on where it stopped as long as its bodies stand still. What
is not reached keeps its last answer, widened by the motion since (`engine.Answers`).
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from proximity_monitor import engine
from proximity_monitor.scene.books import Books
from proximity_monitor.scene.near import NearPairs
from proximity_monitor.scene.placing import Placing
from proximity_monitor.scene.searches import Searches
from proximity_monitor.scene.state import PairStates, PoseSample, Tick

if TYPE_CHECKING:
    from proximity_monitor.scene import Scene, Thresholds


_ONCE_S = 50e-6
"""By how much more a tick's end may be taken to last after one that lasted longer."""


class Monitor:
    """Answers for all watched pairs of a scene, tick by tick, under a time budget."""

    def __init__(
        self,
        scene: Scene,
        models: Mapping[str, engine.Model],
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
            engine.ModelError: a body must be a solid, but its model is none; it names the body.
            ValueError: no thread at all.
        """
        self._clock = clock
        self._pairs = scene.pairs
        self._placing = placing = Placing(scene.bodies, models)
        self._near = NearPairs(scene.pairs, placing.answers, placing.solid)
        self._searches = Searches(placing.models, threads)
        self._agenda = engine.Agenda(placing.answers, self._searches.assembly)
        self._books = Books(scene.pairs, self._near, self._agenda)
        self._searches.prepare()
        self._compile()
        self._ignored = 0
        self._searched_s = self._closing_s = 0.0

    def _compile(self) -> None:
        """Run the kernels that no search runs, so that the first tick need not compile them."""
        two, none = np.arange(2), np.empty(0, np.int64)
        engine.BroadPhase().near(np.zeros((2, 3)), np.ones(2), np.ones(2, bool), two)
        self._placing.answers.move(none, np.empty((0, 4, 4)))
        self._look(none, True)
        self._agenda.order()
        self._agenda.take(self._agenda.ask(none), [], 0.0)
        self._agenda.report(0.0)

    def set_thresholds(self, thresholds: Sequence[Thresholds]) -> None:
        """Take new thresholds, one a pair: they order the searches from the next tick on.

        A pair's range counts as warn + hysteresis where that is more.
        """
        self._books.set_thresholds(thresholds)

    def set_tolerance(self, rel_err: float | None = None, abs_err: float | None = None) -> None:
        """Take tolerances for all pairs, abs_err in metres; None: each pair's own of the scene."""
        self._books.set_tolerance(rel_err, abs_err)

    def deform(self, name: str, points: np.ndarray) -> None:
        """Move the control points (n, 3) of a deforming body's model: metres, model frame.

        Every body that shares the model changes with it. Bounds stay certified: each distance
        changes by no more than the largest displacement of a point.

        Raises:
            KeyError: there is no such body.
            engine.ModelError: see `engine.Model.deform`; or a solid would be none any more.
                Nothing has changed.
        """
        self._placing.deform(name, points)

    def replace_model(self, name: str, model: engine.Model) -> None:
        """Give a body another model, as of a cloud of which a new one has come.

        Raises:
            KeyError: there is no such body.
        """
        body, rows = self._placing.replace(name, model)
        self._searches.replace(body, model)
        self._agenda.renew(rows)

    def ignore(self, pairs: Collection[int]) -> None:
        """Neither search nor list these pairs, positions among the scene's, from now on."""
        positions = np.array(sorted(pairs), dtype=np.int64)
        self._ignored = len(positions)
        self._near.ignore(positions)
        self._books.ignore(positions)

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
        silent: Collection[str] = (),
        distances: bool = True,
    ) -> Tick:
        """Answer for the given poses within the budget.

        Args:
            poses: the last good pose of each moving body by name; None or a missing name means that
                the body has no pose yet. Names of other bodies are ignored.
            silent: bodies, fixed ones too, that are not to be relied on, whatever their poses say:
                such as a deforming one whose vertices are late.
            budget_s: seconds for the whole tick. 0 searches nothing and still certifies
                everything. A search that is running at the end of the budget overruns it by one
                slice at most.
            distances: whether anybody wants the distances; if not, pairs are only decided against
                their thresholds, which is cheaper; but the distance of one that is at a threshold
                is searched, as its alert tells it.

        Raises:
            ValueError: a pose is not finite or not rigid; it names the body, nothing has changed.
        """
        started = self._clock()
        placing = self._placing
        moved = placing.take(poses, silent)
        change = self._near.update(placing.known, placing.silent, moved)
        self._searches.forget(change.left)
        self._books.update(change)
        self._look(self._near.rows, distances)
        # What closes the tick is set aside beforehand, as long as it takes.
        deadline = started + budget_s - min(self._closing_s, budget_s / 2.0)
        self._searched_s = self._clock()
        looked_at = self._search(deadline)
        tick = self._report(looked_at, started, budget_s)
        # The longest lately, what a search overran included; but where the machine was busy
        # elsewhere, once is no measure.
        closing_s = started + tick.elapsed_s - min(self._searched_s, deadline)
        closing_s = min(closing_s, self._closing_s + _ONCE_S)
        self._closing_s = max(closing_s, 0.9 * self._closing_s)
        return tick

    def _look(self, rows: np.ndarray, distances: bool) -> None:
        self._agenda.look(rows, self._placing.known, self._placing.silent, distances)

    def _search(self, deadline: float) -> list[int]:
        """Search pairs until all is known or the time is over; those that were, in their order.

        A pair that takes long gets half of the time that is left as long as others want some too,
        and more of it when they had their turn.
        """
        looked: dict[int, None] = {}
        while self._clock() < deadline and len(todo := self._agenda.order()):
            questions = self._agenda.ask(todo)
            for start, end in self._in_turn(questions.how):
                left = deadline - self._clock()
                if left <= 0.0:
                    return list(looked)
                part = questions.part(start, end)
                if part.how[0] == engine.Agenda.TOGETHER:
                    reached = self._agenda.search(part, left, self._searches.threads, self._note)
                else:
                    share = left if len(part.at) == len(todo) else left / 2.0
                    found = self._searches.alone(self._placing.answers.poses, part, share)
                    reached = self._agenda.take(part, found, self._note())
                looked.update(dict.fromkeys(reached.tolist()))
        return list(looked)

    def _in_turn(self, how: np.ndarray) -> Iterator[tuple[int, int]]:
        """The places, from and to, of pairs that are searched together, or side by side."""
        alone = how != engine.Agenda.TOGETHER
        if not alone.any():
            yield 0, len(how)
            return
        turns = np.flatnonzero(alone[1:] != alone[:-1]) + 1
        for start, end in itertools.pairwise((0, *turns.tolist(), len(how))):
            step = self._searches.threads if alone[start] else end - start
            for first in range(start, end, step):
                yield first, min(first + step, end)

    def _note(self) -> float:
        """Take note that a search ended now."""
        self._searched_s = self._clock()
        return self._searched_s

    def _report(self, looked_at: list[int], started: float, budget_s: float) -> Tick:
        near = self._near
        states, left = self._agenda.report(self._clock())
        at = states["at"]
        pairs = PairStates(
            names=self._placing.names,
            positions=near.positions[at],
            bodies=states["bodies"],
            lower=states["lower"],
            upper=states["upper"],
            points=states["points"],
            status=states["status"],
            age_s=states["age_s"],
            silent=states["silent"].view(np.bool_),
            session_min=states["min_upper"],
            session_min_lower=states["min_lower"],
            kinds=self._placing.kinds,
            elements=states["faces"],
            parameters=states["weights"],
        )
        return Tick(
            pairs,
            elapsed_s=self._clock() - started,
            budget_s=budget_s,
            looked_at=tuple(near.positions[looked_at].tolist()) if looked_at else (),
            left=left,
            far=len(self._pairs) - self._ignored - len(at) - near.unsure,
            beyond=near.beyond,
            unsure=near.unsure,
        )


def simulate(
    scene: Scene,
    models: Mapping[str, engine.Model],
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
