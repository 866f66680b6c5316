"""Pieces of patches and curves in the search for a deepest point: cells, which can be divided."""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.addressed import Addressed, arrays_at, constant
from ..base.jit import implements, inlined, kernel
from ..base.state import CELL
from ..base.trees import NONE, SurfaceTree
from ..inside import pieces
from ..inside.ball_state import MORE
from ..tree.layout import first_of
from .cells import directions_of, divide_cell, net_of, root_cell
from .edges import place_on, point_on
from .facing import vector
from .sides import is_within_trim
from .trim import OUTSIDE

Parts = namedtuple("Parts", "cells nets roots")
"""The cells of a search, laid out as those of `Dividing` (see base/state.py)."""

_LAYOUT = {"cells": (CELL, 0), "nets": (np.float64, 0), "roots": (np.int32, 0)}
_PARTS = constant(Addressed(Parts, _LAYOUT))

_DIVIDED = 4
"""Most parts of a cell that is divided once."""


@implements(pieces.memory_of, SurfaceTree)
@inlined
def _memory(surface, memory):
    return arrays_at(_PARTS, MORE, memory)


@implements(pieces.forget, SurfaceTree)
@kernel
def _forget(surface, parts, at):
    at.parts = 0  # this drops their roots too: see `root_cell`


@implements(pieces.has_room, SurfaceTree)
@inlined
def _has_room(surface, parts, at):
    # The leaves of a node are pushed one by one, each of one element.
    return at.parts + _DIVIDED <= len(parts.cells)


@kernel
def _push(surface, parts, state, part, kind, near, bound):
    piece = state.cells[state.order[state.at[0].size]]
    piece.lane, piece.near, piece.part = kind, near, part
    pieces.push_piece(surface, parts, state, bound)


@implements(pieces.push_elements, SurfaceTree)
@kernel
def _push_element(surface, parts, state, leaf, near, bound):
    at = state.at[0]
    cell, at.parts = root_cell(
        surface, first_of(leaf), parts.cells, parts.nets, parts.roots, at.parts
    )
    _push(surface, parts, state, cell, pieces.WHOLE, near, bound)


@implements(pieces.divide, SurfaceTree)
@kernel
def _divide(surface, parts, state, piece, near, bound):
    at, cell = state.at[0], piece.part
    in_u, in_v, _ = directions_of(surface, parts.cells, parts.nets, cell, (0.0, 0.0, 0.0))
    at.parts = divide_cell(surface, cell, parts.cells, parts.nets, at.parts, in_u, in_v)
    first, count = np.int64(parts.cells[cell].child), np.int64(parts.cells[cell].children)
    if first == NONE:
        return False
    for k in range(count):
        if parts.cells[first + k].side != OUTSIDE:
            _push(surface, parts, state, first + k, pieces.PART, near, bound)
    return True


@implements(pieces.count_of, SurfaceTree)
@inlined
def _count(surface, parts, piece):
    return np.int64(surface.pieces[parts.cells[piece.part].element].points)


@implements(pieces.control_of, SurfaceTree)
@inlined
def _control(surface, parts, piece, i):
    room = np.int64(surface.pieces[parts.cells[piece.part].element].room)
    at = net_of(parts.cells, parts.nets, piece.part) + i
    return (parts.nets[at], parts.nets[at + room], parts.nets[at + 2 * room])


@implements(pieces.margin_of, SurfaceTree)
@inlined
def _margin(surface, parts, piece):
    return parts.cells[piece.part].margin


@implements(pieces.span_of, SurfaceTree)
@inlined
def _span(surface, parts, piece):
    cell = parts.cells[piece.part]
    return vector(cell.along_u), vector(cell.along_v)


@implements(pieces.corners_of, SurfaceTree)
@inlined
def _corners(surface, parts, piece):
    curve = surface.pieces[parts.cells[piece.part].element].degree_v == 0
    return 2 if curve else 4


@implements(pieces.spot_of, SurfaceTree)
@kernel
def _spot(surface, parts, piece, corner):
    cell = parts.cells[piece.part]
    u, v = 0.5 * (cell.low[0] + cell.high[0]), 0.5 * (cell.low[1] + cell.high[1])
    if corner > 0:
        u = cell.low[0] if (corner - 1) % 2 == 0 else cell.high[0]
        v = cell.low[1] if (corner - 1) // 2 == 0 else cell.high[1]
    return point_on(surface, cell.element, u, v), (u, v, 0.0)


@implements(pieces.is_within_trim, SurfaceTree)
@inlined
def _is_within_trim(surface, element, weights):
    return is_within_trim(surface, element, vector(weights))


@implements(pieces.weights_on, SurfaceTree)
@inlined
def _weights(surface, element, point):
    return point.weights[0], point.weights[1]


@implements(pieces.move_on, SurfaceTree)
@kernel
def _move(surface, element, u, v):
    u, v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
    if surface.pieces[element].degree_v == 0:
        v = 0.0
    return point_on(surface, element, u, v), u, v


@implements(pieces.element_of, SurfaceTree)
@inlined
def _element(surface, parts, piece):
    return np.int64(parts.cells[piece.part].element)


@implements(pieces.spot_at, SurfaceTree)
@kernel
def _spot_at(surface, element, best):
    weights = vector(best.weights)
    return vector(best.place), parameters_of(surface, element, weights)


@kernel
def parameters_of(tree, element, weights):
    """Convert an element's u and v, 0 to 1, to what `Feature.parameters` reports."""
    element, u, v = place_on(tree, element, weights[0], weights[1])
    piece = tree.pieces[element]
    u = piece.low[0] + u * (piece.high[0] - piece.low[0])
    of_curve = 1.0 if piece.degree_v == 0 else 0.0
    v = piece.low[1] + v * (piece.high[1] - piece.low[1])
    return (
        min(max(u, piece.low[0]), piece.high[0]),
        min(max(v, piece.low[1]), piece.high[1]),
        of_curve,
    )
