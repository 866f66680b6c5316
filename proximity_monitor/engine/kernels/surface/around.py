"""Find the piece of a surface that is about nearest to a point, as a start for later searches.

A piece counts with the distance of one of its points: the one at the parameters where the
parallelogram of its corners comes nearest. So another piece may be nearer than the answer. Points
that trimming loops have cut off do not count: a plane's corners are often nearer than all that is
left of it, and edges are pieces of their own.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import implements, inlined, kernel
from ..base.trees import NONE
from ..base.vectors import add, dot, scaled, sub
from ..inside import visit
from ..inside.nearest import point_gaps
from .edges import point_on
from .facing import closest_in, vector
from .sides import is_within_trim

Around = namedtuple("Around", "place slack")
"""The query; the answer is (distance, piece, u, v)."""


@inlined
def _control(piece, nets, i):
    """Return a control point of a piece, metres."""
    at, w = piece.net + i, nets[piece.net + 3 * piece.room + i]
    return (nets[at] / w, nets[at + piece.room] / w, nets[at + 2 * piece.room] / w)


@implements(visit.lane_gaps, Around)
@inlined
def _lane_gaps(query, nodes, base, x, y, z, margin, gaps):
    point_gaps(nodes, base, x, y, z, margin, gaps)


@implements(visit.limit, Around)
@inlined
def _limit(query, answer):
    return answer[0]


@implements(visit.meet, Around)
@kernel
def _meet(query, tree, t, answer):
    piece = tree.pieces[t]
    if piece.edge == NONE:
        centre, e, f = vector(piece.centre), vector(piece.along_u), vector(piece.along_v)
    else:
        a, b = _control(piece, tree.nets, 0), _control(piece, tree.nets, np.int64(piece.degree_u))
        centre, e, f = scaled(add(a, b), 0.5), scaled(sub(b, a), 0.5), (0.0, 0.0, 0.0)
    u, v = closest_in(centre, e, f, query.place)
    u, v = 0.5 + 0.5 * u, (0.5 + 0.5 * v if piece.degree_v > 0 else 0.0)
    way = sub(point_on(tree, t, u, v), query.place)
    distance = np.sqrt(dot(way, way))
    if distance < answer[0] and is_within_trim(tree, t, (u, v, 0.0)):
        return distance, np.int64(t), u, v
    return answer
