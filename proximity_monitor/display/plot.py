"""The plot of clearance over time, with the thresholds."""

from __future__ import annotations

from collections.abc import Collection
from html import escape

import numpy as np
import viser

from proximity_monitor.display.choice import Choice, PairName
from proximity_monitor.display.session import Session
from proximity_monitor.display.signs import DECIMALS
from proximity_monitor.display.state import STALE, Pairs, SceneInfo, Thresholds

LOG, THRESHOLDS = "Log", "Thresholds"

_THRESHOLDS = ("warn", "stop")

LIMITS = "warn dashed, stop dotted"
"""The part of the title that says which line is which."""

ABOVE = 3.0
"""The scale THRESHOLDS reaches to this many times warn."""

DEEP = 1.0
"""For a lower bound alone, no scale reaches further below contact than this many times warn: a
search that the budget cut may leave the lower bound anywhere."""

HEIGHT = 125
"""Pixels of the plot's height, with the numbers below it."""

BELOW = 30
"""Pixels of the numbers below the plot."""

PADDING = (8, 24, 0, 0)
"""Pixels above, right, below and left; the uppermost number extends half above the plot."""

LABEL = 12
"""Minimum pixels between two numbers beside the plot."""

MISSED = 5.0
"""If two ticks are more than this many periods apart, the clearance between them is not known."""

COVER = "#e4e6ea"
"""The colour that covers times at which the clearance is not known."""


class Plot:
    """The plot of one page, of the highlighted pair or of the smallest clearance of all."""

    def __init__(self, gui: viser.GuiApi, session: Session, choice: Choice) -> None:
        """Add the plot at the current place of the GUI."""
        self._gui = gui
        self._session = session
        self._choice = choice
        self._looks: dict = {}
        self._plot: viser.GuiUplotHandle | None = None
        self._title = gui.add_html("")
        self._holder = gui.add_folder(None)
        self._scale = gui.add_dropdown(
            "Scale", (LOG, THRESHOLDS), hint=f"{THRESHOLDS}: only up to {ABOVE:g} times warn"
        )

    def show(self, scene: SceneInfo, start: float) -> None:
        """Draw the session so far, which began at the stamp `start`; cover times not known.

        Thresholds are always drawn. If those of pairs differ, the curve of the smallest clearance
        has those of the pair that is nearest now, and the title names this pair.
        """
        pair, ignored = self._choice.pair, self._choice.ignored
        stamps, lower, upper = self._session.series(pair, ignored)
        if len(stamps) < 2:
            self._clear()  # the old plot may be of another scene
            return
        unit, newest = scene.unit, self._session.newest.pairs
        digits = DECIMALS.get(unit.symbol, 4)
        lower, upper = (np.round(x / unit.to_metre, digits) for x in (lower, upper))
        drawn = shared_thresholds(scene, ignored) if pair is None else scene.thresholds_of(pair)
        whose = ""
        if drawn is None:
            nearest = nearest_pair(newest, ignored, 0.1**digits * unit.to_metre)
            drawn = scene.thresholds if nearest is None else scene.thresholds_of(nearest)
            whose = ", of "
            whose += "the scene" if nearest is None else f"{' - '.join(nearest)}, the nearest now"
        warn, stop = (getattr(drawn, x) / unit.to_metre for x in _THRESHOLDS)
        thresholds = Thresholds(warn, stop, 0.0)
        scale = scale_of(self._scale.value, thresholds, lower, upper)
        known = ~np.isnan(lower) & np.isfinite(upper)
        places, rows, cover = covered(stamps, known, 1.0 / (scene.settings["rate_hz"] or 1.0))
        data = [np.round(stamps[places] - start, 2)]
        data += [x[rows] for x in (np.maximum(lower, scale["range"][0]), upper)]
        data += [cover, *(np.full(len(rows), x) for x in (warn, stop))]
        looks = {"series": _series(unit.symbol), **_scales(scale, thresholds)}
        if self._plot is None or looks != self._looks:
            # If the look of a plot changed, a browser would forget which times it shows. So another
            # plot is made. The title changes more often, so it is not part of the plot.
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
        which = "all" if len(newest) == scene.pairs else "the listed"
        title = f"smallest clearance of {which} pairs" if pair is None else " - ".join(pair)
        what = f"lower and upper bound [{unit.symbol}] over time [s]; {LIMITS}"
        told = escape(f"{title}: {what}{whose}{grey}")
        room = 'class="pm pm-small pm-room" style="--lines:2"'
        self._title.content = f'<div {room} id="pm-plot">{told}</div>'

    def _clear(self) -> None:
        if self._plot is not None:
            self._plot.remove()
            self._plot = None
            self._title.content = ""


