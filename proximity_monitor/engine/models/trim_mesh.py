"""Triangles that show what a trim leaves of a patch."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .trim import Trim

Reals = NDArray[np.float64]
_THIN = 1e-9
"""Bands thinner than this share of the patch's range of v are not shown."""


def trimmed_grid(trim: Trim, u: Reals, v: Reals) -> tuple[Reals, NDArray[np.int64]]:
    """Return triangles in the parameters of a patch, no larger than the steps of a grid.

    The patch is cut into bands of v in which no segment of a loop begins or ends. Each band is cut
    at the segments that cross it, and the parts that are left at the grid's lines of u. Segments
    count as their chords.

    Args:
        trim: the trim of the patch.
        u: (n,) the grid's parameters, ascending, with both ends of the patch's rectangle.
        v: (m,) the same in v.

    Returns:
        Parameters (k, 2), and triangles (j, 3) of their indices.
    """
    begins, ends = (_parameters(trim, trim.segments[end]) for end in "ab")
    levels = np.unique(np.concatenate([v, begins[:, 1], ends[:, 1]]))
    levels = levels[(levels >= v[0]) & (levels <= v[-1])]
    points, faces, start = [], [], 0
    for low, high in pairwise(levels):
        if high - low <= _THIN * (v[-1] - v[0]):
            continue  # the triangles of such a band would show as the cap of an arc
        for left, right in _between(begins, ends, low, high, u[0], u[-1]):
            # Take the same u at both ends: oblique lines would fold the triangles of a thin band.
            lines = u[(u > left.min()) & (u < right.max())]
            lines = np.concatenate([[left.min()], lines, [right.max()]])
            rows = np.clip(lines, left[:, None], right[:, None])
            count = len(lines)
            points.append(np.column_stack([rows.ravel(), np.repeat([low, high], count)]))
            a = start + np.arange(count - 1)
            b = a + count
            widths = np.diff(rows, axis=1) > 0.0  # triangles of width 0 are left out
            faces.append(np.column_stack([a, a + 1, b + 1])[widths[0]])
            faces.append(np.column_stack([a, b + 1, b])[widths[1]])
            start += 2 * count
    if not points:
        return np.empty((0, 2)), np.empty((0, 3), np.int64)
    return np.concatenate(points), np.concatenate(faces)


def _between(
    begins: Reals, ends: Reals, low: float, high: float, least: float, most: float
) -> list[tuple[Reals, Reals]]:
    """Return what is left of a band of v: for each part the u of its left and of its right border.

    A border is (2,): u at the band's lower and upper end.
    """
    below, above = np.minimum(begins[:, 1], ends[:, 1]), np.maximum(begins[:, 1], ends[:, 1])
    crossing = np.flatnonzero((below <= low) & (above >= high))
    rise = (ends[crossing] - begins[crossing]).T
    sides = [
        begins[crossing, 0] + rise[0] * ((level - begins[crossing, 1]) / rise[1])
        for level in (low, high)
    ]
    found = np.clip(np.column_stack(sides), least, most)
    found = found[np.argsort(np.column_stack(sides).sum(axis=1), kind="stable")]
    pairs = zip(found[0::2], found[1::2], strict=False)
    return [(left, right) for left, right in pairs if (right > left).any()]


def _parameters(trim: Trim, points: Reals) -> Reals:
    """Return parameters of the patch from points (n, 2) of the unit square or outside of it."""
    made = np.empty_like(points)
    for axis in range(2):
        share, arcs = points[:, axis], int(trim.record["arcs"][axis])
        tangent = float(trim.record["tangent"][axis])
        if arcs:
            arc = np.clip(np.floor(share * arcs), 0, arcs - 1)
            place = np.clip(2.0 * (share * arcs - arc) - 1.0, -1.0, 1.0)
            bent = (arc + 0.5 + 0.5 * np.tan(place * np.arctan(tangent)) / tangent) / arcs
            share = np.where((share >= 0.0) & (share <= 1.0), bent, share)
        made[:, axis] = trim.record["low"][axis] + share * trim.record["extent"][axis]
    return made
