"""Time against model size, 500 to 512,000 triangles (Johnson and Cohen 1997, figure 6)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from itertools import pairwise

import numpy as np
from matplotlib.figure import Figure

from proximity_monitor import engine
from proximity_monitor.engine.models.tree import WIDTH

from ..scenes import Track
from .part import Job, Part, Rows, only, values
from .style import figure, log_axis, looks, name_axes
from .timing import Asker, Query, blocks, summary, take_turns
from .words import folded, number, percent, table

MEMORIES = ("none", "cached")

_BLOCKS, _QUICK = 8, 2


def measure(job: Job) -> Rows:
    """Return one row for each size, with and without the last query's nearest triangles."""
    models = job.models()
    tracks = {track.a: track for track in job.scene.tracks}
    steps = len(next(iter(tracks.values())).poses_a)
    turns = blocks(steps, job.scene.block, _QUICK if job.quick else _BLOCKS)
    askers = {
        (name, memory): _asker(models[name], track, memory)
        for name, track in tracks.items()
        for memory in MEMORIES
    }
    found = take_turns(askers, turns, job.advance)
    return [
        {"triangles": len(models[name].faces), "memory": memory, **summary(timed)}
        for (name, memory), timed in found.items()
    ]


def _asker(model: engine.TriangleMesh, track: Track, memory: str) -> Asker:
    kept = engine.Pair(model, model)

    def ask(steps: Sequence[int]) -> list[Query]:
        queries = []
        for i in steps:
            pair = kept if memory == "cached" else engine.Pair(model, model)
            queries.append(partial(pair.distance, track.poses_a[i], track.poses_b[i]))
        return queries

    return ask


def _line(rows: Rows, key: str) -> tuple[float, float, float]:
    """Fit a line over log2(triangles); return its slope, start, and share of variance explained."""
    doublings = np.log2([row["triangles"] for row in rows])
    found = np.array([row[key] for row in rows], float)
    slope, start = np.polyfit(doublings, found, 1)
    rest = found - (start + slope * doublings)
    return float(slope), float(start), float(1.0 - rest.var() / found.var())


def _draw(rows: Rows) -> Figure:
    fig = figure(2, 1, 9.0, 3.7)
    for axes, key, what in zip(
        fig.axes,
        ("median_us", "bound_tests"),
        ("median processor time [µs]", "bound tests a query, mean"),
        strict=True,
    ):
        for memory, look in looks(values(rows, "memory")).items():
            mine = only(rows, memory=memory)
            sizes = np.array([r["triangles"] for r in mine])
            label = {"none": "nothing known", "cached": "last answer known"}[memory]
            axes.plot(sizes, [r[key] for r in mine], linestyle="none", label=label, **look)
            slope, start, _ = _line(mine, key)
            fitted = f"{number(slope, 2)} a doubling"
            axes.plot(
                sizes,
                start + slope * np.log2(sizes),
                color=look["color"],
                linewidth=1,
                label=fitted,
            )
        log_axis(axes.xaxis)
        axes.set_ylim(bottom=0.0)
        axes.yaxis.set_major_formatter("{x:,.0f}")
        axes.legend(fontsize=8)
        name_axes(axes, "", "triangles of each model", what)
    return fig


def _tell(rows: Rows) -> str:
    sizes = values(rows, "triangles")
    text = [
        f"Exact distance of two lumpy tori, one of which goes round the other; both of {sizes[0]:,}"
        f" to {sizes[-1]:,} triangles, at the same poses.\n\n{{growth}}\n"
    ]
    headings = ["triangles", "nothing known: median, µs", "bound tests", "triangle tests"]
    headings += ["last answer known: median, µs", "bound tests", "triangle tests"]
    lines = []
    for size in sizes:
        line = [f"{size:,}"]
        for memory in values(rows, "memory"):
            (row,) = only(rows, triangles=size, memory=memory)
            line += [number(row[k]) for k in ("median_us", "bound_tests", "primitive_tests")]
        lines.append(line)
    text.append(folded("The numbers", table(headings, lines)))
    said = []
    for memory, words in (("none", "With nothing known"), ("cached", "With the last answer known")):
        mine = only(rows, memory=memory)
        slope, _, share = _line(mine, "median_us")
        tests, _, _ = _line(mine, "bound_tests")
        ratio = mine[-1]["median_us"] / mine[0]["median_us"]
        said.append(
            f"{words}, each doubling adds {number(slope, 2)} µs and {number(tests, 2)} bound tests "
            f"(a straight line over the logarithm explains {100.0 * share:.0f} % of the variance "
            f"of the times); {number(sizes[-1] / sizes[0])} times the triangles take "
            f"{number(ratio, 2)} times as long."
        )
    said.append(_levels(only(rows, memory="none")))
    said.append(
        "In the 1997 paper, too, the time grows with the logarithm, from 36 to 110 ms for 500 to "
        "5,000 triangles. Its model is the bunny, which this repository does not include; the "
        "lumpy torus takes its place."
    )
    return "\n".join([*text, " ".join(said) + "\n"])


def _levels(rows: Rows) -> str:
    """Return what another level of the hierarchy adds."""
    added: dict[bool, list[float]] = {True: [], False: []}
    for before, after in pairwise(rows):
        levels = [math.ceil(math.log(row["triangles"], WIDTH)) for row in (before, after)]
        more = after["bound_tests"] / before["bound_tests"] - 1.0
        added[levels[0] != levels[1]].append(more)
    new, same = (percent(float(np.mean(added[key]))) for key in (True, False))
    return (
        f"A doubling past a power of {WIDTH}, where a full hierarchy gets another level, adds "
        f"{new} to the bound tests in the mean; any other adds {same}."
    )


PART = Part(
    "growth",
    "Time against model size (figure 6 of the 1997 paper)",
    measure,
    _tell,
    {"growth": _draw},
    ("growing",),
)
