"""How high an element of a surface reaches within a ball, as `ball_caps.cap_height` asks."""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, shared
from ..base.memory import on_stack, table_on_stack
from ..base.state import NONE, SurfaceTree
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
"""Divisions of an element: what is open then counts with its control points."""

_FINE_SPARE, _FINE_TOP = 0.25, 0.02
"""Shares of what a plane may give away, and of the height up to which it is of use: so much higher
than its points an element's control points may count as."""


_STEPS = 32
"""Steps that looking into an element takes as long as, on average."""


@implements(leaf_steps, SurfaceTree)
@inlined
def _leaf_steps(tree):
    return _STEPS


@implements(visit.meet, Cap, SurfaceTree)
@shared
def _height(query, tree, t, answer):
    """The height when an element has been looked into as well."""
    o, n, radius, top, spare = query.place, query.normal, query.radius, query.top, query.spare
    piece, down = tree.pieces[t], scaled(n, -1.0)
    if piece.edge != NONE:
        return answer  # it lies on parts of its patch
    parts, about = on_stack(NUMBERS, 0.0), table_on_stack(MOST, ABOUT, 0.0)
    take_whole(piece, tree.nets, o, parts)
    left = begin_parts(piece, parts, False, about)
    count, room, divisions = 1, room_of(piece), 0
    fine, seen, square = max(_FINE_SPARE * spare, _FINE_TOP * top), spare, radius * radius
    while count > 0:
        k = count - 1
        at = place_of(piece, k)
        margin = margin_of(tree, piece, o, np.int64(about[k, SPLITS]))
        high = margin - least_along(piece, parts, at, down)
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
                    seen = max(seen, dot(n, corner))
        if seen > top:
            return np.inf
        enough = seen
        if side == CROSSING:  # all of it is so high, whatever is left
            enough = max(enough, least_along(piece, parts, at, n))
        if high <= enough + fine or count >= room or divisions >= _DIVISIONS:
            answer = max(answer, min(high, radius))
            if answer > top:
                return np.inf
            count -= 1
            continue
        halve(piece, parts, about, left, k, count)
        divisions += 1
        count += 1
    return answer
