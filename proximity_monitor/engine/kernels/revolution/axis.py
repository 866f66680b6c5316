"""How far a profile reaches beyond its axis."""

from __future__ import annotations

import numpy as np

from ..base.jit import allocating_entry
from .part import BOX, COLUMNS, PLACE, ROWS, copy, halve, take

_DEEPEST, _MOST = 60, 1 << 16
"""How often a piece is halved, and how many parts are looked at in all, at most. After 30 halvings
a polynomial is nearer to its control points than rounding can tell, so it reaches neither limit.
The rest is for weights that differ by many powers of ten."""

_SLACK = 1e-3
"""How much farther beyond the axis a point may be than the one found, as a share of `allowed`. That
is a few units of rounding of the profile's size; closer points cannot be told apart."""


@allocating_entry
def farthest_beyond(nets, degrees, allowed):
    """Find the point of a profile that is farthest beyond the axis, by more than `allowed`.

    No point of a part is farther beyond the axis than the part's control points. So a part is
    halved if a control point of it is farther beyond the axis than the farthest end of a part so
    far.

    Args:
        nets: (n, 16, 3) control points rho w, z w and w of the profile's pieces.
        degrees: (n,) of the pieces.
        allowed: metres.

    Returns:
        (i, t, rho): the piece, the parameter on it from 0 to 1, and rho, metres; i is -1 if no
        point is that far beyond the axis.
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
