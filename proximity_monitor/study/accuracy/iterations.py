"""Error and time against iterations, for surfaces (Johnson and Cohen 1997, figure 11)."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from time import thread_time

import numpy as np
from matplotlib.figure import Figure

from proximity_monitor import engine

from ..scenes import Track
from .certificate import BrokenCertificateError
from .part import Job, Part, Rows, only, values
from .style import figure, log_axis, looks, name_axes
from .timing import blocks
from .words import folded, number, percent, table

_BLOCKS, _QUICK = 3, 1
_MOST = 400
"""Iterations of a query, at most."""
_SHARE = 0.5
"""An iteration is shown, and bounds are called exact, for at least this share of the queries."""
_ROUNDING = 1e-9
"""Share of the distance by which a lower bound may fall below the one before: the end of a search
allows for rounding in another way."""
_TOLD = (1, 2, 3, 5, 10, 20, 50, 100, 200)
"""Iterations that the page lists, beside the last."""
_FLOOR = 1e-12
"""Smaller errors are drawn at this value: they are those of searches that have ended."""


@dataclass
class Course:
    """A query, iteration by iteration."""

    lower: list[float] = field(default_factory=list)
    upper: list[float] = field(default_factory=list)
    tests: list[int] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)


def measure(job: Job) -> Rows:
    """Return one row for each iteration that half the queries reach.

    An iteration is the work of a call whose budget ends at once. The next call about the same pair
    at the same poses continues from there.

    Raises:
        BrokenCertificateError: bounds that the end of the search contradicts, or that come apart.
    """
    models, (track,) = job.models(), job.scene.tracks
    turns = blocks(len(track.poses_a), job.scene.block, _QUICK if job.quick else _BLOCKS)
    courses = []
    for turn in turns:
        _course(models, track, turn[0])  # not counted: it does the work that is done once
        courses += [_course(models, track, i) for i in turn]
        job.advance(1.0 / len(turns))
    for i, course in enumerate(courses):
        check(f"{job.name}: query {i}", course)
    longest = sorted(len(course.lower) for course in courses)
    shown = longest[int((1.0 - _SHARE) * len(longest))]
    return [{"scene": job.name, "iteration": k + 1, **_row(courses, k)} for k in range(shown)]


def _course(models: dict[str, engine.Model], track: Track, step: int) -> Course:
    pair, course = engine.Pair(models[track.a], models[track.b]), Course()
    while len(course.lower) < _MOST:
        start = thread_time()
        found = pair.distance(track.poses_a[step], track.poses_b[step], budget_s=0.0)
        course.seconds.append(thread_time() - start)
        course.lower.append(found.lower)
        course.upper.append(found.upper)
        course.tests.append(found.bound_tests)
        if found.status is not engine.Status.OUT_OF_TIME:
            break
    return course


def check(where: str, course: Course) -> None:
    """Raise unless every iteration's bounds hold, and none is weaker than the one before."""
    for lower, upper in zip(course.lower, course.upper, strict=True):
        if not (lower <= course.upper[-1] and course.lower[-1] <= upper):
            raise BrokenCertificateError(
                f"{where}: [{lower!r}, {upper!r}] m contradicts the last "
                f"[{course.lower[-1]!r}, {course.upper[-1]!r}] m"
            )
    lost = _ROUNDING * course.upper[-1]
    for (low, later), (high, now) in zip(
        pairwise(course.lower), pairwise(course.upper), strict=True
    ):
        if later < low - lost or now > high:
            raise BrokenCertificateError(f"{where}: bounds are wider than those before")


def _row(courses: list[Course], k: int) -> dict[str, float]:
    """Return medians after an iteration; a query that has ended keeps its last bounds."""
    true = np.array([course.upper[-1] for course in courses])
    lower, upper = (
        np.array([getattr(course, name)[: k + 1][-1] for course in courses])
        for name in ("lower", "upper")
    )
    running = [course for course in courses if len(course.lower) > k]
    low, median, high = np.percentile((upper - lower) / true, (25, 50, 75))
    return {
        "queries": len(courses),
        "ended": float(np.mean([len(course.lower) <= k + 1 for course in courses])),
        "gap_median": float(median),
        "gap_low": float(low),
        "gap_high": float(high),
        "error_median": float(np.median((upper - true) / true)),
        "error_max": float(np.max((upper - true) / true)),
        "found": float(np.mean(upper <= true)),
        "bound_tests": float(np.median([course.tests[k] for course in running])),
        "iteration_us": float(1e6 * np.median([course.seconds[k] for course in running])),
    }


