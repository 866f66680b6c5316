"""The largest ball inside two solids: a search of space, best first.

Let F(x) be the smaller of a point's depths in both solids. A ball around x of radius F(x) lies in
both, and none around x is larger. Cells of space are kept in a heap by a bound of F; the one with
the largest is looked into: F at its centre, which with half its diagonal bounds F in it, and planes
above which a solid has nothing (`ball_caps`), of which any two together bound F as well
(`ball_rows`). A cell that may hold a larger ball is halved, and its halves inherit the planes. What
is found is improved by an ascent. Whatever stops the search, no ball is larger than the largest
bound that is left, or was pruned.

Faces pushed into each other are bounded by one plane each, wherever the centre is; so cells are cut
along the line through both nearest points of the largest ball found.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import entry, kernel, shared
from ..base.memory import on_stack, table_on_stack
from ..base.state import CUT, ENDED
from .ball_caps import plane
from .ball_cells import halve, limit_of, pop, push
from .ball_frame import axis_of, common_box, take_axes
from .ball_point import certain_radius, possible_depth, sound
from .ball_rows import bound_of
from .ball_state import FULL
from .ball_tangents import tangent

_CLIMBS = 12
"""Steps of an ascent, at the most."""

_SPARE = 0.1
"""Share of what is tolerated that a plane may give away, to be found sooner."""

_MOST = 0.5
"""Share of the largest ball's radius up to which a plane that lies above the nearest point of the
surface is of use."""

_CELL_STEPS = 8
"""What a cell costs beside its descents, in steps of these."""


@shared
def _sound_both(tree_a, tree_b, region_a, region_b, state):
    """Find both depths of the trial point; returns how many steps that took."""
    at, point = state.at[0], state.trial[0]
    at.points += 1
    steps = 0
    for k in range(2):
        if k == 0:
            tree, region = tree_a, region_a
        else:
            tree, region = tree_b, region_b
        steps += sound(
            tree, region, state.motions[k], k, at.slack, at.swept[k], point, state.stack,
            state.reached,
        )  # fmt: skip
    return steps


@kernel
def _copy(point, other):
    for k in range(2):
        other.depth[k], other.away[k], other.side[k] = point.depth[k], point.away[k], point.side[k]
        other.clear[k], other.near[k] = point.clear[k], point.near[k]
        for i in range(3):
            other.way[k, i] = point.way[k, i]
    for i in range(3):
        other.place[i] = point.place[i]


@kernel
def _keep(state):
    """Keep the trial point where it is the centre of the largest ball so far; returns whether."""
    at, trial = state.at[0], state.trial[0]
    radius = certain_radius(trial, at.swept, at.slack)
    if not radius > at.radius:
        return False
    at.radius = radius
    _copy(trial, state.best[0])
    return True


@kernel
def _try(state, x, y, z, near, inherited, moved):
    """Make a point the trial point; where `inherited`, sides are those of a point so far away."""
    at, trial = state.at[0], state.trial[0]
    trial.place[0], trial.place[1], trial.place[2] = x, y, z
    for k in range(2):
        trial.near[k] = near.near[k]
        trial.clear[k] = near.clear[k] - moved - 4.0 * at.slack
        trial.side[k] = near.side[k] if inherited and trial.clear[k] > 0.0 else 0


@kernel
def _climb(tree_a, tree_b, region_a, region_b, state):
    """One step of the ascent from the best point; returns how many steps of a descent it took.

    To first order the depths grow along their ways u and v. Of all steps no longer than `reach` the
    one is taken after which the smaller of both is largest.
    """
    at, best = state.at[0], state.best[0]
    at.climbs -= 1
    reach = at.reach
    c = e = 0.0
    for i in range(3):
        c += best.way[0, i] * best.way[1, i]
    first, second = best.depth[0], best.depth[1]
    e = second - first
    if first + reach <= second + reach * c:
        p, q, gain = reach, 0.0, reach
    elif second + reach <= first + reach * c:
        p, q, gain = 0.0, reach, reach
    else:
        # p u + q v, such that both depths are the same after it.
        part = e / (2.0 * max(1.0 - c, 1e-12))
        whole = 0.0
        if 1.0 + c > 1e-9:
            left = reach * reach - part * part * 2.0 * (1.0 - c)
            whole = np.sqrt(max(left, 0.0) / (2.0 * (1.0 + c)))
        p, q = part + whole, whole - part
        gain = first + p + q * c - min(first, second)
    tolerated = limit_of(at) - at.radius
    if not gain > 0.02 * tolerated:
        at.climbs = 0
        return 0
    move = 0.0
    step = on_stack(3, 0.0)
    for i in range(3):
        step[i] = p * best.way[0, i] + q * best.way[1, i]
        move += step[i] * step[i]
    move = np.sqrt(move) * (1.0 + 1e-12)
    _try(
        state, best.place[0] + step[0], best.place[1] + step[1], best.place[2] + step[2],
        best, True, move,
    )  # fmt: skip
    steps = _sound_both(tree_a, tree_b, region_a, region_b, state)
    before = at.radius
    if _keep(state):
        at.reach = min(2.0 * reach, 0.95 * at.radius)
        if at.radius - before < 0.01 * tolerated:
            at.climbs = 0
    else:
        at.reach = 0.4 * reach
    return steps


@kernel
def _ascend(state):
    """Begin an ascent from the best point."""
    at = state.at[0]
    at.climbs = _CLIMBS
    at.reach = 0.95 * at.radius


@shared
def _plane(
    tree_a, tree_b, region_a, region_b, k, behind, point, centre, half, spare, state, row
):  # fmt: skip
    """Find a plane of solid k for a cell, as `plane` does, seen from a point.

    Or from a point so far behind that one that the other face of what is thin, too thin for a
    larger ball, is nearer than this one.
    """
    at = state.at[0]
    limit, steps = limit_of(at), 0
    if k == 0:
        tree, region = tree_a, region_a
    else:
        tree, region = tree_b, region_b
    most = _MOST * at.radius
    if not at.radius > 0.0:
        most = 0.5 * np.sqrt(half[0] * half[0] + half[1] * half[1] + half[2] * half[2])
    if at.cells > 0:
        # A plane that lies higher does not help to prune, even if the other one costs nothing.
        trial = state.trial[0]
        rise = 2.0 * limit - trial.depth[0] - trial.depth[1]
        most = min(most, max(rise, 2.0 * spare))
    most = max(most, spare)
    motion = state.motions[k]
    if behind:
        back = limit - at.swept[k] - 0.5 * point.away[k]
        if point.side[k] <= 0 or not back > 0.0:
            return False, steps
        _go_behind(point, k, back, state)
        point = state.probe[0]
        steps += sound(
            tree, region, motion, k, at.slack, at.swept[k], point, state.stack, state.reached
        )
    found, cost = plane(
        tree, region, motion, k, at, point, centre, half, spare, most, row, state.stack
    )
    return found, steps + cost


@shared
def _begin_cells(tree_a, tree_b, region_a, region_b, state):
    """Put the cuboid around all that both models share into an empty heap; returns steps."""
    at, best = state.at[0], state.best[0]
    at.size = 0
    at.dropped = 0.0
    for i in range(state.order.shape[0]):
        state.order[i] = i
    cell = state.cells[0]
    if not common_box(tree_a, tree_b, state, cell.centre, cell.half):
        return 1
    cell.count = 0
    steps = 1
    cell.first = 0
    for k in range(2):
        cell.side[k], cell.clear[k], cell.near[k] = 0, -1.0, best.near[k]
        if at.radius > 0.0:
            for behind in range(2):
                found, cost = _plane(
                    tree_a, tree_b, region_a, region_b, k, behind == 1, best, cell.centre,
                    cell.half, 0.0, state, cell.rows[cell.count],
                )  # fmt: skip
                cell.count += found
                steps += cost
    used, mean = on_stack(2, np.int64(0)), on_stack(4, 0.0)
    bound = bound_of(
        cell.rows, cell.count, cell.centre, cell.half, limit_of(at), at.slack, mean, used
    )
    push(state, 0, min(bound, at.ceiling))
    return steps


@shared
def _look_into(tree_a, tree_b, region_a, region_b, state):
    """Look into the cell with the largest bound; returns how many steps that took."""
    at, trial = state.at[0], state.trial[0]
    bound = state.bounds[0]
    number = pop(state)
    cell = state.cells[number]
    at.cells += 1
    axes, centre, half = at.axes, cell.centre, cell.half
    _try(
        state,
        axes[0, 0] * centre[0] + axes[1, 0] * centre[1] + axes[2, 0] * centre[2],
        axes[0, 1] * centre[0] + axes[1, 1] * centre[1] + axes[2, 1] * centre[2],
        axes[0, 2] * centre[0] + axes[1, 2] * centre[1] + axes[2, 2] * centre[2],
        cell, True, 0.0,
    )  # fmt: skip
    at.points += 1
    steps = _CELL_STEPS
    radius = np.sqrt(half[0] * half[0] + half[1] * half[1] + half[2] * half[2])
    depths = on_stack(2, 0.0)
    first = cell.first
    for i in range(2):
        # The one first that was the shallower before: it may be enough.
        k = first if i == 0 else 1 - first
        if k == 0:
            tree, region = tree_a, region_a
        else:
            tree, region = tree_b, region_b
        steps += sound(
            tree, region, state.motions[k], k, at.slack, at.swept[k], trial, state.stack,
            state.reached,
        )  # fmt: skip
        depths[k] = possible_depth(trial, k, region.inside, at.swept[k], radius, at.slack)
        bound = min(bound, depths[k])
        if bound <= limit_of(at):
            at.dropped = max(at.dropped, bound)
            return steps
    if _keep(state):
        _ascend(state)
    shallow = 0 if depths[0] <= depths[1] else 1
    limit = limit_of(at)
    if bound <= limit:
        at.dropped = max(at.dropped, bound)
        return steps
    rows = table_on_stack(12, 4, 0.0)
    used, mean = on_stack(2, np.int64(0)), on_stack(4, 0.0)
    used[0] = used[1] = 0
    count, spare = cell.count, _SPARE * (max(limit, at.floor) - at.radius)
    for i in range(count):
        for j in range(4):
            rows[i, j] = cell.rows[i, j]
    for attempt in range(5):
        k = 1 - shallow if attempt & 1 else shallow
        if attempt == 2 or attempt == 3:
            tree = tree_a if k == 0 else tree_b
            found = tangent(tree, state.motions[k], k, at, trial, centre, half, rows[count])
            steps += 1
        else:
            found, cost = _plane(
                tree_a, tree_b, region_a, region_b, k, attempt == 4, trial, centre, half, spare,
                state, rows[count],
            )  # fmt: skip
            steps += cost
        if found:
            count += 1
            by_rows = bound_of(rows, count, centre, half, limit, at.slack, mean, used)
            bound = min(bound, by_rows)
            if bound <= limit:
                at.dropped = max(at.dropped, bound)
                return steps
    if count > 0 and count == cell.count:
        bound_of(rows, count, centre, half, limit, at.slack, mean, used)
    halve(state, number, rows, count, mean, used, bound)
    return steps


@kernel
def _go_behind(point, k, behind, state):
    """Make the probe a point so far behind another one, seen from the surface of solid k."""
    probe = state.probe[0]
    for i in range(3):
        probe.place[i] = point.place[i] + behind * point.way[k, i]
    probe.clear[k] = point.clear[k] - behind * (1.0 + 1e-12) - 4.0 * state.at[0].slack
    probe.side[k] = point.side[k] if probe.clear[k] > 0.0 else 0
    probe.near[k] = point.near[k]


@entry
def search_ball(tree_a, tree_b, region_a, region_b, state, seeds_alone, steps):
    """Go on with a search for at most about `steps` steps; returns ENDED, CUT or FULL.

    With `seeds_alone` it ends when a ball is found, or no seed is left.
    """
    at = state.at[0]
    while True:
        if steps <= 0:
            return CUT
        if at.climbs > 0 and not seeds_alone:
            steps -= _climb(tree_a, tree_b, region_a, region_b, state)
        elif at.seed < at.seeds:
            i = at.seed
            at.seed += 1
            seeds = state.seeds
            _try(state, seeds[i, 0], seeds[i, 1], seeds[i, 2], state.best[0], False, 0.0)
            steps -= _sound_both(tree_a, tree_b, region_a, region_b, state)
            if _keep(state):
                at.seed = at.seeds
                _ascend(state)
        elif seeds_alone:
            return ENDED
        elif not at.begun:
            at.begun = True
            if at.radius > 0.0:
                take_axes(at.axes, axis_of(state.best[0]))
                at.framed = True
            steps -= _begin_cells(tree_a, tree_b, region_a, region_b, state)
        elif at.radius > 0.0 and not at.framed:
            take_axes(at.axes, axis_of(state.best[0]))
            at.framed = True
            steps -= _begin_cells(tree_a, tree_b, region_a, region_b, state)
        elif at.size == 0 or state.bounds[0] <= limit_of(at):
            return ENDED
        elif at.size + 1 >= state.order.shape[0]:
            return FULL
        else:
            steps -= _look_into(tree_a, tree_b, region_a, region_b, state)
