"""Measures of a set of triangles: size and centre."""

from __future__ import annotations

import numpy as np

from ..base.jit import entry
from ..base.memory import on_stack


@entry
def measure(corners, centre):
    """Measure triangles (m, 9), and write the centre (3,) of their bounding box.

    Returns the largest distance of a corner from the centre, the largest absolute coordinate, and
    the largest norm of a corner.
    """
    low, high = on_stack(3, np.inf), on_stack(3, -np.inf)
    for axis in range(3):
        low[axis], high[axis] = np.inf, -np.inf
    squared_norm = 0.0
    for t in range(corners.shape[0]):
        for corner in range(0, 9, 3):
            squared = 0.0
            for axis in range(3):
                x = corners[t, corner + axis]
                low[axis], high[axis] = min(low[axis], x), max(high[axis], x)
                squared += x * x
            squared_norm = max(squared_norm, squared)
    largest = 0.0
    for axis in range(3):
        centre[axis] = 0.5 * low[axis] + 0.5 * high[axis]
        largest = max(largest, max(-low[axis], high[axis]))
    squared_distance = 0.0
    for t in range(corners.shape[0]):
        for corner in range(0, 9, 3):
            squared = 0.0
            for axis in range(3):
                x = corners[t, corner + axis] - centre[axis]
                squared += x * x
            squared_distance = max(squared_distance, squared)
    return np.sqrt(squared_distance), largest, np.sqrt(squared_norm)
