"""The gap between the bounds against the time budget, and the time really used."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from proximity_monitor import engine

from ..scenes import Track
from .certificate import check
from .part import Job, Part, Row, Rows, only, values
from .style import figure, log_axis, looks, name_axes
from .timing import Asker, Query, Timed, blocks, summary, take_turns
from .words import folded, number, percent, table

ORDERS = ("depth_first", "priority", "breadth_first")
BUDGETS_US = (10, 20, 30, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000)

KEPT = 1.25
"""A budget pays if the searches that it cuts take at most this multiple of it, in the median."""

_BLOCKS, _QUICK, _LENGTH = 10, 1, 2
ORDER_WORDS = {
    "depth_first": "depth first",
    "priority": "by priority",
    "breadth_first": "level by level",
}
_FLOOR = 1e-4
"""Smaller gaps are drawn at this value: they are those of searches that have ended."""


def measure(job: Job) -> Rows:
    """Return one row for each order and budget; every query starts without a remembered pair.

    Raises:
        BrokenCertificateError: bounds that the exact answer contradicts.
    """
    models = job.models()
    (track,) = job.scene.tracks
    turns = blocks(len(track.poses_a), _LENGTH, _QUICK if job.quick else _BLOCKS)
    cases = [(order, budget) for order in ORDERS for budget in BUDGETS_US]
    askers = {case: _asker(models, track, case[0], 1e-6 * case[1]) for case in cases}
    exact = _asker(models, track, ORDERS[0], None)
    found = take_turns({None: exact, **askers}, turns, job.advance)
    rows = []
    for order, budget in cases:
        timed = found[order, budget]
        check(f"{job.name}, {order}, {budget} µs", timed, found[None])
        row = {"scene": job.name, "order": order, "budget_us": budget}
        rows.append(row | summary(timed) | _bounds(timed, found[None]))
    return rows


def _asker(
    models: dict[str, engine.TriangleMesh], track: Track, order: str, budget_s: float | None
) -> Asker:
    # Search once: what a model makes on the first search of an order must not use up the budget.
    engine.Pair(models[track.a], models[track.b]).distance(
        track.poses_a[0], track.poses_b[0], budget_s=0.0, order=order
    )

    def ask(steps: Sequence[int]) -> list[Query]:
        return [
            partial(
                engine.Pair(models[track.a], models[track.b]).distance,
                track.poses_a[i],
                track.poses_b[i],
                budget_s=budget_s,
                order=order,
            )
            for i in steps
        ]

    return ask


def _bounds(timed: Timed, exact: Timed) -> dict[str, float]:
    """Return gaps as shares of the exact distance, and times by the clock that budgets use."""
    true = exact.of("upper")
    gaps = (timed.of("upper") - timed.of("lower")) / true
    used = 1e6 * timed.of("elapsed_s")
    ended = [answer.status is not engine.Status.OUT_OF_TIME for answer in timed.answers]
    low, median, high = np.percentile(gaps, (25, 50, 75))
    return {
        "gap_median": float(median),
        "gap_low": float(low),
        "gap_high": float(high),
        "lower_median": float(np.median(timed.of("lower") / true)),
        "upper_median": float(np.median(timed.of("upper") / true)),
        "ended": float(np.mean(ended)),
        "used_median_us": float(np.median(used)),
        "used_max_us": float(used.max()),
    }


def _draw(rows: Rows) -> Figure:
    scenes = values(rows, "scene")
    fig = figure(len(scenes) + 1, 1, 4.0 * (len(scenes) + 1), 3.8)
    *gaps, used = fig.axes
    style = looks(values(rows, "order"))
    for scene, axes in zip(scenes, gaps, strict=True):
        for order, look in style.items():
            mine = only(rows, scene=scene, order=order)
            budgets = [r["budget_us"] for r in mine]
            low, median, high = (
                [max(float(r[key]), _FLOOR) for r in mine]
                for key in ("gap_low", "gap_median", "gap_high")
            )
            axes.plot(budgets, median, label=order, markersize=4, **look)
            axes.fill_between(budgets, low, high, color=look["color"], alpha=0.15, linewidth=0)
        axes.axhline(_FLOOR, color="#888888", linewidth=0.8)
        log_axis(axes.yaxis)
        axes.annotate("ended: exact", (BUDGETS_US[0], _FLOOR), fontsize=8, va="bottom")
        name_axes(axes, scene, "budget [µs]", "(upper - lower) / distance")
    # Only budgets that cut off every search: there the budget alone decides how long a search
    # takes.
    cut = only(rows, ended=0.0)
    for order, look in style.items():
        mine = only(cut, order=order)
        for key, filled in (("used_median_us", look["color"]), ("used_max_us", "none")):
            label = f"{order}, {'median' if filled != 'none' else 'longest'}"
            used.plot(
                [r["budget_us"] for r in mine],
                [r[key] for r in mine],
                linestyle="none",
                markersize=4,
                markerfacecolor=filled,
                label=label,
                **look,
            )
    used.plot(BUDGETS_US, BUDGETS_US, color="black", linewidth=1, label="budget")
    log_axis(used.yaxis)
    name_axes(used, "Time used by searches cut off", "budget [µs]", "time by the clock [µs]")
    for axes in fig.axes:
        log_axis(axes.xaxis)
        axes.legend(fontsize=7)
    return fig


def _tell(rows: Rows) -> str:
    text = [
        "The gap between the certified bounds, as a share of the distance, when a budget ends "
        "the search (the 1997 paper's figure 11); medians of queries that remember nothing. "
        "The bounds of every query were checked against the exact answer.\n\n{budget}\n"
    ]
    headings = ["budget, µs"]
    orders = values(rows, "order")
    for order in orders:
        headings += [f"{order}: gap", "ended", "used, µs", "longest, µs"]
    for scene in values(rows, "scene"):
        lines = []
        for budget in values(rows, "budget_us"):
            line = [number(budget, 1)]
            for order in orders:
                (row,) = only(rows, scene=scene, order=order, budget_us=budget)
                line += [f"{row['gap_median']:.1e}", percent(row["ended"])]
                line += [number(row["used_median_us"]), number(row["used_max_us"])]
            lines.append(line)
        title = f"{scene}, {rows[0]['queries']} queries each"
        text.append(folded(title, table(headings, lines)))
    return "\n".join([*text, _why(rows)])


def _why(rows: Rows) -> str:
    """Return what the numbers say, in a paragraph."""
    said = []
    for scene in values(rows, "scene"):
        for order in values(rows, "order"):
            cut = [r for r in only(rows, scene=scene, order=order) if r["ended"] == 0.0]
            if len(cut) > 2:
                logs = np.log2([[r["budget_us"], r["gap_median"]] for r in cut])
                slope = float(np.polyfit(*logs.T, 1)[0])
                said.append(f"{2.0**slope:.2f} ({scene}, {order})")
    over = [r for r in rows if r["ended"] == 0.0]
    text = (
        "In the 1997 paper each level of a breadth-first search halves the error and takes the "
        "same time, because few boxes stay active. "
    )
    if said:
        text += (
            "Here, as long as the budget cuts the search, doubling it leaves this share of the "
            f"gap: {', '.join(said)}. "
        )
    if over:
        worst = max(over, key=lambda r: r["used_max_us"] - r["budget_us"])
        late = float(np.median([r["used_median_us"] - r["budget_us"] for r in over]))
        text += (
            "A search looks at the clock between slices of its work. So it may exceed its budget "
            "by one slice, and by the time that other programs take of the processor. Searches "
            f"that were cut took {number(abs(late), 2)} µs {'more' if late > 0.0 else 'less'} than "
            "their budget in the median, and at most "
            f"{number(worst['used_max_us'] - worst['budget_us'], 2)} µs more "
            f"({worst['order']}, {worst['scene']}, budget {number(worst['budget_us'], 1)} µs)."
        )
    return f"{text}\n\n{_smallest(rows)}\n"


def smallest_budgets(rows: Rows) -> list[tuple[str, float, Row]]:
    """Return by order the smallest budget that pays, µs, and a row of the smallest that cut all."""
    found = []
    for order in values(rows, "order"):
        cut = [r for r in only(rows, order=order) if r["ended"] == 0.0]
        kept = [b for b in values(cut, "budget_us") if _is_kept(only(cut, budget_us=b))]
        if kept:
            least = only(cut, budget_us=min(values(cut, "budget_us")))[0]
            found.append((order, min(kept), least))
    return found


def _smallest(rows: Rows) -> str:
    """Return from which budget on one pays, and what to do with less time."""
    said = [
        f"{number(kept, 1)} µs {ORDER_WORDS[order]} (with a budget of "
        f"{number(least['budget_us'], 1)} µs a search takes "
        f"{number(least['used_median_us'], 2)} µs)"
        for order, kept, least in smallest_budgets(rows)
    ]
    if not said:
        return "No search was cut, so nothing is known about the smallest budget that pays."
    return (
        f"**The smallest budget that pays is {', '.join(said)}.** Whatever its budget, a call "
        "takes some microseconds to begin and does one slice of work. So with a smaller budget it "
        "takes as long, and knows little more than the distance of the triangles that it began "
        "with. If there is less time for each pair, ask about many pairs in one call of an "
        "`Assembly` with one budget for all, or ask `within` for a yes or no. Or give one search "
        "several budgets: the same `Pair` goes on where it stopped."
    )


def _is_kept(rows: Rows) -> bool:
    """Return whether the rows of all scenes keep a budget, in the median, to a factor of KEPT."""
    return all(row["used_median_us"] <= KEPT * row["budget_us"] for row in rows)


PART = Part(
    "budget",
    "The gap between the bounds, against the time budget",
    measure,
    _tell,
    {"budget": _draw},
    ("concentric/0.5", "engine/crankshaft-block"),
)
