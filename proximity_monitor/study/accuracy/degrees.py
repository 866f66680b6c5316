"""Time against the degree of a surface, 2 to 15 (Johnson and Cohen 1997, figure 10)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from matplotlib.figure import Figure

from proximity_monitor import engine

from ..scenes import Track
from ..surfaces import POINT
from .certificate import check
from .paper import CLOSEST_POINT_HZ, SURFACES_HZ
from .part import Job, Part, Rows, only, values
from .style import figure, looks, name_axes
from .timing import Asker, Query, blocks, summary, take_turns
from .words import folded, number, table

TO_POINT, TO_PATCH = "point to patch", "patch to patch"
CUBIC = 3

_BLOCKS, _QUICK = 6, 1


def measure(job: Job) -> Rows:
    """Return one row for each question and degree; no query knows anything beforehand.

    Raises:
        BrokenCertificateError: an answer whose bounds do not meet.
    """
    models, steps = job.models(), len(job.scene.tracks[0].poses_a)
    turns = blocks(steps, job.scene.block, _QUICK if job.quick else _BLOCKS)
    askers = {(track.a, track.b): _asker(models, track) for track in job.scene.tracks}
    rows: Rows = []
    for (a, b), timed in take_turns(askers, turns, job.advance).items():
        check(f"{job.name}, {a}, {b}", timed, timed, 0.0)
        patch = models[b]
        degree, _ = patch.degrees
        rows.append({
            "net": f"{job.name.partition('/')[2]}x{len(patch.control)}",
            "question": TO_POINT if a == POINT else TO_PATCH,
            "degree": degree,
            "pieces": (len(patch.control) - degree) ** 2,
            **summary(timed),
        })  # fmt: skip
    return rows


def _asker(models: dict[str, engine.Model], track: Track) -> Asker:
    def ask(steps: Sequence[int]) -> list[Query]:
        a, b = models[track.a], models[track.b]
        return [
            partial(engine.Pair(a, b).distance, track.poses_a[i], track.poses_b[i]) for i in steps
        ]

    return ask


def _lines(rows: Rows) -> dict[str, Rows]:
    """Return the rows of each line of a figure, in the order of the degrees."""
    return {
        f"{question}, {net}": only(rows, question=question, net=net)
        for question in values(rows, "question")
        for net in values(rows, "net")
    }


def _of_cubic(rows: Rows, key: str) -> list[float]:
    """Return a column as multiples of its value at degree 3."""
    (cubic,) = only(rows, degree=CUBIC)
    return [row[key] / cubic[key] for row in rows]


def _draw(rows: Rows) -> Figure:
    fig = figure(2, 1, 9.0, 3.7)
    lines = _lines(rows)
    for axes, key, what in zip(
        fig.axes,
        ("median_us", "bound_tests"),
        ("median processor time, degree 3 = 1", "bound tests a query, degree 3 = 1"),
        strict=True,
    ):
        for (name, mine), look in zip(lines.items(), looks(lines).values(), strict=True):
            at = [row["degree"] for row in mine]
            axes.plot(at, _of_cubic(mine, key), label=name, linewidth=1, markersize=4, **look)
        axes.set_ylim(bottom=0.0)
        axes.set_xticks(values(rows, "degree"))
        axes.legend(fontsize=8)
        name_axes(axes, "", "degree in u and in v", what)
    return fig


def _tell(rows: Rows) -> str:
    text = [
        "Exact distance from points, and from another patch at random poses, to wavy B-spline "
        "patches with uniform knots. As in the paper, each net keeps its control points and gets "
        "one degree after the other. Its net of 10 x 10 points allows no degree above 9, so a "
        "second net has 16 x 16. A net of n x n points has (n - degree)² polynomial pieces. "
        "Nothing is known beforehand.\n\n{degrees}\n"
    ]
    headings = ["net", "degree", "pieces"]
    for question in (TO_POINT, TO_PATCH):
        headings += [f"{question}: time, degree 3 = 1", "bound tests", "time a test, degree 3 = 1"]
    lines = []
    for net in values(rows, "net"):
        columns = [only(rows, net=net, question=q) for q in (TO_POINT, TO_PATCH)]
        for column in columns:
            for row in column:
                row["each_us"] = row["median_us"] / row["bound_tests"]
        ratios = [
            (_of_cubic(column, "median_us"), _of_cubic(column, "each_us")) for column in columns
        ]
        for i, row in enumerate(columns[0]):
            line = [net, str(row["degree"]), str(row["pieces"])]
            for column, (times, each) in zip(columns, ratios, strict=True):
                line += [number(times[i], 2), number(column[i]["bound_tests"]), number(each[i], 2)]
            lines.append(line)
    text.append(folded("The numbers", table(headings, lines)))
    text.append(_why(rows))
    return "\n".join(text) + "\n"


def _why(rows: Rows) -> str:
    """Return what the numbers say, beside the paper's."""
    said = []
    for name, mine in _lines(rows).items():
        last, times = mine[-1], _of_cubic(mine, "median_us")
        tests = _of_cubic(mine, "bound_tests")
        said.append(
            f"{name}: degree {last['degree']} takes {number(times[-1], 2)} times as long as "
            f"degree {CUBIC}, with {number(tests[-1], 2)} times its bound tests"
        )
    cubic = {q: only(rows, question=q, degree=CUBIC)[0] for q in (TO_POINT, TO_PATCH)}
    rates = [f"{number(1e6 / cubic[q]['median_us'], 2)} Hz ({q})" for q in (TO_POINT, TO_PATCH)]
    return (
        f"{'; '.join(said)}. The paper plots its times without numbers. It says that convergence "
        "is slower for higher degrees, because each piece has a larger hull and is harder to "
        "prune, and that it remains stable. Here it is stable, too: the bounds of every query "
        "meet. But a higher degree costs time for another reason. Hulls of more control points "
        "take longer to test and to divide. Fewer of them are tested, because the same net has "
        "fewer pieces and fewer waves. The paper's algorithms run at "
        f"{CLOSEST_POINT_HZ[0]} to {CLOSEST_POINT_HZ[1]} Hz for a point, to 1e-6 of the "
        f"parameters, and at {SURFACES_HZ[0]} to {SURFACES_HZ[1]} Hz for two surfaces, on a "
        f"machine of its time; ours, exact, of degree 3 and {values(rows, 'net')[0]} control "
        f"points, at {' and '.join(rates)}."
    )


PART = Part(
    "degrees",
    "Time against degree (figure 10 of the 1997 paper)",
    measure,
    _tell,
    {"degrees": _draw},
    ("degrees/10", "degrees/16"),
)
