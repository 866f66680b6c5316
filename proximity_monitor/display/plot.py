"""Clearance over time beside its thresholds."""

from __future__ import annotations

from collections.abc import Collection
from html import escape

import numpy as np
import viser

from proximity_monitor.display.choice import Choice, PairName
from proximity_monitor.display.session import Session
from proximity_monitor.display.signs import DECIMALS
from proximity_monitor.display.state import SceneInfo, Thresholds

LOG, LIMITS = "Log", "Limits"

_LIMITS = ("warn", "stop")

ABOVE = 3.0
"""The scale of the limits reaches to so many times warn."""

DEEP = 1.0
"""No scale reaches further below contact than so many times warn for a lower bound alone: a search
that was cut may leave it anywhere."""

HEIGHT = 150
"""Pixels, with those below."""

BELOW = 30
"""Pixels that the numbers below the plot take."""

PADDING = (8, 24, 0, 0)
"""Pixels above, right, below and left: half of the uppermost number is above the plot."""

LABEL = 12
"""Least pixels between two numbers beside the plot."""

MISSED = 5.0
"""Nobody knows what was between two ticks so many periods apart."""

COVER = "#e4e6ea"
"""The colour of the times that nobody knows."""


class Plot:
    """The plot of one page, of the highlighted pair or of the smallest clearance of all."""

    def __init__(self, gui: viser.GuiApi, session: Session, choice: Choice) -> None:
        """Add it at this place of the GUI."""
        self._gui = gui
        self._session = session
        self._choice = choice
        self._looks: dict = {}
        self._plot: viser.GuiUplotHandle | None = None
        self._title = gui.add_html("")
        self._holder = gui.add_folder(None)
        self._scale = gui.add_dropdown("Scale", (LOG, LIMITS))

    def show(self, scene: SceneInfo, start: float) -> None:
        """Draw the session so far, which began at a stamp; what is not known is covered.

        Thresholds are drawn where they hold for all that is drawn. Of pairs with unlike ones the
        smallest clearance has none, and their own are shown with each.
        """
        pair, ignored = self._choice.pair, self._choice.ignored
        stamps, lower, upper = self._session.series(pair, ignored)
        if len(stamps) < 2:
            self._clear()  # it may be of another scene
            return
        unit = scene.unit
        lower, upper = lower / unit.to_metre, upper / unit.to_metre
        shared = shared_limits(scene, ignored) if pair is None else scene.thresholds_of(pair)
        warn, stop = (getattr(shared or scene.thresholds, x) / unit.to_metre for x in _LIMITS)
        limits = Thresholds(warn, stop, 0.0)
        scale = scale_of(self._scale.value, limits, lower, upper)
        known = ~np.isnan(lower) & np.isfinite(upper)
        places, rows, cover = covered(stamps, known, 1.0 / (scene.settings["rate_hz"] or 1.0))
        digits = DECIMALS.get(unit.symbol, 4)
        data = [np.round(stamps[places] - start, 2)]
        data += [np.round(x, digits)[rows] for x in (np.maximum(lower, scale["range"][0]), upper)]
        data += [cover, *(np.full(len(rows), x) for x in (warn, stop) if shared is not None)]
        looks = {"series": _series(unit.symbol)[: len(data)], **_scales(scale, limits)}
        if self._plot is None or looks != self._looks:
            # Another look of the same plot would make a browser forget which times it shows: the
            # page begins another plot, and so does not tell it the title, which changes more often.
            self._clear()
            self._looks = looks
            with self._holder:
                self._plot = self._gui.add_uplot(
                    tuple(data),
                    **looks,
                    bands=({"series": (2, 1), "fill": "rgba(86,180,233,0.25)"},),
                    legend={"show": False},
                    height=HEIGHT,
                    padding=PADDING,
                )
        else:
            self._plot.data = tuple(data)
        grey = "; grey: not known" if cover.any() else ""
        all_listed = len(self._session.newest.pairs) == scene.pairs
        which = "all" if all_listed else "the listed"
        title = f"smallest clearance of {which} pairs" if pair is None else " - ".join(pair)
        own = "" if shared is not None else "; a highlighted pair has its own thresholds"
        what = f"lower and upper bound [{unit.symbol}] over time [s]"
        told = escape(f"{title}: {what}{grey}{own}")
        self._title.content = f'<div class="pm pm-small" id="pm-plot">{told}</div>'

    def _clear(self) -> None:
        if self._plot is not None:
            self._plot.remove()
            self._plot = None
            self._title.content = ""


def shared_limits(scene: SceneInfo, ignored: Collection[PairName]) -> Thresholds | None:
    """Return the thresholds of all pairs that are not ignored; None: warn or stop differ."""
    own = [limits for pair, limits in scene.own_thresholds.items() if pair not in ignored]
    every = own if own and len(own) >= scene.pairs - len(ignored) else [scene.thresholds, *own]
    return every[0] if len({(limits.warn, limits.stop) for limits in every}) == 1 else None


