"""Alerts: when a pair changes between clear, warn, stop and stale.

A pair is judged by its certified lower bound, so it is clear only when that is certain. A bound
equal to a threshold triggers at once. A level is released only when the bound has stayed above its
threshold plus the hysteresis for `hold_s`, so a distance that varies about a threshold gives one
alert and not thirty a second. A pair that a tick does not list is certified to be farther apart
than all these limits, unless a body is silent.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from proximity_monitor.scene.relative_motion import Courses, RelativeMotion, relative_motion
from proximity_monitor.scene.state import (
    NO_POSE_YET,
    NO_RECENT_POSE,
    STATUSES,
    PairState,
    PairStates,
    PairStatus,
    Tick,
    as_arrays,
    silence,
)

if TYPE_CHECKING:
    from proximity_monitor.scene import Thresholds, Unit, WatchedPair

_INTERSECTING = STATUSES.index(PairStatus.INTERSECTING)


class Level(enum.Enum):
    """How near a pair is known to be."""

    CLEAR = "clear"
    WARN = "warn"
    STOP = "stop"
    STALE = "stale"
    """A body of the pair has no pose or shape, or one too old to be relied on."""


@dataclass(frozen=True, slots=True)
class Alert:
    """One change of level of one pair."""

    index: int
    """The pair's position among the scene's pairs."""
    a: str
    b: str
    old: Level
    new: Level
    lower: float
    """Bounds in metres; NaN if a pose is unknown, or if nothing is certain about an unlisted
    pair."""
    upper: float
    reason: str
    """One line for the user, with lengths in the scene's unit."""
    motion: RelativeMotion | None = None
    """How the two bodies move relative to each other; None if the tick did not list the pair."""
    seconds_left: float = math.nan
    """Seconds until the lower bound reaches the next threshold at the present closing speed: the
    stop threshold at level warn, contact at level stop. NaN unless the bodies approach."""


@dataclass(slots=True)
class _Held:
    """Memory about a pair that is not clear."""

    level: Level
    """The last level other than stale."""
    above_stop_s: float = math.nan
    """Time since which the bound is above stop + hysteresis without a break; NaN if it is not."""
    above_warn_s: float = math.nan


