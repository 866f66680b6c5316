"""A flight recorder: the last ticks and alerts, in bounded memory, and their files."""

from __future__ import annotations

import csv
from collections import deque
from collections.abc import Sequence
from copy import copy
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from proximity_monitor.scene.alerts import Alert
from proximity_monitor.scene.state import Tick, as_arrays

if TYPE_CHECKING:
    from proximity_monitor.scene import WatchedPair

TICKS = 108_000
"""How many ticks are kept: an hour at 30 Hz, in 5 MB."""

ALERTS = 10_000
"""How many alerts are kept, in some 10 MB."""

_TICK = np.dtype(
    [
        ("stamp_ns", np.int64),
        ("clearance", np.float64),  # metres, certified; at most 0 while a pair is stale
        ("upper", np.float64),  # metres, of the pair with the smallest lower bound
        ("pair", np.int64),  # that pair's index; a stale pair goes first; -1: none is listed
        ("elapsed_s", np.float64),
        ("budget_s", np.float64),
    ]
)


class StampedAlert(NamedTuple):
    """An alert and its tick's stamp, nanoseconds of the node's clock."""

    stamp_ns: int
    alert: Alert


class Recording:
    """The last ticks and alerts; older ones are overwritten."""

    def __init__(
        self, pairs: Sequence[WatchedPair], *, ticks: int = TICKS, alerts: int = ALERTS
    ) -> None:
        """Begin empty; `pairs` are the scene's, `ticks` and `alerts` say how many are kept."""
        self._pairs = pairs
        self._ring = np.zeros(ticks, _TICK)
        self._count = 0
        self._alerts: deque[StampedAlert] = deque(maxlen=alerts)

    def add(self, stamp_ns: int, tick: Tick, alerts: Sequence[Alert]) -> None:
        """Keep the summary of a tick, and its alerts."""
        pairs, nearest = as_arrays(tick.pairs), None
        if len(pairs):
            nearest = np.argmin(np.where(pairs.stale, -np.inf, pairs.lower))
        self._ring[self._count % len(self._ring)] = (
            stamp_ns,
            tick.clearance(),
            np.inf if nearest is None else pairs.upper[nearest],
            -1 if nearest is None else pairs.positions[nearest],
            tick.elapsed_s,
            tick.budget_s,
        )
        self._count += 1
        self._alerts.extend(StampedAlert(stamp_ns, alert) for alert in alerts)

    def snapshot(self) -> Recording:
        """Return a copy that another thread may read while this one goes on."""
        taken = copy(self)
        taken._ring, taken._alerts = self._ring.copy(), self._alerts.copy()
        return taken

    @property
    def ticks(self) -> np.ndarray:
        """The kept ticks, the oldest first, as an array of records."""
        at = self._count % len(self._ring)
        return self._ring[:at] if self._count == at else np.roll(self._ring, -at)

    @property
    def alerts(self) -> tuple[StampedAlert, ...]:
        """The kept alerts, the oldest first."""
        return tuple(self._alerts)

    def write_csv(self, folder: Path) -> tuple[Path, Path]:
        """Write ticks.csv and alerts.csv into an existing folder and return their paths.

        Lengths are in metres and times in seconds, with every digit; stamps in nanoseconds. A
        `clearance_m` of 0 may mean that a pair's pose was stale or unknown.

        Raises:
            OSError: a file cannot be written.
        """
        ticks, alerts = folder / "ticks.csv", folder / "alerts.csv"
        with ticks.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(
                ["stamp_ns", "clearance_m", "upper_m", "a", "b", "elapsed_s", "budget_s"]
            )
            # One by one: `tolist` would be a single step of the interpreter, which stops all other
            # threads.
            rows = map(np.void.item, self.ticks)
            for stamp_ns, lower, upper, pair, elapsed, budget in rows:
                a, b = (self._pairs[pair].a, self._pairs[pair].b) if pair >= 0 else ("", "")
                writer.writerow([stamp_ns, lower, upper, a, b, elapsed, budget])
        with alerts.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["stamp_ns", "a", "b", "old", "new", "lower_m", "upper_m", "reason"])
            for stamp_ns, alert in self._alerts:
                old, new = alert.old.value, alert.new.value
                bounds = alert.lower, alert.upper
                writer.writerow([stamp_ns, alert.a, alert.b, old, new, *bounds, alert.reason])
        return ticks, alerts
