"""Converts a scene file's numbers to read-only arrays in metres and unit vectors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from proximity_monitor.scene.description import Unit
from proximity_monitor.scene.report import Keys, Report


def direction(data: Mapping[str, Any], keys: Keys, key: str, report: Report) -> np.ndarray:
    """Return a unit vector; zeros, with a problem in the report, if the length is 0."""
    vector = np.array(data[key], dtype=np.float64)
    largest = np.abs(vector).max()
    if not largest > 0.0:
        report.add((*keys, key), f"must be a direction with a length above 0 (got {data[key]})")
        return np.zeros(3)
    vector /= largest  # so that no square underflows or overflows
    return vector / np.linalg.norm(vector)


def metres(lengths: Any, unit: Unit) -> np.ndarray:
    """Return the file's lengths in metres, read-only."""
    return frozen(unit.to_metre * np.array(lengths, dtype=np.float64))


def frozen(array: np.ndarray) -> np.ndarray:
    """Make an array read-only and return it."""
    array.setflags(write=False)
    return array
