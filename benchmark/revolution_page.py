"""Write the page and the figures of `benchmark/revolution.py`."""

from __future__ import annotations

import platform
from datetime import UTC, datetime
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

SOLIDS = "pawn", "cup", "bottle", "table", "light mill"

_PAGE = """# Two solids of revolution

Written on {day} ({machine}, one thread, processor time) by

    {command}

It follows the tables and figures of Son, Yoon, Kim and Elber, *Efficient Minimum Distance
Computation for Solids of Revolution*, 2020. Its five solids resemble the paper's: they are those of
the bundled scene `chess`, scaled to a largest coordinate of 1 m. The paper prints no numbers for
its figures, so these show ours alone. Its machine and its solids were different.

## Hierarchies (Tables 1 and 2, Figure 9)

The columns *PQP* and *paper* are the paper's; the others are ours. A mesh has so many triangles
that no chord is farther from the solid than the precision. `fewer` means that such a mesh would
exceed this run's limit of triangles, so a mesh within the limit was measured. `build` is the time
to build the tree of fat arcs, including the reach of its largest parts along 32 vectors; the memory
includes these as well. A solid of revolution also keeps its exact patches, for questions about
other kinds of models; they are not counted here. The paper does print 590 MB for the light mill at
1e-05.

{sizes}
![Building the tree of fat arcs](images/revolution_build.png)

## Static solids (Figure 12)

All 15 pairs, at random poses and along a motion of {frames:,} frames in all, shared among the
pairs; FCL was asked at about every hundredth frame. Times are in microseconds per question, asked
from Python one at a time: medians, or means where the title says so. In the last three columns one
call asks about all poses of a pair; they are means per question, over the 15 pairs. A single
question takes longer by the cost of its call. The `Pair` was made beforehand, like FCL's objects;
at random poses it did not remember volumes (`coherent=False`). `alone` is `engine.distance`, which
makes all of that for each question. Fat arcs were asked for the distance of the true solids to
within the precision; meshes, which are that far from the solids, for their own exact distance. The
bars in the figure are means of one pair.

{distances}
![Mean time of a question along a motion, for each pair](images/revolution_distance.png)

## Deforming solids (Figure 8)

A sixth solid morphs through the five, in 50 steps from each to the next. Its distance to each of
the five is asked in every frame. Milliseconds per frame: `deform` + the question.

{morphing}
![A solid that morphs against each of the five](images/revolution_morphing.png)

If all five solids deform at once, and all ten pairs are asked:

{deforming}
## Exact answers

At random poses, at some of which the solids cross, beside OCCT. `open` counts answers whose bounds
are more than 1e-11 m apart. `OCCT wrong` counts answers of OCCT that are more than 1e-6 m too
large, and `by` is the largest such error, in metres.

{exact}
Two equal tori with radii of 1 m and 0.3 m, at random poses with centres 0.96 m to 3.6 m apart. They
are asked of a `Pair` that was made beforehand, and `alone` by `engine.distance`, as in the row
above. OCCT gets its own toroidal surface, or the same torus as rational faces.

{tori}
## Depths

All 15 pairs at random poses at which they overlap: the depth to 1 %, one question at a time.
`points` is the median number of points whose depth was tested. The meshes are within 0.001 m of the
solids; they are asked for their own depth.

{depths}
## Press fits

Shafts of 1 m length, whose radius is slightly too large for a bore of 0.6 m radius. They are off
its axis and tilted by up to half of the excess. Each pair is asked about in both orders, to 1 % of
the depth. The columns are milliseconds (median and maximum), the median number of bounds, and how
many answers had wider bounds in the end.

{fits}"""


def table(headings: list[str], rows: list[list[str]]) -> str:
    """Return a table in Markdown."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def write_page(
    out: Path, command: str, frames: int, found: tuple[dict, dict, dict], tables: dict[str, str]
) -> str:
    """Write the page and its figures to a folder, and return the page.

    Args:
        out: the folder.
        command: the command that was run.
        frames: how many frames the motion has.
        found: three results, each by precision in metres: milliseconds to build each solid's tree;
            mean microseconds of each pair, `rm` by fat arcs, `mm` by meshes, `fm` by FCL; and for
            each solid the milliseconds a frame to deform and to ask.
        tables: Markdown, by their names in the page.
    """
    built, bars, morphed = found
    (out / "images").mkdir(parents=True, exist_ok=True)
    _draw_build(built, out / "images" / "revolution_build.png")
    _draw_pairs(bars, out / "images" / "revolution_distance.png")
    _draw_morphing(morphed, out / "images" / "revolution_morphing.png")
    machine = f"{platform.machine()}, Python {platform.python_version()}"
    day = datetime.now(UTC).strftime("%d %B %Y")
    page = _PAGE.format(command=command, day=day, machine=machine, frames=frames, **tables)
    (out / "revolution.md").write_text(page)
    return page


def _groups(count: int, each: int) -> tuple[np.ndarray, float]:
    return np.arange(count, dtype=float), 0.8 / each


def _finish(figure: plt.Figure, path: Path) -> None:
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _put_legend(axes: plt.Axes, columns: int) -> None:
    """Put the legend above the axes, because bars fill the whole width below."""
    axes.legend(fontsize=7, ncols=columns, loc="lower left", bbox_to_anchor=(0.0, 1.0))


def _draw_build(built: dict, path: Path) -> None:
    figure, axes = plt.subplots(figsize=(7.0, 3.2))
    places, width = _groups(len(SOLIDS), len(built))
    for k, (precision, times) in enumerate(built.items()):
        axes.bar(
            places + (k - 0.5 * len(built) + 0.5) * width, times, width, label=f"{precision:g} m"
        )
    axes.set_xticks(places, SOLIDS)
    axes.set_ylabel("build, ms")
    _put_legend(axes, len(built))
    _finish(figure, path)


def _draw_pairs(bars: dict, path: Path) -> None:
    figure, rows = plt.subplots(len(bars), 1, figsize=(8.0, 2.4 * len(bars)), sharex=True)
    names = [f"{a[0].upper()}-{b[0].upper()}" for i, a in enumerate(SOLIDS) for b in SOLIDS[i:]]
    kinds = ("rm", "fat arcs"), ("mm", "our meshes"), ("fm", "FCL")
    for axes, (precision, times) in zip(np.atleast_1d(rows), bars.items(), strict=True):
        shown = [(key, label) for key, label in kinds if times[key]]
        places, width = _groups(len(names), len(shown))
        for k, (key, label) in enumerate(shown):
            axes.bar(places + (k - 0.5 * len(shown) + 0.5) * width, times[key], width, label=label)
        axes.set_yscale("log")
        axes.set_title(f"{precision:g} m", fontsize=9)
        axes.set_ylabel("us")
        axes.set_xticks(places, names, fontsize=7)
    _put_legend(figure.axes[0], len(kinds))
    _finish(figure, path)


def _draw_morphing(morphed: dict, path: Path) -> None:
    figure, axes = plt.subplots(figsize=(7.0, 3.2))
    places, width = _groups(len(SOLIDS), len(morphed))
    for k, (precision, times) in enumerate(morphed.items()):
        deform, ask = np.array(times).T
        at = places + (k - 0.5 * len(morphed) + 0.5) * width
        axes.bar(at, deform, width, color=f"C{k}", alpha=0.5, label=f"deform, {precision:g} m")
        axes.bar(at, ask, width, bottom=deform, color=f"C{k}", label=f"question, {precision:g} m")
    axes.set_xticks(places, SOLIDS)
    axes.set_ylabel("ms a frame")
    _put_legend(axes, len(morphed))
    _finish(figure, path)
