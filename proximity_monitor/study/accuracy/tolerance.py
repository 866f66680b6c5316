"""Time against the relative error asked for, and the error really made."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from proximity_monitor import engine

from .certificate import check, relative_errors
from .part import Job, Part, Rows, only, values
from .style import figure, log_axis, looks, name_axes
from .timing import Asker, Query, blocks, summary, take_turns
from .words import asked, folded, number, percent, table

ASKED = (0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)

_BLOCKS, _QUICK = 45, 3
_FLOOR = 1e-16
"""A figure shows an error of 0 as this: the rounding of a double."""


def measure(job: Job) -> Rows:
    """Return one row for each relative error; leave out poses at which the bodies touch.

    Raises:
        BrokenCertificateError: an answer errs by more than was asked for.
    """
    models = job.models()
    (track,) = job.scene.tracks

    def asker(rel_err: float) -> Asker:
        pair = engine.Pair(models[track.a], models[track.b])

        def ask(steps: Sequence[int]) -> list[Query]:
            return [
                partial(pair.distance, track.poses_a[i], track.poses_b[i], rel_err=rel_err)
                for i in steps
            ]

        return ask

    turns = blocks(len(track.poses_a), job.scene.block, _QUICK if job.quick else _BLOCKS)
    found = take_turns({rel_err: asker(rel_err) for rel_err in ASKED}, turns, job.advance)
    exact = found[0.0]
    apart = exact.of("lower") > 0.0
    rows = []
    for rel_err, timed in found.items():
        check(f"{job.name}, relative error {rel_err:g}", timed, exact, rel_err)
        row = {"scene": job.name, "rel_err": rel_err, "touching": float(1.0 - apart.mean())}
        row |= summary(timed, apart)
        errors = relative_errors(timed, exact, apart)
        gaps = timed.of("upper")[apart] / timed.of("lower")[apart] - 1.0
        row["error_median"], row["error_p99"] = map(float, np.percentile(errors, (50, 99)))
        row["error_max"], row["gap_max"] = float(errors.max()), float(gaps.max())
        rows.append(row)
    return rows


def _draw(rows: Rows) -> Figure:
    fig = figure(2, 1, 9.0, 3.7)
    time, error = fig.axes
    places = np.arange(len(ASKED))
    style = looks(values(rows, "scene"))
    for scene, look in style.items():
        mine = only(rows, scene=scene)
        time.plot(places, [r["median_us"] for r in mine], label=scene, **look)
        low, high = ([r[key] for r in mine] for key in ("low_us", "high_us"))
        time.fill_between(places, low, high, color=look["color"], alpha=0.15, linewidth=0)
        for key, line in (("error_max", "-"), ("error_median", ":")):
            made = [max(float(r[key]), _FLOOR) for r in mine]
            label = f"{scene}, {'worst' if key == 'error_max' else 'median'}"
            error.plot(places, made, linestyle=line, label=label, **look)
    error.plot(places[1:], ASKED[1:], color="black", linewidth=1, label="asked for")
    for axes in fig.axes:
        log_axis(axes.yaxis)
        axes.set_xticks(places, [asked(e) for e in ASKED])
    time.legend(fontsize=8)
    error.legend(fontsize=8, loc="upper left")
    name_axes(time, "Time", "relative error asked for", "processor time a query [µs]")
    name_axes(error, "Error really made", "relative error asked for", "relative error")
    return fig


def _tell(rows: Rows) -> str:
    headings = ["error asked for", "median, µs", "mean, µs", "bound tests", "triangle tests"]
    headings += ["error made, median", "99 %", "worst"]
    text = [
        "Medians; the band holds the middle half of the queries. The error made is the relative "
        "error of the upper bound, which is the distance of the closest points, against the exact "
        "answer. Every query was checked: none errs by more than was asked for "
        f"(at most {100.0 * _worst(rows):.1f} % of it), and none contradicts the exact bounds.\n\n"
        "{tolerance}\n"
    ]
    for scene in values(rows, "scene"):
        mine = only(rows, scene=scene)
        touch = float(mine[0]["touching"])
        title = f"{scene}, {mine[0]['queries']:,} queries"
        if touch:
            title += f"; the {percent(touch)} of all poses that touch are left out"
        text.append(folded(title, table(headings, [_cells(row) for row in mine])))
    text.append(_why(rows))
    return "\n".join(text)


def _worst(rows: Rows) -> float:
    """Return the largest error made, as a share of the error asked for."""
    return max(float(row["error_max"]) / float(row["rel_err"]) for row in rows if row["rel_err"])


def _cells(row: dict) -> list[str]:
    keys = ("median_us", "mean_us", "bound_tests", "primitive_tests")
    errors = ("error_median", "error_p99", "error_max")
    return [
        asked(row["rel_err"]),
        *(number(row[k]) for k in keys),
        *(_error(row[k]) for k in errors),
    ]


def _error(error: float) -> str:
    return "0" if error == 0.0 else f"{error:.1e}"


def _why(rows: Rows) -> str:
    """Return what the numbers say, in a paragraph."""
    said = []
    for scene in values(rows, "scene"):
        mine = only(rows, scene=scene)
        exact, tenth, rough = (only(mine, rel_err=e)[0] for e in (0.0, 0.1, 1.0))
        gain = exact["mean_us"] / tenth["mean_us"]
        fewer = exact["bound_tests"] / tenth["bound_tests"]
        useful = [
            r["rel_err"] for r in mine if r["rel_err"] and r["mean_us"] < 0.9 * exact["mean_us"]
        ]
        start = (
            f"the first error that saves a tenth of the time is {asked(min(useful))}"
            if useful
            else "no error asked for saves a tenth of the time"
        )
        said.append(
            f"In {scene} {start}. An allowed error of 10 % takes {number(1.0 / gain, 2)} of the "
            f"exact query's mean time and {number(1.0 / fewer, 2)} of its bound tests; its median "
            f"error is {_error(tenth['error_median'])}. If 100 % is allowed, the median error is "
            f"{percent(rough['error_median'])}."
        )
    return (
        "With a tolerance, a search drops each pair of volumes that could improve the distance "
        "only by less than the tolerance. That saves time where many pairs are nearly as near as "
        "the nearest. " + " ".join(said) + "\n"
    )


PART = Part(
    "tolerance",
    "Time and error made, against the relative error asked for",
    measure,
    _tell,
    {"tolerance": _draw},
    ("cave/path", "cave/random"),
)
