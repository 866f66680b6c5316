"""Points that are likely to lie inside both of two solids: where a search for a ball begins."""

from __future__ import annotations

import numpy as np

from ..base.jit import entry, kernel
from ..base.state import FEATURE_A, FEATURE_B, SWEPT, TREE_A, TREE_B
from ..base.vectors import add, along, cross, dot, scaled, sub, unit
from ..elements.primitives import corners, mixed
from .ball_begin import add_seed
from .ball_point import turned_back
from .ball_state import CELL, NONE, ball_at
from .solid_table import solid_at

_SHARES = (0.1, 1e-3, 1e-5)
"""How far beside a contact is tried, as shares of the triangles' size."""


@entry
def add_seeds(solids, memory, row, body, triangle):
    """Begin a search at points about a contact, or about a triangle of one solid, too.

    Args:
        solids: (2, 2, n), as for `begin_ball`.
        memory: as for it.
        row: (ANSWER,) the answer about the distance of the cores, whose nearest points are the
            contact; not read where there is a triangle.
        body: of which solid the triangle is, 0 or 1.
        triangle: in tree order, or NONE. Its first corner lies inside the other solid; beside it
            are points inside both.
    """
    tree_a, _, _ = solid_at(solids[0])
    tree_b, _, _ = solid_at(solids[1])
    state = ball_at(CELL, memory)
    if triangle == NONE:
        _add_at_contact(tree_a, tree_b, state, row)
    elif body == 0:
        _add_at_triangle(tree_a, state.motions[0], triangle, state)
    else:
        _add_at_triangle(tree_b, state.motions[1], triangle, state)


@kernel
def _add_at_contact(tree_a, tree_b, state, row):
    ta, tb = np.int64(row[TREE_A]), np.int64(row[TREE_B])
    p = _point(tree_a, state.motions[0], ta, row, FEATURE_A)
    q = _point(tree_b, state.motions[1], tb, row, FEATURE_B)
    way = sub(q, p)
    apart = np.sqrt(dot(way, way))
    a, b = tree_a.scale[SWEPT], tree_b.scale[SWEPT]
    if a + b > 0.0 and apart > 0.0:
        # Along the way from core to core, where both depths are the same, or one core's end.
        way = scaled(way, 1.0 / apart)
        over = a + b - apart
        middle = a - 0.5 * over
        for at in (middle, middle + over, -0.5 * over, 0.0, apart, apart + 0.5 * over, 0.5 * apart):
            add_seed(state, along(p, way, at))
        return
    n, size = _normal(tree_a, state.motions[0], ta)
    m, other = _normal(tree_b, state.motions[1], tb)
    size = min(size, other)
    middle = scaled(add(p, q), 0.5)
    for share in _SHARES:
        step = share * (size if size > 0.0 else 1.0)
        add_seed(state, along(middle, add(n, m), -step))
        add_seed(state, along(middle, sub(n, m), step))
        add_seed(state, along(middle, sub(m, n), step))
        add_seed(state, along(middle, add(n, m), step))


@kernel
def _add_at_triangle(tree, motion, triangle, state):
    a, b, c = corners(tree.triangles, triangle)
    n, size = _normal(tree, motion, triangle)
    if size > 0.0:
        middle = _in_a(motion, scaled(add(add(a, b), c), 1.0 / 3.0))
        for share in _SHARES:
            add_seed(state, along(middle, n, -share * size))
            add_seed(state, along(middle, n, share * size))
    add_seed(state, _in_a(motion, a))


@kernel
def _in_a(motion, v):
    """A point of a solid's frame in a's; `motion` leads the other way."""
    return turned_back(motion, sub(v, (motion[9], motion[10], motion[11])))


@kernel
def _point(tree, motion, triangle, row, at):
    """The point of a triangle whose weights stand in an answer from `at` on, in a's frame."""
    weights = (row[at], row[at + 1], row[at + 2])
    return _in_a(motion, mixed(corners(tree.triangles, triangle), weights))


@kernel
def _normal(tree, motion, triangle):
    """The unit normal of a triangle in a's frame, or zero; and how large it is, metres."""
    a, b, c = corners(tree.triangles, triangle)
    n = cross(sub(b, a), sub(c, a))
    length = np.sqrt(dot(n, n))
    if not length > 0.0:
        return (0.0, 0.0, 0.0), 0.0
    return turned_back(motion, unit(n)), np.sqrt(length)
