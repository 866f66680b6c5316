"""What the search for the largest ball inside two solids consists of, as the kernels see it."""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.addressed import Addressed, arrays_at, constant
from ..base.jit import inlined
from ..base.tables import table

ROWS = 6
"""Planes that a cell inherits, at the most; `ball_cells.halve` has room for as many."""

POINT = np.dtype(
    [
        ("place", np.float64, (3,)),  # metres, in a's frame
        ("depth", np.float64, (2,)),  # metres, no more than it is, but for the slack; where the
        # side is unknown, |it|
        ("away", np.float64, (2,)),  # metres from the nearest point found of the core's surface
        ("side", np.int64, (2,)),  # of the core: 1 inside, -1 outside, 0 unknown
        ("clear", np.float64, (2,)),  # metres around the point where all points are on that side
        ("near", np.int64, (2,)),  # the nearest elements, in tree order
        ("spot", np.float64, (2, 2)),  # where on them, if `feet.foot_of` needs that
        ("loose", np.float64, (2,)),  # metres that the surface may be nearer; 0 of triangles
        ("way", np.float64, (2, 3)),  # unit vectors, a's frame, along which the depths grow
        ("weights", np.float64, (3,)),  # of a surface's deepest point: where on its element it is
    ],
    align=True,
)
"""A point of space, and what is known of its depth in the solids a and b."""

CELL = np.dtype(
    [
        ("centre", np.float64, (3,)),  # metres, in the search's frame
        ("half", np.float64, (3,)),  # half lengths along its axes
        ("rows", np.float64, (ROWS, 4)),  # n and h: a depth is at most h - n · y, see `ball_rows`
        ("count", np.int64),  # how many there are
        ("first", np.int64),  # the solid that the cell it was cut from was less deep in
        ("side", np.int64, (2,)),  # of the centre, with how far around it all points share it
        ("clear", np.float64, (2,)),
        ("near", np.int64, (2,)),  # triangles that are near the centre
    ],
    align=True,
)
"""A cuboid of space."""

PIECE = np.dtype(
    [
        ("corners", np.float64, (3, 3)),  # metres, in the surface's frame: of a part of a triangle
        ("part", np.int64),  # of which, in tree order; or the cell of a patch or curve
        ("lane", np.int64),  # or of which volume; then it is not negative
        ("near", np.int64),  # a triangle of the solid that is near
    ],
    align=True,
)
"""A part of a surface."""

SEARCH = np.dtype(
    [
        ("radius", np.float64),  # metres, certified: of the largest ball found; 0 before one is
        ("slack", np.float64),  # metres: what rounding may do to a depth
        ("joints", np.float64),  # metres: how far from the elements may be what closes the gaps
        # between them. Radii and bounds are those of the elements' surface, and differ from those
        # of the closed one by no more.
        ("floor", np.float64),  # metres: what is below it need not be told from 0
        ("rel_err", np.float64),
        ("abs_err", np.float64),  # metres, of a radius
        ("dropped", np.float64),  # the largest bound of a cell that was pruned
        ("ceiling", np.float64),  # metres: what no radius exceeds
        ("trusted", np.float64),  # metres: of a ball from which on it is improved where it is
        ("reach", np.float64),  # metres: how far the next step of the ascent may go
        ("axes", np.float64, (3, 3)),  # of the search's frame, in a's
        ("swept", np.float64, (2,)),  # radii that sweep the cores
        ("size", np.int64),  # cells in the heap
        ("trust", np.float64),  # metres: how far Newton's next step may go
        ("newtons", np.int64),  # such steps that are left
        ("climbs", np.int64),  # steps that are left to the ascent
        ("begun", np.bool_),  # the cells hold all that both models share
        ("framed", np.bool_),  # the frame is along the axis of a ball
        ("task", np.int64),  # what the trial point is for, one of those below
        ("turn", np.int64),  # how many of its depths are known
        ("height", np.int64),  # of the stack of a descent that was cut, else 0
        ("seed", np.int64),  # which seed is next
        ("seeds", np.int64),  # how many there are
        ("middle", np.int64),  # which is the middle of what both models share, NONE where none is
        ("patience", np.int64),  # steps that the trial point may still take
        ("points", np.int64),  # points whose depth was asked for
        ("cells", np.int64),  # cells that were looked into
        ("parts", np.int64),  # cells of a surface's elements that were made
    ],
    align=True,
)
"""A search."""

NONE = -1

IDLE, SEED, CLIMB, CELL_CENTRE, NEWTON = 0, 1, 2, 3, 4
"""What the trial point is for: nothing, or it is a seed, a step of the ascent, a cell's centre, or
where Newton's method says that two surfaces are farthest apart."""

Ball = namedtuple("Ball", "at motions seeds best trial probe bounds order cells stack reached")
"""A search and its memory. at (1,) SEARCH; motions (2, 12): from a's frame to a's and to b's; seeds
(k, 3) points to begin with, in a's frame; best, trial and probe (1,) POINT: the centre of the
largest ball found, the point asked about last, and one beside a cell; bounds (n,) metres, a heap
with the largest first; order (n,) int32: the cells that they are of, and after these the free ones;
cells (n,) CELL; stack (int32) and reached: scratch of a descent."""


MORE = len(Ball._fields)
"""The column from which on the table holds what else a search needs."""


def ball_table(ball, more):
    """The table of a search's memory (see base/tables.py), and of more arrays."""
    return table((*ball, *more))


_LAYOUT = {
    "at": (SEARCH, 0), "motions": (np.float64, 12), "seeds": (np.float64, 3), "best": (POINT, 0),
    "trial": (POINT, 0), "probe": (POINT, 0), "bounds": (np.float64, 0), "order": (np.int32, 0),
    "cells": (CELL, 0), "stack": (np.int32, 0), "reached": (np.float64, 0),
}  # fmt: skip


OF_CELLS, OF_PIECES = (
    constant(Addressed(Ball, _LAYOUT | {"cells": (kind, 0)})) for kind in (CELL, PIECE)
)
"""A search whose cells are cuboids of space, and one of parts of a surface."""


@inlined
def ball_at(kind, memory):
    """The search, of one of these kinds, of a table that `ball_table` made."""
    return arrays_at(kind, 0, memory)


FULL = 2
"""What a slice returns, beside ENDED and CUT, when there is no room for more cells."""
