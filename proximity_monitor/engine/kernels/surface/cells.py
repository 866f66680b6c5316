"""Cells: whole elements of a surface, and the parts that a search divides them into.

The control points of a part follow from those of the whole by de Casteljau's midpoint rule, and the
surface lies within their convex hull. Cells are in the frame of their model, so they serve all
queries about it. They are kept until room runs out.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel, shared
from ..base.memory import on_stack
from ..base.rounding import NET_SPLIT
from ..base.trees import CONVERSION, NONE
from ..base.vectors import norm
from ..elements.errors import points_err
from .clip import clip_cell
from .edges import put_edge
from .subdivide import copy_net, halves_u, halves_v, project
from .trim import CROSSING, classify_rectangle

MOST_SPLITS = 96
"""Most divisions of a cell, u and v together. The sides are then 2^-48 of the element's parameter
range, which float64 still resolves."""

_FLATTER = 3.0
"""If one direction is this many times as flat as the other, only the other is divided."""

_MOST_POINTS = 256
"""Most control points of a cell: degree 15 in both directions."""


@kernel
def net_of(cells, nets, index):
    """Return the index in `nets` where the control points of a cell begin."""
    return index * (len(nets) // len(cells))


@kernel
def root_cell(tree, element, cells, nets, roots, used):
    """Return the cell of a whole element, or NONE if no room is left; and how many are in use.

    `roots` is cleared when the first cell is made, because many searches need no cell at all.
    """
    if used == 0:
        for i in range(len(roots)):
            roots[i] = NONE
    found = roots[element]
    if found != NONE:
        return found, used
    if used >= len(cells):
        return NONE, used
    cell, piece = cells[used], tree.pieces[element]
    cell.element, cell.child, cell.children, cell.splits = element, NONE, 0, 0
    cell.side = piece.side
    for i in range(2):
        cell.low[i], cell.high[i] = 0.0, 1.0
    if piece.degree_v == 0:
        cell.high[1] = 0.0
    base = net_of(cells, nets, used)
    copy_net(piece, tree.nets, nets, base)
    _measure(tree, piece, nets, cell, base)
    if cell.side == CROSSING:
        clip_cell(tree.trims, piece, cell)
    roots[element] = used
    return used, used + 1


@shared
def divide_cell(tree, index, cells, nets, used, in_u, in_v):
    """Divide a cell in u, in v or in both; return how many cells are then in use.

    Does nothing if the cell is already divided. Does nothing either if the cell is too small or
    there is no room: then the cell has no child.
    """
    cell = cells[index]
    if cell.child != NONE or cell.splits >= MOST_SPLITS or used + 4 > len(cells):
        return used
    piece = tree.pieces[cell.element]
    if piece.edge != NONE:
        return _divide_edge(tree, index, cells, nets, used)
    net, step = net_of(cells, nets, index), net_of(cells, nets, 1)
    one = net_of(cells, nets, used)
    if in_u and in_v:
        halves_u(piece, nets, net, one, one + 2 * step)
        halves_v(piece, nets, one, one, one + step)
        halves_v(piece, nets, one + 2 * step, one + 2 * step, one + 3 * step)
    elif in_u:
        halves_u(piece, nets, net, one, one + step)
    else:
        halves_v(piece, nets, net, one, one + step)
    count = 4 if in_u and in_v else 2
    splits = cell.splits + (2 if in_u and in_v else 1)
    middle_u, middle_v = 0.5 * (cell.low[0] + cell.high[0]), 0.5 * (cell.low[1] + cell.high[1])
    for k in range(count):
        child = cells[used + k]
        child.element, child.child, child.children = cell.element, NONE, 0
        child.splits = splits
        for i in range(2):
            child.low[i], child.high[i] = cell.low[i], cell.high[i]
        upper_u = (k >= 2) if in_v else (k == 1)
        upper_v = (k % 2 == 1) if in_u else (k == 1)
        if in_u:
            if upper_u:
                child.low[0] = middle_u
            else:
                child.high[0] = middle_u
        if in_v:
            if upper_v:
                child.low[1] = middle_v
            else:
                child.high[1] = middle_v
        if piece.rational:
            project(piece, nets, one + k * step)
        _measure(tree, piece, nets, child, one + k * step)
        child.side = cell.side
        if child.side == CROSSING:
            child.side = _side(tree, piece, child)
            if child.side == CROSSING:
                clip_cell(tree.trims, piece, child)
    cell.child, cell.children = used, count
    return used + count


@kernel
def _side(tree, piece, cell):
    """Classify a part by the trimming loops: INSIDE, OUTSIDE or CROSSING."""
    low, width = piece.low, (piece.high[0] - piece.low[0], piece.high[1] - piece.low[1])
    return classify_rectangle(
        tree.trims,
        piece.patch,
        low[0] + cell.low[0] * width[0],
        low[1] + cell.low[1] * width[1],
        low[0] + cell.high[0] * width[0],
        low[1] + cell.high[1] * width[1],
    )


@kernel
def _divide_edge(tree, index, cells, nets, used):
    """Divide a part of an edge at the middle of its parameter interval."""
    cell = cells[index]
    piece = tree.pieces[cell.element]
    low, high = cell.low[0], cell.high[0]
    middle = 0.5 * (low + high)
    for k in range(2):
        child = cells[used + k]
        child.element, child.child, child.children = cell.element, NONE, 0
        child.splits, child.side = cell.splits + 1, cell.side
        child.low[0] = low if k == 0 else middle
        child.high[0] = middle if k == 0 else high
        child.low[1] = child.high[1] = 0.0
        base = net_of(cells, nets, used + k)
        bend = 0.25 * cell.bend_u
        bend = put_edge(tree, piece, child.low[0], child.high[0], bend, nets, base)
        _measure(tree, piece, nets, child, base)
        child.bend_u = bend
    cell.child, cell.children = used, 2
    return used + 2


@inlined
def length_in(piece, cell, axis):
    """Return the length of a cell along u (axis 0) or v (axis 1), in the patch's parameters."""
    return (cell.high[axis] - cell.low[axis]) * (piece.high[axis] - piece.low[axis])


