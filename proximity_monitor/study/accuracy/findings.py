"""The study's conclusions: five findings by which to choose a tolerance, an order and a budget."""

from __future__ import annotations

from collections.abc import Mapping

from .budget import KEPT, ORDER_WORDS, smallest_budgets
from .part import Rows, only, values
from .words import asked, listed, number, percent

_WORTH = 0.1
"""A tolerance is worth its error if it saves this share of an exact query's mean time."""
_LOOK_US = 1000
"""Budget, µs, at which the orders are compared: a tick at 1 kHz."""
_MOST = 0.5
"""Orders are compared only if fewer than this share of the searches end within the budget."""


def findings(data: Mapping[str, Rows]) -> str:
    """Return the findings for which there are data, as a list in Markdown.

    Args:
        data: rows by the names of parts.
    """
    said = [
        found
        for name, find in (
            ("tolerance", _first_tolerance),
            ("tolerance", _tenth),
            ("orders", _memory),
            ("budget", _budget),
            ("growth", _size),
        )
        if (rows := data.get(name)) and (found := find(rows))
    ]
    if not said:
        return ""
    lines = [f"{k}. {finding}\n" for k, finding in enumerate(said, 1)]
    return "## What to choose\n\n" + "".join(lines)


def _first_tolerance(rows: Rows) -> str:
    """Return the smallest error that is worth asking for, in each scene."""
    said = []
    for scene in values(rows, "scene"):
        mine = only(rows, scene=scene)
        (exact,) = only(mine, rel_err=0.0)
        worth = [
            float(r["rel_err"])
            for r in mine
            if r["rel_err"] and r["mean_us"] < (1.0 - _WORTH) * exact["mean_us"]
        ]
        least = asked(min(worth)) if worth else "none"
        said.append(f"{least} in {scene}")
    return (
        "**Ask for the exact distance, or allow an error that is large enough to save time.** The "
        f"smallest relative error that saves {percent(_WORTH)} of the exact query's time is "
        f"{listed(said)}. A smaller one saves less."
    )


def _tenth(rows: Rows) -> str:
    """Return what a relative error of 10 % saves, and what it costs."""
    said = []
    for scene in values(rows, "scene"):
        mine = only(rows, scene=scene)
        exact, tenth = (only(mine, rel_err=e)[0] for e in (0.0, 0.1))
        share = tenth["mean_us"] / exact["mean_us"]
        said.append(
            f"{number(share, 2)} of the exact query's time in {scene} (median error "
            f"{percent(tenth['error_median'])})"
        )
    return (
        f"**`rel_err=0.1` is the tolerance to try first.** It takes {listed(said)}. No answer errs "
        "by more than was asked for, and its bounds show by how much it may err."
    )


def _memory(rows: Rows) -> str:
    """Return what a pair that is kept saves along a path; empty if no path was measured."""
    mine = only(rows, order="depth_first", sequence="verification")
    if not mine:
        return ""
    new, kept = (only(mine, memory=memory)[0] for memory in ("none", "cached"))
    return (
        "**Keep one `Pair` for every two bodies.** It remembers the last query. That reduces the "
        "time of the next one along a path to a share of "
        f"{number(kept['mean_us'] / new['mean_us'], 2)} ({kept['scene']}, exact), and changes no "
        "answer."
    )


def _budget(rows: Rows) -> str:
    """Return the smallest budgets that pay, and which order has the narrowest bounds when cut."""
    least = [f"{number(us, 1)} µs {ORDER_WORDS[order]}" for order, us, _ in smallest_budgets(rows)]
    cut = only(rows, budget_us=_LOOK_US)
    gaps = []
    for scene in values(cut, "scene"):
        mine = [
            f"{percent(row['gap_median'])} {ORDER_WORDS[row['order']]}"
            for row in only(cut, scene=scene)
            if row["ended"] < _MOST
        ]
        if mine:
            gaps.append(f"{listed(mine)} in {scene}")
    text = "**If a budget cuts most searches, search level by level (`breadth_first`).** "
    if gaps:
        text += (
            f"After {number(_LOOK_US, 1)} µs of a search that needs far longer, the gap between "
            f"the bounds is this share of the distance: {'; '.join(gaps)}. "
        )
    if least:
        text += (
            f"The smallest budget that pays is {', '.join(least)}: with less, a search takes more "
            f"than {number(KEPT, 3)} times its budget."
        )
    return text.rstrip()


def _size(rows: Rows) -> str:
    """Return how time grows with the size of the models."""
    known = [row for row in rows if row["memory"] == "cached"] or rows
    sizes = values(known, "triangles")
    first, last = (only(known, triangles=size)[0] for size in (min(sizes), max(sizes)))
    more = last["triangles"] / first["triangles"]
    return (
        "**Do not decimate a mesh to save time.** A query of "
        f"{number(more)} times as many triangles takes only "
        f"{number(last['mean_us'] / first['mean_us'], 2)} times as long, and no bound includes the "
        "error of the decimation."
    )
