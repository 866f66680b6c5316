"""The node's own state for /diagnostics: three statuses, each saying in a line what is wrong.

``<node>: clearance`` is an error while a pair is at stop, a warning while one is at warn or stale;
``<node>: schedule`` a warning when ticks overran since the last message, or the node is paused or
not active; ``<node>: inputs`` a warning while a body is silent, an unknown one is published, or
messages were refused since the last message. Counts run from the time the node was configured.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from proximity_monitor.ros.inputs import Inputs
from proximity_monitor.ros.parameters import Settings
from proximity_monitor.scene.alerts import Level
from proximity_monitor.scene.state import PairStatus, Tick

WINDOW_S = 10.0
"""Percentiles and the achieved rate are over the ticks of so many seconds."""

OVERRUN_S = 0.001
"""How far a search may run past the budget before it counts: a slice of a search takes well under a
millisecond, so what is above is a real overrun or a machine that is too busy."""


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
        """Drop the window but not the counts: no ticks were wanted for a while."""
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


@dataclass
class Health:
    """What the diagnostics need to know, and what they said last."""

    node: str
    hardware_id: str
    timing: Timing = field(default_factory=Timing)
    _overruns: int = 0
    _rejected: int = 0

    def message(
        self,
        stamp: Time,
        *,
        settings: Settings,
        inputs: Inputs,
        now_ns: int,
        tick: Tick | None,
        levels: Sequence[Level],
        activity: str,
    ) -> DiagnosticArray:
        """Return the diagnostics of this second; `activity` is active, paused or inactive."""
        array = DiagnosticArray()
        array.header.stamp = stamp
        array.status = [
            self._clearance(tick, levels),
            self._schedule(settings, tick, activity),
            self._inputs(inputs, now_ns),
        ]
        return array

    def _clearance(self, tick: Tick | None, levels: Sequence[Level]) -> DiagnosticStatus:
        count = Counter(levels)
        level, worst = DiagnosticStatus.OK, "all pairs clear"
        if tick is None:
            level, worst = DiagnosticStatus.WARN, "no tick yet"
        elif count[Level.STOP]:
            level, worst = DiagnosticStatus.ERROR, f"{count[Level.STOP]} pairs at stop"
        elif count[Level.WARN] or count[Level.STALE]:
            level = DiagnosticStatus.WARN
            worst = f"{count[Level.WARN]} pairs at warn, {count[Level.STALE]} stale"
        kinds = Counter(pair.status for pair in tick.pairs) if tick is not None else Counter()
        values = {f"pairs {each.value}": str(count[each]) for each in Level}
        values.update({f"pairs {each.value}": str(kinds[each]) for each in PairStatus})
        values["clearance_m"] = repr(tick.clearance()) if tick is not None else "nan"
        return self._status("clearance", level, worst, values)

    def _schedule(self, settings: Settings, tick: Tick | None, activity: str) -> DiagnosticStatus:
        overruns = self.timing.budget_overruns + self.timing.period_overruns
        new, self._overruns = overruns - self._overruns, overruns
        level, what = DiagnosticStatus.OK, "on time"
        if activity != "active":
            level, what = DiagnosticStatus.WARN, f"{activity}: no clearance is watched"
        elif new:
            level, what = DiagnosticStatus.WARN, f"{new} overruns in the last second"
        values = {
            "activity": activity,
            "rate_hz": f"{settings.rate_hz:g}",
            "budget_ms": f"{settings.budget_s * 1e3:g}",
            **self.timing.values(),
            "pairs left": str(tick.left) if tick is not None else "nan",
        }
        return self._status("schedule", level, what, values)

    def _inputs(self, inputs: Inputs, now_ns: int) -> DiagnosticStatus:
        rejected = sum(inputs.rejected.values())
        new, self._rejected = rejected - self._rejected, rejected
        silent, strangers = inputs.silent(now_ns), inputs.strangers
        wrong = []
        if silent:
            wrong.append(f"no recent pose of {', '.join(silent)}")
        if strangers:
            wrong.append(f"unknown bodies: {', '.join(strangers)}")
        if new:
            wrong.append(f"{new} messages rejected in the last second")
        values = {f"rejected: {reason}": str(n) for reason, n in inputs.rejected.items()}
        values["silent bodies"] = ", ".join(silent)
        values["unknown bodies"] = ", ".join(strangers)
        level = DiagnosticStatus.WARN if wrong else DiagnosticStatus.OK
        return self._status("inputs", level, "; ".join(wrong) or "all bodies reported", values)

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
