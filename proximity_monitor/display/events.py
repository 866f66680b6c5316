"""The session's events: each change of a pair's state, with its moment and its bounds then."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from proximity_monitor.display.choice import PairName
from proximity_monitor.display.signs import CLEAR_SIGN, Sign, clearance, sign
from proximity_monitor.display.state import Frame, Pairs, SceneInfo

MOST = 2000
"""How many events are kept; beyond it the oldest go."""


class Event(NamedTuple):
    """A change of a pair's state."""

    number: int
    """Of the session, from 0."""
    stamp_s: float
    pair: PairName
    before: Sign
    after: Sign
    clearance: str
    lower: float
    """Metres, as is `upper`; NaN: beyond the pair's range, or without a pose."""
    upper: float


class Events:
    """Those of the session, for all browsers."""

    def __init__(self) -> None:
        """Begin without events."""
        self._last: Frame | None = None
        self._count = 0
        self.all: list[Event] = []
        """The oldest first."""
        self.lost = 0
        """How many of the oldest were dropped."""

    def clear(self) -> None:
        """Begin anew."""
        self._last = None
        self.all = []
        self._count = self.lost = 0

    def note(self, frame: Frame, scene: SceneInfo) -> bool:
        """Note what changed since the tick before; return whether anything did."""
        before, self._last = self._last, frame
        if before is None:
            return False
        found = []
        for pair in _changed(before.pairs, frame.pairs):
            was, now = (_sign(pairs, pair, scene) for pairs in (before.pairs, frame.pairs))
            if was.word != now.word:
                row = frame.pairs.places.get(pair)
                told, bounds = "", (math.nan, math.nan)
                if row is not None:
                    told = clearance(frame.pairs, row, scene.unit)
                    bounds = (float(frame.pairs.lower[row]), float(frame.pairs.upper[row]))
                found.append(Event(self._count, frame.stamp_s, pair, was, now, told, *bounds))
                self._count += 1
        self.all = (self.all + found)[-MOST:]
        self.lost = self._count - len(self.all)
        return bool(found)

    def at(self, number: int) -> Event | None:
        """Return an event by its number, if it is still kept."""
        i = number - self.lost
        return self.all[i] if 0 <= i < len(self.all) else None


def _changed(before: Pairs, after: Pairs) -> list[PairName]:
    """Return the pairs whose state may have changed."""
    if before.names == after.names:
        same = (before.level == after.level) & (before.status == after.status)
        same &= before.touching == after.touching
        return [after.names[i] for i in np.flatnonzero(~same)]
    return list(dict.fromkeys((*before.names, *after.names)))


def _sign(pairs: Pairs, pair: PairName, scene: SceneInfo) -> Sign:
    row = pairs.places.get(pair)
    return CLEAR_SIGN if row is None else sign(pairs, row, scene)  # else it is beyond its range
