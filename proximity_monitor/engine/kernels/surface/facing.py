"""Where two cells face each other: near points of the parallelograms that stand for them.

These points give a direction along which to compare the cells' control points, and parameters to
begin a local search with. Nothing certain depends on either: a poor direction weakens the bound.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.memory import on_stack, table_on_stack
from ..base.vectors import along, dot, moved, norm, rotated, sub

_SWEEPS = 3
"""Rounds of coordinate descent. With two, near offset surfaces need six times as many divisions."""


_LONG = 4.0
"""A cell is long if it is this many times as long as wide."""

_DEPENDENT = 1e-12
"""An axis counts as dependent on others if no more than this share of its square is left beside
them: that is rounding."""

_NONE = 1e-300
"""Squared lengths below this are taken for this, to divide by."""

_MOST, _INWARD = 16, 1e-9
"""Most changes of the set of held places; and the cosine between the way and an axis above which a
place is let go."""


@kernel
def vector(field):
    """Return three numbers of a record as a vector."""
    return (field[0], field[1], field[2])


@inlined
def _step(way, axis, squared, at, sign):
    """Return the best place in -1..1 along one half axis, and the way from there.

    `sign` is the sign of the axis in the way.
    """
    # way = ... + sign * at * axis; its length is least where its product with the axis vanishes.
    if squared <= 0.0:
        return at, way
    best = at - sign * dot(way, axis) / squared
    best = min(max(best, -1.0), 1.0)
    return best, along(way, axis, sign * (best - at))


@kernel
def parallelograms(cell_a, cell_b, motion):
    """Find near points of two cells' parallelograms by coordinate descent from their centres.

    Returns the way from a's point to b's point, in a's frame, and the places, -1 to 1, along the
    half axes of each parallelogram.
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
    if is_long(ee, ff) or is_long(gg, hh):
        # If both are long, descent takes small steps. A way that is tilted along a cell weakens the
        # bound by the tilt times the cell's length.
        places = on_stack(4, 0.0)
        places[0], places[1], places[2], places[3] = a, b, c, d
        axes = table_on_stack(4, 3, 0.0)
        axes[0, 0], axes[0, 1], axes[0, 2] = -e[0], -e[1], -e[2]
        axes[1, 0], axes[1, 1], axes[1, 2] = -f[0], -f[1], -f[2]
        axes[2, 0], axes[2, 1], axes[2, 2] = g
        axes[3, 0], axes[3, 1], axes[3, 2] = h
        way = _straightened(way, axes, places)
        a, b, c, d = places[0], places[1], places[2], places[3]
    return way, (a, b), (c, d)


@inlined
def is_long(uu, vv):
    """Tell whether a cell is far longer than wide, from the squares of its half axes."""
    return max(uu, vv) > _LONG * _LONG * min(uu, vv)


@kernel
def _straightened(way, axes, places):
    """Return the shortest way between two parallelograms; move their places (4,) along axes (4, 3).

    By an active set (Nocedal and Wright, Numerical Optimization, section 16.5): a place that would
    go beyond an end is held there, one place at a time, and let go if the way becomes shorter
    inwards. The way is normal to the axes of all places that are not held.
    """
    factor, step, held = table_on_stack(4, 4, 0.0), on_stack(4, 0.0), on_stack(4, 0)
    for i in range(4):
        held[i] = 0 if -1.0 < places[i] < 1.0 else 1
    straight = False
    for _ in range(_MOST):
        _put_step(way, axes, held, factor, step)
        share, last = 1.0, -1
        for i in range(4):
            end = 1.0 if step[i] > 0.0 else -1.0
            if abs(places[i] + step[i]) > 1.0 and (end - places[i]) / step[i] < share:
                share, last = (end - places[i]) / step[i], i
        for i in range(4):
            places[i] += share * step[i]
            way = along(way, _axis(axes, i), share * step[i])
        if last >= 0:
            places[last], held[last], straight = 1.0 if step[last] > 0.0 else -1.0, 1, False
            continue
        if not straight:  # once more, for the error that rounding has left
            straight = True
            continue
        worst = _INWARD * norm(way)
        for i in range(4):
            one = _axis(axes, i)
            inward = dot(one, way) * places[i]
            if held[i] != 0 and inward > worst * norm(one):
                worst, last = inward / norm(one), i
        if last < 0:
            break
        held[last], straight = 0, False
    return way


@inlined
def _axis(axes, i):
    return (axes[i, 0], axes[i, 1], axes[i, 2])


@kernel
def _put_step(way, axes, held, factor, step):
    """Write the step to where the way is normal to all axes whose places are not held."""
    for i in range(4):
        one, free = _axis(axes, i), held[i] == 0
        step[i] = -dot(one, way) if free else 0.0
        for j in range(i + 1):
            value = dot(one, _axis(axes, j)) if free else 0.0
            for k in range(j):
                value -= factor[i, k] * factor[j, k]
            if i == j:  # an axis that depends on others, or is zero, gets no step
                factor[i, i] = np.sqrt(value) if value > _DEPENDENT * dot(one, one) else 0.0
            else:
                factor[i, j] = value / factor[j, j] if factor[j, j] > 0.0 else 0.0
        for k in range(i):
            step[i] -= factor[i, k] * step[k]
        step[i] = step[i] / factor[i, i] if factor[i, i] > 0.0 else 0.0
    for i in (3, 2, 1, 0):
        for k in range(i + 1, 4):
            step[i] -= factor[k, i] * step[k]
        step[i] = step[i] / factor[i, i] if factor[i, i] > 0.0 else 0.0


@kernel
def closest_in(centre, e, f, q):
    """Return the places, -1 to 1, along both half axes of a parallelogram's nearest point to q.

    If the nearest point of the whole plane lies outside, the answer is on one of the edges beyond
    which that point lies.
    """
    way = sub(q, centre)
    ee, ff, ef, ew, fw = dot(e, e), dot(f, f), dot(e, f), dot(e, way), dot(f, way)
    of_e, of_f = 1.0 / max(ee, _NONE), 1.0 / max(ff, _NONE)
    area = ee * ff - ef * ef
    if area > _DEPENDENT * ee * ff:
        a, b = (ew * ff - fw * ef) / area, (fw * ee - ew * ef) / area
        if abs(a) <= 1.0 and abs(b) <= 1.0:
            return a, b
    else:
        a, b = ew * of_e, 0.0
    a, b = _within(a), _within(b)
    c, d = _within((ew - b * ef) * of_e), _within((fw - a * ef) * of_f)
    # Half the squared distance from q, less the terms that both have in common.
    one = a * (0.5 * a * ee - ew) + d * (0.5 * d * ff - fw + a * ef)
    other = c * (0.5 * c * ee - ew) + b * (0.5 * b * ff - fw + c * ef)
    return (a, d) if one <= other else (c, b)


@inlined
def _within(at):
    return min(max(at, -1.0), 1.0)


@kernel
def parameters_in(cell, place):
    """Return the element's parameters, as weights, at places -1 to 1 along a cell's half axes."""
    u = 0.5 * ((cell.low[0] + cell.high[0]) + place[0] * (cell.high[0] - cell.low[0]))
    v = 0.5 * ((cell.low[1] + cell.high[1]) + place[1] * (cell.high[1] - cell.low[1]))
    return (min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0), 0.0)
