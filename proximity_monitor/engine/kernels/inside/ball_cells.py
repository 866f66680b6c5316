"""The heap of cells of space that may hold a larger ball's centre, and how a cell is halved."""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel
from ..base.memory import on_stack, table_on_stack
from .ball_rows import bound_of
from .ball_state import ROWS

_OVERLAP = 2.0**-51
"""Share of the coordinates by which halves overlap, so that rounding leaves no gap."""


_LEFT = 0.25
"""Share of the tolerance that must be left after the gaps between elements, see `radius_limit`."""


@kernel
def radius_limit(at):
    """Return the radius, metres, up to which a larger ball does not matter beside the one found."""
    radius = at.radius
    if radius == 0.0 and at.floor > 0.0:
        return 0.0  # a solid has holes: only this search can prove that no point is in both
    limit = max(radius + 32.0 * at.slack, at.floor)
    if radius > 0.0:  # no tolerance before a first ball: it is not known whether there is any
        tolerated = max(radius * at.rel_err, at.abs_err)
        # The gaps between elements widen both bounds. If they use up most of the tolerance, no
        # search could meet it; then the room is larger.
        room = tolerated - (2.0 + at.rel_err) * at.joints
        if room < _LEFT * tolerated:
            room = max(tolerated, 2.0 * at.joints)
        limit = max(limit, radius + room)
    return limit


@kernel
def push(state, slot, bound):
    """Push the cell in a free slot onto the heap, or drop it if its bound is within the limit."""
    at, bounds, order = state.at[0], state.bounds, state.order
    if bound <= radius_limit(at):
        at.dropped = max(at.dropped, bound)
        return
    i = at.size
    at.size += 1
    cell = order[slot]
    order[slot] = order[i]
    while i > 0:
        above = (i - 1) // 2
        if bounds[above] >= bound:
            break
        bounds[i], order[i] = bounds[above], order[above]
        i = above
    bounds[i], order[i] = bound, cell


@kernel
def pop(state):
    """Remove and return the cell with the largest bound; its slot is then the first free one."""
    at, bounds, order = state.at[0], state.bounds, state.order
    at.size -= 1
    n = at.size
    taken, bound, cell = order[0], bounds[n], order[n]
    i = 0
    while True:
        below = 2 * i + 1
        if below >= n:
            break
        if below + 1 < n and bounds[below + 1] > bounds[below]:
            below += 1
        if bounds[below] <= bound:
            break
        bounds[i], order[i] = bounds[below], order[below]
        i = below
    bounds[i], order[i] = bound, cell
    order[n] = taken
    return taken


@kernel
def halve(state, parent, rows, count, mean, used, bound):
    """Push both halves of a cell that is not in the heap, cut across its longest edge.

    Args:
        state: Ball.
        parent: the cell's number; it is in the first free slot.
        rows: (n, 4) all known rows of the cell: first the inherited ones, then the new ones.
        count: the number of rows.
        mean: (4,) the mean of rows that bounded the cell best.
        used: (2,) the two rows that this mean began with.
        bound: metres, of the cell.
    """
    at, cells = state.at[0], state.cells
    point, cell = state.trial[0], state.cells[parent]
    longest = 0
    for i in range(1, 3):
        if cell.half[i] > cell.half[longest]:
            longest = i
    half, middle = 0.5 * cell.half[longest], cell.centre[longest]
    if half <= at.slack:  # smaller cells cannot have better bounds
        at.dropped = max(at.dropped, bound)
        return
    kept = table_on_stack(ROWS, 4, 0.0)
    n = 0
    if count > 0:
        _keep_row(kept, 0, mean)
        _keep_row(kept, 1, rows[used[0]])
        n = 2
        if used[0] != used[1]:
            _keep_row(kept, 2, rows[used[1]])
            n = 3
    for i in range(count - 1, -1, -1):
        if n < ROWS and i != used[0] and i != used[1]:
            _keep_row(kept, n, rows[i])
            n += 1
    limit = radius_limit(at)
    pair, row = on_stack(2, np.int64(0)), on_stack(4, 0.0)
    for which in range(2):
        # The second half overwrites the parent's own slot.
        slot = at.size + 1 - which
        child = cells[state.order[slot]]
        for i in range(3):
            child.centre[i], child.half[i] = cell.centre[i], cell.half[i]
        child.centre[longest] = middle - half if which == 0 else middle + half
        child.half[longest] = half + _OVERLAP * (abs(middle) + half)
        for i in range(n):
            for j in range(4):
                child.rows[i, j] = kept[i, j]
        child.count = n
        child.first = 0 if point.depth[0] <= point.depth[1] else 1
        for k in range(2):
            child.near[k], child.side[k] = point.near[k], point.side[k]
            child.clear[k] = point.clear[k] - half * (1.0 + 1e-12) - 4.0 * at.slack
        below = bound_of(child.rows, n, child.centre, child.half, limit, at.slack, row, pair)
        push(state, slot, min(bound, below))


@kernel
def _keep_row(kept, i, row):
    for j in range(4):
        kept[i, j] = row[j]
