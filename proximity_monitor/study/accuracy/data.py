"""The study's data: a CSV file for each part, and one that records how each was measured."""

from __future__ import annotations

import csv
import os
import platform
from importlib import metadata
from pathlib import Path

import proximity_monitor

from .part import Row, Rows

RUNS = "runs"
"""Name of the file that records how each part was measured."""


def write_rows(path: Path, rows: Rows) -> None:
    """Write rows with the same keys, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_suffix(".part")
    with beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.9g}" if isinstance(v, float) else v for k, v in row.items()})
    beside.replace(path)


def read_rows(path: Path) -> Rows:
    """Return the rows of a file, numbers as numbers; none if there is no such file."""
    if not path.is_file():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return [{k: _value(v) for k, v in row.items()} for row in csv.DictReader(file)]


def _value(text: str) -> str | int | float:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text


def note_run(folder: Path, part: str, command: str, quick: bool) -> None:
    """Record how a part was measured: the command, the machine and the versions."""
    row: Row = {"part": part, "command": command, "quick": int(quick), **_machine()}
    path = folder / f"{RUNS}.csv"
    others = [each for each in read_rows(path) if each["part"] != part]
    write_rows(path, [*others, row])


def _machine() -> Row:
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = info.read_text(encoding="utf-8").splitlines()
        cpu = next((x.partition(": ")[2] for x in lines if x.startswith("model name")), cpu)
    return {
        "cpu": cpu,
        "cores": os.cpu_count() or 1,
        "system": platform.system(),
        "python": f"Python {platform.python_version()}",
        "numpy": f"numpy {metadata.version('numpy')}",
        "numba": f"numba {metadata.version('numba')}",
        "package": f"proximity_monitor {proximity_monitor.__version__}",
    }
