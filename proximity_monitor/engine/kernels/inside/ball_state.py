"""The state of a search for the largest ball inside two solids, as the kernels see it.

A cell's row bounds a depth by a linear function; a seed is a point where the search may begin.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.addressed import Addressed, arrays_at, constant
from ..base.jit import inlined
from ..base.tables import table

ROWS = 6
"""Maximum number of rows that a cell inherits; `ball_cells.halve` has room for as many."""

KEPT = 4
"""Maximum number of rows that a piece of a surface inherits."""

POINT = np.dtype(
    [
        ("place", np.float64, (3,)),  # metres, in a's frame
        ("depth", np.float64, (2,)),  # metres, a lower bound up to the slack; if the side is
        # unknown, as if inside
        ("away", np.float64, (2,)),  # metres to the nearest point found on the core's surface
        ("side", np.int64, (2,)),  # of the core: 1 inside, -1 outside, 0 unknown
        ("clear", np.float64, (2,)),  # metres around the point where all points share its side
        ("near", np.int64, (2,)),  # the nearest elements, in tree order
        ("spot", np.float64, (2, 2)),  # the place on them, if `feet.foot_of` needs it
        ("loose", np.float64, (2,)),  # metres by which the surface may be nearer; 0 for triangles
        ("way", np.float64, (2, 3)),  # unit vectors, a's frame, along which the depths grow
        ("weights", np.float64, (3,)),  # a surface's deepest point: its place on its element
    ],
    align=True,
)
"""A point of space and its known depths in the solids a and b."""

CELL = np.dtype(
    [
        ("centre", np.float64, (3,)),  # metres, in the search's frame
        ("half", np.float64, (3,)),  # half lengths along the frame's axes
        ("rows", np.float64, (ROWS, 4)),  # n and h: a depth is at most h - n · y, see `ball_rows`
        ("count", np.int64),  # number of rows
        ("first", np.int64),  # the solid in which the parent cell's centre was less deep
        ("side", np.int64, (2,)),  # of the centre, as in POINT
        ("clear", np.float64, (2,)),  # of the centre, as in POINT
        ("near", np.int64, (2,)),  # elements near the centre
    ],
    align=True,
)
"""A cuboid of space."""

PIECE = np.dtype(
    [
        ("corners", np.float64, (3, 3)),  # of a part of a triangle: metres, the surface's frame
        ("part", np.int64),  # the triangle, in tree order; or the cell of a patch or curve
        ("lane", np.int64),  # the lane, if the piece is a volume; else WHOLE or PART (pieces.py)
        ("near", np.int64),  # a nearby element of the solid
        ("rows", np.float64, (KEPT, 4)),  # n and h, in the surface's frame, see `piece_rows`
        ("count", np.int64),  # number of rows
    ],
    align=True,
)
"""A piece of a surface: a lane's volume, an element or a part of one."""

SEARCH = np.dtype(
    [
        ("radius", np.float64),  # metres, certified, of the largest ball found; 0 if none yet
        ("slack", np.float64),  # metres: the rounding error of a depth
        ("joints", np.float64),  # metres: the boundary that closes the gaps between elements may be
        # this far from the elements. Radii and bounds refer to the elements' surface. They differ
        # from those of the closed boundary by no more.
        ("floor", np.float64),  # metres: smaller values need not be told from 0
        ("rel_err", np.float64),
        ("abs_err", np.float64),  # metres, of a radius
        ("dropped", np.float64),  # metres: the largest bound of a pruned cell
        ("ceiling", np.float64),  # metres: no radius exceeds it
        ("large_enough", np.float64),  # metres: then a ball is improved without trying the middle
        ("reach", np.float64),  # metres: maximum length of the ascent's next step
        ("axes", np.float64, (3, 3)),  # of the search's frame, in a's
        ("swept", np.float64, (2,)),  # metres: the cores' swept radii
        ("size", np.int64),  # cells in the heap
        ("trust", np.float64),  # metres: maximum length of Newton's next step
        ("newtons", np.int64),  # Newton's steps left
        ("climbs", np.int64),  # steps left to the ascent
        ("begun", np.bool_),  # the heap was filled with the region that both models share
        ("framed", np.bool_),  # the search's frame is aligned with the axis of a ball
        ("task", np.int64),  # what the trial point is for, one of the values below
        ("turn", np.int64),  # how many of its depths are known
        ("height", np.int64),  # of the stack of an interrupted descent, else 0
        ("seed", np.int64),  # the next seed
        ("seeds", np.int64),  # number of seeds
        ("middle", np.int64),  # the seed that is the middle of the shared region, or NONE
        ("patience", np.int64),  # steps left for the trial point
        ("points", np.int64),  # number of trial points
        ("cells", np.int64),  # number of cells examined
        ("parts", np.int64),  # number of cells of a surface's elements made
        ("rows", np.float64, (KEPT, 4)),  # what the next pieces inherit, as in PIECE
        ("count", np.int64),  # number of these rows
        ("bound", np.float64),  # metres: of the cell for which rows are sought
        ("known", np.float64, (2 * ROWS, 4)),  # all its rows: first the inherited ones
        ("number", np.int64),  # of these rows
        ("mean", np.float64, (4,)),  # the mean of rows that bounded it best
        ("used", np.int64, (2,)),  # the two rows that this mean began with
        ("bowl", np.float64),  # metres: how high the bowl of a is over its centre; may be infinite
        ("attempt", np.int64),  # which row is sought next, see `ball._bound_cell`
    ],
    align=True,
)
"""The scalars of a search."""

NONE = -1

IDLE, SEED, CLIMB, CELL_CENTRE, NEWTON, BOUNDING = 0, 1, 2, 3, 4, 5
"""What the trial point is: nothing, a seed, the end of an ascent's step, a cell's centre, or the
place where Newton's method expects two surfaces to be farthest apart. BOUNDING: a cell's centre
whose depths are known; rows for the cell are sought."""

Ball = namedtuple("Ball", "at motions seeds best trial probe bounds order cells stack reached")
"""A search and its memory. at (1,) SEARCH; motions (2, 12), from a's frame to a's and to b's; seeds
(k, 3), in a's frame; best, trial and probe (1,) POINT: the centre of the largest ball found, the
point under examination, and a helper point (see `_go_behind`); bounds (n,), metres, a heap with the
largest first; order (n,) int32, the cells of these bounds, then the free cells; cells (n,) CELL;
stack (int32) and reached: scratch of a descent."""


MORE = len(Ball._fields)
"""First row in the table of the additional arrays of a search."""


def ball_table(ball, more):
    """Return the table of a search's memory (see base/tables.py) and of additional arrays."""
    return table((*ball, *more))


_LAYOUT = {
    "at": (SEARCH, 0), "motions": (np.float64, 12), "seeds": (np.float64, 3), "best": (POINT, 0),
    "trial": (POINT, 0), "probe": (POINT, 0), "bounds": (np.float64, 0), "order": (np.int32, 0),
    "cells": (CELL, 0), "stack": (np.int32, 0), "reached": (np.float64, 0),
}  # fmt: skip


OF_CELLS, OF_PIECES = (
    constant(Addressed(Ball, _LAYOUT | {"cells": (kind, 0)})) for kind in (CELL, PIECE)
)
"""Layouts of a search whose cells are cuboids of space, and of one with pieces of a surface."""


@inlined
def ball_at(kind, memory):
    """Return the Ball, in one of these layouts, of a table that `ball_table` made."""
    return arrays_at(kind, 0, memory)


FULL = 2
"""A slice returns this, instead of ENDED or CUT, if there is no room for more cells."""
