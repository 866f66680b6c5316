"""The session's events: each change of a pair's state, with its moment; a press goes there."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import NamedTuple

import numpy as np
import viser

from proximity_monitor.display.bridge import PRESSES, word
from proximity_monitor.display.choice import Choice, PairName
from proximity_monitor.display.session import Session
from proximity_monitor.display.signs import CLEAR_SIGN, Sign, clearance, sign
from proximity_monitor.display.state import Frame, Pairs, SceneInfo

MOST = 2000
"""How many events are kept; beyond it the oldest go."""

LISTED = 40
"""How many of them are listed, the newest."""

EVERY_S = 0.3
"""Seconds between two updates of the list."""


class Event(NamedTuple):
    """A change of a pair's state."""

    number: int
    """Of the session, from 0."""
    stamp_s: float
    pair: PairName
    before: Sign
    after: Sign
    clearance: str


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
                told = "" if row is None else clearance(frame.pairs, row, scene.unit)
                found.append(Event(self._count, frame.stamp_s, pair, was, now, told))
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


class EventList:
    """The list of events on one page."""

    def __init__(
        self,
        gui: viser.GuiApi,
        events: Events,
        session: Session,
        choice: Choice,
        forget: Callable[[], None],
    ) -> None:
        """Add it at this place of the GUI; `forget` begins the smallest clearances anew."""
        self._events = events
        self._session = session
        self._choice = choice
        self._due_s = 0.0
        button = gui.add_button("Forget the smallest clearances", icon=viser.Icon.ERASER)
        self._list = gui.add_html("")

        @button.on_click
        async def _(_) -> None:
            forget()

    def show(self, now_s: float) -> None:
        """Bring the list up to date."""
        if now_s >= self._due_s:
            self._due_s = now_s + EVERY_S
            self._list.content = self._html()

    def go(self, number: str) -> None:
        """Look back at an event's moment, at its pair."""
        event = self._events.at(int(number)) if number.isdecimal() else None
        if event is not None:
            self._choice.at_s, self._choice.pair = event.stamp_s, event.pair

    def _html(self) -> str:
        events, start = self._events, self._session.span_s[0]
        rows = "".join(_row(event, start) for event in events.all[: -LISTED - 1 : -1])
        more = len(events.all) - LISTED
        rest = [f"{more} older"] if more > 0 else []
        rest += [f"the first {events.lost} are no longer known"] if events.lost else []
        return (
            f'<div class=pm {PRESSES}><table class=pm-table id="pm-events"><tr><th>at</th>'
            f"<th>state</th><th>pair</th><th class=pm-num>clearance</th></tr>{rows}</table>"
            f"<div class='pm-small pm-dim'>{'; '.join(rest)}</div></div>"
        )


def _row(event: Event, start: float) -> str:
    a, b = map(escape, event.pair)
    return (
        f"<tr class=pm-row {word(f'event:{event.number}')}><td>{event.stamp_s - start:.1f} s</td>"
        f'<td class=pm-sign style="color:{event.after.colour}">{event.before.glyph}'
        f" {event.before.word} → {event.after.glyph} {event.after.word}</td><td>{a} - {b}</td>"
        f"<td class=pm-num>{escape(event.clearance)}</td></tr>"
    )
