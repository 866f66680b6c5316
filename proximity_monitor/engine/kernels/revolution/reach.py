"""How far parts of a profile reach along vectors of its plane: the support functions of fat arcs.

A part reaches no farther along a vector than its arcs do, and finer arcs give a tighter bound.
Looking into a part takes some thirty arcs from the root down. So the reaches of the largest parts
along a few vectors are stored, those around the square |x| + |z| = 1. A support function is
sublinear: along a vector between two of these a part reaches no more than their interpolation.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import allocating_entry, inlined, kernel
from ..base.memory import on_stack
from ..base.rounding import DOUBLE_EPS
from ..base.trees import NONE, VECTORS

_SIDE = (VECTORS - 1) // 4
"""Vectors on each side of the square for which reaches are stored."""

_PARTS = 64
"""Parts of a profile whose reaches are stored, at most: all its pieces, if these are about 30."""

_ROUNDING = 128.0 * DOUBLE_EPS
"""What rounding does to an interpolated reach, as a share of the largest coordinate P.

The place around the square errs by less than 12 u of a vector of length 1, which changes the reach
of a part by less than 3 P times that. Stored reaches err by less than 32 u P, and the interpolation
by less than 16 u P.
"""

_STACK = 128
"""Room for arcs that wait, twice the depth of a tree."""


@inlined
def arc_at(arcs, own, i):
    """Return arc i of a tree; those in `own` follow the tree's own arcs."""
    # Unsigned, here and below: else numba checks at each access whether an index is negative.
    return arcs[np.uint64(i)] if i < len(arcs) else own[np.uint64(i - len(arcs))]


@inlined
def bulge(arc):
    """Return how far an arc bulges from its chord, metres."""
    half = np.sqrt(arc.half[0] * arc.half[0] + arc.half[1] * arc.half[1])
    return half * abs(arc.sine) / (1.0 + arc.cosine)


@inlined
def _reach(arc, x, z):
    """Return the reach of a fat arc along a vector of the plane."""
    reach = reach_from_middle(arc.half[0], arc.half[1], arc.sine, arc.cosine, x, z)
    return x * arc.middle[0] + z * arc.middle[1] + arc.error * np.sqrt(x * x + z * z) + reach


@inlined
def reach_from_middle(hx, hz, sine, cosine, x, z):
    """Return an arc's reach along a vector from its chord's middle; the numbers are an ARC's."""
    along = x * hx + z * hz
    if sine != 0.0:
        # If the vector is a normal of the arc, the reach is r (|v| - cos(alpha) v . b), with b the
        # unit vector of the bulge and r = half / sin(alpha): written so that nothing cancels if the
        # arc is nearly straight.
        up = hx * z - hz * x
        up, sine = (up, sine) if sine > 0.0 else (-up, -sine)
        if up > 0.0 and abs(along) * cosine <= up * sine:
            half, length = np.sqrt(hx * hx + hz * hz), np.sqrt(x * x + z * z)
            risen = up * sine
            return (along * along + risen * risen) / (sine * (half * length + up * cosine))
    return abs(along)


@inlined
def _around(x, z):
    """Return a vector's place around the square, counted in stored vectors, and its |x| + |z|."""
    size = max(abs(x) + abs(z), 1e-300)
    back = _SIDE * (1.0 - x / size)
    return (back if z >= 0.0 else 4.0 * _SIDE - back), size


@inlined
def _coarse(arcs, own, reaches, i, x, z, place, size):
    """Return a bound of a part's reach without looking into it; `_around` gives place and size."""
    if i >= len(reaches):
        return _reach(arc_at(arcs, own, i), x, z)
    row, k = reaches[np.uint64(i)], min(np.int64(place), np.int64(4 * _SIDE - 1))
    share, k = place - k, np.uint64(k)
    return size * (row[k] + share * (row[k + np.uint64(1)] - row[k]))