def _draw(rows: Rows) -> Figure:
    fig = figure(2, 1, 9.0, 3.7)
    gaps, times = fig.axes
    for scene, look in looks(values(rows, "scene")).items():
        mine = only(rows, scene=scene)
        at = [row["iteration"] for row in mine]
        low, median, high = (
            [max(float(row[key]), _FLOOR) for row in mine]
            for key in ("gap_low", "gap_median", "gap_high")
        )
        gaps.plot(at, median, label=scene, markersize=4, linewidth=1, **look)
        gaps.fill_between(at, low, high, color=look["color"], alpha=0.15, linewidth=0)
        times.plot(at[1:], _times(mine), label=scene, markersize=4, linewidth=1, **look)
    gaps.axhline(_FLOOR, color="#888888", linewidth=0.8)
    log_axis(gaps.yaxis)
    gaps.annotate("ended: exact", (1, _FLOOR), fontsize=8, va="bottom")
    log_axis(times.yaxis)
    name_axes(gaps, "", "iterations", "(upper - lower) / distance")
    name_axes(times, "", "iterations", "time since the first, median iteration = 1")
    for axes in fig.axes:
        log_axis(axes.xaxis)
        axes.legend(fontsize=8)
    return fig


def _times(rows: Rows) -> list[float]:
    """Return cumulative times, in median iterations, without the first, which begins the search."""
    each = [row["iteration_us"] for row in rows[1:]]
    return list(np.cumsum(each) / np.median(each))


def _tell(rows: Rows) -> str:
    text = [
        "Two bicubic B-spline nets: 10 x 10 control points at random poses, and flat ones of "
        "30 x 30, one above the other and nearly parallel to it. Each call has a budget of 0, so "
        "it does one slice of work, and the next call goes on there: that is an iteration. Its "
        "certified bounds were checked against the exact distance and against those of the "
        "iteration before. Medians of all queries; the band holds the middle half of them.\n\n"
        "{iterations}\n"
    ]
    headings = ["iteration", "bound tests", "gap", "ended", "upper bound exact", "its error, worst",
                "time, median iteration = 1"]  # fmt: skip
    for scene in values(rows, "scene"):
        mine = only(rows, scene=scene)
        usual = float(np.median([row["iteration_us"] for row in mine[1:]]))
        lines = [
            [
                str(row["iteration"]),
                number(row["bound_tests"]),
                f"{row['gap_median']:.1e}",
                percent(row["ended"]),
                percent(row["found"]),
                f"{row['error_max']:.1e}",
                number(row["iteration_us"] / usual, 2),
            ]
            for row in mine
            if row["iteration"] in (*_TOLD, len(mine))
        ]
        text.append(folded(f"{scene}, {mine[0]['queries']} queries", table(headings, lines)))
    text.append(_why(rows))
    return "\n".join(text) + "\n"


def _why(rows: Rows) -> str:
    """Return what the numbers say, beside the paper's."""
    said = []
    for scene in values(rows, "scene"):
        mine = only(rows, scene=scene)
        exact = next(row for row in mine if row["found"] >= _SHARE)
        each = np.array([row["iteration_us"] for row in mine[1:]])
        low, high = np.percentile(each, (10, 90)) / np.median(each)
        said.append(
            f"In {scene} half of the searches end within {len(mine)} iterations, and half of the "
            f"upper bounds are exact within {exact['iteration']}. The second iteration leaves a "
            f"gap of {percent(mine[1]['gap_median'])} of the distance, {_fall(mine)}. Eight "
            f"iterations of ten take {number(low, 2)} to {number(high, 2)} times the median's time."
        )
    return (
        "The 1997 paper plots both without numbers. It says that the time of an iteration is "
        "fairly constant, and that each iteration halves the error of the distance. Here, too, the "
        "time is fairly constant, except that of the first iteration, which begins the search. "
        f"{' '.join(said)} "
        "So the error is not halved steadily. Where few parts of the surfaces are near each "
        "other, Newton's method finds the distance early, each division of the parts brings the "
        "lower bound much nearer, and a proof of convexity ends the search at once. Where the "
        "surfaces are nearly parallel, many pairs of pieces may be nearest, and they are bounded "
        "before the nearest of them are divided. A search that is cut meanwhile knows little more "
        "than after its second iteration; the last iterations bring almost everything."
    )


def _fall(rows: Rows) -> str:
    """Return how the gap falls from the second iteration on."""
    for row in rows[2:]:
        if row["gap_median"] < 0.5 * rows[1]["gap_median"]:
            return f"which is first halved in iteration {row['iteration']}"
    return "which no later one halves"


PART = Part(
    "iterations",
    "Error and time against iterations (figure 11 of the 1997 paper)",
    measure,
    _tell,
    {"iterations": _draw},
    ("nets/random", "nets/parallel"),
)
