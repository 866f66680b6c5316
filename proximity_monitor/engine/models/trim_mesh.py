"""Triangles over what a trim leaves of a patch, to be shown."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .trim import Trim

Reals = NDArray[np.float64]
_THIN = 1e-9
"""Thinner bands, as a share of the patch's v, are not shown."""


def trimmed_grid(trim: Trim, u: Reals, v: Reals) -> tuple[Reals, NDArray[np.int64]]:
    """Triangles in the parameters of a patch, as small as the steps of a grid.

    The patch is cut into bands of v in which no segment of a loop begins or ends, these between the
    segments that cross them, and the pieces along the grid's lines of u. Segments
    count as their chords.

    Args:
        trim: of the patch.
        u: (n,) the grid's parameters, ascending, both ends of the patch's rectangle among them.
        v: (m,) the same.

    Returns:
        Parameters (k, 2), and triangles (j, 3) of their indices.
    """
    begins, ends = (_parameters(trim, trim.segments[end]) for end in "ab")
    levels = np.unique(np.concatenate([v, begins[:, 1], ends[:, 1]]))
    levels = levels[(levels >= v[0]) & (levels <= v[-1])]
    points, faces, start = [], [], 0
    for low, high in pairwise(levels):
        if high - low <= _THIN * (v[-1] - v[0]):
            continue  # a fan over nothing would be seen as the cap of an arc
        for left, right in _between(begins, ends, low, high, u[0], u[-1]):
            # The same lines of u at both ends: lines askew would fold the triangles of a thin band.
            lines = u[(u > left.min()) & (u < right.max())]
            lines = np.concatenate([[left.min()], lines, [right.max()]])
            rows = np.clip(lines, left[:, None], right[:, None])
            count = len(lines)
            points.append(np.column_stack([rows.ravel(), np.repeat([low, high], count)]))
            a = start + np.arange(count - 1)
            b = a + count
            widths = np.diff(rows, axis=1) > 0.0  # where a row is cut off, its triangles vanish
            faces.append(np.column_stack([a, a + 1, b + 1])[widths[0]])
            faces.append(np.column_stack([a, b + 1, b])[widths[1]])
            start += 2 * count
    if not points:
        return np.empty((0, 2)), np.empty((0, 3), np.int64)
    return np.concatenate(points), np.concatenate(faces)


def _between(
    begins: Reals, ends: Reals, low: float, high: float, least: float, most: float
) -> list[tuple[Reals, Reals]]:
    """What is left of a band of v: pairs of u at its lower and upper end, of either side."""
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
    """Points (n, 2) of the unit square as parameters of the patch; the frame stays outside."""
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
