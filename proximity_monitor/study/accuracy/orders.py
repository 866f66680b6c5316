"""Table 5 of the 1999 paper: search orders, with and without triangle caching, and the ideal."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from proximity_monitor import engine
from proximity_monitor.engine.models.tree import WIDTH

from ..scenes import Track
from .budget import ORDERS
from .certificate import check
from .paper import SEARCHES, SEQUENCES
from .part import Job, Part, Rows, only, values
from .style import PALETTE, figure, log_axis
from .timing import Asker, Query, blocks, summary, take_turns
from .words import folded, number, percent, table

_IDEAL = ("ideal", "given")
CASES = (*((order, memory) for order in ORDERS for memory in ("none", "cached")), _IDEAL)
"""Orders, and what is known beforehand: nothing, the nearest triangles of the last query, or the
distance itself."""

_QUICK = 3


def measure(job: Job) -> Rows:
    """Return one row for each search.

    Raises:
        BrokenCertificateError: two searches whose answers contradict each other.
    """
    models = job.models(volume="rss")
    (track,) = job.scene.tracks
    sequence, count = next((s, n) for s, (name, n) in SEQUENCES.items() if name == job.name)
    steps = np.linspace(0, len(track.poses_a) - 1, count).round().astype(int)
    turns = blocks(count, job.scene.block, _QUICK if job.quick else count)
    askers = {case: _asker(models, track, *case) for case in CASES}
    found = take_turns(askers, [steps[turn] for turn in turns], job.advance)
    rows = []
    for (order, memory), timed in found.items():
        check(f"{job.name}, {order}, {memory}", timed, found["depth_first", "cached"], 0.0)
        row = {"scene": job.name, "sequence": sequence, "order": order, "memory": memory}
        rows.append(row | summary(timed))
    return rows


def _asker(models: dict[str, engine.TriangleMesh], track: Track, order: str, memory: str) -> Asker:
    a, b = models[track.a], models[track.b]
    kept = engine.Pair(a, b)

    def ask(steps: Sequence[int]) -> list[Query]:
        queries = []
        for i in steps:
            pair = engine.Pair(a, b) if memory == "none" else kept
            poses = track.poses_a[i], track.poses_b[i]
            if (order, memory) == _IDEAL:
                # The same as Pair.ideal, but the first of its two searches is not timed.
                pair, order_now = engine.Pair(a, b, coherent=False), "depth_first"
                pair.distance(*poses)
            else:
                order_now = order
            queries.append(partial(pair.distance, *poses, order=order_now))
        return queries

    return ask


def _name(order: str, memory: str) -> str:
    return (
        "ideal" if order == "ideal" else order.replace("_", " ") + " + cache" * (memory == "cached")
    )


def _draw(rows: Rows) -> Figure:
    sequences = values(rows, "sequence")
    fig = figure(2, len(sequences), 9.0, 0.6 + 2.7 * len(sequences), sharey=True)
    grid = iter(fig.axes)
    places = np.arange(len(CASES))
    for sequence in sequences:
        mine = only(rows, sequence=sequence)
        ideal = mine[-1]
        for key, theirs, what in (
            ("bound_tests", "bound_tests", "bound tests / ideal"),
            ("mean_us", "mean_ms", "mean time / ideal"),
        ):
            axes = next(grid)
            ours = [row[key] / ideal[key] for row in mine]
            axes.plot(ours, places - 0.1, "o", color=PALETTE[0], label="ours")
            base = getattr(SEARCHES[sequence, *_IDEAL], theirs)
            given = [(i, SEARCHES.get((sequence, *case))) for i, case in enumerate(CASES)]
            paper = [(getattr(cost, theirs) / base, i + 0.1) for i, cost in given if cost]
            axes.plot(
                *np.transpose(paper),
                "D",
                color=PALETTE[1],
                markerfacecolor="none",
                label="paper",
            )
            log_axis(axes.xaxis)
            axes.axvline(1.0, color="#888888", linewidth=0.8)
            axes.set_yticks(places, [_name(*case) for case in CASES])
            axes.set_title(f"{sequence} ({mine[0]['scene']})", fontsize=10, loc="left")
            axes.set_xlabel(what, fontsize=9)
    fig.axes[0].invert_yaxis()
    fig.axes[0].legend(fontsize=8)
    return fig


def _tell(rows: Rows) -> str:
    text = [
        "Exact distances with rectangle swept spheres, in several search orders, with and without "
        "a cache. The cache holds the nearest triangles of the last query, and the volumes that "
        "were too far. The ideal search is given the distance, so only knowledge of earlier "
        "queries could spare it a test. As in the paper, `computation` asks at random poses and "
        "`verification` at successive ones. The cave and the path are generated.\n\n{orders}\n"
    ]
    headings = ["search", "bound tests", "triangle tests", "median, µs", "mean, µs"]
    headings += ["tests / ideal", "time / ideal", "paper: N_bv, millions", "N_p, millions"]
    headings += ["mean, ms", "N_bv / ideal", "time / ideal"]
    for sequence in values(rows, "sequence"):
        mine = only(rows, sequence=sequence)
        ideal, best = mine[-1], SEARCHES[sequence, *_IDEAL]
        lines = []
        for row in mine:
            line = [_name(row["order"], row["memory"])]
            for key in ("bound_tests", "primitive_tests", "median_us", "mean_us"):
                line.append(number(row[key]))
            line.append(number(row["bound_tests"] / ideal["bound_tests"], 3))
            line.append(number(row["mean_us"] / ideal["mean_us"], 3))
            cost = SEARCHES.get((sequence, row["order"], row["memory"]))
            if cost:
                line += [number(1e-6 * cost.bound_tests), number(1e-6 * cost.primitive_tests)]
                line += [number(cost.mean_ms), number(cost.bound_tests / best.bound_tests, 3)]
                line += [number(cost.mean_ms / best.mean_ms, 3)]
            else:
                line += ["", "", "", "", ""]
            lines.append(line)
        title = f"{sequence} ({mine[0]['scene']}), {mine[0]['queries']:,} queries each"
        text.append(folded(title, table(headings, lines)))
    return "\n".join([*text, _why(rows)])


def _why(rows: Rows) -> str:
    """Return a paragraph on where we differ from the paper, and why."""
    said = []
    for sequence in values(rows, "sequence"):
        tests = {
            (row["order"], row["memory"]): row["bound_tests"]
            for row in only(rows, sequence=sequence)
        }
        times = {
            (row["order"], row["memory"]): row["mean_us"] for row in only(rows, sequence=sequence)
        }
        ideal = tests[_IDEAL]
        plain, cached = (tests["depth_first", m] / ideal for m in ("none", "cached"))
        queue = tests["priority", "none"] / ideal
        their = SEARCHES[sequence, *_IDEAL].bound_tests
        theirs = SEARCHES[sequence, "depth_first", "none"].bound_tests / their
        spared = 1.0 - (queue - 1.0) / (plain - 1.0)
        slower = times["priority", "cached"] / times["depth_first", "cached"]
        fastest = min((case for case in times if case != _IDEAL), key=times.__getitem__)
        said.append(
            f"In `{sequence}` our depth-first search without cache makes {number(plain)} times as "
            f"many bound tests as the ideal search, the paper's {number(theirs)} times as many; "
            f"with cache, ours makes {number(cached)} times as many. A priority queue alone spares "
            f"{percent(spared)} of the tests that the ideal search does not make. With cache, the "
            f"priority search takes {number(slower, 2)} times as long as the depth-first search. "
            f"The fastest is {_name(*fastest)}."
        )
    said.append(
        "The paper's depth-first search descends into the left child first, whichever is nearer. "
        f"Ours bounds {WIDTH} children together and takes the nearest first, which leaves less for "
        "a queue or a cache to spare. A queue costs time for each pair, and pays only if it spares "
        "more than that."
    )
    return " ".join(said) + "\n"


PART = Part(
    "orders",
    "Search orders, caching and the ideal search (Table 5 of the 1999 paper)",
    measure,
    _tell,
    {"orders": _draw},
    tuple(scene for scene, _ in SEQUENCES.values()),
)
