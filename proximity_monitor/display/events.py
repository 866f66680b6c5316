"""The session's events: each change of a pair's state, with its moment and its bounds then."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from proximity_monitor.display.choice import PairName
from proximity_monitor.display.signs import CLEAR_SIGN, Sign, clearance, sign
from proximity_monitor.display.snapshot import Snapshot
from proximity_monitor.display.state import Frame, Pairs, SceneInfo

MOST = 2000
"""How many events are kept; beyond it the oldest go."""

BYTES = 64_000_000
"""Bytes that their poses may take at most, so of many bodies fewer are kept."""

PICTURES = 100
"""Of how many events the pictures are kept; beyond it those that were taken first go."""


class Event(NamedTuple):
    """A change of a pair's state."""

    number: int
    """Of the session, from 0."""
    stamp_s: float
    pair: PairName
    before: Sign
    after: Sign
    clearance: str
    then: Snapshot | None
    """The pair then; None: beyond its range."""

    @property
    def lower(self) -> float:
        """Metres, as is `upper`; NaN: beyond the pair's range, or without a pose."""
        return math.nan if self.then is None else self.then.lower

    @property
    def upper(self) -> float:
        """The other bound."""
        return math.nan if self.then is None else self.then.upper

    @property
    def sight(self) -> Snapshot | None:
        """What a picture of it shows; None: the pair's closest points are not known."""
        known = self.then is not None and not np.isnan(self.then.points).any()
        return self.then if known else None


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
        self.pictures: Mapping[int, bytes] = {}
        """PNG files of events, by their numbers: those that browsers have taken."""

    def clear(self) -> None:
        """Begin anew."""
        self._last = None
        self.all = []
        self._count = self.lost = 0
        self.pictures = {}

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
                told = "" if row is None else clearance(frame.pairs, row, scene.unit)
                then = None if row is None else Snapshot.of(frame, row)
                found.append(Event(self._count, frame.stamp_s, pair, was, now, told, then))
                self._count += 1
        most = max(min(MOST, BYTES // max(frame.poses.nbytes, 1)), 1)
        self.all = (self.all + found)[-most:]
        self.lost = self._count - len(self.all)
        return bool(found)

    def at(self, number: int) -> Event | None:
        """Return an event by its number, if it is still kept."""
        i = number - self.lost
        return self.all[i] if 0 <= i < len(self.all) else None

    def keep(self, event: Event, picture: bytes) -> None:
        """Keep a picture of an event that is still known. Any thread may call."""
        if self.at(event.number) is event:
            kept = [*self.pictures.items(), (event.number, picture)]
            self.pictures = dict(kept[-PICTURES:])


def _changed(before: Pairs, after: Pairs) -> list[PairName]:
    """Return the pairs whose state may have changed; those beyond their range are clear."""
    if before.names == after.names:
        return [after.names[i] for i in np.flatnonzero(_differ(before, after, slice(None)))]
    known = (before.places.get(name, -1) for name in after.names)
    was = np.fromiter(known, int, len(after))
    came = was < 0
    changed = came & _unclear(after)
    changed[~came] = _differ(before, after, ~came, was[~came])
    gone = (before.names[i] for i in np.flatnonzero(_unclear(before)))
    return [
        *(name for name in gone if name not in after.places),
        *(after.names[i] for i in np.flatnonzero(changed)),
    ]


def _unclear(pairs: Pairs) -> np.ndarray:
    return (pairs.level != 0) | pairs.touching


def _differ(
    before: Pairs, after: Pairs, now: np.ndarray | slice, was: np.ndarray | slice = slice(None)
) -> np.ndarray:
    """Return whether what decides on a sign differs between rows of two ticks."""
    same = (before.level[was] == after.level[now]) & (before.status[was] == after.status[now])
    return ~(same & (before.touching[was] == after.touching[now]))


def _sign(pairs: Pairs, pair: PairName, scene: SceneInfo) -> Sign:
    row = pairs.places.get(pair)
    return CLEAR_SIGN if row is None else sign(pairs, row, scene)  # else it is beyond its range
