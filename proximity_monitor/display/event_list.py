"""The list of events on one page; a press looks back at the event's moment."""

from __future__ import annotations

from bisect import bisect_left
from html import escape

import viser

from proximity_monitor.display.bridge import PRESSES, word
from proximity_monitor.display.choice import Choice
from proximity_monitor.display.conflicts import UNDECIDED, row_mark
from proximity_monitor.display.decisions import Decision
from proximity_monitor.display.event_picture import EventPicture
from proximity_monitor.display.events import Event
from proximity_monitor.display.inbox import News
from proximity_monitor.display.listing import admits, left_out
from proximity_monitor.display.paging import page_of, pager
from proximity_monitor.display.shared import Shared
from proximity_monitor.display.state import SceneInfo
from proximity_monitor.scene.naming import counted

TURN = "events-from"
"""The word that a press sends to turn to another page of the list."""

EVERY_S = 0.3
"""Seconds between two updates of the list."""


class EventList:
    """The list, and the button that forgets the smallest clearances."""

    def __init__(
        self, gui: viser.GuiApi, shared: Shared, choice: Choice, picture: EventPicture
    ) -> None:
        """Add both at the current place of the GUI; the pressed event's picture comes between."""
        self._events = shared.events
        self._session = shared.session
        self._decisions = shared.decisions
        self._choice = choice
        self._due_s = 0.0
        self._newest: int | None = None  # first event on the page; None: always the newest
        self._reset_here = False
        button = gui.add_button(
            "Reset the smallest clearances, for everybody", icon=viser.Icon.ERASER
        )
        self._reset = gui.add_html("")
        self._picture = picture
        picture.add(gui)
        with gui.add_folder("Events"):
            self._list = gui.add_html("")

        @button.on_click
        def _(_) -> None:
            self._session.forget_worst()
            self._reset_here = True
            shared.reset_minima()

    def show(self, news: News, now_s: float) -> None:
        """Bring the list up to date."""
        self._picture.show(news.scene, self._session.span_s[0])
        if now_s >= self._due_s:
            self._due_s = now_s + EVERY_S
            self._list.content = self._html(news.scene)
            told = escape(news.reset) if self._reset_here else ""
            self._reset.content = f'<div class="pm pm-small" id="pm-reset">{told}</div>'

    def go(self, number: str) -> None:
        """Look back at the moment and the pair of an event, given by its number."""
        event = self._events.at(int(number)) if number.isdecimal() else None
        if event is not None:
            self._choice.look_back(event.pair, event.stamp_s, event.then)
            self._picture.choose(event)

    def turn(self, newest: str) -> None:
        """Show the page that begins with an event, given by its number; empty: with the newest."""
        self._newest, self._due_s = int(newest) if newest.isdecimal() else None, 0.0

    def _html(self, scene: SceneInfo) -> str:
        choice, decisions, every = self._choice, self._decisions.all, self._events.all
        listed = [
            event for event in every if admits(choice, event.pair, event.after.kind, decisions)
        ][::-1]
        numbers = [-event.number for event in listed]
        first = 0 if self._newest is None else bisect_left(numbers, -self._newest)
        page = page_of(first, len(listed))
        start = self._session.span_s[0]
        rows = "".join(
            _row(event, start, decisions.get(frozenset(event.pair), UNDECIDED), scene, choice)
            for event in listed[page]
        )

        def mark(first: int) -> str:  # a number stays right if more events come meanwhile
            return str(listed[first].number) if first else ""

        lost = self._events.lost
        rest = f"; {counted(lost, 'older one is', 'older ones are')} no longer kept" if lost else ""
        told = f"newest first{rest}" if every or lost else "no pair has changed its state yet"
        return (
            f'<div class=pm {PRESSES}><table class=pm-table id="pm-events"><tr><th>at</th>'
            f"<th>state</th><th>pair</th><th class=pm-num>clearance</th></tr>{rows}</table>"
            f"{pager(TURN, page.start, len(listed), mark)}"
            f"<div class='pm-small pm-dim'>{told}</div>"
            f"{left_out(len(every) - len(listed))}</div>"
        )


def _row(event: Event, start: float, decision: Decision, scene: SceneInfo, choice: Choice) -> str:
    a, b = map(escape, event.pair)
    decided = row_mark(decision, event.after.kind, event.upper, scene.unit, "worse then")
    chosen = " pm-chosen" if (event.pair, event.stamp_s) == (choice.pair, choice.at_s) else ""
    return (
        f'<tr class="pm-row{chosen}" {word(f"event:{event.number}")}>'
        f"<td class=pm-on>{event.stamp_s - start:.1f} s</td>"
        f'<td class=pm-sign style="color:{event.after.colour}">{event.before.glyph}'
        f" {event.before.word} → {event.after.glyph} {event.after.word}</td>"
        f"<td>{a} - {b}{decided}</td>"
        f"<td class=pm-num>{escape(event.clearance)}</td></tr>"
    )
