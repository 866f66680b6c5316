"""The session's events: each change of a pair's state, with its moment and its bounds then."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from proximity_monitor.display.choice import PairName
from proximity_monitor.display.signs import CLEAR_SIGN, Sign, all_unproved, clearance, sign
from proximity_monitor.display.snapshot import Snapshot
from proximity_monitor.display.state import Frame, Pairs, SceneInfo
from proximity_monitor.display.unlisted import sign_of

MOST = 2000
"""How many events are kept; beyond this number the oldest are dropped."""

BYTES = 64_000_000
"""Maximum bytes for their poses. In a scene of many bodies fewer events are kept."""

PICTURES = 100
"""How many events keep their pictures; beyond this number the pictures taken first are dropped."""


class Event(NamedTuple):
    """A change of a pair's state."""

    number: int
    """Counts from 0 while the display runs, across sessions. So a number on an old page never means
    another event."""
    stamp_s: float
    pair: PairName
    before: Sign
    after: Sign
    clearance: str
    then: Snapshot | None
    """The pair at that tick; None: the tick did not list it."""

    @property
    def lower(self) -> float:
        """Metres, as `upper` is; NaN: the pair was not listed or had no pose."""
        return math.nan if self.then is None else self.then.lower

    @property
    def upper(self) -> float:
        """The upper bound; see `lower`."""
        return math.nan if self.then is None else self.then.upper

    @property
    def sight(self) -> Snapshot | None:
        """The pair for a picture of the event; None: its closest points are not known."""
        known = self.then is not None and not np.isnan(self.then.points).any()
        return self.then if known else None


class Events:
    """The events of the session, for all browsers."""

    def __init__(self) -> None:
        """Begin without events."""
        self._last: Frame | None = None
        self._unknown: dict[PairName, Sign] = {}  # signs of pairs not listed, perhaps not clear
        self._count = self._first = 0
        self.all: list[Event] = []
        """The oldest first."""
        self.lost = 0
        """How many of the session's oldest events were dropped."""
        self.pictures: Mapping[int, bytes] = {}
        """PNG files of events by their numbers, as far as browsers have taken them."""

    def clear(self) -> None:
        """Drop all events and begin again."""
        self._last = None
        self._unknown = {}
        self.all = []
        self._first, self.lost = self._count, 0
        self.pictures = {}

    def note(self, frame: Frame, scene: SceneInfo) -> bool:
        """Note the changes since the previous tick; return whether there were any."""
        before, self._last = self._last, frame
        if before is None:
            return False
        found = []
        for pair in dict.fromkeys((*_changed(before.pairs, frame.pairs, scene), *self._unknown)):
            was = self._unknown.pop(pair, None) or _sign(before.pairs, pair, scene)
            now, row = _sign(frame.pairs, pair, scene), frame.pairs.places.get(pair)
            if row is None and now is not CLEAR_SIGN:
                self._unknown[pair] = now
            if was.word != now.word:
                told = "" if row is None else clearance(frame.pairs, row, scene.unit)
                then = None if row is None else Snapshot.of(frame, row)
                found.append(Event(self._count, frame.stamp_s, pair, was, now, told, then))
                self._count += 1
        most = max(min(MOST, BYTES // max(frame.poses.nbytes, 1)), 1)
        self.all = (self.all + found)[-most:]
        self.lost = self._count - len(self.all) - self._first
        return bool(found)

    def at(self, number: int) -> Event | None:
        """Return an event by its number, if it is still kept."""
        i = number - self._first - self.lost
        return self.all[i] if 0 <= i < len(self.all) else None

    def keep(self, event: Event, picture: bytes) -> None:
        """Keep the picture of an event, if the event is still kept. Any thread may call this."""
        if self.at(event.number) is event:
            kept = [*self.pictures.items(), (event.number, picture)]
            self.pictures = dict(kept[-PICTURES:])


def _changed(before: Pairs, after: Pairs, scene: SceneInfo) -> list[PairName]:
    """Return the pairs whose state may have changed.

    A pair that is clear when it is first listed has not changed: it was clear, beyond its range.
    """
    if before.names == after.names:
        differ = _differ(before, after, scene, slice(None), slice(None))
        return [after.names[i] for i in np.flatnonzero(differ)]
    known = (before.places.get(name, -1) for name in after.names)
    was = np.fromiter(known, int, len(after))
    came = was < 0
    changed = came & _unclear(after)
    changed[~came] = _differ(before, after, scene, ~came, was[~came])
    gone = (before.names[i] for i in np.flatnonzero(_unclear(before)))
    return [
        *(name for name in gone if name not in after.places),
        *(after.names[i] for i in np.flatnonzero(changed)),
    ]


def _unclear(pairs: Pairs) -> np.ndarray:
    return (pairs.level != 0) | pairs.touching


def _differ(
    before: Pairs, after: Pairs, scene: SceneInfo, now: np.ndarray | slice, was: np.ndarray | slice
) -> np.ndarray:
    """Return whether anything that determines the sign differs between rows of two ticks."""
    same = (before.level[was] == after.level[now]) & (before.status[was] == after.status[now])
    same &= before.touching[was] == after.touching[now]
    return ~same | (all_unproved(before, scene)[was] != all_unproved(after, scene)[now])


def _sign(pairs: Pairs, pair: PairName, scene: SceneInfo) -> Sign:
    row = pairs.places.get(pair)
    return sign_of(pair, pairs, scene) if row is None else sign(pairs, row, scene)
