"""The tree of fat arcs around a profile."""

from __future__ import annotations

import numpy as np

from ..base.jit import allocating_entry, inlined
from ..base.trees import ARC, NONE
from .arcs import fit_arc, hold
from .profile import size_of_part

MOST = 1 << 16
"""Arcs that a tree has before its pieces are no longer halved."""

_FAR = 2.0
"""Control points of the part of an arc are not farther away than so many sizes. So the margins of
points, MARGIN in meridian.py, hold for them as well."""

NARROW = 1e-12
"""A part of a piece is not halved if its range of the parameter is no longer than this."""


@inlined
def put_halves(arc, one, other):
    """Make two arcs stand for the halves of an arc's part; the caller has to fit them."""
    middle = 0.5 * (arc.low + arc.high)
    one.curve = other.curve = arc.curve
    one.low, one.high = arc.low, middle
    other.low, other.high = middle, arc.high
    one.child = other.child = NONE


@allocating_entry
def build_arcs(curves, size, precision):
    """Build the tree of fat arcs around the pieces of a profile; the first arc holds all of them.

    Args:
        curves: (c,) CURVE_PIECE, one after the other along the profile.
        size: metres; no less than the largest coordinate of a point of the profile.
        precision: metres; arcs are halved down to this error, and until the control points of their
            parts are not much farther away than the profile.

    Returns:
        (k,) ARC. The two halves of an arc are adjacent.
    """
    room = 4 * len(curves) + 256
    arcs, spans = np.empty(room, ARC), np.empty((room, 2), np.int64)
    spans[0, 0], spans[0, 1] = 0, len(curves)
    count, at = 1, 0
    arcs[0].low, arcs[0].high, arcs[0].curve, arcs[0].child = 0.0, 1.0, 0, NONE
    while at < count:
        if count + 2 > room:
            more, wider = np.empty(2 * room, ARC), np.empty((2 * room, 2), np.int64)
            for i in range(room):
                more[i], wider[i, 0], wider[i, 1] = arcs[i], spans[i, 0], spans[i, 1]
            arcs, spans, room = more, wider, 2 * room
        arc, first, end = arcs[at], spans[at, 0], spans[at, 1]
        if end - first > 1:
            hold(curves, first, end, size, arc)
            middle = (first + end) // 2
            for k in range(2):
                half = arcs[count + k]
                spans[count + k, 0] = first if k == 0 else middle
                spans[count + k, 1] = middle if k == 0 else end
                half.curve, half.child = np.int32(spans[count + k, 0]), NONE
                half.low, half.high = 0.0, 1.0
            arc.child = np.int32(count)
            count += 2
        else:
            curve = curves[first]
            fit_arc(curve, arc.low, arc.high, size, arc)
            wide = arc.high - arc.low > NARROW
            coarse = arc.error > precision
            coarse = coarse or size_of_part(curve, arc.low, arc.high, size) > _FAR * size
            if coarse and wide and count + 2 <= MOST:
                arc.child = np.int32(count)
                put_halves(arc, arcs[count], arcs[count + 1])
                for k in range(2):
                    spans[count + k, 0], spans[count + k, 1] = first, end
                count += 2
        at += 1
    return arcs[:count].copy()
