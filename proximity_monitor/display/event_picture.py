"""The picture of the pressed event.

No browser may have shown the pair when the event happened. So the browser in which the event is
pressed draws the picture from the stored poses. From then on all browsers have it.
"""

from __future__ import annotations

import base64
import threading
from collections.abc import Callable
from html import escape

import viser

from proximity_monitor.display.choice import Choice
from proximity_monitor.display.events import Event, Events
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.portraits import Portraits
from proximity_monitor.display.save import png, why_not
from proximity_monitor.display.signs import length
from proximity_monitor.display.state import SceneInfo


class EventPicture:
    """Takes the picture while the page looks back at the event, and shows it."""

    def __init__(
        self,
        events: Events,
        choice: Choice,
        portraits: Portraits,
        parts: Callable[[], Parts | None],
    ) -> None:
        """Begin without an event.

        Args:
            events: stores the pictures.
            choice: holds the moment that the page shows.
            portraits: takes the pictures.
            parts: returns the page's parts.
        """
        self._events = events
        self._choice = choice
        self._portraits = portraits
        self._parts = parts
        self._event: Event | None = None
        self._tried: Event | None = None  # the event whose picture is being taken or has failed
        self._problem = ""
        self._busy = False
        self._told: tuple = ()

    def add(self, gui: viser.GuiApi) -> None:
        """Add the picture at the current place of the GUI."""
        self._html = gui.add_html("")

    def choose(self, event: Event) -> None:
        """Show this event from now on."""
        self._tried, self._event = None, event

    def show(self, scene: SceneInfo, start_s: float) -> None:
        """Show the event's picture, and have it taken if there is none. Call this in each step.

        Args:
            scene: the scene of the session.
            start_s: stamp of the session's beginning.
        """
        event = self._event
        if event is not None and self._events.at(event.number) is not event:
            event = self._event = None  # its session has ended, or it is no longer kept
        picture = None if event is None else self._events.pictures.get(event.number)
        if event is not None and picture is None and not self._busy and self._tried is not event:
            self._begin(event)
        told = (event, picture, self._line(event), scene, start_s)
        if told != self._told:
            self._told = told
            self._html.content = "" if event is None else _figure(*told)

    def _begin(self, event: Event) -> None:
        """Start a thread that takes the picture; it waits for the page's steps and the browser."""
        looks = (self._choice.at_s, self._choice.pair) == (event.stamp_s, event.pair)
        if event.sight is not None and looks:
            self._busy, self._tried, self._problem = True, event, ""
            threading.Thread(target=self._take, args=(event, self._parts()), daemon=True).start()

    def _take(self, event: Event, parts: Parts | None) -> None:
        try:
            image = self._portraits.take(event.sight.frame(event.pair), event.pair, parts)
            self._events.keep(event, png(image))
        except Exception as error:  # any failure of a browser is told in place of the picture
            self._problem = f"No picture: {why_not(error)}"
        finally:
            self._busy = False

    def _line(self, event: Event | None) -> str:
        """Return why there is no picture; empty if there is one or will be one."""
        if event is None:
            return ""
        if event.sight is None:
            return "No picture: the closest points were not known."
        return self._problem if self._tried is event else ""


def _figure(
    event: Event, picture: bytes | None, problem: str, scene: SceneInfo, start_s: float
) -> str:
    image = f'<div class="pm-dim">{escape(problem)}</div>'
    if picture is not None:
        data = base64.b64encode(picture).decode()
        image = f'<img alt="the pair then" src="data:image/png;base64,{data}" style="width:100%">'
    bounds = ""
    if event.then is not None:
        low, high = (length(x, scene.unit) for x in (event.lower, event.upper))
        bounds = f", {low}" if low == high else f", between {low} and {high}"
    told = (
        f"{event.stamp_s - start_s:.1f} s: {' - '.join(event.pair)}, {event.before.word} →"
        f" {event.after.word}{bounds}"
    )
    return f'<div class="pm pm-small" id="pm-event">{escape(told)}{image}</div>'
