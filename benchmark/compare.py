"""Time this engine, python-fcl and coal side by side in one process, on one thread.

    python benchmark/compare.py [--scene NAME ...] [--quick] [--out DIR] [--data DIR] [--pqp DIR]

Writes compare.csv and compare.md and prints compare.md. If PQP's sources are given, the page also
compares with PQP (see pqp.py). Ends with status 1 if two engines disagree by more than a millionth
of a scene's scale.
"""

from __future__ import annotations

import argparse
import csv
import platform
import sys
from importlib import metadata
from pathlib import Path

import numpy as np
import peers
import pqp
from measure import measure
from recorded import available
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from proximity_monitor.study.scenes import SCENES

TOLERATED = 1e-6
OUT = Path(__file__).resolve().parents[1] / "build" / "benchmark"

NOTES = """\
Times are medians of the processor time of a query, in microseconds; `10 %` is this engine with a
relative error of 0.1, `batch` is the mean of `engine.distances`. Ratios say how many times as long
the other library's exact query takes. They compare medians, but means for `batch` and `means`.
`ideal` counts the bound tests of a search that is given the distance beforehand. A search over the
same hierarchies that knows nothing about earlier poses cannot make fewer.
"""


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return the exit status."""
    options = _parser().parse_args(arguments)
    libraries = peers.installed()
    if not libraries:
        sys.exit("no other library to compare with: pip install python-fcl coal")
    try:
        scenes = {**SCENES, **available(options.data)}
    except FileNotFoundError as error:
        sys.exit(f"--data or PROXIMITY_MONITOR_DATA: {error}")
    chosen = [name for name in scenes if _wanted(name, options.scene)]
    for asked in options.scene:
        if not any(_wanted(name, [asked]) for name in scenes):
            sys.exit(f"--scene {asked}: must be one of {', '.join(scenes)}")
    try:
        program = pqp.Pqp(options.pqp) if options.pqp else None
    except FileNotFoundError as error:
        sys.exit(f"--pqp: {error}")
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task("", total=len(chosen))
        for name in chosen:
            progress.update(task, description=name)
            row = measure(
                scenes[name](), libraries, options.quick, lambda n: progress.advance(task, n)
            )
            row["bound_tests_to_ideal"] = _share(row["bound_tests"], row["ideal_bound_tests"])
            rows.append({"scene": name, **_ratios(row, libraries), **row})
            _write_csv(options.out / "compare.csv", rows)
    tables = _times(rows, libraries), _summary(rows, libraries), _work(rows, libraries)
    if program:
        chosen_scenes = {name: scenes[name] for name in chosen}
        tables += (pqp.table(chosen_scenes, program, options.quick, options.out),)
    page = "\n".join((_machine(libraries) + "\n", NOTES, *tables))
    (options.out / "compare.md").write_text(page)
    print(page, end="")
    wrong = [f"{r['scene']} ({r['disagreement']:.1e})" for r in rows if not _agree(r)]
    if wrong:
        print("THE ENGINES DISAGREE on " + ", ".join(wrong), file=sys.stderr)
    return 1 if wrong else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--scene", nargs="+", default=[], help="scenes or families; default: all")
    parser.add_argument("--quick", action="store_true", help="only a few blocks of each scene")
    parser.add_argument("--out", type=Path, default=OUT, help="output folder (%(default)s)")
    parser.add_argument("--data", type=Path, help="folder that contains falling_tori")
    parser.add_argument(
        "--pqp", type=Path, metavar="DIR", help="also compare with PQP, whose sources are in DIR"
    )
    return parser


def _wanted(name: str, asked: list[str]) -> bool:
    return not asked or name in asked or name.partition("/")[0] in asked


def _agree(row: dict[str, float]) -> bool:
    return row["disagreement"] <= TOLERATED  # False for NaN


def _ratios(row: dict[str, float], libraries: list) -> dict[str, float]:
    """Return how many times as long each peer's exact query takes as each of our queries."""
    ratios = {}
    for library in libraries:
        name = library.name
        for ours, suffix in (("ours", ""), ("ours_10", "_10")):
            ratios[f"{name}_ratio{suffix}"] = row[f"{name}_median_us"] / row[f"{ours}_median_us"]
        for ours, suffix in (("ours", "means"), ("batch", "batch"), ("batch_10", "batch_10")):
            ratios[f"{name}_ratio_{suffix}"] = row[f"{name}_mean_us"] / row[f"{ours}_mean_us"]
    return ratios


