"""The study from beginning to end: measure part by part, then write, draw and tell."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from ..recorded import VARIABLE, RecordedDataError, falling_tori, find_falling_tori
from ..scenes import SCENES, StudyScene, growing_tori
from ..surfaces import SURFACES
from . import (
    bounds,
    budget,
    cones,
    degrees,
    growth,
    iterations,
    orders,
    spheres,
    tolerance,
    volumes_page,
)
from .certificate import BrokenCertificateError
from .data import note_run, write_rows
from .page import render
from .part import Job, Part, Rows

PARTS = (
    tolerance.PART,
    budget.PART,
    bounds.PART,
    volumes_page.PART,
    orders.PART,
    *spheres.PARTS,
    growth.PART,
    degrees.PART,
    iterations.PART,
    cones.PART,
)
INTERRUPTED = 130
"""The exit code by which shells know Ctrl-C."""

Makers = Mapping[str, Callable[[], StudyScene]]
Plan = list[tuple[Part, list[str]]]


def scenes(data: Path | None) -> dict[str, Callable[[], StudyScene]]:
    """Return a maker of each scene that is available; it keeps the scene that it made.

    Raises:
        FileNotFoundError: `data`, or the environment, names a folder without recorded data.
    """
    makers: dict[str, Callable[[], StudyScene]] = {**SCENES, "growing": growing_tori, **SURFACES}
    folder = find_falling_tori(data, Path("../shared/data"))
    if folder:
        makers["falling-tori"] = lambda: falling_tori(folder)
    return {name: cache(make) for name, make in makers.items()}


def plan(makers: Makers, parts: Sequence[str], wanted: Sequence[str]) -> Plan:
    """Return which scenes are measured for which parts.

    Args:
        makers: the scenes that are available.
        parts: names of parts; none: all.
        wanted: names of scenes or families, the word before the slash; none: all.

    Raises:
        ValueError: a scene that no chosen part has; the message names the scenes that they have.
    """
    chosen: Plan = []
    offered: list[str] = []
    for part in PARTS:
        if parts and part.name not in parts:
            continue
        kept = []
        for entry in part.scenes:
            there = [
                name for name in ([entry] if isinstance(entry, str) else entry) if name in makers
            ]
            offered += there
            kept += [name for name in there if _asked(name, wanted)][:1]
        if kept:
            chosen.append((part, kept))
    for name in wanted:
        if not any(_asked(each, [name]) for each in offered):
            known = ", ".join(dict.fromkeys(offered))
            raise ValueError(f"--scene {name}: not in the chosen parts; they have {known}")
    return chosen


def _asked(name: str, wanted: Sequence[str]) -> bool:
    """Return whether a scene is wanted by its name or its family's; if none is wanted, all are."""
    return not wanted or name in wanted or name.partition("/")[0] in wanted


def run(chosen: Plan, makers: Makers, out: Path, quick: bool, command: str) -> int:
    """Measure, write the data after each scene, and render; return the exit code.

    The exit code is 0; 1 if an answer broke its certificate; 2 if the recorded data cannot be read;
    or INTERRUPTED after Ctrl-C, which keeps and renders what was measured so far. A part's new data
    replaces its old data as soon as its first scene is done.
    """
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
    )
    code = 0
    try:
        with Progress(*columns, console=console) as progress:
            task = progress.add_task("", total=sum(len(names) for _, names in chosen))
            for part, names in chosen:
                rows: Rows = []
                for name in names:
                    progress.update(task, description=f"{part.name}: {name}")
                    job = Job(name, makers[name](), quick, lambda n: progress.advance(task, n))
                    rows += part.measure(job)
                    write_rows(out / "accuracy" / f"{part.name}.csv", rows)
                    note_run(out / "accuracy", part.name, command, quick)
    except BrokenCertificateError as error:
        print(f"AN ANSWER IS WRONG: {error}", file=sys.stderr)
        print("No page was written; the data of earlier scenes is kept.", file=sys.stderr)
        return 1
    except RecordedDataError as error:
        print(f"--data or {VARIABLE}: {error}", file=sys.stderr)
        return 2
    except (KeyboardInterrupt, SystemError) as error:
        # Ctrl-C in compiled code arrives as a SystemError whose cause is the KeyboardInterrupt.
        if KeyboardInterrupt not in (type(error), type(error.__cause__)):
            raise
        print("Interrupted: what was measured so far is kept.", file=sys.stderr)
        code = INTERRUPTED
    print(f"Wrote {render(out, PARTS)}, its figures, and its data in {out / 'accuracy'}.")
    return code
