"""The look of figures: colours that colour-blind readers can tell apart, and marker shapes."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import cycle

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, NullLocator

# The palette of Okabe and Ito, without its yellow, which is faint on white.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
MARKERS = "os^Dv*"
DPI = 100


def figure(columns: int, rows: int, width: float, height: float, **sharing: bool) -> Figure:
    """Return an empty figure with a grid of axes; width and height in inches."""
    fig = Figure(figsize=(width, height), layout="constrained")
    fig.subplots(rows, columns, squeeze=False, **sharing)
    for axes in fig.axes:
        axes.grid(True, which="major", color="#dddddd", linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=9)
    return fig


def log_axis(axis: Axis) -> None:
    """Set a logarithmic scale with plain numbers; it also marks 2 and 5 if it spans few decades."""
    axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    low, high = axis.get_view_interval()
    few = high < 300.0 * low
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
    axis.set_minor_locator(NullLocator() if few else LogLocator(subs="all"))
    axis.set_minor_formatter(NullFormatter())
    if few or (low > 5e-3 and high < 1e7):
        axis.set_major_formatter(lambda value, _: f"{value:,.0f}" if value >= 1.0 else f"{value:g}")


def looks(names: Iterable[str]) -> dict[str, dict[str, str]]:
    """Return colour and marker for each name, as arguments of `plot`."""
    pairs = cycle(zip(PALETTE, MARKERS, strict=True))
    return {
        name: {"color": colour, "marker": marker}
        for name, (colour, marker) in zip(names, pairs, strict=False)
    }


def name_axes(axes: Axes, title: str, x: str, y: str) -> None:
    """Set title and labels, in sizes that can be read on a page."""
    axes.set_title(title, fontsize=10, loc="left")
    axes.set_xlabel(x, fontsize=9)
    axes.set_ylabel(y, fontsize=9)
