"""Clearance over time beside its thresholds."""

from __future__ import annotations

import numpy as np
import viser

from proximity_monitor.display.choice import Choice
from proximity_monitor.display.session import Session
from proximity_monitor.display.signs import DECIMALS
from proximity_monitor.display.state import SceneInfo, Thresholds

LOG, LIMITS = "Log", "Limits"

ABOVE = 3.0
"""The scale of the limits reaches to so many times warn."""

HEIGHT = 150
"""Pixels."""


class Plot:
    """The plot of one page, of the highlighted pair or of the smallest clearance of all."""

    def __init__(self, gui: viser.GuiApi, session: Session, choice: Choice) -> None:
        """Add it at this place of the GUI."""
        self._gui = gui
        self._session = session
        self._choice = choice
        self._kind: tuple = ()
        self._plot: viser.GuiUplotHandle | None = None
        self._holder = gui.add_folder(None)
        self._scale = gui.add_button_group("Scale", (LOG, LIMITS))

    def show(self, scene: SceneInfo, start: float) -> None:
        """Draw the session so far, which began at a stamp; what is not known is a gap."""
        stamps, lower, upper = self._session.series(self._choice.pair, self._choice.ignored)
        known = np.isfinite(lower) & np.isfinite(upper)  # the plot knows no other numbers
        stamps, lower, upper = stamps[known], lower[known], upper[known]
        if len(stamps) < 2:
            return
        unit, pair = scene.unit, self._choice.pair
        limits = scene.thresholds if pair is None else scene.thresholds_of(pair)
        digits = DECIMALS.get(unit.symbol, 4)
        data = [np.round(stamps - start, 2)]
        data += [np.round(bound / unit.to_metre, digits) for bound in (lower, upper)]
        data += [np.full(len(stamps), x / unit.to_metre) for x in (limits.warn, limits.stop)]
        shown = Thresholds(*(x / unit.to_metre for x in (limits.warn, limits.stop, 0.0)))
        scale = _scale(self._scale.value, shown, np.array((lower, upper)) / unit.to_metre)
        kind = (unit.symbol, str(scale))
        if self._plot is None or self._kind != kind:
            self._kind = kind
            self._make(tuple(data), unit.symbol, scale)
        title = f"{pair[0]} - {pair[1]}" if pair is not None else "smallest clearance of all pairs"
        self._plot.title = f"{title}: lower and upper bound [{unit.symbol}] over time [s]"
        self._plot.data = tuple(data)

    def _make(self, data: tuple[np.ndarray, ...], symbol: str, scale: dict) -> None:
        if self._plot is not None:
            self._plot.remove()
        bare = {
            "show": "asinh" not in scale
        }  # there would be a line for each digit of each tenfold
        with self._holder:
            self._plot = self._gui.add_uplot(
                data,
                _series(symbol),
                bands=({"series": (2, 1), "fill": "rgba(86,180,233,0.25)"},),
                scales={"x": {"time": False}, "y": scale},
                axes=({"size": 30}, {"size": 60, "ticks": bare, "grid": bare}),
                legend={"show": False},
                height=HEIGHT,
            )


def _scale(kind: str, limits: Thresholds, bounds: np.ndarray) -> dict:
    """Return the scale of the clearances, in which contact and the thresholds are always seen.

    Args:
        kind: LOG or LIMITS.
        limits: the thresholds, in the unit of the plot.
        bounds: the lower and upper bounds to show, in the same.
    """
    warn = max(limits.warn, limits.stop, 1e-9)
    if kind == LIMITS:
        low = max(_round(min(0.0, bounds.min())), -ABOVE * warn)
        return {"auto": False, "range": (low, ABOVE * warn)}
    # The hyperbolic sine's inverse is linear near zero, so contact and overlaps have a place, and
    # logarithmic far from it.
    low, high = _round(min(0.0, bounds.min())), _round(max(ABOVE * warn, bounds.max()))
    return {"auto": False, "range": (low, high), "distr": 4, "asinh": max(limits.stop, 0.1 * warn)}


def _round(value: float) -> float:
    """Return a number not nearer to zero that is 1, 2 or 5 times a power of ten, or zero.

    A plot is made anew whenever its scale changes, so it should not change with each tick.
    """
    if value == 0.0:
        return 0.0
    power = 10.0 ** np.floor(np.log10(abs(value)))
    factor = next(x for x in (1.0, 2.0, 5.0, 10.0) if abs(value) <= 1.000001 * x * power)
    return float(np.copysign(factor * power, value))


def _series(symbol: str) -> tuple[dict, ...]:
    return (
        {"label": "s"},
        {"label": f"lower [{symbol}]", "stroke": "#0072b2", "width": 1.5},
        {"label": f"upper [{symbol}]", "stroke": "#56b4e9", "width": 1.5},
        {"label": f"warn [{symbol}]", "stroke": "#e69f00", "dash": (8, 4), "width": 1},
        {"label": f"stop [{symbol}]", "stroke": "#d55e00", "dash": (3, 3), "width": 1},
    )