def _share(tests: float, ideal: float) -> float:
    """Return tests / ideal; bodies that touch may need no test, so 0 / 0 counts as 1."""
    if ideal > 0.0:
        return tests / ideal
    return 1.0 if tests == 0.0 else float("inf")


def _write_csv(path: Path, rows: list[dict]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()})


def _machine(libraries: list) -> str:
    """Return the versions of what was compared, and the processor."""
    versions = [f"{name} {metadata.version(name)}" for name in ("numpy", "numba")]
    versions += [peers.version(library) for library in libraries]
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = info.read_text().splitlines()
        cpu = next((x.partition(": ")[2] for x in lines if x.startswith("model name")), cpu)
    return f"Python {platform.python_version()}, {', '.join(versions)}; {cpu}."


def _times(rows: list[dict], libraries: list) -> str:
    """Return the table of times and ratios in Markdown."""
    columns = [("scene", "scene", ""), ("queries", "queries", "d")]
    columns += [("ours", "ours_median_us", ".1f"), ("10 %", "ours_10_median_us", ".1f")]
    columns += [("batch", "batch_mean_us", ".1f")]
    for name in (library.name for library in libraries):
        columns += [(name, f"{name}_median_us", ".0f"), (f"{name}/ours", f"{name}_ratio", ".2f")]
        columns += [("/10 %", f"{name}_ratio_10", ".2f"), ("means", f"{name}_ratio_means", ".2f")]
        columns += [("/batch", f"{name}_ratio_batch", ".2f")]
    return _table(rows, columns)


def _work(rows: list[dict], libraries: list) -> str:
    """Return the table of tests, model sizes and build times in Markdown."""
    columns = [("scene", "scene", ""), ("triangles", "triangles", ".0f")]
    columns += [("touching", "touching", ".0%"), ("disagreement", "disagreement", ".0e")]
    columns += [("bound tests", "bound_tests", ".0f"), ("ideal", "ideal_bound_tests", ".0f")]
    columns += [("bound tests / ideal", "bound_tests_to_ideal", ".2f")]
    columns += [("at 10 %", "bound_tests_10", ".0f")]
    columns += [("triangle tests", "primitive_tests", ".0f")]
    columns += [("at 10 %", "primitive_tests_10", ".0f"), ("build, s", "ours_build_s", ".4f")]
    columns += [(library.name, f"{library.name}_build_s", ".4f") for library in libraries]
    columns += [("bytes a triangle", "bytes_per_triangle", ".0f")]
    return _table(rows, columns)


def _table(rows: list[dict], columns: list[tuple[str, str, str]]) -> str:
    """Return the rows as a Markdown table; a column is its heading, key and format."""
    lines = [[heading for heading, _, _ in columns], ["---"] * len(columns)]
    lines += [[format(row[key], spec) for _, key, spec in columns] for row in rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _summary(rows: list[dict], libraries: list) -> str:
    """Return the geometric mean and the worst scene of each ratio, as a Markdown list."""
    lines = []
    for library in libraries:
        for suffix, what in (
            ("", "exact, medians"),
            ("_10", "10 %, medians"),
            ("_means", "exact, means"),
            ("_batch", "batch, means"),
            ("_batch_10", "batch 10 %, means"),
        ):
            key = f"{library.name}_ratio{suffix}"
            families: dict[str, list[float]] = {}
            for row in rows:
                families.setdefault(row["scene"].partition("/")[0], []).append(np.log(row[key]))
            scenes = np.exp(np.mean(np.concatenate(list(families.values()))))
            means = np.exp(np.mean([np.mean(logs) for logs in families.values()]))
            worst = min(rows, key=lambda row: row[key])
            lines.append(
                f"- {library.name} / ours, {what}: geometric mean {scenes:.2f} over {len(rows)} "
                f"scenes, {means:.2f} over {len(families)} families; "
                f"worst {worst[key]:.2f} ({worst['scene']})"
            )
    return "".join(line + "\n" for line in lines)


if __name__ == "__main__":
    sys.exit(main())
