"""The point of a surface that is nearest to a given one, as near to it as is asked for.

Parts of elements are bounded by the gap between the point and their control points, along the way
to a near point of the parallelogram that stands for a part. What may hold a point that is nearer by
more than is tolerated is divided. Newton's method makes the upper bound.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import implements, inlined, kernel, shared
from ..base.memory import on_stack, table_on_stack
from ..base.vectors import add, along, cross, dot, norm, scaled, sub
from ..inside import visit
from ..inside.nearest import point_gaps
from .evaluate import jet_at
from .facing import closest_in
from .parts import (
    MOST,
    NUMBERS,
    corner_of,
    divide,
    extents_of,
    least_along,
    margin_of,
    place_of,
    room_of,
    take_whole,
)

Foot = namedtuple("Foot", "place slack share")
"""The query: nothing is looked into that is nearer by less than a share, or some slacks. The answer
is (distance, piece, u, v, least, divisions): the surface is no nearer than the least of what was
left, and it took so many divisions."""

_DIVISIONS = 4096
"""Divisions of an element: around the centre of a sphere all of it is about as near."""

_NEARER = 0.25
"""Share of what is tolerated that a part's corner must be nearer by to begin a local search."""

_NEWTON = 16
_LEAST_STEP = 1e-15
"""Iterations; and the share of the squared distance below which a step's gain is nothing."""


@inlined
def enough(distance, share, slack):
    """The distance from which on nothing nearer than `distance` is looked for."""
    return distance - max(share * distance, 4.0 * slack)


@implements(visit.lane_gaps, Foot)
@inlined
def _lane_gaps(query, nodes, base, x, y, z, margin, gaps):
    point_gaps(nodes, base, x, y, z, margin, gaps)


@implements(visit.limit, Foot)
@inlined
def _limit(query, answer):
    return enough(answer[0], query.share, query.slack)


@kernel
def away_from(piece, parts, at, margin):
    """A lower bound of how far a part is from the origin, and where on it about it is nearest.

    That is told by places from -1 to 1 along the half axes of the parallelogram that stands for it.
    The last number is how far its nearest corner is.
    """
    p, q = corner_of(piece, parts, at, 0), corner_of(piece, parts, at, 1)
    r, s = corner_of(piece, parts, at, 2), corner_of(piece, parts, at, 3)
    near = np.sqrt(min(min(dot(p, p), dot(q, q)), min(dot(r, r), dot(s, s))))
    low, high, right, left = add(p, q), add(r, s), add(q, s), add(p, r)
    centre = scaled(add(low, high), 0.25)
    e, f = scaled(sub(high, low), 0.25), scaled(sub(right, left), 0.25)
    a, b = closest_in(centre, e, f, (0.0, 0.0, 0.0))
    way = along(along(centre, e, a), f, b)
    size = norm(way)
    bound = 0.0
    for attempt in range(2):
        if attempt == 1:  # as where it is beside the part: then its normal may do better
            way = cross(e, f)
            if dot(way, centre) < 0.0:
                way = scaled(way, -1.0)
        length = norm(way)
        if length > 0.0:
            n = scaled(way, 1.0 / length)
            bound = max(bound, least_along(piece, parts, at, n) - margin)
        if bound > 0.5 * size:
            break
    return bound, a, b, near


