"""The point of a surface that is nearest to a given one, as near to it as is asked for.

Parts of elements are bounded by the gap between the point and their control points, along the way
to a near point of the parallelogram that stands for a part. What may hold a point that is nearer by
more than is tolerated is divided. Newton's method makes the upper bound. Where loops cross a part,
either its distance falls all over it, so that only its edges count, which are elements of their
own, or it is divided.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import implements, inlined, kernel, shared
from ..base.memory import on_stack, table_on_stack
from ..base.state import NONE
from ..base.vectors import add, along, cross, dot, norm, scaled, sub
from ..inside import visit
from ..inside.nearest import point_gaps
from .edges import point_on
from .evaluate import jet_at
from .facing import closest_in
from .parts import (
    ABOUT,
    EACH,
    HIGH_U,
    HIGH_V,
    LOW_U,
    LOW_V,
    MOST,
    NUMBERS,
    SPLITS,
    begin_parts,
    corner_of,
    halve,
    least_along,
    lines_of,
    margin_of,
    place_of,
    room_of,
    side_of_part,
    take_whole,
)
from .sides import is_left
from .trim import CROSSING, INSIDE, OUTSIDE

Foot = namedtuple("Foot", "place slack share")
"""The query: nothing is looked into that is nearer by less than a share, or some slacks. The answer
is (distance, piece, u, v, least, divisions): the surface is no nearer than the least of what was
left, and it took so many divisions."""

_DIVISIONS = 4096
"""Divisions of an element: around the centre of a sphere all of it is about as near."""

_NEARER = 0.25
"""Share of what is tolerated that a part's corner must be nearer by to begin a local search."""

_LOOKS, _CHORDS = 256, 64
"""Looks at parts of an edge, and how many of them may wait."""

FAR = 1e150
"""Metres: farther than anything is."""

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
    piece, nets, p, share, slack = (
        tree.pieces[t], tree.nets, query.place, query.share, query.slack
    )  # fmt: skip
    if piece.edge != NONE:
        return _foot_on_edge(query, tree, t, answer)
    if t == nearest:
        return answer  # it was looked into
    if distance >= FAR and piece.side == CROSSING:  # any of its points is better than none
        nearest = np.int64(piece.face)
        best_u, best_v = 0.5, (0.5 if tree.pieces[nearest].degree_v > 0 else 0.0)
        distance = norm(sub(point_on(tree, nearest, best_u, best_v), p))
    parts, bounds = on_stack(NUMBERS, 0.0), on_stack(MOST, 0.0)
    about = table_on_stack(MOST, ABOUT, 0.0)
    take_whole(piece, nets, p, parts)
    left = begin_parts(piece, parts, False, about)
    top, room, divisions, fresh = 1, room_of(piece), 0, 1
    while top > 0:
        # Those that were not yet bounded: the whole, or both halves of what was divided.
        for k in range(top - fresh, top):
            row = about[k]
            margin = margin_of(tree, piece, p, np.int64(row[SPLITS]))
            bounds[k], a, b, near = away_from(piece, parts, place_of(piece, k), margin)
            below = enough(distance, share, slack)
            if bounds[k] >= below:
                continue
            side = side_of_part(tree, piece, about, k)
            if side == OUTSIDE:
                bounds[k] = np.inf
                continue
            if side == CROSSING and _leads_to_edges(piece, parts, place_of(piece, k), row, margin):
                bounds[k] = np.inf
                continue
            # A point is looked for where a corner says that there is a nearer one.
            if divisions > 0 and (side != INSIDE or near > distance - _NEARER * (distance - below)):
                continue
            u = 0.5 * ((row[LOW_U] + row[HIGH_U]) + a * (row[HIGH_U] - row[LOW_U]))
            v = 0.5 * ((row[LOW_V] + row[HIGH_V]) + b * (row[HIGH_V] - row[LOW_V]))
            u, v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
            found, u, v = _by_newton(piece, nets, p, u, v, distance)
            if found < distance and is_left(tree, t, (u, v, 0.0)):
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
        halve(piece, parts, about, left, k, top)
        divisions += 1
        top += 1
        fresh = 2
    return distance, nearest, best_u, best_v, least, cost + divisions


