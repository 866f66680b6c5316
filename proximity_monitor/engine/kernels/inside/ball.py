"""Find the largest ball inside two solids: a best-first search of space.

Let F(x) be the smaller of a point's depths in both solids. The ball around x of radius F(x) is the
largest around x that lies in both. A heap keeps cells of space by an upper bound of F. The search
examines the cell with the largest bound. F at its centre plus half the cell's diagonal bounds F in
the cell. Planes above which a solid has nothing (`ball_caps`) bound F as well, any two together
(`ball_rows`). A cell that may hold a larger ball's centre is halved; the halves inherit the planes.
An ascent improves every ball found. Whatever stops the search, no ball is larger than the largest
bound of a cell in the heap or of a pruned cell.

If faces are pushed into each other, one plane bounds each solid, wherever the centre is. So the
cells are aligned with the line through both nearest points of the largest ball found.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import entry, kernel, shared
from ..base.memory import on_stack
from ..base.state import CUT, ENDED
from ..base.trees import MeshTree
from .ball_bowls import WAYS, bowls
from .ball_cells import halve, pop, push, radius_limit
from .ball_frame import axis_of, common_box, in_a_frame, take_axes
from .ball_kinds import continue_depth_of_solid, plane_of_solid, tangent_of_solid
from .ball_newton import begin_newton, seed_between
from .ball_point import certain_depth, possible_depth
from .ball_rows import bound_of
from .ball_state import BOUNDING, CELL_CENTRE, CLIMB, FULL, IDLE, NEWTON, OF_CELLS, SEED, ball_at
from .ball_trial import ascend, begin_climb, end_climb, end_newton, keep, try_point
from .solid_table import solid_at

_SPARE = 0.1
"""Share of the tolerance by which a plane may lie too high, so that it is found sooner."""

_BOWLS = 5
_ATTEMPTS = _BOWLS + WAYS
"""Bowls are sought after so many other attempts to find a row for a cell; and all attempts."""

_CELL_STEPS = 8
"""Cost of a cell besides its descents, in steps."""

_MIDDLE_STEPS = 128
"""Maximum number of steps for the middle of both models. If a model is a ball, nearly all of its
surface is nearest to the middle, and examining it takes longer than comparing the surfaces."""


@shared
def _begin_cells(tree_a, tree_b, region_a, region_b, state):
    """Put the cuboid around the region that both models share into an empty heap; return steps."""
    at, best = state.at[0], state.best[0]
    at.size = 0
    at.dropped = 0.0
    for i in range(state.order.shape[0]):
        state.order[i] = i
    cell = state.cells[0]
    if not common_box(tree_a, tree_b, region_a, region_b, state, cell.centre, cell.half):
        return 1
    cell.count = 0
    steps = 1
    cell.first = 0
    for k in range(2):
        cell.side[k], cell.clear[k], cell.near[k] = 0, -1.0, best.near[k]
        if at.radius > 0.0:
            for behind in range(2):
                found, cost = plane_of_solid(
                    tree_a, tree_b, region_a, region_b, k, behind == 1, best, cell.centre,
                    cell.half, 0.0, state, cell.rows[cell.count],
                )  # fmt: skip
                cell.count += found
                steps += cost
    used, mean = on_stack(2, np.int64(0)), on_stack(4, 0.0)
    bound = bound_of(
        cell.rows, cell.count, cell.centre, cell.half, radius_limit(at), at.slack, mean, used
    )
    push(state, 0, min(bound, at.ceiling))
    return steps


@kernel
def _try_centre(state, task, centre, near, inherited):
    """Make a cell's centre, given in the search's frame, the trial point."""
    x, y, z = in_a_frame(state.at[0].axes, centre)
    try_point(state, task, x, y, z, near, inherited, 0.0)


@kernel
def _begin_cell(state):
    """Begin to examine the cell with the largest bound; it stays in the heap meanwhile."""
    cell = state.cells[state.order[0]]
    _try_centre(state, CELL_CENTRE, cell.centre, cell, True)


@kernel
def _compare_with_middle(tree_a, tree_b, region_a, region_b, state):
    """Make the middle of the region that both models share the trial point, before the next ascent.

    If the models overlap a little, an ascent from a ball at the region's rim takes small steps.
    """
    at, best = state.at[0], state.best[0]
    at.large_enough = 0.0
    take_axes(at.axes, axis_of(best))
    centre, half = on_stack(3, 0.0), on_stack(3, 0.0)
    if common_box(tree_a, tree_b, region_a, region_b, state, centre, half):
        _try_centre(state, SEED, centre, best, False)


@kernel
def _depth_in_cell(region_a, region_b, k, state):
    """Return a bound of the depth in solid k over the cell whose centre is the trial point."""
    at, half = state.at[0], state.cells[state.order[0]].half
    radius = np.sqrt(half[0] * half[0] + half[1] * half[1] + half[2] * half[2])
    inside = region_a.inside if k == 0 else region_b.inside
    return possible_depth(state.trial[0], k, inside, at.swept[k], radius, at.slack)


@shared
def _begin_bounding(region_a, region_b, state):
    """Bound the cell whose centre's depths are known; if it stays, begin to seek rows for it."""
    at = state.at[0]
    at.bound = state.bounds[0]
    for k in range(2):
        at.bound = min(at.bound, _depth_in_cell(region_a, region_b, k, state))
    if keep(state):
        ascend(state)
    else:
        seed_between(state, radius_limit(at))
    if at.bound <= radius_limit(at):
        _drop_cell(state)
        return
    cell = state.cells[state.order[0]]
    for i in range(cell.count):
        for j in range(4):
            at.known[i, j] = cell.rows[i, j]
    at.task, at.attempt, at.number = BOUNDING, 0, cell.count


