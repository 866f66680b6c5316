"""The time and accuracy of each setting that was tried in this scene."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from proximity_monitor.display.signs import DECIMALS, length
from proximity_monitor.display.state import BOUNDED, Frame, Health, SceneInfo

SETTLED = 2
"""How many messages about times must come after a change of settings: the first is from before."""

TRIED = 8
"""How many settings are remembered, with their costs."""


class Tried:
    """The costs by setting, shared by all browsers."""

    def __init__(self) -> None:
        """Begin without any costs."""
        self._scene: SceneInfo | None = None
        self._costs: dict[str, str] = {}
        self._heard: Health | None = None
        self._setting, self._messages = "", 0  # in force, and how many messages came since then

    def note(self, scene: SceneInfo, frame: Frame, health: Health | None) -> None:
        """Note the cost of the settings in force. Another scene begins a new table."""
        if self._scene is None or self._scene.key != scene.key:
            self._costs.clear()
            self._setting = ""
        self._scene = scene
        if health is None:
            return
        what = _named(scene.settings, scene.unit.symbol, scene.unit.to_metre)
        if what != self._setting:
            self._setting, self._messages = what, 0
        if health is not self._heard:
            self._heard = health
            self._messages += 1
        p50, p99 = (health.number(f"search_p{share}_ms") for share in (50, 99))
        if self._messages < SETTLED or math.isnan(p50):
            return
        pairs = frame.pairs
        gaps = (pairs.upper - pairs.lower)[np.isfinite(pairs.upper)]
        widest = float(gaps.max()) if len(gaps) else 0.0
        bounded = int((pairs.status == BOUNDED).sum())
        self._costs.pop(what, None)
        self._costs[what] = (
            f"<td class=pm-num>{p50:.2f}</td><td class=pm-num>{p99:.2f}</td>"
            f"<td class=pm-num>{length(widest, scene.unit)}</td><td class=pm-num>{bounded}</td>"
        )
        while len(self._costs) > TRIED:
            del self._costs[next(iter(self._costs))]

    def table(self) -> str:
        """Return the costs as HTML, the last one first."""
        rows = "".join(
            f"<tr{' class=pm-chosen' if told == self._setting else ''}><td>{told}</td>{cost}</tr>"
            for told, cost in reversed(self._costs.items())
        )
        return (
            "<table class='pm-table pm-small'><tr><th>tried in this scene</th>"
            "<th class=pm-num>p50 [ms]</th>"
            "<th class=pm-num>p99 [ms]</th><th class=pm-num>widest bounds</th>"
            f"<th class=pm-num>cut</th></tr>{rows}</table>"
        )


def _named(settings: Mapping[str, float | None], symbol: str, to_metre: float) -> str:
    rel, absolute = settings["rel_err"], settings["abs_err"]
    errors = []
    if rel:
        errors.append(f"{100.0 * rel:g} %")
    if absolute:
        errors.append(f"{absolute / to_metre:.{DECIMALS.get(symbol, 4)}g} {symbol}")
    if rel is None or absolute is None:  # each pair may have a tolerance of its own
        errors.append("as the scene says")
    return f"{' or '.join(errors) or 'exact'}, {settings['budget_ms']:g} ms"
