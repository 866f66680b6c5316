"""Seeds of a search for a ball: points that are likely to lie inside both solids."""

from __future__ import annotations

import numpy as np

from ..base.jit import entry, kernel
from ..base.state import TREE_A, TREE_B
from ..base.trees import SWEPT, MeshTree
from ..base.vectors import add, along, dot, scaled, sub, turned_back
from .ball_begin import add_seed
from .ball_state import NONE, OF_CELLS, ball_at
from .feet import corner_of, middle_of, spot_of_row
from .solid_table import solid_at

_SHARES = (0.1, 1e-3, 1e-5)
"""Distances of the seeds from a contact, as shares of the elements' size."""


KIND_A = KIND_B = MeshTree
"""The kinds of both trees. Other entries substitute other kinds (see pairs/balls.py)."""


@entry
def add_seeds(solids, memory, row, first, body, element):
    """Add seeds around a contact, or around an element of one solid.

    Args:
        solids: (2, n, 2), as for `begin_ball`.
        memory: as for `begin_ball`.
        row: (ANSWER,) the answer about the distance of the cores; its nearest points are the
            contact. Not read if an element is given.
        first: which model of the answer the first solid is, 0 or 1.
        body: the solid that the element belongs to, 0 or 1.
        element: in tree order, or NONE. Its first corner lies inside the other solid, so points
            beside it lie inside both.
    """
    tree_a, _, _ = solid_at(KIND_A, solids[0])
    tree_b, _, _ = solid_at(KIND_B, solids[1])
    state = ball_at(OF_CELLS, memory)
    if element == NONE:
        _add_at_contact(tree_a, tree_b, state, row, first)
    elif body == 0:
        _add_at_element(tree_a, state.motions[0], element, state)
    else:
        _add_at_element(tree_b, state.motions[1], element, state)


@kernel
def _add_at_contact(tree_a, tree_b, state, row, first):
    ta, tb = np.int64(row[TREE_A + first]), np.int64(row[TREE_B - first])
    p, n, size = spot_of_row(tree_a, ta, row, first)
    q, m, other = spot_of_row(tree_b, tb, row, 1 - first)
    p, n = _in_a(state.motions[0], p), turned_back(state.motions[0], n)
    q, m = _in_a(state.motions[1], q), turned_back(state.motions[1], m)
    way = sub(q, p)
    apart = np.sqrt(dot(way, way))
    a, b = tree_a.scale[SWEPT], tree_b.scale[SWEPT]
    if a + b > 0.0 and apart > 0.0:
        # Seeds on the line through both cores' nearest points: points where both depths may be
        # equal, the nearest points themselves, and their middle.
        way = scaled(way, 1.0 / apart)
        over = a + b - apart
        middle = a - 0.5 * over
        for at in (middle, middle + over, -0.5 * over, 0.0, apart, apart + 0.5 * over, 0.5 * apart):
            add_seed(state, along(p, way, at))
        return
    size = min(size, other)
    middle = scaled(add(p, q), 0.5)
    for share in _SHARES:
        step = share * (size if size > 0.0 else 1.0)
        add_seed(state, along(middle, add(n, m), -step))
        add_seed(state, along(middle, sub(n, m), step))
        add_seed(state, along(middle, sub(m, n), step))
        add_seed(state, along(middle, add(n, m), step))


@kernel
def _add_at_element(tree, motion, element, state):
    middle, n, size = middle_of(tree, element)
    if size > 0.0:
        middle, n = _in_a(motion, middle), turned_back(motion, n)
        for share in _SHARES:
            add_seed(state, along(middle, n, -share * size))
            add_seed(state, along(middle, n, share * size))
    add_seed(state, _in_a(motion, corner_of(tree, element)))


@kernel
def _in_a(motion, v):
    """Convert a point of a solid's frame to a's; `motion` is the inverse, from a's frame."""
    return turned_back(motion, sub(v, (motion[9], motion[10], motion[11])))
