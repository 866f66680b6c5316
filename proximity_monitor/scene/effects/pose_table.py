"""Reads poses from a CSV file: one pose per row, columns found by their names."""

from __future__ import annotations

import csv
import math
from array import array
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

import numpy as np

from proximity_monitor.scene.description import Unit
from proximity_monitor.scene.poses import UNIT_LENGTH
from proximity_monitor.scene.report import SceneError, shown
from proximity_monitor.scene.schema import bounds

COLUMNS = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")

# Eight minutes at 1 kHz: reading them takes three seconds, and making their path 0.3 GB.
_MAX_ROWS = 500_000
# Lines of eight numbers are shorter; without a limit, a file without line ends would be read whole.
_MAX_LINE = 4096
# Seconds, eleven days: a larger time must be a clock's stamp.
_, _LATEST = bounds("time")
_, _FURTHEST = bounds("coordinate")


def read_poses(path: Path, unit: Unit) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read a table with the columns t, x, y, z, qx, qy, qz, qw, in any order, and maybe others.

    Args:
        path: the file.
        unit: the unit of its lengths.

    Returns:
        Times (n,) in seconds, increasing; positions (n, 3) in metres; quaternions (n, 4)
        x, y, z, w of length 1.

    Raises:
        SceneError: the table cannot be read; the message begins with the file and the line.
    """
    numbers = array("d")
    reader = None
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(_lines(file), strict=True)
            header = next(reader, [])
            places = _places(header)
            for row in reader:
                if row:
                    numbers.extend(_numbers(row, places, len(header), numbers, unit))
    except OSError as error:
        raise SceneError(f"{path}: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise SceneError(f"{path}: is not UTF-8 text") from None
    except (csv.Error, ValueError) as error:
        line = max(reader.line_num, 1) if reader else 1
        raise SceneError(f"{path}:{line}: {error}") from None
    if not numbers:
        raise SceneError(f"{path}: has a header but no poses")
    table = np.array(numbers).reshape(-1, len(COLUMNS))
    lengths = np.linalg.norm(table[:, 4:], axis=1, keepdims=True)
    return table[:, 0].copy(), unit.to_metre * table[:, 1:4], table[:, 4:] / lengths


def _lines(file: TextIO) -> Iterator[str]:
    """Yield the lines of a file; raise ValueError at a line that is too long, before its end."""
    while line := file.readline(_MAX_LINE + 1):
        if len(line) > _MAX_LINE:
            raise ValueError(f"a line has more than {_MAX_LINE} characters")
        yield line


def _places(header: list[str]) -> list[int]:
    names = [name.strip() for name in header]
    missing = [name for name in COLUMNS if name not in names]
    if missing:
        raise ValueError(
            f"the first line must name the columns {', '.join(COLUMNS)}; "
            f"{', '.join(missing)} missing (got {shown(','.join(header))})"
        )
    for name in COLUMNS:
        if names.count(name) > 1:
            raise ValueError(f"the column {name} appears twice")
    return [names.index(name) for name in COLUMNS]


def _numbers(
    row: list[str], places: list[int], width: int, before: array, unit: Unit
) -> list[float]:
    """Return the numbers of one row, in the order of COLUMNS; `before` holds the earlier rows."""
    if len(before) == _MAX_ROWS * len(COLUMNS):
        raise ValueError(f"more than {_MAX_ROWS} poses")
    if len(row) != width:
        raise ValueError(f"has {len(row)} columns, but the header has {width}")
    numbers = []
    for name, place in zip(COLUMNS, places, strict=True):
        try:
            number = float(row[place])
        except ValueError:
            raise ValueError(f"{name} must be a number (got {shown(row[place])})") from None
        if not math.isfinite(number):
            raise ValueError(f"{name} must be finite (got {row[place].strip()})")
        numbers.append(number)
    t = numbers[0]
    if not 0.0 <= t <= _LATEST:
        raise ValueError(f"t must be 0 to {_LATEST:g} s after the start (got {t:g})")
    if before and not t > (last := before[-len(COLUMNS)]):
        raise ValueError(f"t must be later than in the previous row, {last:g} (got {t:g})")
    for name, number in zip(COLUMNS[1:4], numbers[1:4], strict=True):
        if abs(number) * unit.to_metre > _FURTHEST:
            raise ValueError(
                f"{name} must be within {_FURTHEST:g} m of 0 (got {number:g} {unit.symbol})"
            )
    length = math.hypot(*numbers[4:])
    if abs(length - 1.0) > UNIT_LENGTH:
        raise ValueError(f"the quaternion must have length 1 (got {length:.6g})")
    return numbers
