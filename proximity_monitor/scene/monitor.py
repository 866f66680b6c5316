"""The monitor of a scene: takes poses and a time budget, returns bounds for every watched pair.

A pair that is farther apart than its range is not examined, unless `Monitor.keep` names it. The
other pairs are searched in the order of the schedule (`engine/assembly/schedule.py`). A search that
ran out of time continues where it stopped, if its bodies have not moved. A pair that the budget
does not reach keeps its last answer, widened by the motion since (`engine/assembly/answers.py`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from proximity_monitor import engine
from proximity_monitor.engine.assembly.broad_phase import BroadPhase
from proximity_monitor.engine.assembly.schedule import Schedule
from proximity_monitor.scene.placing import Placing
from proximity_monitor.scene.state import PairStates, PoseSample, Tick
from proximity_monitor.scene.watch import NearPairs

if TYPE_CHECKING:
    from proximity_monitor.scene import Scene, Thresholds


_ONCE_S = 50e-6
"""By how much, at most, one tick can increase the time that is set aside for a tick's end."""


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
        """Watch `scene`; everything that is done only once, such as compiling, is done here.

        Args:
            scene: bodies and watched pairs.
            models: by body name, in metres.
            threads: how many threads share the searches of a tick. The number changes which pairs
                a budget reaches, not what is found. Only the bounds of a depth may differ, within
                its tolerance: a search begins with what earlier ones found, and how far those got
                depends on the clock.
            clock: seconds, never going back; measures the budget and the ages.

        Raises:
            engine.ModelError: a body must be a solid, but its model is none; names the body.
            ValueError: `threads` is less than 1.
        """
        if threads < 1:
            raise ValueError(f"threads = {threads}: must be at least 1")
        self._clock = clock
        self._threads = threads
        self._pairs = scene.pairs
        self._placing = placing = Placing(scene.bodies, models)
        self._near = NearPairs(scene.pairs, placing.answers, placing.solid)
        self._schedule = Schedule(placing.answers, engine.Assembly(placing.models))
        self._thresholds: Sequence[Thresholds] | None = None  # None: the scene's own
        self._tolerance: tuple[float | None, float | None] = None, None
        self._ignored = np.empty(0, np.int64)
        self._kept: frozenset[int] = frozenset()
        self._closing_s = 0.0
        self._begin(self._near.rows)
        self._prepare()

    def _prepare(self) -> None:
        """Run every kernel once, so that the first tick need not compile them."""
        two, none = np.arange(2), np.empty(0, np.int64)
        BroadPhase().near(np.zeros((2, 3)), np.ones(2), np.ones(2, bool), two)
        self._placing.answers.move(none, np.empty((0, 4, 4)))
        self._schedule.prepare()

    def set_thresholds(self, thresholds: Sequence[Thresholds]) -> None:
        """Take new thresholds, one per pair; they order the searches from the next tick on.

        A pair's range counts as at least warn + hysteresis.
        """
        if len(thresholds) != len(self._pairs):
            raise ValueError(f"{len(thresholds)} thresholds for {len(self._pairs)} pairs")
        self._thresholds = thresholds
        different = {id(each): each for each in thresholds}.values()
        self._near.set_least(max((t.warn + t.hysteresis for t in different), default=0.0))
        self._specify(slice(None))

    def set_tolerance(self, rel_err: float | None = None, abs_err: float | None = None) -> None:
        """Take tolerances for all pairs, abs_err in metres; None: each pair's own in the scene."""
        self._tolerance = rel_err, abs_err
        self._specify(slice(None))
        self._schedule.records["done"] = False

    def deform(self, name: str, points: np.ndarray) -> None:
        """Move the control points (n, 3) of a deforming body's model: metres, model frame.

        Every body that shares the model changes with it. Bounds stay certified: each distance
        changes by no more than the largest displacement of a point.

        Raises:
            KeyError: there is no such body.
            engine.ModelError: see `engine.Model.deform`; or a solid would no longer be a solid.
                Nothing has changed.
        """
        self._placing.deform(name, points)

    def replace_model(self, name: str, model: engine.Model) -> None:
        """Give a body another model, such as a new cloud.

        Raises:
            KeyError: there is no such body.
        """
        body, rows = self._placing.replace(name, model)
        self._schedule.replace(body, model, rows)

    def ignore(self, pairs: Collection[int]) -> None:
        """Neither search nor list these pairs from now on; `pairs` are positions in the scene."""
        self._ignored = np.array(sorted(pairs), dtype=np.int64)
        self._near.ignore(self._ignored)
        self._specify(slice(None))

    def keep(self, pairs: Collection[int]) -> None:
        """List these pairs from now on, whatever their range; `pairs` are positions in the scene.

        An example are the pairs of `Alerts.held`, which are still at a level: a reader of ticks
        must not take them for clear.
        """
        before, self._kept = self._kept, frozenset(pairs)
        if changed := before ^ self._kept:
            self._near.keep(np.array(sorted(self._kept), dtype=np.int64))
            self._specify(np.isin(self._near.positions, list(changed)))

    def reset_minima(self) -> None:
        """Forget the smallest clearances of the session."""
        self._schedule.reset_minima()

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
            silent: bodies, also fixed ones, that are unreliable whatever their poses say, such as
                a deforming body whose vertices are late.
            budget_s: seconds for the whole tick. 0 searches nothing and still certifies
                everything. A search that is running at the end of the budget overruns it by one
                slice at most.
            distances: whether the caller wants the distances. If not, pairs are only decided
                against their thresholds, which is cheaper. The distance of a pair at a threshold
                is searched anyway, because its alert needs it.

        Raises:
            KeyError: there is no such silent body; nothing has changed.
            ValueError: a pose is not finite or not rigid; names the body, nothing has changed.
        """
        started = self._clock()
        placing = self._placing
        moved = placing.take(poses, silent)
        change = self._near.update(placing.known, placing.silent, moved)
        self._schedule.end(change.left, change.left_rows)
        self._begin(change.come_rows)
        placing.settle()
        self._schedule.update(self._near.rows, placing.known, placing.silent, distances)
        # Set aside the time that the end of the tick takes.
        deadline = started + budget_s - min(self._closing_s, budget_s / 2.0)
        searched = self._schedule.search(deadline, self._clock, self._threads)
        ended = min(self._clock(), deadline)
        tick = self._report(searched, started, budget_s)
        # Set aside the longest recent end, including a search's overrun. One long end counts only
        # in part (`_ONCE_S`), because the machine may have been busy elsewhere.
        closing_s = min(started + tick.elapsed_s - ended, self._closing_s + _ONCE_S)
        self._closing_s = max(closing_s, 0.9 * self._closing_s)
        return tick

    def _begin(self, rows: np.ndarray) -> None:
        """Begin the records of new rows."""
        if len(rows):
            self._schedule.begin(rows)
            self._specify(np.isin(self._near.rows, rows))

    def _specify(self, which: np.ndarray | slice) -> None:
        """Write the questions about some of the near pairs into their records."""
        near, watched, records = self._near, self._pairs, self._schedule.records
        rows, kinds = near.rows[which], near.kinds[which]
        rel_err, abs_err = self._tolerance
        own = np.array([(each.rel_err, each.abs_err) for each in watched.kinds]).reshape(-1, 2)
        records["rel_err"][rows] = own[kinds, 0] if rel_err is None else rel_err
        records["abs_err"][rows] = own[kinds, 1] if abs_err is None else abs_err
        deciding = np.array([each.question != "distance" for each in watched.kinds])
        records["deciding"][rows] = deciding[kinds]
        records["ignored"][rows] = np.isin(near.positions[which], self._ignored)
        if self._thresholds is None:
            levels = np.array([_levels(each.thresholds) for each in watched.kinds])[kinds]
        else:
            given = (self._thresholds[i] for i in near.positions[which].tolist())
            levels = np.array([_levels(each) for each in given]).reshape(-1, Schedule.LEVELS)
        records["levels"][rows] = levels
        records["range"][rows] = np.where(
            np.isin(near.positions[which], list(self._kept)),
            np.inf,
            np.maximum(watched.ranges[kinds], levels.max(axis=1, initial=0.0)),
        )

    def _report(self, searched: list[int], started: float, budget_s: float) -> Tick:
        near = self._near
        states, left = self._schedule.report(self._clock())
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
            elements=states["elements"],
            parameters=states["parameters"],
        )
        return Tick(
            pairs,
            elapsed_s=self._clock() - started,
            budget_s=budget_s,
            searched=tuple(near.positions[searched].tolist()) if searched else (),
            left=left,
            far=len(self._pairs) - len(self._ignored) - len(at) - near.unsure,
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
    """Run a monitor over recorded poses: one tick per mapping from body name to (4, 4) pose."""
    monitor = Monitor(scene, models, threads=threads, clock=clock)
    return [
        monitor.tick(
            {n: None if p is None else PoseSample(p) for n, p in poses.items()},
            budget_s,
            distances=distances,
        )
        for poses in recorded_poses
    ]


def _levels(thresholds: Thresholds) -> tuple[float, ...]:
    """Return the clearances at which an alert may begin or end."""
    warn, stop, more = thresholds.warn, thresholds.stop, thresholds.hysteresis
    return stop, warn, stop + more, warn + more
