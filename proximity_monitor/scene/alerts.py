"""When a pair changes between clear, warn, stop and stale: thresholds, hysteresis and silence.

A pair is judged by its certified lower bound, so it is clear only when that is certain. A distance
equal to the threshold triggers. A level that triggered is released only above its threshold plus
the hysteresis, so that a distance that trembles about a threshold gives one alert and not thirty a
second.
"""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from proximity_monitor.scene.state import PairState, PairStatus

if TYPE_CHECKING:
    from proximity_monitor.scene import Thresholds, Unit


class Level(enum.Enum):
    """How near a pair is known to be."""

    CLEAR = "clear"
    WARN = "warn"
    STOP = "stop"
    STALE = "stale"
    """A body of the pair has no pose, or one too old to be relied on."""


@dataclass(frozen=True, slots=True)
class Alert:
    """One change of level of one pair; bounds in metres (NaN when a pose is unknown)."""

    a: str
    b: str
    old: Level
    new: Level
    lower: float
    upper: float
    reason: str
    """One line for people, lengths in the scene's unit."""


class Alerts:
    """The levels of all watched pairs, in the scene's order; they begin as stale."""

    def __init__(self, count: int, unit: Unit) -> None:
        """Begin with `count` pairs; `unit` is the one that reasons are written in."""
        self._unit = unit
        self.levels: list[Level] = [Level.STALE] * count
        self._held: list[Level] = [Level.CLEAR] * count  # the last level that was no silence

    def update(self, pairs: Sequence[PairState], thresholds: Sequence[Thresholds]) -> list[Alert]:
        """Judge the pairs of a tick and return the changes.

        Args:
            pairs: one state a pair.
            thresholds: one a pair; they may differ from those of the last call.
        """
        changes = []
        for i, (pair, limits) in enumerate(zip(pairs, thresholds, strict=True)):
            new, reason = self._judge(pair, limits, self._held[i])
            old, self.levels[i] = self.levels[i], new
            if new is not Level.STALE:
                self._held[i] = new
            if new is not old:
                changes.append(Alert(pair.a, pair.b, old, new, pair.lower, pair.upper, reason))
        return changes

    def _judge(self, pair: PairState, limits: Thresholds, held: Level) -> tuple[Level, str]:
        if pair.silent:
            what = "no pose yet" if pair.status is PairStatus.UNKNOWN else "no recent pose"
            return Level.STALE, f"{what} of {' and '.join(pair.silent)}"
        if pair.status is PairStatus.INTERSECTING:
            return Level.STOP, "intersecting: contact cannot be excluded"
        for level, limit, holds in (
            (Level.STOP, limits.stop, held is Level.STOP),
            (Level.WARN, limits.warn, held in (Level.STOP, Level.WARN)),
        ):
            if not pair.lower > limit:
                return level, f"{self._at(pair)} <= {level.value} {self._length(limit)}"
            if holds and not pair.lower > limit + limits.hysteresis:
                return level, (
                    f"{self._at(pair)} is not above {level.value} {self._length(limit)}"
                    f" + hysteresis {self._length(limits.hysteresis)}"
                )
        return Level.CLEAR, f"{self._at(pair)} > warn {self._length(limits.warn)}"

    def _at(self, pair: PairState) -> str:
        kind = "lower bound" if pair.status is PairStatus.BOUNDED else "distance"
        return f"{kind} {self._length(pair.lower)}"

    def _length(self, metres: float) -> str:
        return f"{metres / self._unit.to_metre:.4g} {self._unit.symbol}"
