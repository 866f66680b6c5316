"""The foot: the point of a surface that is nearest to a given point, to within a tolerance.

A piece is bounded by the gap between the point and the piece's control points, along the way to a
near point of the parallelogram that stands for the piece. If a piece may hold a point that is
nearer by more than the tolerance, Newton's method and Taylor's formula mostly settle it (see
minimum.py); otherwise its control points are divided. If loops cross a part, either the distance
falls all over the part, so that only its edges count, which are elements of their own, or the part
is divided.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import implements, inlined, kernel, shared
from ..base.lanes import least_beyond
from ..base.memory import on_stack, table_on_stack
from ..base.rounding import DOUBLE_EPS
from ..base.trees import NONE
from ..base.vectors import along, dot, norm, scaled, sub
from ..inside import visit
from ..inside.nearest import point_gaps
from ..inside.visit import descend
from .edges import point_on
from .facing import closest_in, vector
from .limits import limits_in, limits_of, limits_of_part
from .minimum import Rectangle, half_of, minimum_in
from .part import away_from, leads_to_edges
from .parts import (
    ABOUT,
    EXTENT_U,
    EXTENT_V,
    HIGH_U,
    HIGH_V,
    LOW_U,
    LOW_V,
    MOST,
    NUMBERS,
    SPLITS,
    begin_parts,
    extents_of,
    halve,
    margin_of,
    place_of,
    room_of,
    side_of_part,
    take_whole,
)
from .sides import is_within_trim
from .square import is_beyond
from .trim import CROSSING, OUTSIDE

Foot = namedtuple("Foot", "place slack share spare finest")
"""The query. The search ignores points that are nearer than the distance found by less than the
tolerance: a `share` of the distance, `spare` metres or `finest` metres (what bounds resolve),
whichever is largest. The answer is (distance, piece, u, v, least, cost): the parts that were left
undivided are no nearer than `least`, and `cost` counts divisions and proofs. A search may begin
with a point of a piece that it has not looked into yet; the answer then holds ~piece."""

_PATIENCE, _GROWTH = 4096, 12
"""The cost above which the finest tolerance grows, and the power of the cost by which it grows. So
every search ends: from the centre of a sphere, all of the sphere is about equally near."""

_NEARER = 0.25
"""An edge is divided only if its bend exceeds this share of the tolerance."""

_RECTANGLES, _FEW, _EVERY = 16, 4, 4
"""Most rectangles of a piece that are looked at before its control points are divided; the same of
a part. After the first divisions, parts are looked at in this way only after every so many further
divisions: near a pole only control points help."""

UNDIVIDED = 128
"""Most rectangles of a piece that are looked at if control points are not divided."""

_LOOKS, _CHORDS = 256, 64
"""Most looks at parts of an edge, and most parts that may wait."""

_TOLD = 2.0**-52
"""The shortest parameter stretch, in 0 to 1, whose ends float64 holds wherever halving puts it."""

FAR = 1e150
"""Metres: larger than any distance."""


_TURN, _LOOK = 4, 2
"""Steps of a descent until the cost of its elements is counted; and steps that a look takes."""


@inlined
def _spared(query, cost):
    """Return the metres that are tolerated at a cost."""
    return max(query.spare, max(cost / _PATIENCE, 1.0) ** _GROWTH * query.finest)


@inlined
def enough(query, answer):
    """Return the distance, metres, from which on nothing is looked for."""
    return answer[0] - max(query.share * answer[0], _spared(query, answer[5]))


@inlined
def unlooked(distance, piece, u, v):
    """Return the answer to begin with: no point, or a point of a piece still to be looked into."""
    return distance, ~np.int64(piece), u, v, np.inf, np.int64(0)


@inlined
def look_for(query, tree, answer, top, stack, bounds, found, steps):
    """Continue a search for about `steps` steps: (answer, how many are open, steps left)."""
    while top > 0 and steps > 0:  # in turns: the steps of an element are known only afterwards
        turn, before = min(steps, _TURN), answer[5]
        answer, top, left = descend(query, tree, answer, top, stack, bounds, found, turn)
        steps -= turn - left + _LOOK * (answer[5] - before)
    return answer, top, max(steps, 0)


@inlined
def bounded(query, answer):
    """Return the nearest piece of an answer, and a lower bound of the distance, metres."""
    least = min(answer[4], answer[0] - max(query.share * answer[0], _spared(query, 0)))
    return max(answer[1], ~answer[1]), max(least, 0.0)


@implements(visit.lane_gaps, Foot)
@inlined
def _lane_gaps(query, nodes, base, x, y, z, margin, gaps):
    point_gaps(nodes, base, x, y, z, margin, gaps)


@implements(visit.limit, Foot)
@inlined
def _limit(query, answer):
    return enough(query, answer)


@implements(visit.meet, Foot)
@shared
def foot_in(query, tree, t, answer):
    """Return the answer with an element looked into as well."""
    piece, first = tree.pieces[t], answer[5]
    if piece.edge != NONE:
        answer = _foot_on_edge(query, tree, t, answer)
    elif t != answer[1]:  # else it has been looked into
        if answer[0] >= FAR and piece.side == CROSSING:  # any of its points is better than none
            nearest = np.int64(piece.face)
            u, v = 0.5, (0.5 if tree.pieces[nearest].degree_v > 0 else 0.0)
            distance = norm(sub(point_on(tree, nearest, u, v), query.place))
            answer = distance, ~nearest, u, v, answer[4], first
        most = 1 if piece.side == CROSSING else _RECTANGLES
        done, answer = look_at_whole(query, tree, t, answer, most)
        if not done:
            answer = _look_at_parts(query, tree, t, answer)
    if answer[5] > _PATIENCE:  # the tolerance has grown beyond that of the query
        distance, nearest, u, v, least, cost = answer
        answer = distance, nearest, u, v, min(least, enough(query, answer)), cost
    return answer


@inlined
def _costing(answer, more):
    """Return an answer with `more` added to its cost."""
    distance, nearest, u, v, least, cost = answer
    return distance, nearest, u, v, least, cost + more


@kernel
def _improved(query, tree, t, answer, limits, at, u, v):
    """Look for a minimum in a rectangle of piece t, from u, v on.

    Returns the bound, the u and v where the search has led, the rectangle that is left, whether to
    halve it in u, and the answer.
    """
    distance, nearest, best_u, best_v, least, cost = answer
    found, u, v, bound, at, in_u = minimum_in(
        tree.pieces[t], tree.nets, limits, query.place, at, u, v, distance,
        query.share, _spared(query, cost), query.slack,
    )  # fmt: skip
    if found < distance and is_within_trim(tree, t, (u, v, 0.0)):
        distance, nearest, best_u, best_v = found, np.int64(t), u, v
    return bound, u, v, at, in_u, (distance, nearest, best_u, best_v, least, cost + 1)


@kernel
def look_at_whole(query, tree, t, answer, most):
    """Return whether a piece is settled without dividing control points, and the answer then.

    Looks at no more than `most` of its rectangles, and no more than UNDIVIDED.
    """
    piece, p = tree.pieces[t], query.place
    below = enough(query, answer)
    centre, e, f = sub(vector(piece.centre), p), vector(piece.along_u), vector(piece.along_v)
    a, b = closest_in(centre, e, f, (0.0, 0.0, 0.0))
    way = along(along(centre, e, a), f, b)
    length = norm(way)
    if below < FAR and length > 0.0:
        n = scaled(way, (1.0 - 4.0 * DOUBLE_EPS) / length)
        plane = dot(n, p) + (max(below, 0.0) + margin_of(tree, piece, p, 0))
        room = np.int64(piece.room)
        if least_beyond(tree.nets, piece.net, room, n[0], n[1], n[2], -plane) >= 0.0:
            return True, answer
    whole = Rectangle(0.0, 1.0, 0.0, 1.0 if piece.degree_v > 0 else 0.0)
    u, v = 0.5 + 0.5 * a, 0.5 + 0.5 * b
    return _look_at_rectangle(query, tree, t, answer, limits_of(piece), whole, u, v, most)


@kernel
def _look_at_rectangle(query, tree, t, answer, limits, at, u, v, most):
    """As `look_at_whole`, for one rectangle of a piece, divided into no more than `most`.

    The search for minima begins at u, v.
    """
    stack = table_on_stack(UNDIVIDED, 6, 0.0)
    _put(stack, 0, at)
    stack[0, 4], stack[0, 5] = u, v
    top = looks = 1
    while top > 0:
        top -= 1
        row = stack[top]
        at = Rectangle(row[0], row[1], row[2], row[3])
        bound, u, v, at, in_u, answer = _improved(
            query, tree, t, answer, limits, at, row[4], row[5]
        )
        if bound >= enough(query, answer):
            continue
        if looks >= most or bound == -np.inf:
            return False, answer
        low = (u <= 0.5 * (at.low_u + at.high_u)) if in_u else (v <= 0.5 * (at.low_v + at.high_v))
        _put(stack, top, half_of(at, 1 if low else 0, in_u))
        _put(stack, top + 1, half_of(at, 0 if low else 1, in_u))  # this half comes first
        stack[top + 1, 4], stack[top + 1, 5] = u, v
        top += 2
        looks += 2
    return True, answer


@inlined
def _put(stack, k, at):
    """Write a rectangle and its middle to row k."""
    stack[k, 0], stack[k, 1], stack[k, 2], stack[k, 3] = at.low_u, at.high_u, at.low_v, at.high_v
    stack[k, 4], stack[k, 5] = 0.5 * (at.low_u + at.high_u), 0.5 * (at.low_v + at.high_v)


@kernel
def _look_at_parts(query, tree, t, answer):
    """Return the answer with a piece looked into, divided where needed."""
    piece, p = tree.pieces[t], query.place
    parts, bounds = on_stack(NUMBERS, 0.0), on_stack(MOST, 0.0)
    about = table_on_stack(MOST, ABOUT, 0.0)
    take_whole(piece, tree.nets, p, parts)
    begin_parts(piece, parts, True, about)
    if piece.side == CROSSING and leads_to_edges(
        piece, parts, 0, about[0], margin_of(tree, piece, p, 0)
    ):
        return answer
    if is_beyond(piece, parts, 0, enough(query, answer), margin_of(tree, piece, p, 0)):
        return answer
    top, room = 1, room_of(piece)
    bounds[0] = -np.inf
    while top > 0:
        k = top - 1
        if bounds[k] >= enough(query, answer):
            top -= 1
            continue
        if top >= room:
            distance, nearest, u, v, least, cost = answer
            answer = distance, nearest, u, v, min(least, bounds[k]), cost
            top -= 1
            continue
        answer = _costing(answer, 1)
        # Divide a part where it is longer itself: near a pole all parts are equally near, however
        # thin.
        about[k, EXTENT_U], about[k, EXTENT_V], left = extents_of(
            piece, parts, place_of(piece, k), True
        )
        halve(piece, parts, about, left, k, top)
        top += 1
        for half in range(k, top):
            bounds[half], answer = _look_at_part(query, tree, t, answer, parts, about, half)
    return answer


@kernel
def _look_at_part(query, tree, t, answer, parts, about, k):
    """Return a lower bound of the distance to a part, infinity if it is settled; and the answer."""
    piece, row, at = tree.pieces[t], about[k], place_of(tree.pieces[t], k)
    margin = margin_of(tree, piece, query.place, np.int64(row[SPLITS]))
    bound, a, b = away_from(piece, parts, at, margin)
    if bound >= enough(query, answer):
        return bound, answer
    side = side_of_part(tree, piece, about, k)
    if side == OUTSIDE:
        return np.inf, answer
    if side == CROSSING and leads_to_edges(piece, parts, at, row, margin):
        return np.inf, answer
    if is_beyond(piece, parts, at, enough(query, answer), margin):
        return np.inf, answer
    splits = np.int64(row[SPLITS])
    if splits > _EVERY and splits % _EVERY != 0:
        return bound, answer
    most = 1 if side == CROSSING else _FEW
    low_u, high_u, low_v, high_v = row[LOW_U], row[HIGH_U], row[LOW_V], row[HIGH_V]
    # A shorter stretch may have been rounded to a different one: see `is_halved`.
    if high_u - low_u < _TOLD or (piece.degree_v > 0 and high_v - low_v < _TOLD):
        return bound, answer
    limits = limits_in(limits_of_part(piece, parts, at, margin), high_u - low_u, high_v - low_v)
    u = 0.5 * ((low_u + high_u) + a * (high_u - low_u))
    v = 0.5 * ((low_v + high_v) + b * (high_v - low_v))
    place = Rectangle(low_u, high_u, low_v, high_v)
    done, answer = _look_at_rectangle(query, tree, t, answer, limits, place, u, v, most)
    return np.inf if done else bound, answer


@kernel
def _foot_on_edge(query, tree, t, answer):
    """As `foot_in`, of an edge. A part of length h, of 0..1, lies within h² `bend` of the chord."""
    piece, p = tree.pieces[t], query.place
    margin = margin_of(tree, piece, p, 0)
    stack = table_on_stack(_CHORDS, 8, 0.0)
    first, last = sub(point_on(tree, t, 0.0, 0.0), p), sub(point_on(tree, t, 1.0, 0.0), p)
    _put_chord(stack, 0, 0.0, 1.0, first, last)
    top, looks = 1, 0
    while top > 0:
        top -= 1
        looks += 1
        low, high = stack[top, 0], stack[top, 1]
        first = stack[top, 2], stack[top, 3], stack[top, 4]
        last = stack[top, 5], stack[top, 6], stack[top, 7]
        way = sub(last, first)
        square = dot(way, way)
        s = min(max(-dot(first, way) / square, 0.0), 1.0) if square > 0.0 else 0.0
        bend = piece.bend * (high - low) * (high - low)
        bound = norm(along(first, way, s)) - bend - margin
        if bound >= enough(query, answer):
            continue
        u = low + s * (high - low)
        found = norm(sub(point_on(tree, t, u, 0.0), p))
        distance, nearest, best_u, best_v, least, cost = answer
        if found < distance:
            answer = found, np.int64(t), u, 0.0, least, cost
        spare = answer[0] - enough(query, answer)
        if bend > _NEARER * spare and top + 2 <= _CHORDS and looks < _LOOKS:
            middle = 0.5 * (low + high)
            between = sub(point_on(tree, t, middle, 0.0), p)
            # The half that is nearer is looked at first.
            turn = 0 if s > 0.5 else 1
            _put_chord(stack, top + turn, low, middle, first, between)
            _put_chord(stack, top + 1 - turn, middle, high, between, last)
            top += 2
        else:
            distance, nearest, best_u, best_v, least, cost = answer
            answer = distance, nearest, best_u, best_v, min(least, bound), cost
    return _costing(answer, looks // 4)


@inlined
def _put_chord(stack, k, low, high, first, last):
    stack[k, 0], stack[k, 1] = low, high
    stack[k, 2], stack[k, 3], stack[k, 4] = first
    stack[k, 5], stack[k, 6], stack[k, 7] = last
