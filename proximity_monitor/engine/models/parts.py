"""Choose into how many parts the spans of patches and curves are cut, so that volumes are thin.

Pieces of equal size make the better hierarchy: one large piece among small ones makes the volumes
around its neighbours large. On a trimmed patch, small pieces show sooner what has been cut off.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .nurbs import Net

Parts = tuple[tuple[int, int], ...]
"""For each patch or curve: into how many parts each of its spans is cut, in u and in v."""

_PIECES, _MOST, _MOST_TRIMMED = 1024, 8, 16
"""The approximate number of pieces of a model of few spans, and the most parts of a span, also of a
trimmed patch. Small pieces have thin volumes: against a mesh, an eighth of the leaf pairs is left.
"""

_TRIMMED = 2.0
"""Factor on the length of the pieces of trimmed patches, which makes them shorter than others. With
it the parts of the gearbox are compared in half the time of even parts."""

_HALVINGS = 24
"""Steps of the bisection for the length of pieces."""


def even_parts(nets: Sequence[Net]) -> Parts:
    """Return the same number of parts for all spans."""
    count = sum(len(u.low) * len(v.low) for u, v in (net.spans for net in nets))
    parts = max(min(math.isqrt(_PIECES // count), _MOST), 1)
    return ((parts, parts),) * len(nets)


def parts_of(nets: Sequence[Net]) -> Parts:
    """Return numbers of parts with which all pieces are about equally long."""
    counts = np.array([[len(each.low) for each in net.spans] for net in nets])
    trimmed = np.array([net.trim is not None for net in nets])
    lengths = np.array([_lengths(net) for net in nets]) / counts
    lengths[trimmed] *= _TRIMMED
    most = np.where(trimmed, _MOST_TRIMMED, _MOST)[:, None]

    def cut(length: float) -> NDArray[np.int64]:
        return np.clip(np.ceil(lengths / length), 1, most).astype(np.int64)

    high = float(lengths.max())
    if not high > 0.0:
        return ((1, 1),) * len(nets)
    low = high / _MOST_TRIMMED
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        if (cut(middle) * counts).prod(axis=1).sum() > _PIECES:
            low = middle
        else:
            high = middle
    return tuple((int(u), int(v)) for u, v in cut(high))


def _lengths(net: Net) -> tuple[float, float]:
    """Return the longest rows of a net's control points in u and v, metres; 0 in v for a curve."""
    along_u, along_v = (
        float(np.linalg.norm(np.diff(net.control, axis=axis), axis=2).sum(axis=axis).max())
        for axis in range(2)
    )
    return along_u, 0.0 if net.is_curve else along_v
