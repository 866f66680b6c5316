"""Which of many balls meet: sweep and prune along one axis, with temporal coherence.

The intervals of the balls along an axis are kept sorted by their lower ends. If bodies move little
between two calls, the order stays nearly the same, and an insertion sort mends it in linear time
(Thomas et al. 2000, section 5, after Cohen et al. 1995). One sweep then finds every pair of
intervals that overlap, and for these the balls themselves are compared.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import entry, kernel, loop16
from ..base.memory import on_stack
from ..base.rounding import DOUBLE_EPS

WIDTH = 16
"""How many balls are compared with another at once; this takes two thirds of the time."""

UNSORTED = -1
"""Returned if mending the order would take longer than sorting it anew."""

SHIFTS = 16
"""Average number of places per interval by which `_mend` may shift intervals before it gives up."""

GROWTH, FLOOR = 16.0 * DOUBLE_EPS, 1e-150
"""Growth of a radius: GROWTH as a share of the radius plus the centre's coordinates; FLOOR, metres.

Let u = 2^-53, C the largest absolute coordinate of both centres and S the sum of the radii r. An
interval's ends err by u (C + r), so two intervals that touch seem apart by at most
2 u (2 C + S) < 4 u (C + S). The squared distance errs by 4 u and the square of S by 3 u of
themselves, which is 3.5 u of the lengths. (Products below 1e-300 lose digits; then both lengths are
below FLOOR.) GROWTH adds 16 u (C + S), less u for its own three roundings.
"""


@kernel
def _mend(low, order):
    """Sort `order` by the lower ends; return False if it is too far from sorted to be mended.

    In this case, `order` is left in any order.
    """
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
    """Mark which of the WIDTH balls from `first` on meet a given ball; return how many do."""
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
    """Write every pair of balls that meet and of which at least one is moving, lower index first.

    centres (n, 3) and radii (n,) in metres; moving (n,); order (m,): the bodies that take part, in
    the order that the last call left; low (n,): scratch; lanes (5, m + WIDTH): scratch with finite
    content; pairs (k, 2). Returns how many pairs there are, or UNSORTED. If there are more than k
    pairs, only k are written. Because of rounding, balls that do not quite meet may be listed, but
    no pair that meets is left out.
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
    """Return the radius, enlarged by the rounding allowance."""
    reach = abs(centres[body, 0]) + abs(centres[body, 1]) + abs(centres[body, 2]) + radii[body]
    return radii[body] + GROWTH * reach + FLOOR
