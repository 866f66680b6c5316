"""A ball beside a surface that no point of the surface lies in, and that touches it at one point.

What lies within such a ball is at least as far from the surface as from the ball's own surface: for
a centre c, a point t and any point s of the surface, |s - t| >= |s - c| - |t - c|. So one search
from a point dismisses all of another model that the ball holds, however many pieces are beside it.
Where the ball leans on the surface at the nearest point, and its centre lies behind that of the
other model, the bound of that point is the distance itself.

The larger the ball, the more it holds. It begins as a large one and shrinks where the surface
enters it, until it touches that in two points (Ma, Bae and Choi, 3D medial axis point approximation
using nearest neighbors and the normal field, 2012). Where the other model surrounds the centre of
one that touches the surface in two points, it may fill a bowl: then the surface is a sphere's,
perhaps, and only the whole ball holds all of what is about as near as the nearest point.
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

Bowl = namedtuple("Bowl", "place slack radius")
"""The query whether nothing is nearer to a place than a radius; the answer is (yes, cost)."""

Empty = namedtuple("Empty", "place slack share spare finest own")
"""The query, as Foot, but `own` is not looked into, and pieces are not divided: where that would be
needed, the least is 0."""

LOOKS = 256
"""Looks at rectangles of pieces until a search gives up. It tolerates no more by then (foot.py)."""

_ALL, _ITSELF, _OTHERS = 0, 1, 2

_ROUNDS, _SMALLER, _HALF, _LEAST = 4, 0.9, 0.5, 0.01
"""Balls that are tried; how large the next one is, as a share of that through the point found in
this one; as a share of this one, where nothing could be proven; and as such at the least."""

_ALONG = 0.9
"""Cosine of a normal and the way between nearest points from which on the ball leans on it."""

_CLEAR = 1e-12
"""Share of the surface's size that a point found in a ball lies above the plane that touches both,
for the ball through it to be known."""

_FLAT = 1e-12
"""Share of both squared derivatives' product that their area's square has at the least."""

_ROUGH = 1e-7
"""Share of the distance by which another point may be nearer than the one that is found."""

_SPARE = 0.25 * RESOLUTION
"""Share of the surface's size that its distance to the centre need not be known to. It has to be
less than all of it, so that the bound of nearest points is among those that are not nearer."""


_AROUND = 0.25
"""How far the middle of the other model may be from a ball's centre, as a share of its radius, for
that to be taken for a bowl."""

_NUMBERS = 1024
"""Room for the net of a whole piece."""


def find_ball(tree_a, tree_b, state):
    """Look for a ball between the nearest points known so far, where it is time to.

    Returns the steps of a search that this took.
    """


def is_in_ball(tree_a, tree_b, state, a, b):
    """Whether two elements are beyond the limit by what is known of a ball."""


@implements(visit.lane_gaps, (Empty, Bowl))
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
    # An edge lies on a part of its patch.
    if tree.pieces[t].edge != NONE or t == query.own:
        return answer
    return _look(query, tree, t, answer)


@kernel
def _look(query, tree, t, answer):
    """The answer when an element has been looked into, as far as that goes without a division."""
    done, answer = look_at_whole(query, tree, t, answer, UNDIVIDED)
    distance, nearest, u, v, _, cost = answer
    if done and cost < LOOKS:
        return answer
    return distance, nearest, u, v, 0.0, cost


@shared
def _nearest(tree, place, radius, more, element, u, v, which):
    """About the point of a surface nearest to a place, metres: element, u, v.

    It is looked for within a radius, among ALL elements, in the given one or in all OTHERS, and the
    given point is the answer where there is none. Returns also a lower bound of the distance, which
    is `more` less than that at least, and what it cost.
    """
    stack, bounds = on_stack(ROOM, np.int32(0)), on_stack(ROOM, 0.0)
    found = on_stack(WIDTH, np.float32(0.0))
    query = Empty(place, points_err(tree), 0.0, more, 0.0, element if which == _OTHERS else NONE)
    answer = unlooked(radius, element, u, v)
    if which == _ITSELF:
        if tree.pieces[element].edge == NONE:  # else its patch is among the others
            answer = _look(query, tree, element, answer)
    else:
        top = at_root(stack, bounds)
        answer, _, _ = descend(query, tree, answer, top, stack, bounds, found, TO_THE_END)
    nearest, least = bounded(query, answer)
    return nearest, answer[2], answer[3], least, answer[5]


@implements(visit.limit, Bowl)
@inlined
def _limit_of_bowl(query, answer):
    return query.radius if answer[0] else -np.inf


@implements(visit.meet, Bowl)
@kernel
def _meet_bowl(query, tree, t, answer):
    piece, parts = tree.pieces[t], on_stack(_NUMBERS, 0.0)
    if piece.edge != NONE:  # it lies on a part of its patch
        return answer
    take_whole(piece, tree.nets, query.place, parts)
    margin = margin_of(tree, piece, query.place, 0)
    return answer[0] and is_beyond(piece, parts, 0, query.radius, margin), answer[1] + 1


@shared
def _is_bowl(tree, place, radius):
    """Whether no point of a surface is nearer to a place than a radius, metres; what it cost.

    By the squared distance of each piece alone: from the centre of a sphere that is the same all
    over it, and no step of Newton's method leads anywhere. What rounding does to a piece and that
    distance is in the margin (see square.py); edges lie on a part of their patch.
    """
    stack, bounds = on_stack(ROOM, np.int32(0)), on_stack(ROOM, 0.0)
    found = on_stack(WIDTH, np.float32(0.0))
    query = Bowl(place, points_err(tree), radius)
    answer, top = (True, np.int64(0)), at_root(stack, bounds)
    answer, _, _ = descend(query, tree, answer, top, stack, bounds, found, TO_THE_END)
    return answer


@inlined
def _spare(tree):
    return _SPARE * tree.scale[2] + points_err(tree)


@kernel
def nearest_on(tree, element, u, v, place):
    """About the point of a surface nearest to a place, metres: element, u, v; and what it cost.

    The search begins with such a point.
    """
    radius = norm(sub(point_on(tree, element, u, v), place))
    spare = max(_ROUGH * radius, _spare(tree))
    element, u, v, _, cost = _nearest(tree, place, radius, spare, element, u, v, _ALL)
    return element, u, v, cost


@kernel
def _normal_at(tree, element, u, v, n):
    """The surface's normal at one of its points, on the side of n, where it is about along that."""
    own = normal_on(tree, element, u, v)
    cosine = dot(own, n)
    return scaled(own, np.copysign(1.0, cosine)) if abs(cosine) > _ALONG else n


