"""The command line: ``python -m proximity_monitor.study``."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from ..ending import checked_output

_PROGRAM = "python -m proximity_monitor.study"

_INSTALL = """\
The study needs {name}. Install what it uses, in the checkout:
    pip install '.[study]'"""

PARTS = {
    "tolerance": "time and actual error, against the requested relative error",
    "budget": "the gap between the bounds, against the time budget",
    "bounds": "what a test of two bounding volumes costs (1999 paper, Table 1)",
    "volumes": "six kinds of bounding volume on four applications (1999 paper, Tables 2 to 4)",
    "orders": "search orders, caching and the ideal search (1999 paper, Table 5)",
    "separated": "spheres side by side (1999 paper, Figure 5)",
    "concentric": "concentric spheres (1999 paper, Figure 6)",
    "growth": "time against model size, 500 to 512,000 triangles (1997 paper, Figure 6)",
    "degrees": "time against the degree of a surface, 2 to 15 (1997 paper, Figure 10)",
    "iterations": "error and time against iterations, for surfaces (1997 paper, Figure 11)",
    "cones": "what spheres, normal cones and directions prune (2000 paper, section 6)",
}
"""The parts, in the order of the page; listed here so that the help imports no library."""

_EPILOG = """\
parts:
{parts}

what is written:
  OUT/accuracy/PART.csv          the data of each part, as soon as a scene is measured
  OUT/images/accuracy_*.png      the figures
  OUT/accuracy.md                the page
Nothing is written outside OUT. `--out docs` in a checkout renews the page in `docs`.

examples:
  {program} accuracy --quick                       all parts, under a minute
  {program} accuracy --out docs                    the page in docs, two minutes
  {program} accuracy --part volumes --scene chain  one scene of one part
  {program} accuracy --render-only --out docs      page and figures again, from the data

Ctrl-C keeps what was measured so far, and writes the page from it. The exit code is 0, 1 if an
answer contradicts the exact one or the study cannot run, 2 for a wrong argument, and 130 after
Ctrl-C."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code (2 for a wrong command line, by `SystemExit`)."""
    with checked_output(_PROGRAM):
        return _run(arguments)


def _run(arguments: Sequence[str] | None) -> int:
    given = list(sys.argv[1:] if arguments is None else arguments)
    parser = _parser()
    chosen = parser.parse_args(given)
    if chosen.study is None:
        parser.print_help()
        return 0
    try:
        return _accuracy(chosen, f"{_PROGRAM} {shlex.join(given)}")
    except KeyboardInterrupt:  # before anything is measured, or while the page is written
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=_PROGRAM, description="Studies of the distance engine, from its own scenes."
    )
    studies = parser.add_subparsers(title="studies", metavar="STUDY", dest="study")
    listing = "\n".join(f"  {name:<12}{about}" for name, about in PARTS.items())
    accuracy = studies.add_parser(
        "accuracy",
        help="what accuracy costs in time: data, figures and a page",
        description="Measures what accuracy costs in time and writes a CSV file for each part, "
        "figures, and a page. Every answer is compared with the exact one.",
        epilog=_EPILOG.format(parts=listing, program=_PROGRAM),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    accuracy.add_argument(
        "--quick", action="store_true", help="few queries: under a minute instead of two"
    )
    accuracy.add_argument(
        "--out",
        type=Path,
        default=Path("build/accuracy"),
        metavar="DIR",
        help="folder to write to, created if missing (default: %(default)s)",
    )
    accuracy.add_argument(
        "--part",
        nargs="+",
        choices=PARTS,
        default=[],
        metavar="PART",
        help="measure only these parts; the page keeps the data of other parts in OUT",
    )
    accuracy.add_argument(
        "--scene",
        nargs="+",
        default=[],
        metavar="SCENE",
        help="measure only these scenes or families of scenes, in the parts that have them",
    )
    accuracy.add_argument(
        "--data",
        type=Path,
        metavar="DIR",
        help="folder that contains falling_tori, the 1999 paper's own data; without it a"
        " generated scene is used instead (default: PROXIMITY_MONITOR_DATA, or ../shared/data)",
    )
    accuracy.add_argument(
        "--render-only",
        action="store_true",
        help="measure nothing; write the page and figures from the data in OUT",
    )
    return parser


def _accuracy(chosen: argparse.Namespace, command: str) -> int:
    try:
        from .accuracy import run
        from .accuracy.page import render
    except ImportError as error:
        if (error.name or "").startswith("proximity_monitor"):
            raise  # a fault of the package itself, which no installation repairs
        print(_INSTALL.format(name=error.name), file=sys.stderr)
        return 1
    if chosen.render_only:
        return _rendered(chosen.out, lambda: render(chosen.out, run.PARTS))
    try:
        makers = run.scenes(chosen.data)
        plan = run.plan(makers, chosen.part, chosen.scene)
    except FileNotFoundError as error:
        print(f"--data or PROXIMITY_MONITOR_DATA: {error}", file=sys.stderr)
        return 2
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    try:
        chosen.out.mkdir(parents=True, exist_ok=True)
        return run.run(plan, makers, chosen.out, chosen.quick, command)
    except OSError as error:
        print(f"--out {chosen.out}: {error}", file=sys.stderr)
        return 2


def _rendered(out: Path, render: Callable[[], Path]) -> int:
    """Write the page and its figures again from the data in `out`; return the exit code."""
    if not any((out / "accuracy").glob("*.csv")):
        print(
            f"--render-only: no data in {out / 'accuracy'}; measure first, or pass the folder "
            "that has the data by --out",
            file=sys.stderr,
        )
        return 1
    try:
        print(f"Wrote {render()} and its figures.")
    except OSError as error:
        print(f"--out {out}: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
