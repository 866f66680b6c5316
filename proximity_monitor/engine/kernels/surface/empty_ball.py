"""A ball beside a surface that touches the surface at one point and holds no other point of it.

A point in the ball is at least as far from the surface as from the ball's own surface: for a centre
c, a point t and any point s of the surface, |s - t| >= |s - c| - |t - c|. So one search from a
point dismisses all parts of another model that the ball holds, however many pieces are beside it.
If the ball touches the surface at the nearest point, and the ball's centre lies behind the nearest
point of the other model, then the bound at that point is the distance itself.

The larger the ball, the more it holds. It starts large and shrinks if the surface enters it, until
it touches the surface at two points (Ma, Bae and Choi, 3D medial axis point approximation using
nearest neighbors and the normal field, 2012). The other model may surround the centre of a ball
that touches the surface at two points. Then the surface may be a bowl around the other model,
perhaps a sphere, and only the whole ball holds all points that are about as near as the nearest
point.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import implements, inlined, kernel, shared
from ..base.memory import on_stack
from ..base.rounding import RESOLUTION
from ..base.trees import NONE
from ..base.vectors import along, dot, norm, scaled, sub
from ..elements.errors import points_err
from ..inside import visit
from ..inside.nearest import point_gaps
from ..inside.visit import ROOM, TO_THE_END, at_root, descend
from ..tree.layout import WIDTH
from .edges import normal_on, point_on
from .evaluate import jet_at
from .foot import UNDIVIDED, bounded, enough, look_at_whole, unlooked
from .parts import margin_of, take_whole
from .square import is_beyond

Beyond = namedtuple("Beyond", "place slack radius")
"""The query: is no point nearer to a place than a radius? The answer is (yes, cost)."""

Empty = namedtuple("Empty", "place slack share spare finest own")
"""The query, like Foot, but it skips the element `own` and divides no pieces: if a piece needs a
division, the least is 0."""

LOOKS = 256
"""A search gives up after this many looks at rectangles of pieces. Up to there its tolerance does
not grow (see foot.py)."""

_ALL, _ITSELF, _OTHERS = 0, 1, 2

_ROUNDS, _SMALLER, _HALF, _LEAST = 4, 0.9, 0.5, 0.01
"""Most balls that are tried; then the next ball's radius: as a share of that of the ball through
the point found in this one; as a share of this one's, if nothing is proven; and its least share of
this one's."""

_ALONG = 0.9
"""The ball is placed along a surface normal whose cosine with the way between nearest points
exceeds this."""

_CLEAR = 1e-12
"""A point found in a ball must lie above the ball's tangent plane by this share of the surface's
size. Otherwise the radius of the ball through it is unknown."""

_FLAT = 1e-12
"""Least squared area that both derivatives span, as a share of the product of their squares."""

_ROUGH = 1e-7
"""Another point may be nearer than the one that is found by this share of the distance."""

_SPARE = 0.25 * RESOLUTION
"""The distance from the surface to the centre may err by this share of the surface's size. The
share is less than RESOLUTION, so that the bound at the nearest points still counts as not
nearer."""


_AROUND = 0.25
"""A ball may count as a bowl only if the middle of the other model is nearer to its centre than
this share of its radius."""

_NUMBERS = 1024
"""Room for the net of a whole piece."""


def find_ball(tree_a, tree_b, state):
    """Look for a ball between the nearest points known so far, if it is time to: a stub.

    Returns the steps of a search that this took.
    """


def is_in_ball(tree_a, tree_b, state, a, b):
    """Tell whether a known ball proves two elements to be beyond the limit: a stub."""


@implements(visit.lane_gaps, (Empty, Beyond))
@inlined
def _lane_gaps(query, nodes, base, x, y, z, margin, gaps):
    point_gaps(nodes, base, x, y, z, margin, gaps)


@implements(visit.limit, Empty)
@inlined
def _limit(query, answer):
    return enough(query, answer) if answer[5] < LOOKS else -np.inf


@implements(visit.meet, Empty)
@inlined
def _meet(query, tree, t, answer):
    # An edge needs no look of its own: it lies on a piece of its patch.
    if tree.pieces[t].edge != NONE or t == query.own:
        return answer
    return _look(query, tree, t, answer)


@kernel
def _look(query, tree, t, answer):
    """Return the answer with an element looked into as well, without dividing its piece."""
    done, answer = look_at_whole(query, tree, t, answer, UNDIVIDED)
    distance, nearest, u, v, _, cost = answer
    if done and cost < LOOKS:
        return answer
    return distance, nearest, u, v, 0.0, cost


@shared
def _nearest(tree, place, radius, more, element, u, v, which):
    """Find about the point of a surface nearest to a place, metres: element, u, v.

    The search covers ALL elements, only the given one (ITSELF), or all OTHERS, within a radius. If
    no point is within it, the answer is the given point. Also returns a lower bound of the
    distance, at least `more` below the distance that is found, and the cost.
    """
    stack, bounds = on_stack(ROOM, np.int32(0)), on_stack(ROOM, 0.0)
    found = on_stack(WIDTH, np.float32(0.0))
    query = Empty(place, points_err(tree), 0.0, more, 0.0, element if which == _OTHERS else NONE)
    answer = unlooked(radius, element, u, v)
    if which == _ITSELF:
        if tree.pieces[element].edge == NONE:  # the patch of an edge is among the others
            answer = _look(query, tree, element, answer)
    else:
        top = at_root(stack, bounds)
        answer, _, _ = descend(query, tree, answer, top, stack, bounds, found, TO_THE_END)
    nearest, least = bounded(query, answer)
    return nearest, answer[2], answer[3], least, answer[5]