@kernel
def directions_of(tree, cells, nets, index, n):
    """Decide whether to divide a cell in u, and in v; also return about how far it bends, metres.

    n is a vector in the model's frame, or 0. The gap along n is too small by what the cells bend
    along n. So if surfaces are parallel along a line or an arc, their cells stay long in that
    direction. A cell that does not bend along n is divided as its shape demands.
    """
    cell = cells[index]
    piece = tree.pieces[cell.element]
    if piece.edge != NONE or piece.degree_v == 0:
        return True, False, cell.bend_u + cell.bend_v + cell.twist
    u, v, twist = cell.bend_u, cell.bend_v, cell.twist
    bends = u + v + twist
    if n != (0.0, 0.0, 0.0):
        in_u, in_v, twisted = _bends_along(piece, nets, net_of(cells, nets, index), n)
        bends = 0.0
        if max(max(in_u, in_v), twisted) > cell.margin:
            u, v, twist = in_u, in_v, twisted
            bends = u + v + twist
    # A division in either direction reduces the twist. Divide the longer one: otherwise a fan,
    # straight along its ribs, would fall into many cells of full length. Ignore bends below the
    # margin: they are noise.
    if max(u, v) < max(twist, cell.margin):
        u, v = norm(cell.along_u), norm(cell.along_v)
    return not u * _FLATTER < v, not v * _FLATTER < u, bends


@kernel
def _bends_along(piece, nets, at, n):
    """Measure along n how far a cell is from straight in u and in v, and how far twisted."""
    p, q, room = np.int64(piece.degree_u), np.int64(piece.degree_v), np.int64(piece.room)
    if p == 3 and q == 3:
        return _bends(nets, at, n, 3, 3, room)
    if p == 2 and q == 2:
        return _bends(nets, at, n, 2, 2, room)
    return _bends(nets, at, n, p, q, room)


@inlined
def _bends(nets, at, n, p, q, room):
    line = on_stack(_MOST_POINTS, 0.0)
    for k in range((p + 1) * (q + 1)):
        i = at + k
        line[k] = n[0] * nets[i] + n[1] * nets[i + room] + n[2] * nets[i + 2 * room]
    row, u, v = q + 1, 0.0, 0.0
    for k in range((p - 1) * row):
        u = max(u, abs((line[k] - line[k + row]) - (line[k + row] - line[k + 2 * row])))
    for i in range(p + 1):
        for k in range(i * row, i * row + q - 1):
            v = max(v, abs((line[k] - line[k + 1]) - (line[k + 1] - line[k + 2])))
    twist = abs((line[0] - line[q]) - (line[p * row] - line[p * row + q]))
    return 0.125 * p * (p - 1) * u, 0.125 * q * (q - 1) * v, 0.25 * twist


@kernel
def _measure(tree, piece, nets, cell, base):
    """Write the place and shape of a cell, and the error of its control points (`margin`)."""
    p, q, room = np.int64(piece.degree_u), np.int64(piece.degree_v), np.int64(piece.room)
    if p == 3 and q == 3:
        _shape(nets, base, cell, 3, 3, room)
    elif p == 2 and q == 2:
        _shape(nets, base, cell, 2, 2, room)
    else:
        _shape(nets, base, cell, p, q, room)
    share = NET_SPLIT * (max(p, q) * cell.splits + 1)
    cell.margin = share * tree.scale[2] + tree.scale[CONVERSION]
    if piece.edge != NONE:  # the net of an edge is a box, and its points are evaluated
        cell.margin, cell.bend_u = points_err(tree), piece.bend


@inlined
def _shape(nets, base, cell, p, q, room):
    """Write the place and shape of a cell; no bound depends on them."""
    n = q + 1
    bend_u = bend_v = twist = 0.0
    for axis in range(3):
        at = base + axis * room
        a, b = nets[at], nets[at + q]
        c, d = nets[at + p * n], nets[at + p * n + q]
        cell.centre[axis] = 0.25 * ((a + b) + (c + d))
        cell.along_u[axis] = 0.25 * ((c - a) + (d - b))
        cell.along_v[axis] = 0.25 * ((b - a) + (d - c))
        twist = max(twist, 0.25 * abs((a - b) + (d - c)))
        if p > 1:
            for three in range(3):
                first = at + ((three * q) >> 1)
                last = first + (p - 2) * n
                bend_u = max(bend_u, abs(nets[first] - 2.0 * nets[first + n] + nets[first + 2 * n]))
                bend_u = max(bend_u, abs(nets[last] - 2.0 * nets[last + n] + nets[last + 2 * n]))
        if q > 1:
            for three in range(3):
                first = at + ((three * p) >> 1) * n
                last = first + q - 2
                bend_v = max(bend_v, abs(nets[first] - 2.0 * nets[first + 1] + nets[first + 2]))
                bend_v = max(bend_v, abs(nets[last] - 2.0 * nets[last + 1] + nets[last + 2]))
    # A curve leaves its chord by at most p (p - 1) / 8 times its largest second difference.
    cell.bend_u = 0.125 * p * (p - 1) * bend_u
    cell.bend_v = 0.125 * q * (q - 1) * bend_v
    cell.twist = twist
