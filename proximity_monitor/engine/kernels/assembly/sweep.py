"""Which of many balls meet: sweep and prune along one axis, with temporal coherence.

Intervals along an axis are kept sorted by their lower ends; bodies that move little between two
calls leave that order nearly as it was, and an insertion sort mends it in linear time (Thomas et
al. 2000, section 5, after Cohen et al. 1995). One sweep then meets every pair of intervals that
overlap, and the balls themselves decide.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import entry, kernel, loop16
from ..base.memory import on_stack
from ..base.rounding import DOUBLE_EPS

WIDTH = 16
"""So many balls are compared with another at once, which takes two thirds of the time."""

UNSORTED = -1
"""Returned where mending the order would take longer than sorting it anew."""

SHIFTS = 16
"""So many places may each interval be shifted on average before that."""

GROWTH, FLOOR = 16.0 * DOUBLE_EPS, 1e-150
"""What a radius is enlarged by: GROWTH of radius and centre's coordinates, and metres.

With u = 2^-53, C the largest coordinate of both centres in absolute value and S the sum of the
radii: an interval's ends err by u (C + r), so two intervals that touch seem apart by at most
2 u (2 C + S) < 4 u (C + S); the squared distance errs by 4 u and the square of S by 3 u of
themselves, which is 3.5 u of the lengths (products below 1e-300 lose their digits, and then both
are below FLOOR). GROWTH adds 16 u (C + S), from which its own three roundings take u.
"""


@kernel
def _mend(low, order):
    """Sort `order` by the lower ends; False, and any order, where it is too far from sorted."""
    allowed = SHIFTS * len(order) + 1024
    for i in range(1, len(order)):
        body = order[i]
        key = low[body]
        j = i
        while j > 0 and low[order[j - 1]] > key:
            order[j] = order[j - 1]
            j -= 1
        order[j] = body
        allowed -= i - j
        if allowed < 0:
            return False
    return True


@loop16
def _meeting(x, y, z, r, first, ax, ay, az, ar, meets):
    """Mark which of the WIDTH balls from `first` on meet a ball; returns how many do."""
    count = 0
    for lane in range(WIDTH):
        j = first + np.uint64(lane)
        dx, dy, dz, reach = x[j] - ax, y[j] - ay, z[j] - az, r[j] + ar
        apart = dx * dx + dy * dy + dz * dz > reach * reach
        meets[lane] = 0.0 if apart else 1.0
        count += 0 if apart else 1
    return count


@entry
def sweep(centres, radii, moving, axis, order, low, lanes, pairs):
    """Write every pair of balls that meet, one of them moving, the lower index first.

    centres (n, 3) and radii (n,), metres; order (m,) the bodies that take part, as the last call
    left them; low (n,) scratch, lanes (5, m + WIDTH) too, but finite; pairs (k, 2). Returns how
    many pairs there are: where they are more than k, only k are written. Rounding may list balls
    that do not quite meet, and leaves none out that do.
    """
    for body in order:
        low[body] = centres[body, axis] - _grown(centres, radii, body)
    if not _mend(low, order):
        return UNSORTED
    left, x, y, z, r = lanes[0], lanes[1], lanes[2], lanes[3], lanes[4]
    for i in range(len(order)):
        body = order[i]
        left[i] = low[body]
        x[i], y[i], z[i] = centres[body, 0], centres[body, 1], centres[body, 2]
        r[i] = _grown(centres, radii, body)
    meets = on_stack(WIDTH, 0.0)
    count = 0
    for i in range(len(order)):
        right = centres[order[i], axis] + r[i]
        fixed = not moving[order[i]]
        for first in range(i + 1, len(order), WIDTH):
            if left[first] > right:
                break
            if _meeting(x, y, z, r, np.uint64(first), x[i], y[i], z[i], r[i], meets) == 0:
                continue
            for j in range(first, min(first + WIDTH, len(order))):
                if meets[j - first] == 0.0 or (fixed and not moving[order[j]]):
                    continue
                if count < len(pairs):
                    pairs[count, 0] = min(order[i], order[j])
                    pairs[count, 1] = max(order[i], order[j])
                count += 1
    return count


@kernel
def _grown(centres, radii, body):
    """The radius, enlarged by what rounding can hide."""
    reach = abs(centres[body, 0]) + abs(centres[body, 1]) + abs(centres[body, 2]) + radii[body]
    return radii[body] + GROWTH * reach + FLOOR
