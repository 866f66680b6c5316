"""Clearance over time: the plot, the smallest clearance of the session, and looking back."""

from __future__ import annotations

from collections.abc import Callable
from html import escape

import viser

from proximity_monitor.display.choice import Choice
from proximity_monitor.display.plot import Plot
from proximity_monitor.display.session import Session
from proximity_monitor.display.signs import length
from proximity_monitor.display.state import SceneInfo

EVERY_S = 0.25
"""Seconds between two updates of the plot."""

LIVE_S = 2.0
"""Within this many seconds of its end the slider means now: a slow browser has an older end."""


class Timeline:
    """The plot with its slider, and the panel for the smallest clearance of the session."""

    def __init__(
        self,
        gui: viser.GuiApi,
        plot: viser.GuiTabHandle,
        session: Session,
        choice: Choice,
        on_return: Callable[[], None],
    ) -> None:
        """Add the plot to its tab, and the panel at the current place of the GUI.

        Args:
            gui: takes the panel.
            plot: the tab for the plot.
            session: the session to look back at.
            choice: the highlighted pair, and the moment to show.
            on_return: moves the bodies to their poses at the smallest clearance.
        """
        self._session = session
        self._choice = choice
        self._due_s = 0.0
        with plot:
            self._plot = Plot(gui, session, choice)
            self._slider = gui.add_slider(
                "Look back [s]", 0.0, 1.0, 0.1, 1.0, hint="The session so far; right end: live"
            )
        self._worst = gui.add_html("")
        self._return = gui.add_button("Return to that pose", icon=viser.Icon.ARROW_BACK)
        self._live = gui.add_button("Back to live", icon=viser.Icon.PLAYER_PLAY, disabled=True)

        @self._slider.on_update
        def _(event: viser.GuiEvent) -> None:
            if event.client is not None:
                now = self._slider.value >= self._slider.max - LIVE_S
                choice.at_s = None if now else session.span_s[0] + self._slider.value

        @self._live.on_click
        def _(_) -> None:
            choice.at_s = None

        @self._return.on_click
        def _(_) -> None:
            on_return()

    def show(self, scene: SceneInfo, now_s: float) -> None:
        """Update the plot and the panel, at most every `EVERY_S`."""
        if now_s < self._due_s:
            return
        self._due_s = now_s + EVERY_S
        start, end = self._session.span_s
        self._slider.max = max(round(end - start, 1), 0.1)
        at = self._choice.at_s
        self._live.disabled = at is None
        self._slider.value = self._slider.max if at is None else round(at - start, 1)
        self._tell_worst(scene)
        self._plot.show(scene, start)

    def _tell_worst(self, scene: SceneInfo) -> None:
        found = self._session.worst(self._choice.pair, self._choice.ignored)
        self._return.disabled = found is None or not found[1].placed
        if found is None:
            self._worst.content = ""
            return
        (a, b), worst = found
        lowest = self._session.lowest(self._choice.pair, self._choice.ignored)
        bounds, least = "", length(lowest, scene.unit)
        if least != length(worst.upper, scene.unit):
            bounds = f" (at least {least} at every tick)"
        ago = self._session.span_s[1] - worst.stamp_s
        thinned = ""
        if (every_s := self._session.thinned_s) is not None:
            thinned = (
                f'<div class="pm-small pm-dim" id="pm-thinned">The session is thinned to one tick'
                f" per {every_s:.1f} s. The smallest clearances cover all.</div>"
            )
        self._worst.content = (
            f'<div class="pm pm-room" style="--lines:2" id="pm-worst">Smallest in this session: <b>'
            f"{length(worst.upper, scene.unit)}</b>{bounds}, {escape(f'{a} - {b}')},"
            f" {ago:.0f} s ago{thinned}</div>"
        )