@kernel
def _bend_towards(tree, element, u, v, n):
    """The larger curvature of a surface at one of its points, 1/metres, positive towards n.

    0 where none is known.
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
    """A radius below the largest that is possible, and well above one that is wanted, if one is."""
    return max(_SMALLER * most, 0.5 * (wanted + most)) if wanted < most else _SMALLER * most


@kernel
def empty_ball(tree, element, u, v, n, radius, more, middle, wanted):
    """A ball of that radius at most beside a point of a surface, metres, on the side that n tells.

    `middle` is that of the other model, and `wanted` a radius from which on it may hold all of
    that. All is in the surface's frame.

    Returns its centre; a lower bound of that one's distance to the element, and one of that to all
    others, which is `more` larger than the radius at the most; and what it cost.
    """
    p, spare = point_on(tree, element, u, v), _spare(tree)
    c, own, others, cost = p, 0.0, 0.0, 0
    n = _normal_at(tree, element, u, v, n)
    bend = _bend_towards(tree, element, u, v, n)
    if bend * radius > _SMALLER and norm(sub(along(p, n, 1.0 / bend), middle)) * bend >= _AROUND:
        # One that is larger than the bend allows would cut through the surface beside the point.
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
        clear = height > _CLEAR * tree.scale[2]  # else rounding alone tells a radius
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
