"""Tables 2 to 4 of the 1999 paper, drawn and told: its numbers beside ours."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from proximity_monitor.engine.models.tree import WIDTH

from .paper import (
    APPLICATIONS,
    PQP,
    QUESTIONS,
    VOLUMES,
    Application,
    volume_cost,
)
from .part import Part, Row, Rows, only, values
from .style import PALETTE, figure, log_axis
from .volumes import measure
from .words import folded, listed, number, table


def _applications(rows: Rows) -> list[tuple[Application, str]]:
    """Return the applications that were measured, each with the scene that stands for it."""
    scenes = values(rows, "scene")
    return [(a, name) for a in APPLICATIONS for name in scenes if name in a.scenes]


def _row(rows: Rows, scene: str, question: str, volume: str) -> Row:
    (row,) = only(rows, scene=scene, question=question, volume=volume)
    return row


def _ours(rows: Rows, scene: str, question: str, key: str) -> list[float]:
    """Return a column for all kinds of volume, as multiples of that of rectangle swept spheres."""
    base = float(_row(rows, scene, question, "rss")[key])
    return [float(_row(rows, scene, question, v)[key]) / base for v in VOLUMES]


def _theirs(application: str, question: str, key: str) -> list[float]:
    """Return the same column of the paper, as multiples of its rectangle swept spheres."""
    key = {"mean_us": "mean_ms"}.get(key, key)
    base = getattr(volume_cost(question, application, "rss"), key)
    return [getattr(volume_cost(question, application, v), key) / base for v in VOLUMES]


def _draw(rows: Rows, key: str, what: str) -> Figure:
    applications = _applications(rows)
    fig = figure(len(applications), len(QUESTIONS), 10.0, 6.6, sharex=True, sharey="row")
    places = np.arange(len(VOLUMES))
    grid = iter(fig.axes)
    for question, where in QUESTIONS.items():
        for application, scene in applications:
            axes = next(grid)
            axes.axhline(1.0, color="#888888", linewidth=0.8)
            axes.plot(
                places - 0.12,
                _ours(rows, scene, question, key),
                "o",
                color=PALETTE[0],
                label="ours",
            )
            axes.plot(
                places + 0.12,
                _theirs(application.name, question, key),
                "D",
                color=PALETTE[1],
                markerfacecolor="none",
                label="paper",
            )
            log_axis(axes.yaxis)
            axes.set_xticks(places, VOLUMES, fontsize=8)
            if question == next(iter(QUESTIONS)):
                axes.set_title(f"{application.name}\n({scene})", fontsize=9)
            if axes.get_subplotspec().is_first_col():
                axes.set_ylabel(f"{question} ({where})\n{what}", fontsize=9)
    fig.axes[0].legend(fontsize=8)
    return fig


def _draw_times(rows: Rows) -> Figure:
    return _draw(rows, "mean_us", "mean time / that of rss")


def _draw_tests(rows: Rows) -> Figure:
    return _draw(rows, "bound_tests", "bound tests / those of rss")


def _tell(rows: Rows) -> str:
    applications = _applications(rows)
    text = [
        "Every kind of volume in the paper's four applications; each pair remembers its last "
        "answer. The scenes are not the paper's, so the figures show multiples of the values for "
        "rectangle swept spheres (`rss`). The tables have the values themselves.\n"
    ]
    text += [f"- {a.name}: {a.differs}." for a, _ in applications]
    text += ["\n{volumes_time}\n\n{volumes_tests}\n"]
    for question, where in QUESTIONS.items():
        body = _table(rows, applications, question)
        text.append(folded(f"{where}: {question}, ours beside the paper's", body))
    text.append(_why(rows, applications))
    if "falling-tori" in values(rows, "scene"):
        text.append(_beside_pqp(rows))
    return "\n".join(text)


def _table(rows: Rows, applications: list[tuple[Application, str]], question: str) -> str:
    headings = ["application", "volume", "bound tests", "triangle tests", "median, µs", "mean, µs"]
    headings += ["tests / rss", "time / rss", "paper: N_bv, millions", "a query", "N_p, millions"]
    headings += ["mean, ms", "N_bv / rss", "time / rss"]
    lines = []
    for application, scene in applications:
        keys = ("bound_tests", "mean_us")
        tests, times = (_ours(rows, scene, question, key) for key in keys)
        their_tests, their_times = (_theirs(application.name, question, key) for key in keys)
        for i, volume in enumerate(VOLUMES):
            row = _row(rows, scene, question, volume)
            cost = volume_cost(question, application.name, volume)
            line = [application.name, volume]
            for key in ("bound_tests", "primitive_tests", "median_us", "mean_us"):
                line.append(number(float(row[key])))
            line += [number(tests[i], 2), number(times[i], 2)]
            line.append(number(1e-6 * cost.bound_tests))
            known = application.queries
            line.append(number(cost.bound_tests / known) if known else "")
            line += [number(1e-6 * cost.primitive_tests), number(cost.mean_ms, 4)]
            line += [number(their_tests[i], 2), number(their_times[i], 2)]
            lines.append(line)
    return (
        "Our numbers are means per query. The paper's N are totals; for two applications only it "
        "gives the number of queries.\n\n" + table(headings, lines, 2)
    )


def _fastest(costs: list[float]) -> str:
    return VOLUMES[int(np.argmin(costs))]


def _why(rows: Rows, applications: list[tuple[Application, str]]) -> str:
    """Return a paragraph on where we differ from the paper, and why."""
    said = []
    for question, where in QUESTIONS.items():
        same, other = [], []
        for application, scene in applications:
            ours = _fastest(_ours(rows, scene, question, "mean_us"))
            theirs = _fastest(_theirs(application.name, question, "mean_us"))
            if ours == theirs:
                same.append(f"{application.name} ({ours})")
            else:
                other.append(f"{application.name} ({ours} here, {theirs} there)")
        parts = []
        if same:
            parts.append(f"the fastest kind is that of the paper for {listed(same)}")
        if other:
            parts.append(f"another kind is the fastest for {listed(other)}")
        said.append(f"{where}: {'; '.join(parts)}.")
    tests, times = (
        {v: _geometric_mean(rows, applications, key, v) for v in VOLUMES}
        for key in ("bound_tests", "mean_us")
    )
    said.append(
        f"In the geometric mean over all cells, as multiples of rss, the kinds make this many "
        f"bound tests: {_multiples(tests)}; and they take this much time: {_multiples(times)}. The "
        f"numbers of tests differ from the paper's for other reasons, too. A leaf holds two "
        f"triangles if they are flat together. A node has up to {WIDTH} children, and opening it "
        f"always counts {WIDTH} tests; in a binary tree it counts two. A query that is decided at "
        f"the roots still counts {WIDTH}."
    )
    return " ".join(said) + "\n"


def _geometric_mean(
    rows: Rows, applications: list[tuple[Application, str]], key: str, volume: str
) -> float:
    at = VOLUMES.index(volume)
    cells = [_ours(rows, scene, q, key)[at] for _, scene in applications for q in QUESTIONS]
    return float(np.exp(np.mean(np.log(cells))))


def _multiples(of: dict[str, float]) -> str:
    return ", ".join(f"{volume} {number(value, 2)}" for volume, value in of.items())


def _beside_pqp(rows: Rows) -> str:
    """Compare with the authors' program on its data: how much of the difference is tree width."""
    headings = ["falling-tori, rss", "bound tests", "openings", "triangle tests"]
    lines = []
    for question, (bound, primitive) in PQP.items():
        row = _row(rows, "falling-tori", question, "rss")
        for name, width, tests, triangles in (
            ("ours", WIDTH, float(row["bound_tests"]), float(row["primitive_tests"])),
            ("PQP 1.3", 2, bound, primitive),
        ):
            line = [number(x) for x in (tests, tests / width, triangles)]
            lines.append([f"{name}, {question}", *line])
    return (
        "The authors' program, PQP 1.3, ran on the paper's own data. Its binary tree makes two "
        f"tests per opening, ours {WIDTH}:\n\n" + table(headings, lines)
    )


PART = Part(
    "volumes",
    "Six kinds of bounding volume (Tables 2 to 4 of the 1999 paper)",
    measure,
    _tell,
    {"volumes_time": _draw_times, "volumes_tests": _draw_tests},
    tuple(application.scenes for application in APPLICATIONS),
)
