"""Clearance over time: the plot, the session's worst, and looking back."""

from __future__ import annotations

from collections.abc import Callable
from html import escape

import numpy as np
import viser

from proximity_monitor.display.choice import Choice
from proximity_monitor.display.session import Session
from proximity_monitor.display.signs import DECIMALS, length
from proximity_monitor.display.state import SceneInfo

EVERY_S = 0.25
"""Seconds between two updates of the plot."""

LIVE_S = 0.15
"""Within so many seconds of the newest tick, the slider means now."""


class Timeline:
    """The plot with its slider, and the panel of the session."""

    def __init__(
        self,
        gui: viser.GuiApi,
        plot: viser.GuiTabHandle,
        session: Session,
        choice: Choice,
        on_return: Callable[[], None],
    ) -> None:
        """Add the plot to its tab, and the rest at this place of the GUI.

        Args:
            gui: takes the panel.
            plot: the tab of the plot.
            session: the session to look back at.
            choice: the highlighted pair, and the moment to show.
            on_return: puts the bodies where the smallest clearance was.
        """
        self._gui = gui
        self._session = session
        self._choice = choice
        self._due_s = 0.0
        self._kind = ("", 0)
        self._plot: viser.GuiUplotHandle | None = None
        with plot:
            self._holder = gui.add_folder(None)
            self._slider = gui.add_slider(
                "Look back [s]", 0.0, 1.0, 0.1, 1.0, hint="The session so far; at the end: live"
            )
        self._worst = gui.add_html("")
        self._return = gui.add_button("Return to that pose", icon=viser.Icon.ARROW_BACK)
        self._live = gui.add_button("Back to live", icon=viser.Icon.PLAYER_PLAY, disabled=True)

        @self._slider.on_update
        async def _(event: viser.GuiEvent) -> None:
            if event.client is not None:
                start, end = session.span_s
                at = start + self._slider.value
                choice.at_s = None if at > end - LIVE_S else at

        @self._live.on_click
        async def _(_) -> None:
            choice.at_s = None

        @self._return.on_click
        async def _(_) -> None:
            on_return()

    def show(self, scene: SceneInfo, now_s: float) -> None:
        """Update it from time to time."""
        if now_s < self._due_s:
            return
        self._due_s = now_s + EVERY_S
        start, end = self._session.span_s
        self._slider.max = max(round(end - start, 1), 0.1)
        at = self._choice.at_s
        self._live.disabled = at is None
        self._slider.value = self._slider.max if at is None else round(at - start, 1)
        self._tell_worst(scene)
        self._draw(scene, start)

    def _tell_worst(self, scene: SceneInfo) -> None:
        found = self._session.worst(self._choice.pair, self._choice.ignored)
        self._return.disabled = found is None
        if found is None:
            self._worst.content = ""
            return
        (a, b), worst = found
        bounds = ""
        if worst.lower < worst.upper:
            bounds = f" (at least {length(worst.lower, scene.unit)} at that tick)"
        ago = self._session.span_s[1] - worst.stamp_s
        self._worst.content = (
            f'<div class=pm id="pm-worst">Smallest in this session: <b>'
            f"{length(worst.upper, scene.unit)}</b>{bounds}, {escape(f'{a} - {b}')},"
            f" {ago:.0f} s ago</div>"
        )

    def _draw(self, scene: SceneInfo, start: float) -> None:
        stamps, lower, upper = self._session.series(self._choice.pair, self._choice.ignored)
        known = np.isfinite(lower) & np.isfinite(upper)  # the plot knows no other numbers
        stamps, lower, upper = stamps[known], lower[known], upper[known]
        if len(stamps) < 2:
            return
        unit, pair = scene.unit, self._choice.pair
        digits = DECIMALS.get(unit.symbol, 4)
        data = [np.round(stamps - start, 2)]
        data += [np.round(bound / unit.to_metre, digits) for bound in (lower, upper)]
        if pair is not None:
            limits = scene.thresholds_of(pair)
            data += [np.full(len(stamps), x / unit.to_metre) for x in (limits.warn, limits.stop)]
        title = f"{pair[0]} - {pair[1]}" if pair is not None else "smallest clearance of all pairs"
        kind = (unit.symbol, len(data))
        if self._plot is None or self._kind != kind:
            self._kind = kind
            self._make(tuple(data), unit.symbol)
        self._plot.title = f"{title}: lower and upper bound [{unit.symbol}] over time [s]"
        self._plot.data = tuple(data)

    def _make(self, data: tuple[np.ndarray, ...], symbol: str) -> None:
        if self._plot is not None:
            self._plot.remove()
        with self._holder:
            self._plot = self._gui.add_uplot(
                data,
                _series(symbol)[: len(data)],
                bands=({"series": (2, 1), "fill": "rgba(86,180,233,0.25)"},),
                scales={"x": {"time": False}, "y": {"auto": True}},
                axes=({"size": 30}, {"size": 60}),
                legend={"show": False},
                height=150,
            )


def _series(symbol: str) -> tuple[dict, ...]:
    return (
        {"label": "s"},
        {"label": f"lower [{symbol}]", "stroke": "#0072b2", "width": 1.5},
        {"label": f"upper [{symbol}]", "stroke": "#56b4e9", "width": 1.5},
        {"label": f"warn [{symbol}]", "stroke": "#e69f00", "dash": (8, 4), "width": 1},
        {"label": f"stop [{symbol}]", "stroke": "#d55e00", "dash": (3, 3), "width": 1},
    )