def covered(
    stamps: np.ndarray, known: np.ndarray, period_s: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which ticks to draw, and where to cover what nobody knows.

    To uPlot only null is a gap, and viser sends numbers alone: it would draw a straight line there.
    So that line is covered: the cover is 1 from the last known tick to the next and 0 else, and
    steps at ticks that come twice.

    Args:
        stamps: (n,) seconds, ascending.
        known: (n,) whether the clearance was known.
        period_s: seconds between two ticks of the monitor.

    Returns:
        For each of m points: the tick where it is, the tick whose bounds it has, the cover.
    """
    last = len(stamps) - 1
    at = np.flatnonzero(known)
    if not len(at):
        both = np.array([0, last])
        return both, both, np.ones(2)
    # Long sessions keep and show fewer ticks, and a busy monitor has fewer.
    longest_s = MISSED * max(period_s, float(np.median(np.diff(stamps))))
    steps = np.flatnonzero((np.diff(at) > 1) | (np.diff(stamps[at]) > longest_s))
    begins, ends = at[steps], at[steps + 1]
    if at[0] > 0:
        begins, ends = np.append(begins, 0), np.append(ends, at[0])
    if at[-1] < last:
        begins, ends = np.append(begins, at[-1]), np.append(ends, last)
    places = np.concatenate((at, begins, ends))
    # A cover begins after what is known at its first tick, and ends before that of its last.
    after = np.repeat((0.0, 0.25, -0.25), (len(at), len(begins), len(ends)))
    order = np.argsort(places + after, kind="stable")
    rows = np.clip(places, at[0], at[-1])
    return places[order], rows[order], (after != 0.0).astype(float)[order]


def scale_of(kind: str, limits: Thresholds, lower: np.ndarray, upper: np.ndarray) -> dict:
    """Return the scale of the clearances, in which contact and the thresholds are always seen.

    Args:
        kind: LOG or LIMITS.
        limits: the thresholds, in the unit of the plot.
        lower: (n,) lower bounds to show, in the same; NaN where nothing is known.
        upper: (n,) upper bounds.
    """
    warn = max(limits.warn, limits.stop, 1e-9)
    uppers = upper[np.isfinite(upper)]
    # An overlap is certain as far as the upper bound says.
    low = min(
        max(float(np.nanmin(lower, initial=0.0)), -DEEP * warn), float(uppers.min(initial=0.0))
    )
    if kind == LIMITS:
        return {"auto": False, "range": (max(_round(low), -ABOVE * warn), ABOVE * warn)}
    high = float(uppers.max(initial=ABOVE * warn))
    # The hyperbolic sine's inverse is linear near zero, so contact and overlaps have a place, and
    # logarithmic far from it.
    bend = max(limits.stop, 0.1 * warn)
    return {"auto": False, "range": (_round(low), _round(high)), "distr": 4, "asinh": bend}


def ticks(scale: dict, limits: Thresholds) -> tuple[float, ...]:
    """Return the clearances (k,), ascending, whose numbers stand beside a logarithmic scale.

    The thresholds and contact come first, then tenfolds, the greatest first, then halves and fifths
    of them; what is too near to one before is left out.

    Args:
        scale: from `scale_of`.
        limits: the thresholds, in the unit of the plot.
    """
    low, high = scale["range"]
    bend = scale["asinh"]
    span = float(np.arcsinh(high / bend) - np.arcsinh(low / bend))
    least = span * LABEL / (HEIGHT - BELOW - PADDING[0])
    outermost = max(high, -low)
    powers = range(int(np.floor(np.log10(outermost))), int(np.floor(np.log10(bend))) - 1, -1)
    wanted = [limits.stop, limits.warn, 0.0]
    for factor in (1, 5, 2):
        for power in powers:
            value = float(f"{factor}e{power}")  # a product would have digits that no one wants
            wanted += [value, -value]
    found: list[float] = []
    for value in wanted:
        away = np.abs(np.arcsinh(np.array(found) / bend) - np.arcsinh(value / bend))
        if low <= value <= high and away.min(initial=np.inf) >= least:
            found.append(value)
    return tuple(sorted(found))


def _round(value: float) -> float:
    """Return a number not nearer to zero that is 1, 2 or 5 times a power of ten, or zero.

    A browser makes a plot anew whenever its scale changes, so that should not be with each tick.
    """
    if value == 0.0:
        return 0.0
    power = 10.0 ** np.floor(np.log10(abs(value)))
    factor = next(x for x in (1.0, 2.0, 5.0, 10.0) if abs(value) <= 1.000001 * x * power)
    return float(np.copysign(factor * power, value))


def _scales(scale: dict, limits: Thresholds) -> dict:
    """Return what uPlot takes for the scales and for the numbers beside them."""
    beside: dict = {"size": 60}
    if "asinh" in scale:
        # uPlot's own choice on this scale leaves out tenfolds by their place in a list, so it may
        # have no number but 0, and it never has the thresholds.
        at = ticks(scale, limits)
        beside |= {"splits": at, "filter": at, "values": tuple(f"{x:g}" for x in at)}
    cover = {"auto": False, "range": (0.1, 0.9)}  # over the edges, as the curves are
    return {
        "scales": {"x": {"time": False}, "y": scale, "cover": cover},
        "axes": ({"size": BELOW}, beside),
    }


def _series(symbol: str) -> tuple[dict, ...]:
    """The times, then what is drawn, the uppermost last."""
    return (
        {"label": "s"},
        {"label": f"lower [{symbol}]", "stroke": "#0072b2", "width": 1.5},
        {"label": f"upper [{symbol}]", "stroke": "#56b4e9", "width": 1.5},
        {
            "label": "not known",
            "scale": "cover",
            "fill": COVER,
            "width": 3,
            "points": {"show": False},
        },
        {"label": f"warn [{symbol}]", "stroke": "#e69f00", "dash": (8, 4), "width": 1},
        {"label": f"stop [{symbol}]", "stroke": "#d55e00", "dash": (3, 3), "width": 1},
    )
