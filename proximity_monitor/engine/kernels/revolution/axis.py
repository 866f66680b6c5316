"""How far a profile reaches beyond its axis."""

from __future__ import annotations

import numpy as np

from ..base.jit import allocating_entry
from .part import BOX, COLUMNS, PLACE, ROWS, copy, halve, take

_DEEPEST, _MOST = 60, 1 << 16
"""How often a piece is halved at most, and how many parts are looked at. After 30 times polynomials
are nearer to their control points than rounding tells, so that neither is reached; it is for
weights that differ by many powers of ten that there are more."""

_SLACK = 1e-3
"""Share of what is allowed by which a point may be farther beyond the axis than is found: some
units of rounding of the profile's size, within which nothing could be told."""


@allocating_entry
def farthest_beyond(nets, degrees, allowed):
    """The point of a profile that is farthest beyond the axis, by more than is allowed.

    No point of a part is farther beyond it than its control points. Parts of which some are are
    halved, until none is left that may be farther beyond than the farthest end of one.

    Args:
        nets: (n, 16, 3) control points rho w, z w and w of its pieces.
        degrees: (n,) of the pieces.
        allowed: metres.

    Returns:
        (i, t, rho): a piece, its parameter from 0 to 1, and metres; i is -1 if there is none.
    """
    waiting, depths = np.empty((_DEEPEST + 4, ROWS, COLUMNS)), np.empty(_DEEPEST + 4, np.int64)
    part, looks = np.empty((ROWS, COLUMNS)), 0
    piece, place, found = -1, 0.0, -allowed
    for k in range(len(nets)):
        take(nets[k], degrees[k], 1.0, k, waiting[0])
        left, depths[0] = 1, 0
        while left > 0 and looks < _MOST:
            left -= 1
            looks += 1
            copy(waiting[left], degrees[k], part)
            for end in range(2):
                rho = part[end * degrees[k], 3]
                if rho < found:
                    piece, place, found = k, part[PLACE, end], rho
            if part[BOX, 0] < found - _SLACK * allowed and depths[left] < _DEEPEST:
                halve(part, degrees[k], waiting[left + 1], waiting[left])
                depths[left] += 1
                depths[left + 1] = depths[left]
                left += 2
    return piece, place, found