@kernel
def _drop_cell(state):
    """Drop the cell with the largest bound: no centre of a much larger ball is in it."""
    at = state.at[0]
    at.dropped = max(at.dropped, at.bound)
    pop(state)


@shared
def _bound_cell(tree_a, tree_b, region_a, region_b, state, steps):
    """Seek rows that prune the cell at hand; after the last attempt, halve it.

    The cell stays in the heap meanwhile. Returns the steps left; if none is left, the next slice
    goes on with the next attempt.
    """
    at, trial = state.at[0], state.trial[0]
    cell = state.cells[state.order[0]]
    centre, half = cell.centre, cell.half
    limit = radius_limit(at)
    spare = _SPARE * (max(limit, at.floor) - at.radius)
    # Begin with the solid in which the centre is less deep.
    depth_a = _depth_in_cell(region_a, region_b, 0, state)
    shallow = 0 if depth_a <= _depth_in_cell(region_a, region_b, 1, state) else 1
    while at.attempt < _ATTEMPTS:
        if steps <= 0:
            return steps
        attempt, row = at.attempt, at.known[at.number]
        k = 1 - shallow if attempt & 1 else shallow
        if attempt == 2 or attempt == 3:
            found, cost = tangent_of_solid(tree_a, tree_b, k, state, centre, half, row), 1
        elif attempt >= _BOWLS:
            found, cost = bowls(
                tree_a, tree_b, region_a, region_b, attempt - _BOWLS, state, centre, half, limit,
                spare, row,
            )  # fmt: skip
        else:
            found, cost = plane_of_solid(
                tree_a, tree_b, region_a, region_b, k, attempt == 4, trial, centre, half, spare,
                state, row,
            )  # fmt: skip
        steps -= cost
        at.attempt = _ATTEMPTS if found and attempt >= _BOWLS else attempt + 1
        if found:
            at.number += 1
            by_rows = bound_of(at.known, at.number, centre, half, limit, at.slack, at.mean, at.used)
            at.bound = min(at.bound, by_rows)
            if at.bound <= limit:
                at.task = IDLE
                _drop_cell(state)
                return steps
    if at.number == cell.count > 0:
        bound_of(at.known, at.number, centre, half, limit, at.slack, at.mean, at.used)
    at.task = IDLE
    halve(state, pop(state), at.known, at.number, at.mean, at.used, at.bound)
    return steps


