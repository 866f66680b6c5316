"""The node's own state for /diagnostics: four statuses, each with a line about what is wrong.

- ``<node>: clearance`` is an error if a pair is at stop, and a warning if a pair is at warn or
  stale, or if there was no tick yet.
- ``<node>: schedule`` is a warning if ticks overran since the last message, or if the node is
  paused or not active.
- ``<node>: inputs`` is a warning if a body is silent, an unknown body is published, an attachment
  waits, or messages were refused since the last message.
- ``<node>: outputs`` is a warning if a peer came whose quality of service does not fit, or if
  another node has the same name.

Counts run from the time when the node was configured.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from proximity_monitor.ros.inputs import Inputs
from proximity_monitor.ros.scene_parameters import Settings
from proximity_monitor.scene.alerts import Level
from proximity_monitor.scene.naming import counted
from proximity_monitor.scene.state import STATUSES, PairStatus, Tick, as_arrays, silence
from proximity_monitor.scene.unseen import Unseen

WINDOW_S = 10.0
"""Seconds of ticks that percentiles and the achieved rate cover."""

OVERRUN_S = 0.001
"""Seconds by which a search may exceed its budget before it counts as an overrun. A slice of a
search takes well under a millisecond, so more is a real overrun or a machine that is too busy."""

NAMED = 10
"""How many bodies are named in the line about what is wrong."""


class Timing:
    """How long ticks take, and how many were late."""

    def __init__(self) -> None:
        """Begin without ticks."""
        self._ticks: deque[tuple[float, float, float]] = deque()
        self.budget_overruns = 0
        self.period_overruns = 0

    def record(self, ended_s: float, tick: Tick, whole_s: float, period_s: float) -> None:
        """Add a tick that ended at `ended_s` and took `whole_s` with its messages."""
        self._ticks.append((ended_s, tick.elapsed_s, whole_s))
        while self._ticks[0][0] < ended_s - WINDOW_S:
            self._ticks.popleft()
        self.budget_overruns += tick.elapsed_s > tick.budget_s + OVERRUN_S
        self.period_overruns += whole_s > period_s

    def forget_window(self) -> None:
        """Drop the window but not the counts, for example after a pause."""
        self._ticks.clear()

    def values(self) -> dict[str, str]:
        """Return percentiles over the window, the rate achieved in it, and the counts."""
        ended, searched, whole = np.array(self._ticks).reshape(-1, 3).T
        span = float(ended[-1] - ended[0]) if len(ended) > 1 else 0.0
        rate = f"{(len(ended) - 1) / span:.2f}" if span > 0.0 else "nan"
        values = {"rate_achieved_hz": rate}
        for name, times in (("search", searched), ("tick", whole)):
            for share in (50, 99):
                at = float(np.percentile(times, share)) * 1e3 if len(times) else float("nan")
                values[f"{name}_p{share}_ms"] = f"{at:.3f}"
        values["budget_overruns"] = str(self.budget_overruns)
        values["period_overruns"] = str(self.period_overruns)
        return values


class NodeState(NamedTuple):
    """The state of a configured monitor at the moment of a message."""

    activity: str
    """active, paused or inactive."""
    settings: Settings
    tick: Tick | None
    levels: Mapping[int, Level]
    watched: int
    """Pairs of the scene."""
    inputs: Inputs
    silent: Mapping[str, str]
    """Why bodies are unreliable, by name."""
    refused_joints: Mapping[str, int]
    """How many joint messages were refused or noted, by reason."""
    held: Mapping[str, str]
    """The parent by attached body."""
    waiting: Mapping[str, str]
    """The parent by body that cannot be attached yet."""
    built: Mapping[str, int]
    """Messages made, by topic."""
    alerts_left_out: int
    """Alerts that were not published because one tick had too many."""
    distance_ticks: int
    """Ticks for which distances were wanted."""
    incompatible: Mapping[str, int]
    """Peers whose quality of service does not fit, by topic."""
    unseen: Unseen
    """Pairs that cannot detect one body inside the other."""
    namesakes: int
    """Other nodes of the same name."""
    dropped: Mapping[str, int]
    """Points that are not finite, by body that is a cloud."""
    clouds: Mapping[str, int]
    """Messages that became a model, by body that is a cloud."""


@dataclass
class Health:
    """Makes the diagnostics, and remembers the counts of the last message."""

    node: str
    hardware_id: str
    timing: Timing = field(default_factory=Timing)
    _overruns: int = 0
    _rejected: int = 0
    _incompatible: int = 0

    def message(self, stamp: Time, state: NodeState) -> DiagnosticArray:
        """Return the diagnostics of this second."""
        array = DiagnosticArray()
        array.header.stamp = stamp
        array.status = [
            self._clearance(state),
            self._schedule(state),
            self._inputs(state),
            self._outputs(state),
        ]
        return array

    def _clearance(self, state: NodeState) -> DiagnosticStatus:
        tick, count = state.tick, Counter(state.levels.values())
        pairs = as_arrays(tick.pairs if tick is not None else ())
        if tick is not None:  # the levels include some of the pairs that are not listed
            count[Level.STALE] = int(pairs.stale.sum()) + tick.unsure
            urgent = count[Level.STOP] + count[Level.WARN] + count[Level.STALE]
            count[Level.CLEAR] = len(pairs) + tick.far + tick.unsure - urgent
        level, worst = DiagnosticStatus.OK, "all pairs clear"
        if tick is None:
            level, worst = DiagnosticStatus.WARN, "no tick yet"
        elif count[Level.STOP]:
            level, worst = DiagnosticStatus.ERROR, _pairs(count, Level.STOP)
        elif count[Level.WARN] or count[Level.STALE]:
            level = DiagnosticStatus.WARN
            worst = f"{_pairs(count, Level.WARN)}, {count[Level.STALE]} stale"
        statuses = np.bincount(pairs.status, minlength=len(STATUSES))
        kinds = dict(zip(PairStatus, statuses, strict=True))
        values = {f"pairs {each.value}": str(count[each]) for each in Level}
        values.update({f"pairs {each.value}": str(kinds[each]) for each in PairStatus})
        for key in ("pairs beyond range", "pairs not listed", "pairs not watched"):
            values[key] = "nan"
        if tick is not None:
            values["pairs beyond range"] = str(tick.far)
            values["pairs not listed"] = str(tick.unsure)
            known = len(pairs) + tick.far + tick.unsure
            values["pairs not watched"] = str(state.watched - known)
        values["pairs watched"] = str(state.watched)
        values["pairs that cannot see containment"] = str(state.unseen.count)
        if state.unseen.count:
            values["containment unseen"] = ", ".join(f"{a} - {b}" for a, b in state.unseen.pairs)
        values["clearance_m"] = repr(tick.clearance()) if tick is not None else "nan"
        return self._status("clearance", level, worst, values)

    def _schedule(self, state: NodeState) -> DiagnosticStatus:
        settings, tick = state.settings, state.tick
        overruns = self.timing.budget_overruns + self.timing.period_overruns
        new, self._overruns = overruns - self._overruns, overruns
        level, what = DiagnosticStatus.OK, "on time"
        if state.activity != "active":
            level, what = DiagnosticStatus.WARN, f"{state.activity}: no clearance is watched"
        elif new:
            many = counted(new, "overrun", "overruns")
            level, what = DiagnosticStatus.WARN, f"{many} in the last second"
        values = {
            "activity": state.activity,
            "rate_hz": f"{settings.rate_hz:g}",
            "budget_ms": f"{settings.budget_s * 1e3:g}",
            **self.timing.values(),
            "pairs left": str(tick.left) if tick is not None else "nan",
            "ticks with distances": str(state.distance_ticks),
        }
        return self._status("schedule", level, what, values)

    def _inputs(self, state: NodeState) -> DiagnosticStatus:
        refused = state.inputs.rejected | state.refused_joints
        rejected = sum(refused.values())
        new, self._rejected = rejected - self._rejected, rejected
        strangers = state.inputs.strangers
        wrong = []
        if state.silent:
            wrong.append(silence(state.silent, state.silent, listed=_some))
        if strangers:
            wrong.append(f"unknown bodies: {_some(strangers)}")
        if state.waiting:
            wrong.append(f"not attached yet: {_some(list(state.waiting))}")
        if new:
            wrong.append(f"{counted(new, 'message', 'messages')} rejected in the last second")
        values = {f"rejected: {reason}": str(n) for reason, n in refused.items()}
        values |= {f"points dropped: {name}": str(n) for name, n in state.dropped.items()}
        values |= {f"clouds built: {name}": str(n) for name, n in state.clouds.items()}
        values["silent bodies"] = ", ".join(state.silent)
        values["unknown bodies"] = ", ".join(strangers)
        values["attached bodies"] = _hanging(state.held)
        values["waiting to be attached"] = _hanging(state.waiting)
        level = DiagnosticStatus.WARN if wrong else DiagnosticStatus.OK
        return self._status("inputs", level, "; ".join(wrong) or "all bodies reported", values)

    def _outputs(self, state: NodeState) -> DiagnosticStatus:
        incompatible = sum(state.incompatible.values())
        new, self._incompatible = incompatible - self._incompatible, incompatible
        values = {f"built: {topic}": str(n) for topic, n in state.built.items()}
        values |= {f"incompatible QoS: {topic}": str(n) for topic, n in state.incompatible.items()}
        values["alerts left out"] = str(state.alerts_left_out)
        values["incompatible QoS"] = str(incompatible)
        values["nodes of the same name"] = str(state.namesakes)
        wrong = []
        if state.namesakes:
            wrong.append(
                f"{state.namesakes + 1} nodes are called {self.node}: their results are mixed"
            )
        if new:
            peers = counted(new, "peer", "peers")
            wrong.append(f"{peers} with an incompatible quality of service in the last second")
        level = DiagnosticStatus.WARN if wrong else DiagnosticStatus.OK
        return self._status(
            "outputs", level, "; ".join(wrong) or "all peers are compatible", values
        )

    def _status(
        self, task: str, level: bytes, message: str, values: dict[str, str]
    ) -> DiagnosticStatus:
        return DiagnosticStatus(
            level=level,
            name=f"{self.node}: {task}",
            message=message,
            hardware_id=self.hardware_id,
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )


def _pairs(count: Mapping[Level, int], level: Level) -> str:
    return f"{counted(count[level], 'pair', 'pairs')} at {level.value}"


def _some(names: Sequence[str]) -> str:
    """Return the first names of a list that may be too long for a line."""
    more = len(names) - NAMED
    return ", ".join(names[:NAMED]) + (f" and {more} more" if more > 0 else "")


def _hanging(parents: Mapping[str, str]) -> str:
    return ", ".join(f"{child} on {parent}" for child, parent in parents.items())
