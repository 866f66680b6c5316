"""Parts of one element while it is looked at from a single point: a stack of control nets.

A part is named by where its net begins in `parts`: rows of x w, y w, z w and w of each control
point, whose origin is the point. As all weights w are positive, a plane through the origin has a
control point on the same side as its homogeneous coordinates; so nothing is divided where signs
alone matter.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.rounding import NET_SPLIT
from ..base.state import CONVERSION
from .subdivide import halve_in_u, halve_in_v

ROWS = 4

NUMBERS = 1 << 15
"""Room for nets: 64 parts of degrees up to 7 and 7, 32 of 15 and 15."""

MOST = 64
"""Parts at the most. Each division adds one, so a part is of 2^-32 of an element's parameters."""

_FLATTER = 1e-3
"""Share of its size below which a part's bends do not tell how it is to be divided."""


@inlined
def room_of(piece):
    """The parts that there is room for."""
    return min(MOST, NUMBERS // (ROWS * np.int64(piece.room)))


@inlined
def place_of(piece, k):
    """Where the net of part k begins."""
    return k * ROWS * np.int64(piece.room)


@kernel
def take_whole(piece, nets, origin, parts):
    """Make the whole element part 0."""
    room, at = np.int64(piece.room), piece.net
    for k in range(room):
        w = nets[at + 3 * room + k]
        parts[3 * room + k] = w
        for axis in range(3):
            parts[axis * room + k] = nets[at + axis * room + k] - origin[axis] * w


@kernel
def margin_of(tree, piece, origin, splits):
    """What rounding may do to a part's control points, and had done to the element's, metres.

    Moving the origin by o errs by 2 u (P + |o|) for each coordinate, P being the largest norm of a
    control point, and a product with a unit vector by 3 u of its terms: 8 NET_SPLIT is more.
    """
    size = tree.scale[2] + abs(origin[0]) + abs(origin[1]) + abs(origin[2])
    degree = max(piece.degree_u, piece.degree_v)
    return NET_SPLIT * (degree * splits + 8) * size + tree.scale[CONVERSION]


@kernel
def divide(piece, parts, at, high, in_u):
    """Divide a part: its low half takes its place, and the high half is written to `high`."""
    room = np.int64(piece.room)
    p, n = np.int64(piece.degree_u), np.int64(piece.degree_v) + 1
    for row in range(ROWS):
        one, other = at + row * room, high + row * room
        if in_u:
            halve_in_u(parts, one, one, other, p, n)
        else:
            halve_in_v(parts, one, one, other, p, n)


@inlined
def corner_of(piece, parts, at, i):
    """The corner 0 to 3 of a part: u is low in the first two, v in the first and third."""
    n, p, room = np.int64(piece.degree_v) + 1, np.int64(piece.degree_u), np.int64(piece.room)
    k = at + (p * n if i >= 2 else 0) + (n - 1 if i % 2 == 1 else 0)
    w = parts[k + 3 * room]
    return (parts[k] / w, parts[k + room] / w, parts[k + 2 * room] / w)


@inlined
def _length(parts, at, room, first, stride, count):
    """About how long a row of control points is."""
    found = 0.0
    for i in range(count - 1):
        k = at + first + i * stride
        w = parts[k + 3 * room]
        for axis in range(3):
            m = k + axis * room
            found += abs(parts[m + stride] - parts[m]) / w
    return found


@inlined
def _bend(parts, at, room, first, stride, count):
    """About how far a row of control points is from evenly straight."""
    found = 0.0
    for i in range(count - 2):
        k = at + first + i * stride
        w = parts[k + 3 * room]
        for axis in range(3):
            m = k + axis * room
            change = parts[m + 2 * stride] - 2.0 * parts[m + stride] + parts[m]
            found = max(found, abs(change) / w)
    return 0.125 * count * count * found


@kernel
def is_longer_in_u(piece, parts, at):
    """Whether u is the direction in which a part is longer."""
    p, n, room = np.int64(piece.degree_u), np.int64(piece.degree_v) + 1, np.int64(piece.room)
    if n == 1:
        return True
    u = _length(parts, at, room, 0, n, p + 1) + _length(parts, at, room, n - 1, n, p + 1)
    v = _length(parts, at, room, 0, 1, n) + _length(parts, at, room, p * n, 1, n)
    return u >= v


@kernel
def bends_more_in_u(piece, parts, at):
    """Whether u is the direction in which a part has to be divided to become flat."""
    p, n, room = np.int64(piece.degree_u), np.int64(piece.degree_v) + 1, np.int64(piece.room)
    if n == 1:
        return True
    u = v = 0.0
    for three in range(3):
        u = max(u, _bend(parts, at, room, (three * (n - 1)) >> 1, n, p + 1))
        v = max(v, _bend(parts, at, room, ((three * p) >> 1) * n, 1, n))
    a, b = corner_of(piece, parts, at, 0), corner_of(piece, parts, at, 1)
    c, d = corner_of(piece, parts, at, 2), corner_of(piece, parts, at, 3)
    twist = size = 0.0
    for axis in range(3):
        twist = max(twist, 0.25 * abs((a[axis] - b[axis]) + (d[axis] - c[axis])))
        size = max(size, max(abs(d[axis] - a[axis]), abs(c[axis] - b[axis])))
    # Twist becomes less in either direction, so then it is the longer one.
    if max(u, v) < max(twist, _FLATTER * size):
        return is_longer_in_u(piece, parts, at)
    return u >= v


@kernel
def least_along(piece, parts, at, n):
    """The least product of a vector with a control point: no point of the part has a smaller."""
    room, least = np.int64(piece.room), np.inf
    for k in range(at, at + np.int64(piece.points)):
        value = n[0] * parts[k] + n[1] * parts[k + room] + n[2] * parts[k + 2 * room]
        least = min(least, value / parts[k + 3 * room])
    return least