class Alerts:
    """The levels of all watched pairs; before the first tick they are stale."""

    def __init__(self, pairs: Sequence[WatchedPair], unit: Unit) -> None:
        """Watch the scene's `pairs`; reasons are written in `unit`."""
        self._pairs = pairs
        self._unit = unit
        self._levels: dict[int, Level] = {}
        self._unclear: dict[int, Level] = {}  # those in _levels that are not clear
        self._held: dict[int, _Held] = {}
        self._unlisted = Level.STALE  # level of all pairs that are not in _levels
        self._thresholds: Sequence[Thresholds] = ()
        self._warn = np.empty(0)  # warn thresholds, to find the pairs that must be judged

    @property
    def levels(self) -> Mapping[int, Level]:
        """Levels by index, for the pairs that the last tick listed and all that are not clear."""
        return MappingProxyType(self._levels)

    @property
    def held(self) -> Collection[int]:
        """The pairs, by index, that are at warn or stop, or were when they became stale."""
        return self._held.keys()

    def update(
        self,
        tick: Tick,
        thresholds: Sequence[Thresholds],
        now_s: float,
        courses: Courses = lambda name: None,
        unwatched: Mapping[int, str] = MappingProxyType({}),
        silent: Mapping[str, str] = MappingProxyType({}),
    ) -> list[Alert]:
        """Judge the pairs of a tick and return the changes.

        Args:
            tick: the listed pairs; all others are certified to be farther apart than their range
                and than warn + hysteresis, unless one of their bodies is silent.
            thresholds: one for each pair of the scene, the same that the monitor has; they may
                differ from those of the last call.
            now_s: seconds of a clock that never goes back.
            courses: the bodies' courses up to the tick's poses, for the motion in alerts.
            unwatched: by the index of each pair that is not watched now, the reason in a few
                words. The tick does not list these pairs.
            silent: by the name of each silent body, the reason, such as "no recent pose".
        """
        changes = []
        pairs = as_arrays(tick.pairs)
        # Most pairs are clear; no Python loop runs over them.
        before, clear = self._levels, Level.CLEAR
        levels = dict.fromkeys(pairs.positions.tolist(), clear)
        as_silent = self._as_silent(pairs)
        unclear = dict.fromkeys(pairs.positions[as_silent].tolist(), Level.STALE)
        for place in self._suspects(pairs, thresholds, ~as_silent):
            pair = pairs[place]
            i = pair.index
            new, reason = self._judge(pair, thresholds[i], now_s, silent)
            if new is not clear:
                unclear[i] = new
            old = before.get(i, self._unlisted)
            if new is not old:
                changes.append(self._alert(pair, old, new, reason, thresholds[i], courses))
        for i, old in self._unclear.items():
            if i not in levels:
                new, reason, lower = self._release(
                    i, thresholds[i], now_s, unwatched.get(i), silent
                )
                if new is not clear:
                    unclear[i] = new
                if new is not old:
                    a, b = self._pairs[i].a, self._pairs[i].b
                    changes.append(Alert(i, a, b, old, new, lower, math.inf, reason))
        levels.update(unclear)
        self._levels, self._unclear, self._unlisted = levels, unclear, clear
        return changes

    def interrupt(self) -> None:
        """Note that nothing was watched for a while: the times for `hold_s` begin anew."""
        for held in self._held.values():
            held.above_stop_s = held.above_warn_s = math.nan

    def _as_silent(self, pairs: PairStates) -> np.ndarray:
        """Return which pairs (k,) were silent before and still are."""
        still = pairs.stale
        if self._unlisted is not Level.STALE:
            stale = [i for i, level in self._unclear.items() if level is Level.STALE]
            still &= np.isin(pairs.positions, stale)
        return still

    def _suspects(
        self, pairs: PairStates, thresholds: Sequence[Thresholds], among: np.ndarray
    ) -> list[int]:
        """Return the places of the pairs in the mask `among` (k,) that may not be clear."""
        if thresholds is not self._thresholds:
            self._thresholds = thresholds
            self._warn = np.array([limits.warn for limits in thresholds])
        if self._unlisted is not Level.CLEAR:
            return np.flatnonzero(among).tolist()  # the first tick reports every change
        suspect = ~(pairs.lower > self._warn[pairs.positions]) | pairs.stale
        suspect |= pairs.status == _INTERSECTING
        if self._unclear:
            suspect |= np.isin(pairs.positions, list(self._unclear))
        return np.flatnonzero(suspect & among).tolist()

    def _judge(
        self, pair: PairState, limits: Thresholds, now_s: float, silent: Mapping[str, str]
    ) -> tuple[Level, str]:
        held = self._held.get(pair.index)
        if pair.silent:
            if held is not None:
                held.above_stop_s = held.above_warn_s = math.nan
            why = NO_POSE_YET if pair.status is PairStatus.UNKNOWN else NO_RECENT_POSE
            return Level.STALE, silence(pair.silent, silent, why)
        new, reason = self._step(held, pair.lower, limits, now_s, pair)
        self._keep(pair.index, held, new)
        return new, reason

    def _release(
        self,
        i: int,
        limits: Thresholds,
        now_s: float,
        unwatched: str | None,
        silent: Mapping[str, str],
    ) -> tuple[Level, str, float]:
        """Judge an unlisted pair that was not clear; return level, reason and lower bound."""
        held, watched = self._held.get(i), self._pairs[i]
        names = [name for name in (watched.a, watched.b) if name in silent]
        if names and unwatched is None:
            if held is not None:
                held.above_stop_s = held.above_warn_s = math.nan
            return Level.STALE, silence(names, silent), math.nan
        if unwatched is not None:
            new, reason, lower = Level.CLEAR, unwatched, math.nan
        else:
            lower = max(watched.range, limits.warn + limits.hysteresis)
            # The pair is farther apart than this, so its bound exceeds every limit: pass inf.
            new, reason = self._step(held, math.inf, limits, now_s, None)
            if new is Level.CLEAR:
                reason = f"farther than {self._length(lower)}"
        self._keep(i, held, new)
        return new, reason, lower

    def _keep(self, i: int, held: _Held | None, new: Level) -> None:
        if new is Level.CLEAR:
            self._held.pop(i, None)
        elif held is None:
            self._held[i] = _Held(new)
        else:
            held.level = new

    def _step(
        self,
        held: _Held | None,
        lower: float,
        limits: Thresholds,
        now_s: float,
        pair: PairState | None,
    ) -> tuple[Level, str]:
        """Return the next level of a pair, and the reason; `pair` is None if it is not listed."""
        if held is not None:
            above = lower > limits.stop + limits.hysteresis
            held.above_stop_s = _since(held.above_stop_s, above, now_s)
            above = lower > limits.warn + limits.hysteresis
            held.above_warn_s = _since(held.above_warn_s, above, now_s)
        if pair is not None and pair.status is PairStatus.INTERSECTING:
            if held is not None:
                held.above_stop_s = held.above_warn_s = math.nan
            return Level.STOP, "intersecting: contact cannot be excluded"
        at = "" if pair is None else self._at(pair)
        for level, limit in ((Level.STOP, limits.stop), (Level.WARN, limits.warn)):
            if not lower > limit:
                return level, f"{at} <= {level.value} {self._length(limit)}"
            if held is None or (level is Level.STOP and held.level is not Level.STOP):
                continue
            since = held.above_stop_s if level is Level.STOP else held.above_warn_s
            if math.isnan(since):
                return level, (
                    f"{at} is not above {level.value} {self._length(limit)}"
                    f" + hysteresis {self._length(limits.hysteresis)}"
                )
            if now_s - since < limits.hold_s:
                return level, f"above {level.value} for less than {limits.hold_s:g} s"
        return Level.CLEAR, f"{at} > warn {self._length(limits.warn)}"

    def _alert(
        self,
        pair: PairState,
        old: Level,
        new: Level,
        reason: str,
        limits: Thresholds,
        courses: Courses,
    ) -> Alert:
        motion = relative_motion(pair, courses)
        left = math.nan
        if new in (Level.WARN, Level.STOP):
            threshold = limits.stop if new is Level.WARN else 0.0
            left = motion.seconds_to(pair.lower - threshold)
        if not math.isnan(left):
            what = "stop" if new is Level.WARN else "contact"
            speed = f"{motion.closing / self._unit.to_metre:.4g} {self._unit.symbol}/s"
            reason += f", closing at {speed}, {what} in {left:.3g} s"
        return Alert(
            pair.index, pair.a, pair.b, old, new, pair.lower, pair.upper, reason, motion, left
        )

    def _at(self, pair: PairState) -> str:
        if pair.upper < 0.0:
            depth = self._length(-pair.lower)
            if pair.lower != pair.upper:
                depth = f"{-pair.upper / self._unit.to_metre:.4g}..{depth}"
            return f"overlapping by {depth}: distance {self._length(pair.lower)}"
        if pair.status is PairStatus.BOUNDED:
            return f"lower bound {self._length(pair.lower)} (upper {self._length(pair.upper)})"
        return f"distance {self._length(pair.lower)}"

    def _length(self, metres: float) -> str:
        return f"{metres / self._unit.to_metre:.4g} {self._unit.symbol}"


def _since(since_s: float, above: bool, now_s: float) -> float:
    if not above:
        return math.nan
    return now_s if math.isnan(since_s) else since_s
