"""Whether a profile crosses itself.

Its Bezier pieces are cut into chords with bands as wide as a piece bends away from them. Where the
bands of two chords meet that are no neighbours, both parts are cut again, until they are straight.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import allocating, allocating_entry, inlined, kernel
from ..base.memory import table_on_stack

_LEAST, _MOST, _FLAT = 4, 64, 1e-3
"""Chords of a piece, at least and at most; and how far it may bend away from them, as a share of
the profile's size."""

_STRAIGHT = 1e-12
"""Share of the size by which a part may bend that is taken for straight: how far apart two points
may be that are taken for one, besides."""

_ANGLE = 1e-6
"""Sine of the angle below which straight parts run along each other and do not cross."""

_FINER, _ROOM, _LOOKS = 8, 4096, 1 << 16
"""Into how many parts one is cut; how many pairs may wait; and how many are looked at, at the most.
Where a profile runs along itself for long, it is taken for granted that it does not cross."""

_WIDTH = 16
"""Control points that a piece has room for."""


@allocating_entry
def first_crossing(nets, degrees, size):
    """Where a profile crosses itself first, as it runs along.

    Args:
        nets: (n, 16, 3) control points rho w, z w and w of its pieces, one after the other.
        degrees: (n,) of the pieces.
        size: metres; the largest coordinate.

    Returns:
        (i, j, rho, z): two pieces and a point, metres; i is -1 where it does not.
    """
    chords = _chords(nets, degrees, size)
    pairs, looks = np.empty((_ROOM, 8)), 0
    last = len(chords) - 1
    for i in range(last):
        for j in range(i + 2, last + (i > 0)):  # in a loop the last is a neighbour of the first
            if not _near(chords[i], chords[j]):
                continue
            pairs[0, 0], pairs[0, 1], pairs[0, 2] = chords[i, 5], chords[i, 6], chords[i, 7]
            pairs[0, 3], pairs[0, 4], pairs[0, 5] = chords[j, 5], chords[j, 6], chords[j, 7]
            pairs[0, 6], pairs[0, 7] = chords[i, 4], chords[j, 4]
            found, looks, rho, z = _look(nets, degrees, size, pairs, looks)
            if found:
                return np.int64(chords[i, 5]), np.int64(chords[j, 5]), rho, z
    return -1, -1, 0.0, 0.0


@allocating
def _chords(nets, degrees, size):
    """Chords (n, 8): two ends, the bend, the piece, and its parameters there."""
    counts, bends = np.empty(len(nets), np.int64), np.empty(len(nets))
    for k in range(len(nets)):
        bends[k] = _bend(nets[k], degrees[k])
        wanted = np.sqrt(bends[k] / (_FLAT * size))
        counts[k] = min(max(np.int64(min(wanted, 1e6)), _LEAST), _MOST)
    chords = np.empty((counts.sum(), 8))
    at = 0
    for k in range(len(nets)):
        count = counts[k]
        for i in range(count):
            _cut(nets[k], degrees[k], i / count, (i + 1) / count, chords[at])
            chords[at, 4], chords[at, 5] = bends[k] / (count * count), k
            at += 1
    return chords


@kernel
def _bend(net, degree):
    """About how far a piece bends away from its chord, metres; more than that if it is rational."""
    most = 0.0
    for i in range(degree - 1):
        for c in range(2):
            a, b, d = (
                net[i, c] / net[i, 2],
                net[i + 1, c] / net[i + 1, 2],
                net[i + 2, c] / net[i + 2, 2],
            )
            most = max(most, abs(a - 2.0 * b + d))
    return 0.25 * degree * degree * most


@kernel
def _point(net, degree, t):
    """The point of a piece at t, by de Casteljau's method."""
    rows = table_on_stack(_WIDTH, 3, 0.0)
    for i in range(degree + 1):
        for c in range(3):
            rows[i, c] = net[i, c]
    for level in range(degree, 0, -1):
        for i in range(level):
            for c in range(3):
                rows[i, c] = (1.0 - t) * rows[i, c] + t * rows[i + 1, c]
    return rows[0, 0] / rows[0, 2], rows[0, 1] / rows[0, 2]


@kernel
def _cut(net, degree, low, high, chord):
    """Write the ends of a part of a piece, and its parameters, but for a chord's bend and piece."""
    chord[0], chord[1] = _point(net, degree, low)
    chord[2], chord[3] = _point(net, degree, high)
    chord[6], chord[7] = low, high


@inlined
def _side(a, x, y):
    """How far a point is to the left of a chord, times its length."""
    return (a[2] - a[0]) * (y - a[1]) - (a[3] - a[1]) * (x - a[0])


@kernel
def _near(a, b):
    """Whether the bands of two chords may meet."""
    both = a[4] + b[4]
    for c in range(2):
        if min(a[c], a[2 + c]) > max(b[c], b[2 + c]) + both:
            return False
        if min(b[c], b[2 + c]) > max(a[c], a[2 + c]) + both:
            return False
    for _ in range(2):
        wide = both * np.hypot(a[2] - a[0], a[3] - a[1])
        p, q = _side(a, b[0], b[1]), _side(a, b[2], b[3])
        if min(p, q) > wide or max(p, q) < -wide:
            return False
        a, b = b, a
    return True


@kernel
def _look(nets, degrees, size, pairs, looks):
    """Whether the two parts in pairs[0] cross, how many looks were made then, and where they do."""
    one, other = table_on_stack(_FINER, 8, 0.0), table_on_stack(_FINER, 8, 0.0)
    count, enough = 1, _STRAIGHT * size
    while count > 0 and looks < _LOOKS:
        looks += 1
        count -= 1
        i, j = np.int64(pairs[count, 0]), np.int64(pairs[count, 3])
        bend_a, bend_b = pairs[count, 6], pairs[count, 7]
        low_a, low_b = pairs[count, 1], pairs[count, 4]
        step_a, step_b = pairs[count, 2] - low_a, pairs[count, 5] - low_b
        straight = max(bend_a, bend_b) <= enough
        parts = 1 if straight else _FINER
        for k in range(parts):
            _cut(
                nets[i],
                degrees[i],
                low_a + k * step_a / parts,
                low_a + (k + 1) * step_a / parts,
                one[k],
            )
            _cut(
                nets[j],
                degrees[j],
                low_b + k * step_b / parts,
                low_b + (k + 1) * step_b / parts,
                other[k],
            )
            one[k, 4], other[k, 4] = bend_a / (parts * parts), bend_b / (parts * parts)
        if straight:
            if _cross(one[0], other[0]):
                return True, looks, one[0, 0], one[0, 1]
            continue
        for k in range(parts):
            for m in range(parts):
                if count < _ROOM and _near(one[k], other[m]):
                    pairs[count, 0], pairs[count, 1], pairs[count, 2] = i, one[k, 6], one[k, 7]
                    pairs[count, 3], pairs[count, 4], pairs[count, 5] = j, other[m, 6], other[m, 7]
                    pairs[count, 6], pairs[count, 7] = one[k, 4], other[m, 4]
                    count += 1
    return False, looks, 0.0, 0.0


@kernel
def _cross(a, b):
    """Whether straight parts that meet, or nearly so, cross: unless they run along each other."""
    x, y, u, v = a[2] - a[0], a[3] - a[1], b[2] - b[0], b[3] - b[1]
    return abs(x * v - y * u) > _ANGLE * np.hypot(x, y) * np.hypot(u, v)
