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

ROWS = 4

NUMBERS = 1 << 15
"""Room for nets: 64 parts of degrees up to 7 and 7, 32 of 15 and 15."""

MOST = 64
"""Parts at the most. Each division adds one, so a part is of 2^-32 of an element's parameters."""

_FLATTER = 1e-3
"""Share of its length below which a part's bends do not tell how it is to be divided."""


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


@inlined
def _lines(piece, in_u):
    """The lines of control points along a parameter: their number, both strides, and their points.

    The strides are those from line to line, and from point to point.
    """
    p, n = np.int64(piece.degree_u), np.int64(piece.degree_v) + 1
    return (n, 1, n, p + 1) if in_u else (p + 1, n, 1, n)


@kernel
def divide(piece, parts, at, high, in_u):
    """Divide a part: its low half takes its place, and the high half is written to `high`."""
    room = np.int64(piece.room)
    lines, apart, step, count = _lines(piece, in_u)
    for row in range(ROWS):
        for line in range(lines):
            one = at + row * room + line * apart
            other = high + row * room + line * apart
            for i in range(count):
                parts[other + i * step] = parts[one + i * step]
            # The first points of each level of midpoints are points of the low half.
            for level in range(1, count):
                for i in range(count - level):
                    k = other + i * step
                    parts[k] = 0.5 * (parts[k] + parts[k + step])
                parts[one + level * step] = parts[other]


@inlined
def corner_of(piece, parts, at, i):
    """The corner 0 to 3 of a part: u is low in the first two, v in the first and third."""
    n, p, room = np.int64(piece.degree_v) + 1, np.int64(piece.degree_u), np.int64(piece.room)
    k = at + (p * n if i >= 2 else 0) + (n - 1 if i % 2 == 1 else 0)
    w = parts[k + 3 * room]
    return (parts[k] / w, parts[k + room] / w, parts[k + 2 * room] / w)


@kernel
def to_divide_in_u(piece, parts, at, by_length):
    """Whether u is the direction in which a part is to be divided.

    That is the one in which it bends more; or is longer, where that is asked for, or neither bends
    much.
    """
    room, in_u = np.int64(piece.room), True
    bends = lengths = 0.0
    for parameter in range(2):
        lines, apart, step, count = _lines(piece, parameter == 1)
        bend = length = 0.0
        for line in range(lines):
            reach = 0.0
            for i in range(count - 1):
                k = at + line * apart + i * step
                w, first, second = parts[k + 3 * room], 0.0, 0.0
                for axis in range(3):
                    m = k + axis * room
                    change = parts[m + step] - parts[m]
                    first += abs(change)
                    if i + 2 < count:
                        second += abs(parts[m + 2 * step] - parts[m + step] - change)
                reach += first / w
                bend = max(bend, second / w)
            length = max(length, reach)
        bend = 0.125 * count * count * bend
        if parameter == 0:
            bends, lengths = bend, length
        elif by_length or max(bends, bend) < _FLATTER * max(lengths, length):
            in_u = length >= lengths
        else:
            in_u = bend >= bends
    return in_u


@kernel
def least_along(piece, parts, at, n):
    """The least product of a vector with a control point: no point of the part has a smaller."""
    room, least = np.int64(piece.room), np.inf
    for k in range(at, at + np.int64(piece.points)):
        value = n[0] * parts[k] + n[1] * parts[k + room] + n[2] * parts[k + 2 * room]
        least = min(least, value / parts[k + 3 * room])
    return least