@kernel
def _by_newton(piece, nets, p, u, v, below):
    """The distance from p, and the parameters, of a point that is nearest among those near by.

    Infinity where the given point is no nearer than `below`.
    """
    squared, damping = np.inf, 0.0
    gu = gv = a = b = c = aa = cc = 0.0
    new_u, new_v = u, v
    for _ in range(_NEWTON):
        place, du, dv, duu, duv, dvv = jet_at(piece, nets, new_u, new_v)
        way = sub(place, p)
        new_squared = dot(way, way)
        if squared == np.inf and not new_squared < below * below:
            break
        if new_squared < squared:
            u, v, squared = new_u, new_v, new_squared
            gu, gv, aa, cc = dot(way, du), dot(way, dv), dot(du, du), dot(dv, dv)
            a, b, c = aa + dot(way, duu), dot(du, dv) + dot(way, duv), cc + dot(way, dvv)
            damping = 0.1 * damping if damping > 1e-6 else 0.0
        else:
            damping = max(1e-3, 10.0 * damping)
        held_u = (u <= 0.0 and gu >= 0.0) or (u >= 1.0 and gu <= 0.0)
        held_v = (v <= 0.0 and gv >= 0.0) or (v >= 1.0 and gv <= 0.0)
        step_u = step_v = 0.0
        while True:
            d, f = a + damping * aa, c + damping * cc
            under = d * f - b * b
            if not held_u and not held_v and d > 0.0 and under > 1e-14 * d * f:
                step_u, step_v = (b * gv - f * gu) / under, (b * gu - d * gv) / under
            elif held_v and not held_u and d > 0.0:
                step_u = -gu / d
            elif held_u and not held_v and f > 0.0:
                step_v = -gv / f
            elif not (held_u and held_v) and damping < 1e9:
                damping = max(1e-3, 10.0 * damping)
                continue
            break
        new_u, new_v = min(max(u + step_u, 0.0), 1.0), min(max(v + step_v, 0.0), 1.0)
        gain = -gu * (new_u - u) - gv * (new_v - v)
        if not gain > _LEAST_STEP * squared:
            break
    return np.sqrt(squared), u, v


@implements(visit.meet, Foot)
@shared
def foot_in(query, tree, t, answer):
    """The answer when an element has been looked into as well."""
    distance, nearest, best_u, best_v, least, cost = answer
    if t == nearest:
        return answer  # it was looked into
    piece, nets, p, share, slack = (
        tree.pieces[t], tree.nets, query.place, query.share, query.slack
    )  # fmt: skip
    parts, bounds = on_stack(NUMBERS, 0.0), on_stack(MOST, 0.0)
    splits, spans = on_stack(MOST, np.int64(0)), table_on_stack(MOST, 4, 0.0)
    extents = table_on_stack(MOST, 2, 0.0)
    take_whole(piece, nets, p, parts)
    extents[0, 0], extents[0, 1], left = extents_of(piece, parts, False)
    spans[0, 0] = spans[0, 2] = 0.0
    spans[0, 1], spans[0, 3] = 1.0, (1.0 if piece.degree_v > 0 else 0.0)
    splits[0] = 0
    top, room, divisions, fresh = 1, room_of(piece), 0, 1
    while top > 0:
        # Those that were not yet bounded: the whole, or both halves of what was divided.
        for k in range(top - fresh, top):
            span = spans[k]
            margin = margin_of(tree, piece, p, splits[k])
            bounds[k], a, b, near = away_from(piece, parts, place_of(piece, k), margin)
            below = enough(distance, share, slack)
            # A point is looked for where a corner says that there is a nearer one.
            if bounds[k] >= below or (
                divisions > 0 and near > distance - _NEARER * (distance - below)
            ):
                continue
            u = 0.5 * ((span[0] + span[1]) + a * (span[1] - span[0]))
            v = 0.5 * ((span[2] + span[3]) + b * (span[3] - span[2]))
            u, v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
            found, u, v = _by_newton(piece, nets, p, u, v, distance)
            if found < distance:
                distance, nearest, best_u, best_v = found, np.int64(t), u, v
        fresh = 0
        k = top - 1
        if bounds[k] >= enough(distance, share, slack):
            top -= 1
            continue
        if top >= room or divisions >= _DIVISIONS:
            least = min(least, bounds[k])
            top -= 1
            continue
        at = place_of(piece, k)
        in_u = extents[k, 0] >= extents[k, 1]
        divide(piece, parts, at, place_of(piece, top), in_u)
        extents[k, 0 if in_u else 1] *= left
        extents[top, 0], extents[top, 1] = extents[k, 0], extents[k, 1]
        divisions += 1
        splits[k] += 1
        splits[top] = splits[k]
        for i in range(4):
            spans[top, i] = spans[k, i]
        first = 0 if in_u else 2
        middle = 0.5 * (spans[k, first] + spans[k, first + 1])
        spans[k, first + 1] = spans[top, first] = middle
        top += 1
        fresh = 2
    return distance, nearest, best_u, best_v, least, cost + divisions
