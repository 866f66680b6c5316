"""How large triangles are, and where."""

from __future__ import annotations

import numpy as np

from .jit import allocating_entry


@allocating_entry
def measure(corners):
    """Measures of triangles (m, 9).

    Returns the centre (3,) of their box, the largest distance of a corner from it, the largest
    coordinate and the largest norm of a corner.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    squared_norm = 0.0
    for t in range(corners.shape[0]):
        for corner in range(0, 9, 3):
            squared = 0.0
            for axis in range(3):
                x = corners[t, corner + axis]
                low[axis], high[axis] = min(low[axis], x), max(high[axis], x)
                squared += x * x
            squared_norm = max(squared_norm, squared)
    centre = 0.5 * low + 0.5 * high
    squared_distance = 0.0
    for t in range(corners.shape[0]):
        for corner in range(0, 9, 3):
            squared = 0.0
            for axis in range(3):
                x = corners[t, corner + axis] - centre[axis]
                squared += x * x
            squared_distance = max(squared_distance, squared)
    largest = max(-low.min(), high.max())
    return centre, np.sqrt(squared_distance), largest, np.sqrt(squared_norm)
