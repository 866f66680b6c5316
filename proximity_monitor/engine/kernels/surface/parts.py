"""Parts of one element, as seen from a single point: a stack of control nets.

The index in `parts` where its net begins names a part. A net is x w, y w, z w and w of each control
point, one point after the other. The origin is the point that looks. All weights w are positive, so
a control point and its homogeneous coordinates are on the same side of a plane through the origin.
So if only signs matter, nothing is divided by w.

A row of `about` holds what else is known of a part.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.rounding import NET_SPLIT
from ..base.trees import CONVERSION
from ..base.vectors import sub
from .trim import CROSSING, classify_rectangle

EACH = 4
"""Numbers per control point."""

NUMBERS = 1 << 15
"""Room for nets: 64 parts of degrees up to 10 and 10, or 32 of 15 and 15."""

MOST = 64
"""Most parts. Each division adds one, so a part is down to 2^-32 of its element in u and in v."""

EXTENT_U, EXTENT_V, SPLITS, SIDE, LOW_U, HIGH_U, LOW_V, HIGH_V, ABOUT = range(9)
"""A row of `about`: how much the part extends (see `extents_of`); the number of divisions that made
it; what trimming loops leave of it, or of a larger part that holds it: INSIDE, OUTSIDE or CROSSING;
and where it lies on its element, 0 to 1. The last is the length of a row."""

_FLATTER = 1e-3
"""If an element bends by less than this share of its length, its length tells how to divide it."""


@inlined
def room_of(piece):
    """Return how many parts there is room for."""
    return min(MOST, NUMBERS // (EACH * np.int64(piece.points)))


@inlined
def place_of(piece, k):
    """Return the index where the net of part k begins."""
    return k * EACH * np.int64(piece.points)


@kernel
def take_whole(piece, nets, origin, parts):
    """Write the whole element as part 0, relative to `origin`."""
    room, at = np.int64(piece.room), piece.net
    for k in range(np.int64(piece.points)):
        w = nets[at + 3 * room + k]
        parts[EACH * k] = nets[at + k] - origin[0] * w
        parts[EACH * k + 1] = nets[at + room + k] - origin[1] * w
        parts[EACH * k + 2] = nets[at + 2 * room + k] - origin[2] * w
        parts[EACH * k + 3] = w


@kernel
def margin_of(tree, piece, origin, splits):
    """Return the error of a part's control points, metres: from rounding, here and in the element.

    Moving the origin by o errs by 2 u (P + |o|) in each coordinate, P being the largest norm of a
    control point. A product with a unit vector errs by 3 u of its terms. 8 NET_SPLIT is more than
    both.
    """
    size = tree.scale[2] + abs(origin[0]) + abs(origin[1]) + abs(origin[2])
    return margin_about(tree.scale, piece, size, splits)


@inlined
def margin_about(scale, piece, size, splits):
    """As `margin_of`, from a tree's scale and the sum of all sizes, metres."""
    degree = max(piece.degree_u, piece.degree_v)
    return NET_SPLIT * (degree * splits + 8) * size + scale[CONVERSION]


@inlined
def lines_of(piece, in_u):
    """Return the lines of control points along a parameter: how many, two strides, points per line.

    The strides, in numbers, are from line to line, and from point to point.
    """
    p, n = np.int64(piece.degree_u), np.int64(piece.degree_v) + 1
    return (n, EACH, EACH * n, p + 1) if in_u else (p + 1, EACH * n, EACH, n)


@kernel
def divide(piece, parts, at, high, in_u):
    """Divide a part: its low half takes its place, and the high half is written to `high`."""
    lines, apart, step, count = lines_of(piece, in_u)
    for line in range(lines):
        one, other = at + line * apart, high + line * apart
        for i in range(count):
            for c in range(EACH):
                parts[other + i * step + c] = parts[one + i * step + c]
        # The first points of each level of midpoints are points of the low half.
        for level in range(1, count):
            for i in range(count - level):
                k = other + i * step
                for c in range(EACH):
                    parts[k + c] = 0.5 * (parts[k + c] + parts[k + step + c])
            for c in range(EACH):
                parts[one + level * step + c] = parts[other + c]


