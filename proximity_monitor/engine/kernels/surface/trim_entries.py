"""Entries for Python about trims: many points or rectangles at once."""

from __future__ import annotations

from ..base.jit import entry
from .trim import classify_point, classify_rectangle
from .trim_edge import nearest_on_trim, trim_point


@entry
def classify_points(table, patch, parameters, sides):
    """Write what is left of points (n, 2) of a patch to sides (int8, n): INSIDE and so on."""
    for i in range(len(parameters)):
        sides[i] = classify_point(table, patch, parameters[i, 0], parameters[i, 1])


@entry
def classify_rectangles(table, patch, rectangles, sides):
    """As `classify_points`, for rectangles (n, 4) of a patch: low u, low v, high u, high v."""
    for i in range(len(rectangles)):
        low_u, low_v = rectangles[i, 0], rectangles[i, 1]
        high_u, high_v = rectangles[i, 2], rectangles[i, 3]
        sides[i] = classify_rectangle(table, patch, low_u, low_v, high_u, high_v)


@entry
def nearest_trim_points(table, patch, parameters, scale_u, scale_v, found):
    """Write the points of a patch's loops nearest to points (n, 2) to found (n, 2).

    Returns:
        False if the patch has no loops; then nothing is written.
    """
    for i in range(len(parameters)):
        u, v = parameters[i, 0], parameters[i, 1]
        segment, t = nearest_on_trim(table, patch, u, v, scale_u, scale_v)
        if segment < 0:
            return False
        u, v, _, _ = trim_point(table, patch, segment, t)
        found[i, 0], found[i, 1] = u, v
    return True