@kernel
def _leads_to_edges(piece, parts, at, row, margin):
    """Whether every point of a part can be moved on its piece so that it comes nearer.

    Then no inner point of what loops leave of it is the nearest (see falling.py). About the part's
    centre c, w r' = N' - w' (r - c) with N = w (P - c), as there.
    """
    centre = (0.0, 0.0, 0.0)
    for i in range(4):
        centre = along(centre, corner_of(piece, parts, at, i), 0.25)
    square, heavy = 0.0, 0.0
    for i in range(np.int64(piece.points)):
        k = at + EACH * i
        w = parts[k + 3]
        d = sub((parts[k] / w, parts[k + 1] / w, parts[k + 2] / w), centre)
        square, heavy = max(square, dot(d, d)), max(heavy, w)
    radius = np.sqrt(square) * (1.0 + 1e-12) + margin
    length = norm(centre) + radius
    for parameter in range(2):
        lines, apart, step, count = lines_of(piece, parameter == 0)
        low, high, turn = np.inf, -np.inf, 0.0
        for line in range(lines):
            for i in range(count - 1):
                k = at + line * apart + i * step
                of_w = parts[k + step + 3] - parts[k + 3]
                d = (
                    parts[k + step] - parts[k] - of_w * centre[0],
                    parts[k + step + 1] - parts[k + 1] - of_w * centre[1],
                    parts[k + step + 2] - parts[k + 2] - of_w * centre[2],
                )
                loss = norm(d) * (radius + 1e-12 * length) + 4.0 * heavy * margin * length
                product = dot(d, centre)
                low, high = min(low, product - loss), max(high, product + loss)
                turn = max(turn, abs(of_w))
        loss = turn * radius * length * (1.0 + 1e-9)
        first = LOW_U if parameter == 0 else LOW_V
        if low > loss and row[first] > 0.0:
            return True
        if high < -loss and row[first + 1] < 1.0:
            return True
    return False


@kernel
def _foot_on_edge(query, tree, t, answer):
    """The same of an edge. A part of length h, of 0..1, lies within h² of `bend` of its chord."""
    distance, nearest, best_u, best_v, least, cost = answer
    piece, p = tree.pieces[t], query.place
    margin = margin_of(tree, piece, p, 0)
    stack = table_on_stack(_CHORDS, 2, 0.0)
    stack[0, 0], stack[0, 1] = 0.0, 1.0
    top, looks = 1, 0
    while top > 0:
        top -= 1
        looks += 1
        low, high = stack[top, 0], stack[top, 1]
        first = sub(point_on(tree, t, low, 0.0), p)
        way = sub(sub(point_on(tree, t, high, 0.0), p), first)
        square = dot(way, way)
        s = min(max(-dot(first, way) / square, 0.0), 1.0) if square > 0.0 else 0.0
        bend = piece.bend * (high - low) * (high - low)
        bound = norm(along(first, way, s)) - bend - margin
        if bound >= enough(distance, query.share, query.slack):
            continue
        u = low + s * (high - low)
        found = norm(sub(point_on(tree, t, u, 0.0), p))
        if found < distance:
            distance, nearest, best_u, best_v = found, np.int64(t), u, 0.0
        tolerated = distance - enough(distance, query.share, query.slack)
        if bend > _NEARER * tolerated and top + 2 <= _CHORDS and looks < _LOOKS:
            middle = 0.5 * (low + high)
            # The half that is nearer is looked at first.
            turn = 0 if s > 0.5 else 1
            stack[top + turn, 0], stack[top + turn, 1] = low, middle
            stack[top + 1 - turn, 0], stack[top + 1 - turn, 1] = middle, high
            top += 2
        else:
            least = min(least, bound)
    return distance, nearest, best_u, best_v, least, cost + looks // 4
