"""Write the page and its figures from the data alone."""

from __future__ import annotations

from pathlib import Path

from proximity_monitor.engine.models.tree import WIDTH

from .data import RUNS, read_rows
from .findings import findings
from .part import Part, Rows
from .style import DPI

_HEAD = """\
# What accuracy costs in time

A distance can be exact, within a tolerance, or as good as a time budget allows. This page shows
what each choice costs: the time of a query, its numbers of tests, and how far apart its bounds are.
A *bound test* compares two bounding volumes, or two parts of surfaces; a *triangle test* compares
two triangles. One command wrote the page with all its numbers and figures. The findings come first.
Click the title of a table to open it.

The corresponding figures of the papers are named beside ours: "the 1999 paper" is Larsen,
Gottschalk, Lin and Manocha, *Fast Proximity Queries with Swept Sphere Volumes*; "the 1997 paper"
is Johnson and Cohen, *A Framework for Efficient Minimum Distance Computations*; "the 2000 paper"
is Thomas, Turnbull, Ros and Cameron, *Computing Signed Distances between Free-Form Objects*.

Times are processor times of single queries called from Python, on one thread. Variants that are
compared took turns, block by block, in one process. Each block began with a query that is not
timed, so that no variant pays for what another one displaced from the caches. Opening a node
counts as {width} bound tests, whether or not the node has {width} children.
"""


def render(out: Path, parts: tuple[Part, ...]) -> Path:
    """Write the page and the figures of all parts that have data; return the page's path.

    Args:
        out: the folder; the data lies in its folder `accuracy`.
        parts: all parts, in the order of the page.
    """
    data = {part.name: read_rows(out / "accuracy" / f"{part.name}.csv") for part in parts}
    runs = read_rows(out / "accuracy" / f"{RUNS}.csv")
    text = [
        _HEAD.format(width=WIDTH),
        _conditions([run for run in runs if data.get(str(run["part"]))]),
        findings(data),
    ]
    for part in parts:
        rows = data[part.name]
        text.append(f"## {part.title}\n")
        text.append(_section(out, part, rows) if rows else "Not measured.\n")
    page = out / "accuracy.md"
    page.write_text("\n".join(text), encoding="utf-8")
    return page


def _section(out: Path, part: Part, rows: Rows) -> str:
    told = part.tell(rows)
    images = out / "images"
    images.mkdir(parents=True, exist_ok=True)
    for name, draw in part.draw.items():
        if f"{{{name}}}" not in told:  # its data was not measured
            continue
        file = images / f"accuracy_{name}.png"
        # Without the library's version, so that the same data gives the same file.
        draw(rows).savefig(file, dpi=DPI, metadata={"Software": None})
        told = told.replace(f"{{{name}}}", f"![{part.title}](images/{file.name})")
    return f"{told}\nData: [{part.name}.csv](accuracy/{part.name}.csv).\n"


def _conditions(runs: Rows) -> str:
    """Return how the parts were measured: in one sentence if all were measured alike."""
    said: dict[str, list[str]] = {}
    for run in runs:
        versions = ", ".join(str(run[k]) for k in ("python", "numpy", "numba", "package"))
        few = " It was a quick run: few queries, so expect noise." if run["quick"] else ""
        words = (
            f"Measured by `{run['command']}` on {run['cpu']} ({run['cores']} cores, "
            f"{run['system']}); {versions}.{few}"
        )
        said.setdefault(words, []).append(str(run["part"]))
    if len(said) == 1:
        return f"{next(iter(said))}\n"
    return "".join(f"- {', '.join(parts)}: {words}\n" for words, parts in said.items())
