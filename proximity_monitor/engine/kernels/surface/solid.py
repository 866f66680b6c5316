"""Closed surfaces as solids: what the searches for balls and deepest points ask of them."""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel
from ..base.state import FEATURE_A
from ..base.trees import NONE, SurfaceTree
from ..base.vectors import cross, dot, unit
from ..inside import feet
from ..inside.visit import at_root
from ..tree.layout import leaf
from . import bowl, crossing, height  # noqa: F401 - each implements stubs for surfaces
from .edges import place_on, point_on
from .evaluate import jet_at
from .foot import FAR, Foot, bounded, look_for, unlooked
from .pieces import parameters_of
from .sides import begin_on
from .trim import INSIDE

_SHARE, _LARGEST_SHARE = 0.2, 0.01
"""A point's distance may err by this share of a depth's allowed error, and of itself at most."""


@kernel
def share_of(at):
    """Return the share of itself by which a distance may err."""
    tolerated = at.rel_err
    if at.radius > 0.0:
        tolerated = max(tolerated, at.abs_err / at.radius)
    return min(_SHARE * tolerated, _LARGEST_SHARE)


@implements(feet.seek, SurfaceTree)
@inlined
def _seek(tree, p, k, at, point, stack, reached, found, steps):
    query = Foot(p, at.slack, share_of(at), 0.0, 4.0 * at.slack)
    top = at.height
    answer = unlooked(FAR, point.near[k], 0.0, 0.0)
    if top == 0:
        top = at_root(stack, reached)
        stack[top], reached[top] = leaf(point.near[k], 1), -np.inf  # this leaf is visited first
        top += 1
    else:
        spot = point.spot[k]
        near, least = np.int64(point.near[k]), point.loose[k]
        answer = point.away[k], near, spot[0], spot[1], least, np.int64(0)
    answer, top, steps = look_for(query, tree, answer, top, stack, reached, found, steps)
    distance = answer[0]
    near, least = bounded(query, answer)
    point.away[k], point.near[k], at.height = distance, near, top
    point.spot[k, 0], point.spot[k, 1] = answer[2], answer[3]
    # Until the search ends, this holds the `least` that it goes on with.
    point.loose[k] = answer[4] if top > 0 else max(distance - least, 0.0)
    return steps


@implements(feet.foot_of, SurfaceTree)
@kernel
def _foot(tree, p, k, point):
    near, u, v = np.int64(point.near[k]), point.spot[k, 0], point.spot[k, 1]
    return point_on(tree, near, u, v), parameters_of(tree, near, (u, v, 0.0))


@kernel
def _normal_in(tree, element, u, v):
    """Return a point of an element, its unit normal or zero, and about its size, metres."""
    element, u, v = place_on(tree, element, u, v)
    place, along_u, along_v, _, _, _ = jet_at(tree.pieces[element], tree.nets, u, v)
    n = cross(along_u, along_v)
    return place, unit(n), np.sqrt(np.sqrt(dot(n, n)))


@implements(feet.normal_at, SurfaceTree)
@kernel
def _normal_at(tree, k, point):
    _, n, _ = _normal_in(tree, point.near[k], point.spot[k, 0], point.spot[k, 1])
    return n


@implements(feet.facet_of, SurfaceTree)
@kernel
def _facet(tree, k, point):
    q, _ = _foot(tree, (0.0, 0.0, 0.0), k, point)
    return q, q, q


@implements(feet.spot_of_row, SurfaceTree)
@kernel
def _spot(tree, element, row, side):
    piece, at = tree.pieces[element], FEATURE_A + 4 * side
    if piece.edge != NONE:
        element = np.int64(piece.face)
        piece = tree.pieces[element]
    u = (row[at] - piece.low[0]) / (piece.high[0] - piece.low[0])
    v = 0.0
    if piece.degree_v > 0:
        v = (row[at + 1] - piece.low[1]) / (piece.high[1] - piece.low[1])
    return _normal_in(tree, element, min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0))


@implements(feet.middle_of, SurfaceTree)
@kernel
def _middle(tree, element):
    element, middle = begin_on(tree, element)
    return _normal_in(tree, element, middle[0], middle[1])


@implements(feet.corner_of, SurfaceTree)
@inlined
def _corner(tree, element):
    element, place = begin_on(tree, element)
    if tree.pieces[element].side == INSIDE and tree.pieces[element].edge == NONE:
        place = (0.0, 0.0, 0.0)
    return point_on(tree, element, place[0], place[1])
