"""How high an element of a surface reaches within a ball, over a plane or a paraboloid.

The query says over which: its type is from `ball_caps` or from `ball_bowls`.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, shared
from ..base.memory import on_stack, table_on_stack
from ..base.trees import NONE, SurfaceTree
from ..base.vectors import dot, scaled
from ..inside import visit
from ..inside.ball_caps import Cap, leaf_steps
from .part import away_from
from .parts import (
    ABOUT,
    MOST,
    NUMBERS,
    SPLITS,
    begin_parts,
    corner_of,
    halve,
    least_along,
    margin_of,
    place_of,
    room_of,
    side_of_part,
    take_whole,
)
from .trim import CROSSING, INSIDE, OUTSIDE

_DIVISIONS = 256
"""Most divisions of an element; after that, open parts count by their control points."""

_STEPS = 32
"""Looking into an element takes as long as this many steps, on average."""


@implements(leaf_steps, SurfaceTree)
@inlined
def _leaf_steps(tree):
    return _STEPS


def highest(query, piece, parts, at, margin):
    """Return an upper bound of the height of a part, found fast: a stub."""


def between(query, piece, parts, at, margin, high, crossing):
    """Return two heights: one that all points of a part reach, and a bound, at most `high`: a stub.

    The first matters only if loops cross the part.
    """


def height_at(query, d):
    """Return the height of a point d from the query's place: a stub."""


@implements(highest, Cap)
@inlined
def _highest(query, piece, parts, at, margin):
    return margin - least_along(piece, parts, at, scaled(query.normal, -1.0))


@implements(between, Cap)
@inlined
def _between(query, piece, parts, at, margin, high, crossing):
    return (least_along(piece, parts, at, query.normal) if crossing else -np.inf), high


@implements(height_at, Cap)
@inlined
def _height_at(query, d):
    return dot(query.normal, d)


@shared
def height_in(query, tree, t, answer):
    """Return the height with an element looked into as well."""
    o, radius, top, fine = query.place, query.radius, query.top, query.fine
    piece = tree.pieces[t]
    if piece.edge != NONE:
        return answer  # an edge lies on pieces of its patch
    parts, about = on_stack(NUMBERS, 0.0), table_on_stack(MOST, ABOUT, 0.0)
    take_whole(piece, tree.nets, o, parts)
    left = begin_parts(piece, parts, False, about)
    count, room, divisions = 1, room_of(piece), 0
    seen, square = query.spare, radius * radius
    while count > 0:
        k = count - 1
        at = place_of(piece, k)
        margin = margin_of(tree, piece, o, np.int64(about[k, SPLITS]))
        high = highest(query, piece, parts, at, margin)
        if high <= answer:
            count -= 1
            continue
        bound, _, _ = away_from(piece, parts, at, margin)
        if bound >= radius:
            count -= 1
            continue
        side = side_of_part(tree, piece, about, k)
        if side == OUTSIDE:
            count -= 1
            continue
        if side == INSIDE:
            for i in range(4):
                corner = corner_of(piece, parts, at, i)
                if dot(corner, corner) < square:
                    seen = max(seen, height_at(query, corner))
        if seen > top:
            return np.inf
        crossing = side == CROSSING
        low, high = between(query, piece, parts, at, margin, high, crossing)
        enough = max(seen, low) if crossing else seen  # the whole part is that high, loops or not
        if high <= enough + fine or count >= room or divisions >= _DIVISIONS:
            answer = max(answer, high)
            if answer > top:
                return np.inf
            count -= 1
            continue
        halve(piece, parts, about, left, k, count)
        divisions += 1
        count += 1
    return answer


implements(visit.meet, Cap, SurfaceTree)(height_in)