def shared_thresholds(scene: SceneInfo, ignored: Collection[PairName]) -> Thresholds | None:
    """Return the thresholds that all pairs not ignored share; None if their warn or stop differ."""
    own = [thresholds for pair, thresholds in scene.own_thresholds.items() if pair not in ignored]
    every = own if own and len(own) >= scene.pairs - len(ignored) else [scene.thresholds, *own]
    return (
        every[0] if len({(thresholds.warn, thresholds.stop) for thresholds in every}) == 1 else None
    )


def nearest_pair(pairs: Pairs, ignored: Collection[PairName], digit: float) -> PairName | None:
    """Return the pair with the smallest upper bound of a tick; None: no clearance is known.

    Args:
        pairs: the pairs of the tick; stale ones do not count.
        ignored: pairs that do not count.
        digit: metres. Bounds that are equal when rounded to this are equal; the first of such
            pairs is returned, so that the choice does not change with every tick.
    """
    upper = np.where((pairs.level == STALE) | np.isnan(pairs.upper), np.inf, pairs.upper)
    upper[[pairs.places[name] for name in ignored if name in pairs.places]] = np.inf
    if not np.isfinite(upper).any():
        return None
    return pairs.names[int(np.argmin(np.round(upper / digit)))]


def covered(
    stamps: np.ndarray, known: np.ndarray, period_s: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which ticks to draw, and where to cover times at which the clearance is not known.

    For uPlot only null is a gap, but viser sends numbers alone, so uPlot would draw a straight line
    there. The cover hides that line: it is 1 from the last known tick before a gap to the next, and
    0 elsewhere. It steps at ticks that are listed twice.

    Args:
        stamps: (n,) seconds, ascending.
        known: (n,) whether the clearance was known.
        period_s: seconds between two ticks of the monitor.

    Returns:
        For each of m points: the tick of its time, the tick of its bounds, the cover.
    """
    last = len(stamps) - 1
    at = np.flatnonzero(known)
    if not len(at):
        both = np.array([0, last])
        return both, both, np.ones(2)
    # Long sessions keep and plot fewer ticks, and a busy monitor makes fewer.
    longest_s = MISSED * max(period_s, float(np.median(np.diff(stamps))))
    steps = np.flatnonzero((np.diff(at) > 1) | (np.diff(stamps[at]) > longest_s))
    begins, ends = at[steps], at[steps + 1]
    if at[0] > 0:
        begins, ends = np.append(begins, 0), np.append(ends, at[0])
    if at[-1] < last:
        begins, ends = np.append(begins, at[-1]), np.append(ends, last)
    places = np.concatenate((at, begins, ends))
    # A cover begins after the point of its first tick, and ends before the point of its last.
    after = np.repeat((0.0, 0.25, -0.25), (len(at), len(begins), len(ends)))
    order = np.argsort(places + after, kind="stable")
    rows = np.clip(places, at[0], at[-1])
    return places[order], rows[order], (after != 0.0).astype(float)[order]


def scale_of(kind: str, thresholds: Thresholds, lower: np.ndarray, upper: np.ndarray) -> dict:
    """Return the scale of the clearances; it always includes contact and the thresholds.

    Args:
        kind: LOG or THRESHOLDS.
        thresholds: the thresholds, in the unit of the plot.
        lower: (n,) lower bounds to show, in the same unit; NaN where nothing is known.
        upper: (n,) upper bounds.
    """
    warn = max(thresholds.warn, thresholds.stop, 1e-9)
    uppers = upper[np.isfinite(upper)]
    # The upper bound proves an overlap of its depth, so the scale includes all of that.
    low = min(
        max(float(np.nanmin(lower, initial=0.0)), -DEEP * warn), float(uppers.min(initial=0.0))
    )
    if kind == THRESHOLDS:
        return {"auto": False, "range": (max(_round(low), -ABOVE * warn), ABOVE * warn)}
    high = float(uppers.max(initial=ABOVE * warn))
    # The inverse hyperbolic sine is linear near zero, so contact and overlaps have a place. Far
    # from zero it is logarithmic. No threshold and no positive clearance is deep in the linear
    # part, where it would look like contact.
    shown = np.concatenate((lower, upper, (thresholds.stop, thresholds.warn)))
    least = float(shown[np.isfinite(shown) & (shown > 0.0)].min(initial=max(high, warn)))
    bend = least if least in (thresholds.stop, thresholds.warn) else 1.0 / _round(1.0 / least)
    return {"auto": False, "range": (_round(low), _round(high)), "distr": 4, "asinh": bend}


def ticks(scale: dict, thresholds: Thresholds) -> tuple[float, ...]:
    """Return the clearances (k,), ascending, that get a number beside a logarithmic scale.

    Candidates are the thresholds and contact, then powers of ten from the greatest down, then five
    and two times these. A candidate too near to an earlier one is left out.

    Args:
        scale: from `scale_of`.
        thresholds: the thresholds, in the unit of the plot.
    """
    low, high = scale["range"]
    bend = scale["asinh"]
    span = float(np.arcsinh(high / bend) - np.arcsinh(low / bend))
    least = span * LABEL / (HEIGHT - BELOW - PADDING[0])
    outermost = max(high, -low)
    powers = range(int(np.floor(np.log10(outermost))), int(np.floor(np.log10(bend))) - 1, -1)
    wanted = [thresholds.stop, thresholds.warn, 0.0]
    for factor in (1, 5, 2):
        for power in powers:
            value = float(f"{factor}e{power}")  # a product could have rounding digits
            wanted += [value, -value]
    found: list[float] = []
    for value in wanted:
        away = np.abs(np.arcsinh(np.array(found) / bend) - np.arcsinh(value / bend))
        if low <= value <= high and away.min(initial=np.inf) >= least:
            found.append(value)
    return tuple(sorted(found))


def _round(value: float) -> float:
    """Return the next number away from zero that is 1, 2 or 5 times a power of ten, or zero.

    A browser makes a plot again whenever its scale changes, so the scale changes in coarse steps.
    """
    if value == 0.0:
        return 0.0
    power = 10.0 ** np.floor(np.log10(abs(value)))
    factor = next(x for x in (1.0, 2.0, 5.0, 10.0) if abs(value) <= 1.000001 * x * power)
    return float(np.copysign(factor * power, value))


def _scales(scale: dict, thresholds: Thresholds) -> dict:
    """Return uPlot's options for the scales and for the numbers beside them."""
    beside: dict = {"size": 60}
    if "asinh" in scale:
        # On this scale uPlot drops powers of ten by their place in a list, so 0 may be the only
        # number left, and it never marks the thresholds.
        at = ticks(scale, thresholds)
        beside |= {"splits": at, "filter": at, "values": tuple(f"{x:g}" for x in at)}
    cover = {"auto": False, "range": (0.1, 0.9)}  # so that 0 and 1 lie beyond the edges
    return {
        "scales": {"x": {"time": False}, "y": scale, "cover": cover},
        "axes": ({"size": BELOW}, beside),
    }


def _series(symbol: str) -> tuple[dict, ...]:
    """Return uPlot's options for the times and for each curve; the last is drawn on top."""
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
        {"label": f"stop [{symbol}]", "stroke": "#d55e00", "dash": (2, 3), "width": 1},
    )