@inlined
def _point(parts, k):
    """Return a control point, projected."""
    inverse = 1.0 / parts[k + 3]
    return (parts[k] * inverse, parts[k + 1] * inverse, parts[k + 2] * inverse)


@inlined
def corner_of(piece, parts, at, i):
    """Return corner i, 0 to 3, of a part: u is low in 0 and 1, v is low in 0 and 2."""
    n, p = np.int64(piece.degree_v) + 1, np.int64(piece.degree_u)
    return _point(parts, at + EACH * ((p * n if i >= 2 else 0) + (n - 1 if i % 2 == 1 else 0)))


@kernel
def extents_of(piece, parts, at, by_length):
    """Return how much a part extends along u and along v, and the share that a division leaves.

    A part is divided where it extends more. Its extent is how much it bends, of which a division
    leaves a quarter. If `by_length`, or if the part bends little, the extent is its length. Both
    are measured with projected points, because homogeneous ones change with their weights, however
    near a pole.
    """
    u = v = long_u = long_v = 0.0
    for parameter in range(2):
        lines, apart, step, count = lines_of(piece, parameter == 1)
        bend = length = 0.0
        for line in range(lines):
            reach, here = 0.0, _point(parts, at + line * apart)
            before = here
            for i in range(1, count):
                there = _point(parts, at + line * apart + i * step)
                change = sub(there, here)
                reach += abs(change[0]) + abs(change[1]) + abs(change[2])
                if i > 1:
                    second = sub(change, before)
                    bend = max(bend, abs(second[0]) + abs(second[1]) + abs(second[2]))
                here, before = there, change
            length = max(length, reach)
        v, long_v = u, long_u
        u, long_u = 0.125 * count * count * bend, length
    if by_length or max(u, v) < _FLATTER * max(long_u, long_v):
        return long_u, long_v, 0.5
    # If the part is straight in a direction, its length must shrink too, or parts never get small.
    return max(u, _FLATTER * long_u), max(v, _FLATTER * long_v), 0.25


@kernel
def least_along(piece, parts, at, n):
    """Return the least product of a vector with a control point: no point of the part has less."""
    least, points = np.inf, np.int64(piece.points)
    for i in range(points):
        k = at + EACH * i
        value = n[0] * parts[k] + n[1] * parts[k + 1] + n[2] * parts[k + 2]
        least = min(least, value / parts[k + 3])
    return least


@kernel
def begin_parts(piece, parts, by_length, about):
    """Write the row of part 0, the whole element; return `left` for `halve`."""
    about[0, EXTENT_U], about[0, EXTENT_V], left = extents_of(piece, parts, 0, by_length)
    about[0, SPLITS], about[0, SIDE] = 0.0, float(piece.side)
    about[0, LOW_U] = about[0, LOW_V] = 0.0
    about[0, HIGH_U], about[0, HIGH_V] = 1.0, (1.0 if piece.degree_v > 0 else 0.0)
    return left


@kernel
def halve(piece, parts, about, left, k, top):
    """Divide part k where it extends more: k becomes the low half, part `top` the high half."""
    in_u = about[k, EXTENT_U] >= about[k, EXTENT_V]
    divide(piece, parts, place_of(piece, k), place_of(piece, top), in_u)
    about[k, EXTENT_U if in_u else EXTENT_V] *= left
    about[k, SPLITS] += 1.0
    for i in range(ABOUT):
        about[top, i] = about[k, i]
    low = LOW_U if in_u else LOW_V
    middle = 0.5 * (about[k, low] + about[k, low + 1])
    about[k, low + 1] = about[top, low] = middle


@kernel
def side_of_part(tree, piece, about, k):
    """Return what trimming loops leave of part k: INSIDE, OUTSIDE or CROSSING."""
    if about[k, SIDE] == CROSSING and about[k, SPLITS] > 0.0:
        wide_u, wide_v = piece.high[0] - piece.low[0], piece.high[1] - piece.low[1]
        about[k, SIDE] = classify_rectangle(
            tree.trims,
            piece.patch,
            piece.low[0] + about[k, LOW_U] * wide_u,
            piece.low[1] + about[k, LOW_V] * wide_v,
            piece.low[0] + about[k, HIGH_U] * wide_u,
            piece.low[1] + about[k, HIGH_V] * wide_v,
        )
    return about[k, SIDE]