@kernel
def _look_into(arcs, own, reaches, i, fine, x, z, place, size, here, floor):
    """Return `reach_of` a part whose coarse bound, `here`, is above the floor."""
    stack, values = on_stack(_STACK, np.int32(0)), on_stack(_STACK, 0.0)
    top, best = 1, floor
    stack[0], values[0] = i, here
    while top > 0:
        top -= 1
        here = values[top]
        if here <= best:
            continue
        i = np.int64(stack[top])
        arc = arc_at(arcs, own, i)
        if arc.error <= fine or arc.child == NONE or top + 2 > _STACK:
            best = max(best, min(here, _reach(arc, x, z)) if i < len(reaches) else here)
            continue
        one, other = np.int64(arc.child), np.int64(arc.child) + 1
        first = _coarse(arcs, own, reaches, one, x, z, place, size)
        second = _coarse(arcs, own, reaches, other, x, z, place, size)
        if first >= second:
            one, other, first, second = other, one, second, first
        stack[top], values[top] = one, first
        stack[top + 1], values[top + 1] = other, second
        top += 2
    return best


@inlined
def _reach_of(arcs, own, reaches, i, fine, x, z, floor):
    place, size = _around(x, z)
    here = _coarse(arcs, own, reaches, i, x, z, place, size)
    if here <= floor:
        return floor
    return _look_into(arcs, own, reaches, i, fine, x, z, place, size, here, floor)


@inlined
def reach_of(tree, own, i, fine, x, z, floor):
    """Return how far a part reaches along a vector, by its arcs with errors below `fine` metres.

    Arcs that reach no farther than others, or than `floor`, are not looked into. If none reaches
    beyond the floor, the result is the floor.
    """
    return _reach_of(tree.arcs, own, tree.reaches, i, fine, x, z, floor)


@inlined
def coarse_of(tree, own, i, x, z):
    """Return how far a part reaches along a vector without looking into it: at least `reach_of`."""
    place, size = _around(x, z)
    return _coarse(tree.arcs, own, tree.reaches, i, x, z, place, size)


@inlined
def most_in(sector, x, y):
    """Return the maximum of (x, y) . u over the unit vectors u of a sector."""
    cosine, sine, far, side = sector
    a, b = x * cosine + y * sine, y * cosine - x * sine
    across = np.sqrt(x * x + y * y)
    return across if a >= across * far else a * far + abs(b) * side


@inlined
def reach_in(tree, own, i, fine, sector, v, floor):
    """Return the reach along a vector of space of an arc that turns about z in a sector.

    The vector's part across z is largest in the half-plane nearest to it, and no arc is beyond the
    axis; so the arc reaches farthest there. See `reach_of`.
    """
    return reach_of(tree, own, i, fine, most_in(sector, v[0], v[1]), v[2], floor)


@inlined
def coarse_in(tree, own, i, sector, v):
    """Return the same without looking into arcs: the bound may be larger."""
    return coarse_of(tree, own, i, most_in(sector, v[0], v[1]), v[2])


@allocating_entry
def take_reaches(arcs, size):
    """Return the reaches of the largest parts of a profile along vectors around the square.

    Args:
        arcs: (k,) ARC, the tree around all.
        size: metres; P of `_ROUNDING`, no less than a control point's coordinates.

    Returns:
        (m, VECTORS) metres, for the tree's first m parts; the last vector is the first again.
    """
    # The halves of a part follow an odd number of parts, so an odd count separates no two halves.
    count = min(len(arcs), _PARTS - 1)
    made, none = np.empty((count, VECTORS)), np.empty((0, VECTORS))
    for i in range(count - 1, -1, -1):
        child = np.int64(arcs[i].child)
        for k in range(VECTORS):
            if NONE < child < count:
                made[i, k] = max(made[child, k], made[child + 1, k])
                continue
            x = abs(2 * _SIDE - k) / _SIDE - 1.0
            z = (1.0 - abs(x)) if k <= 2 * _SIDE else abs(x) - 1.0
            reach = _reach_of(arcs, arcs[:0], none, i, 0.0, x, z, -np.inf)
            made[i, k] = reach + _ROUNDING * size
    return made
