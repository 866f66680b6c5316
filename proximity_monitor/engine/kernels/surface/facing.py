"""Where two cells face each other: near points of the parallelograms that stand for them.

These give a direction along which the cells' control points are compared, and parameters to begin
a local search with. Nothing certain depends on either: a poor direction makes a weaker bound.
"""

from __future__ import annotations

from ..base.jit import inlined, kernel
from ..base.vectors import along, dot, moved, rotated, sub

_SWEEPS = 3
"""Rounds of coordinate descent. Two cost six times as many divisions on near offsets."""


@kernel
def vector(field):
    """Three numbers of a record as a vector."""
    return (field[0], field[1], field[2])


@inlined
def _step(way, axis, squared, at, sign):
    """The best place in -1..1 along one half axis, and the way from there; `sign` is that of it."""
    # way = ... + sign * at * axis; its length is least where its product with the axis vanishes.
    if squared <= 0.0:
        return at, way
    best = at - sign * dot(way, axis) / squared
    best = min(max(best, -1.0), 1.0)
    return best, along(way, axis, sign * (best - at))


@kernel
def parallelograms(cell_a, cell_b, motion):
    """Near points of two cells' parallelograms: coordinate descent from their centres.

    Returns the way from that of a to that of b, in a's frame, and the places, -1 to 1, along the
    half axes of each.
    """
    e, f = vector(cell_a.along_u), vector(cell_a.along_v)
    g, h = rotated(motion, vector(cell_b.along_u)), rotated(motion, vector(cell_b.along_v))
    way = sub(moved(motion, vector(cell_b.centre)), vector(cell_a.centre))
    ee, ff, gg, hh = dot(e, e), dot(f, f), dot(g, g), dot(h, h)
    a = b = c = d = 0.0
    for _ in range(_SWEEPS):
        a, way = _step(way, e, ee, a, -1.0)
        b, way = _step(way, f, ff, b, -1.0)
        c, way = _step(way, g, gg, c, 1.0)
        d, way = _step(way, h, hh, d, 1.0)
    return way, (a, b), (c, d)


@kernel
def closest_in(centre, e, f, q):
    """The place, -1 to 1, along both half axes of a parallelogram, of a near point to q."""
    ee, ff = dot(e, e), dot(f, f)
    way = sub(q, centre)
    a = b = 0.0
    for _ in range(_SWEEPS):
        a, way = _step(way, e, ee, a, -1.0)
        b, way = _step(way, f, ff, b, -1.0)
    return a, b


@kernel
def parameters_in(cell, place):
    """The element's parameters at places -1 to 1 along a cell's half axes, as weights."""
    u = 0.5 * ((cell.low[0] + cell.high[0]) + place[0] * (cell.high[0] - cell.low[0]))
    v = 0.5 * ((cell.low[1] + cell.high[1]) + place[1] * (cell.high[1] - cell.low[1]))
    return (min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0), 0.0)
