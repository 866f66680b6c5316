"""What a test of two bounding volumes costs, kind by kind (Table 1 of the 1999 paper)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from proximity_monitor import engine
from proximity_monitor.engine.models.tree import WIDTH

from ..scenes import Track
from .paper import CORE_COSTS, VOLUMES
from .part import Job, Part, Rows, only, values
from .timing import Asker, Query, blocks, summary, take_turns
from .words import number, table

BOUNDS, CALL = "bounds", "call"
"""Two questions. BOUNDS: whether concentric spheres are as near as half their gap, which compares
no triangles (section 4.3.5 of the paper). CALL: the same of spheres far apart: a call alone."""

_GAP = 0.1
_BLOCKS, _QUICK = 10, 2


def measure(job: Job) -> Rows:
    """Return one row for each kind of volume and question."""
    (track,) = job.scene.tracks
    turns = blocks(len(track.poses_a), job.scene.block, _QUICK if job.quick else _BLOCKS)
    far = track.poses_b.copy()
    far[:, 0, 3] += 1000.0
    askers = {}
    for volume in VOLUMES:
        models = job.models(volume=volume)
        for question, poses_b in ((BOUNDS, track.poses_b), (CALL, far)):
            askers[volume, question] = _asker(models, track, poses_b)
    found = take_turns(askers, turns, job.advance)
    return [
        {"volume": volume, "question": question, **summary(timed)}
        for (volume, question), timed in found.items()
    ]


def _asker(
    models: dict[str, engine.TriangleMesh], track: Track, poses_b: NDArray[np.float64]
) -> Asker:
    pair = engine.Pair(models[track.a], models[track.b])

    def ask(steps: Sequence[int]) -> list[Query]:
        return [partial(pair.within, track.poses_a[i], poses_b[i], 0.5 * _GAP) for i in steps]

    return ask


def _tell(rows: Rows) -> str:
    headings = ["volume", "bound tests", "triangle tests", "median, µs", "call alone, µs"]
    headings += ["a bound test, ns", "/ pss", "paper's Table 1"]
    lines, costs = [], {}
    for volume in values(rows, "volume"):
        full, call = (only(rows, volume=volume, question=q)[0] for q in (BOUNDS, CALL))
        time = full["median_us"] - call["median_us"]
        costs[volume] = 1e3 * time / (full["bound_tests"] - call["bound_tests"])
        line = [volume, *(number(full[k]) for k in ("bound_tests", "primitive_tests", "median_us"))]
        line += [number(call["median_us"]), number(costs[volume])]
        line.append(number(costs[volume] / costs["pss"], 2))
        lines.append([*line, number(CORE_COSTS[volume]) if volume in CORE_COSTS else ""])
    lss, rss = (costs[volume] / costs["pss"] for volume in ("lss", "rss"))
    why = (
        f"One loop bounds {WIDTH} volumes at once and treats points and lines as rectangles "
        "without extent. So a test of a looser kind costs about as much, and a looser kind needs "
        "more tests."
        if rss < 1.5
        else "Here, too, a looser kind takes less time for a test, but needs more tests."
    )
    return (
        "The question is whether concentric spheres of 40,000 triangles are as near as half the "
        "gap between them. Bound tests alone answer it; the paper's table, too, was timed without "
        "triangles.\n\n"
        f"{table(headings, lines)}\nIn the paper a test of two lss costs {CORE_COSTS['lss']} times "
        f"as much as one of two pss, and of two rss {CORE_COSTS['rss']} times; here it costs "
        f"{number(lss, 2)} and {number(rss, 2)} times as much. {why} An obb test, by Gilbert's "
        f"algorithm, costs {number(costs['obb'] / costs['rss'], 2)} times an rss test.\n"
    )


PART = Part(
    "bounds",
    "What a bound test costs (Table 1 of the 1999 paper)",
    measure,
    _tell,
    {},
    (f"concentric/{_GAP}",),
)
