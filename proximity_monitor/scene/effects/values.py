"""Converts a scene file's numbers to read-only arrays in metres and unit vectors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from proximity_monitor.scene.description import Unit
from proximity_monitor.scene.report import Keys, Report


def direction(data: Mapping[str, Any], keys: Keys, key: str, report: Report) -> np.ndarray:
    """A unit vector; zeros, and a problem in the report, if there is none."""
    vector = np.array(data[key], dtype=np.float64)
    largest = np.abs(vector).max()
    if not largest > 0.0:
        report.add((*keys, key), f"must be a direction, of a length above 0 (got {data[key]})")
        return np.zeros(3)
    vector /= largest  # so that no square underflows or overflows
    return vector / np.linalg.norm(vector)


def metres(lengths: Any, unit: Unit) -> np.ndarray:
    """Lengths of the file, read-only."""
    return frozen(unit.to_metre * np.array(lengths, dtype=np.float64))


def frozen(array: np.ndarray) -> np.ndarray:
    """The same array, read-only from now on."""
    array.setflags(write=False)
    return array
