"""Sliders for thresholds, budget and tolerance, with the time that accuracy costs beside them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from html import escape

import viser

from proximity_monitor.display.choice import Choice
from proximity_monitor.display.fresh import aging
from proximity_monitor.display.state import Health, SceneInfo
from proximity_monitor.display.tried import Tried
from proximity_monitor.scene.naming import safe

ASK_S = 0.2
"""Minimum seconds between two requests to the monitor while a slider is dragged."""

HAND_S = 1.0
"""Sliders follow the monitor only this many seconds after a request, and once it has answered."""

HEADROOM = 4.0
"""A slider of a length reaches at least to this many times the largest threshold."""

LEAST_M = 1e-3
"""A slider of a length reaches at least this far, in metres."""

_REL_TOP = 50.0
"""Maximum of the slider of the relative error, in percent."""

_HINTS = {
    "warn": "A clearance at or below this is at warn",
    "stop": "A clearance at or below this is at stop",
    "hysteresis": "An alert ends only when the clearance exceeds the threshold by more than this",
    "budget": "Time for the searches of one tick. When it ends, bounds stay certain, but wide",
    "error": "A search may stop when the bounds are this close. 0 in both error fields: exact",
}

Values = Mapping[str, float]


class SettingsPanel:
    """The panel that sets the monitor's own parameters."""

    def __init__(
        self, gui: viser.GuiApi, choice: Choice, tried: Tried, ask: Callable[[Values], None]
    ) -> None:
        """Add the panel at the current place of the GUI; `ask` sends parameters to the monitor."""
        self._tried = tried
        self._choice = choice
        self._ask = ask
        self._wanted: dict[str, float] = {}
        self._asked_s = -math.inf
        self._asked_in: SceneInfo | None = None  # the scene at the last request
        self._prefix = ""
        self._scene: SceneInfo | None = None
        with gui.add_folder("Thresholds"):
            self._whose = gui.add_html("")
            self._lengths = {
                name: gui.add_slider(name, 0.0, 1.0, 0.001, 0.0, hint=_HINTS[name])
                for name in ("warn", "stop", "hysteresis")
            }
        with gui.add_folder("Accuracy and its cost"):
            self._budget = gui.add_slider("Budget [ms]", 0.0, 50.0, 0.5, 0.0, hint=_HINTS["budget"])
            self._rel = gui.add_slider(
                "Relative error [%]", 0.0, _REL_TOP, 0.5, 0.0, hint=_HINTS["error"]
            )
            self._abs = gui.add_slider("Absolute error", 0.0, 1.0, 0.001, 0.0, hint=_HINTS["error"])
            self._cost = gui.add_html("")
        self._refusal = gui.add_html("")
        for name, slider in self._lengths.items():
            slider.on_update(self._on_length(name, slider))
        self._budget.on_update(self._on("budget_ms", self._budget, lambda: 1.0))
        self._rel.on_update(self._on("rel_err", self._rel, lambda: 0.01))
        self._abs.on_update(self._on("abs_err", self._abs, lambda: self._scene.unit.to_metre))

    def show(self, scene: SceneInfo, health: Health | None, refusal: str, now_s: float) -> None:
        """Send new settings, and show the settings in force and their cost."""
        if self._scene is not None and self._scene.key != scene.key:
            # Moves of the sliders since the previous scene ended were meant for that scene.
            self._wanted, self._asked_in, self._asked_s = {}, None, -math.inf
        if self._wanted:
            if now_s >= self._asked_s + ASK_S:
                self._asked_s, self._asked_in = now_s, scene
                wanted, self._wanted = self._wanted, {}
                self._ask(wanted)
        elif (scene is not self._asked_in or refusal) and now_s >= self._asked_s + HAND_S:
            self._follow(scene)
        self._cost.content = "" if health is None else self._tell_cost(scene, health)
        told = f"<div class=pm style='color:#b3261e'>refused: {escape(refusal)}</div>"
        self._refusal.content = told if refusal else ""

    def _follow(self, scene: SceneInfo) -> None:
        """Move the sliders to the settings in force.

        The scales are chosen anew for another pair or scene, or if a value exceeds its scale.
        """
        pair = self._choice.pair
        own = pair in scene.own_thresholds and scene.own_parameters
        prefix = f"pairs.{safe(pair[0])}.{safe(pair[1])}" if own else "thresholds"
        thresholds = scene.own_thresholds[pair] if own else scene.thresholds
        to_unit, symbol = 1.0 / scene.unit.to_metre, scene.unit.symbol
        values = {name: getattr(thresholds, name) * to_unit for name in self._lengths}
        anew = self._scene is None or prefix != self._prefix or self._scene.key != scene.key
        self._prefix, self._scene = prefix, scene
        least = LEAST_M * to_unit
        longest = max(values.values())
        anew_lengths = anew or longest > self._lengths["warn"].max  # they share a scale
        for name, slider in self._lengths.items():
            slider.label = f"{name} [{symbol}]"
            _set(slider, values[name], HEADROOM * max(longest, least), 1000, anew_lengths)
        self._abs.label = f"Absolute error [{symbol}]"
        top = max(scene.thresholds.warn * to_unit, least)
        settings = scene.settings
        _set(self._abs, (settings["abs_err"] or 0.0) * to_unit, top, 1000, anew)
        _set(self._budget, settings["budget_ms"], 2e3 / settings["rate_hz"], 200, anew)
        _set(self._rel, 100.0 * (settings["rel_err"] or 0.0), _REL_TOP, 100, anew)
        whose = f"of {escape(' - '.join(pair))}" if own else "of all pairs without their own"
        self._whose.content = f"<div class='pm pm-small pm-dim'>{whose}</div>"

    def _on_length(self, name: str, slider: viser.GuiSliderHandle):
        def on_update(event: viser.GuiEvent) -> None:
            if event.client is None or self._scene is None:
                return
            moved = {name: slider.value}
            if self._lengths["warn"].value < self._lengths["stop"].value:
                # Of warn and stop, the slider that moves pushes the other: warn >= stop.
                moved = dict.fromkeys(("warn", "stop"), slider.value)
            for each, value in moved.items():
                self._lengths[each].value = value
                self._wanted[f"{self._prefix}.{each}"] = value * self._scene.unit.to_metre

        return on_update

    def _on(self, parameter: str, slider: viser.GuiSliderHandle, factor: Callable[[], float]):
        def on_update(event: viser.GuiEvent) -> None:
            if event.client is not None and self._scene is not None:
                self._wanted[parameter] = slider.value * factor()

        return on_update

    def _tell_cost(self, scene: SceneInfo, health: Health) -> str:
        settings = scene.settings
        p50, p99 = (health.number(f"search_p{share}_ms") for share in (50, 99))
        share = f"{100.0 * p50 / settings['budget_ms']:.0f} %" if settings["budget_ms"] else "n/a"
        return (
            f'<div class=pm id="pm-cost"><div>Search {aging("now:", "last known:")}'
            f" <b>{p50:.2f} ms</b> a tick (median),"
            f" {p99:.2f} ms (99th percentile): {share} of the budget</div>"
            f"{self._tried.table()}</div>"
        )


def _round_up(value: float) -> float:
    """Return the next number that is 1, 2 or 5 times a power of ten, or the value if it is one."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= value)


def _set(slider: viser.GuiSliderHandle, value: float, top: float, steps: int, anew: bool) -> None:
    """Move a slider; give it a scale to at least `top` if `anew`, or if the value exceeds it."""
    if anew or value > slider.max:
        slider.max = _round_up(max(top, value))
        slider.step = slider.max / steps
        slider.precision = max(0, math.ceil(-math.log10(slider.step)))
    slider.value = float(max(value, slider.min))