@implements(visit.limit, Beyond)
@inlined
def _limit_beyond(query, answer):
    return query.radius if answer[0] else -np.inf


@implements(visit.meet, Beyond)
@kernel
def _meet_beyond(query, tree, t, answer):
    piece, parts = tree.pieces[t], on_stack(_NUMBERS, 0.0)
    if piece.edge != NONE:  # an edge lies on a piece of its patch
        return answer
    take_whole(piece, tree.nets, query.place, parts)
    margin = margin_of(tree, piece, query.place, 0)
    return answer[0] and is_beyond(piece, parts, 0, query.radius, margin), answer[1] + 1


@shared
def _is_bowl(tree, place, radius):
    """Tell whether no point of a surface is nearer to a place than a radius, metres; and the cost.

    Only the squared distance of each piece is bounded: from the centre of a sphere it is constant,
    and no step of Newton's method leads anywhere. The margin covers the rounding of a piece and of
    the squared distance (see square.py). Edges lie on a part of their patch.
    """
    stack, bounds = on_stack(ROOM, np.int32(0)), on_stack(ROOM, 0.0)
    found = on_stack(WIDTH, np.float32(0.0))
    query = Beyond(place, points_err(tree), radius)
    answer, top = (True, np.int64(0)), at_root(stack, bounds)
    answer, _, _ = descend(query, tree, answer, top, stack, bounds, found, TO_THE_END)
    return answer


@inlined
def _spare(tree):
    return _SPARE * tree.scale[2] + points_err(tree)


@kernel
def nearest_on(tree, element, u, v, place):
    """Find about the point of a surface nearest to a place, metres: element, u, v, and the cost.

    The search begins with the given point.
    """
    radius = norm(sub(point_on(tree, element, u, v), place))
    spare = max(_ROUGH * radius, _spare(tree))
    element, u, v, _, cost = _nearest(tree, place, radius, spare, element, u, v, _ALL)
    return element, u, v, cost


@kernel
def _normal_at(tree, element, u, v, n):
    """Return the surface's normal at a point, on the side of n; or n if not about parallel to n."""
    own = normal_on(tree, element, u, v)
    cosine = dot(own, n)
    return scaled(own, np.copysign(1.0, cosine)) if abs(cosine) > _ALONG else n


@kernel
def _bend_towards(tree, element, u, v, n):
    """Return the larger curvature of a surface at one of its points, 1/metres, positive towards n.

    Returns 0 if it is unknown.
    """
    piece = tree.pieces[element]
    if piece.edge != NONE or piece.degree_v == 0:
        return 0.0
    _, du, dv, duu, duv, dvv = jet_at(piece, tree.nets, u, v)
    e, f, g = dot(du, du), dot(du, dv), dot(dv, dv)
    a, b, c = dot(duu, n), dot(duv, n), dot(dvv, n)
    area = e * g - f * f
    if not area > _FLAT * e * g:
        return 0.0
    # The roots of (a - k e) (c - k g) = (b - k f)^2.
    half = 0.5 * (a * g + c * e - 2.0 * b * f) / area
    product = (a * c - b * b) / area
    return half + np.sqrt(max(half * half - product, 0.0))


@inlined
def _below(most, wanted):
    """Return a radius below the largest possible one, and well above the wanted one if possible."""
    return max(_SMALLER * most, 0.5 * (wanted + most)) if wanted < most else _SMALLER * most


@kernel
def empty_ball(tree, element, u, v, n, radius, more, middle, wanted):
    """Find a ball of at most a radius, metres, beside a point of a surface, on the side of n.

    `middle` is the middle of the other model. From the radius `wanted` on, the ball may hold all of
    the other model. All is in the surface's frame.

    Returns the ball's centre, lower bounds of the centre's distance to the element and to all
    others, the latter at most `more` larger than the radius; and the cost.
    """
    p, spare = point_on(tree, element, u, v), _spare(tree)
    c, own, others, cost = p, 0.0, 0.0, 0
    n = _normal_at(tree, element, u, v, n)
    bend = _bend_towards(tree, element, u, v, n)
    if bend * radius > _SMALLER and norm(sub(along(p, n, 1.0 / bend), middle)) * bend >= _AROUND:
        # A ball larger than the curvature allows would cut through the surface beside the point.
        radius = _below(1.0 / bend, wanted)
    for _ in range(_ROUNDS):
        c = along(p, n, radius)
        least, others = radius - 4.0 * spare, 0.0
        other, other_u, other_v, own, looks = _nearest(
            tree, c, radius, spare, element, u, v, _ITSELF
        )  # fmt: skip
        cost += looks
        if own >= least:
            other, other_u, other_v, others, looks = _nearest(
                tree, c, radius + more, spare, element, u, v, _OTHERS
            )  # fmt: skip
            cost += looks
        if others >= least or cost >= LOOKS:
            break
        way = sub(point_on(tree, other, other_u, other_v), p)
        height = dot(way, n)
        clear = height > _CLEAR * tree.scale[2]  # else the radius would be rounding noise
        through = dot(way, way) / (2.0 * height) if clear else np.inf
        centre = along(p, n, through)
        if norm(sub(centre, middle)) < _AROUND * through and through > spare:
            bowl, looks = _is_bowl(tree, centre, through - spare)
            cost += looks
            if bowl:
                return centre, through - spare, through - spare, cost
        through = min(_below(through, wanted), radius)
        shrunk = radius if clear and own > 0.0 and others > 0.0 else _HALF * radius
        radius = max(min(shrunk, through), _LEAST * radius)
    return c, own, others, cost