@shared
def _go_on(tree_a, tree_b, region_a, region_b, state, steps):
    """Find the trial point's depths, then do the task it is for; return the steps left."""
    at = state.at[0]
    # Begin with the solid in which the parent cell was less deep: its depth alone may prune.
    first = state.cells[state.order[0]].first if at.task == CELL_CENTRE else 0
    while at.turn < 2:
        if steps <= 0:
            return steps
        k = first if at.turn == 0 else 1 - first
        given = min(steps, at.patience)
        used = given - continue_depth_of_solid(tree_a, tree_b, region_a, region_b, k, state, given)
        steps -= used
        at.patience -= used
        if at.height > 0:
            if at.patience <= 0:
                at.task = IDLE
            return steps
        at.turn += 1
        if at.task == CELL_CENTRE and at.turn == 1:
            bound = min(state.bounds[0], _depth_in_cell(region_a, region_b, k, state))
            if bound <= radius_limit(at):
                at.bound = bound
                _drop_cell(state)
                at.cells += 1
                at.task = IDLE
                return steps - _CELL_STEPS
        elif (
            at.task == SEED and not certain_depth(state.trial[0], k, at.swept, at.slack) > at.radius
        ):
            at.task = IDLE  # one depth rules out a larger ball around the seed
            return steps
    task = at.task
    if task == BOUNDING:
        return _bound_cell(tree_a, tree_b, region_a, region_b, state, steps)
    at.task = IDLE
    if task == CLIMB:
        end_climb(state)
    elif task == NEWTON:
        end_newton(state)
    elif task == CELL_CENTRE:
        at.cells += 1
        steps -= _CELL_STEPS
        _begin_bounding(region_a, region_b, state)
    elif keep(state):
        at.seed = at.seeds
        ascend(state)
    return steps


KIND_A = KIND_B = MeshTree
"""The kinds of both trees. Other entries substitute other kinds (see pairs/balls.py)."""


@entry
def search_ball(solids, memory, tentative, steps):
    """Continue a search for about `steps` steps at most; return ENDED, CUT or FULL.

    `solids` (2, n, 2) are the tables of both solids (see solid_table.py), `memory` is the search's
    table. A `tentative` search gives up, and returns ENDED, if no seed is the centre of a ball.
    """
    tree_a, _, region_a = solid_at(KIND_A, solids[0])
    tree_b, _, region_b = solid_at(KIND_B, solids[1])
    state = ball_at(OF_CELLS, memory)
    at = state.at[0]
    while True:
        if steps <= 0:
            return CUT
        if at.task != IDLE:
            steps = _go_on(tree_a, tree_b, region_a, region_b, state, steps)
        elif at.climbs > 0:
            if at.radius < at.large_enough and at.ceiling > radius_limit(at):
                _compare_with_middle(tree_a, tree_b, region_a, region_b, state)
            elif not (at.newtons > 0 and begin_newton(tree_a, tree_b, state)):
                begin_climb(state)
        elif at.seed < at.seeds:
            seeds, i = state.seeds, at.seed
            at.seed += 1
            try_point(state, SEED, seeds[i, 0], seeds[i, 1], seeds[i, 2], state.best[0], False, 0.0)
            if i == at.middle:
                at.patience = _MIDDLE_STEPS
        elif tentative and not at.radius > 0.0:
            return ENDED
        elif not at.begun and at.radius > 0.0 and at.ceiling <= radius_limit(at):
            return ENDED  # the cells can no longer improve the answer beyond the tolerance
        elif not at.begun or (at.radius > 0.0 and not at.framed):
            at.begun = True
            if at.radius > 0.0:
                take_axes(at.axes, axis_of(state.best[0]))
                at.framed = True
            steps -= _begin_cells(tree_a, tree_b, region_a, region_b, state)
        elif at.size == 0 or state.bounds[0] <= radius_limit(at):
            return ENDED
        elif at.size + 1 >= state.order.shape[0]:
            return FULL
        else:
            _begin_cell(state)
