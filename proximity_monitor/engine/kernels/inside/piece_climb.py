"""Climb to a deeper point of one element, in the search for a surface's deepest point.

A search that divides pieces finds a deep point no sooner than its pieces are small. Where a solid
rests on a surface along a line, there are many such pieces, and all of them are about equally deep.
So once a search has taken a while, it climbs from the deepest point that it has met, along u and v
by turns. The depth grows along `POINT.way`. The slopes at both ends of a step tell where on the
line between them the depth is largest. The climb proves nothing; it lets the search prune sooner.
"""

from __future__ import annotations

from ..base.jit import kernel
from ..base.vectors import dot, sub
from .ball_cells import radius_limit
from .ball_point import certain_depth, place_of
from .ball_state import CLIMB
from .pieces import move_on, weights_on

_FIRST, _AGAIN = 64, 4
"""Number of points after which a search climbs first; and the factor of points until the next."""

_MOST = 48
"""Maximum number of points of a climb."""

_REACH = 0.125
"""Length of the first step, in weights of the element."""

_WORTH = 0.05
"""Share of the tolerance that a step must promise to gain."""

_LEAST, _FARTHEST, _FAILED = 0.02, 4.0, 0.75
"""The next step along the same parameter, as a share of the last one: least and largest, and the
largest after a step that led to a smaller depth."""


@kernel
def forget_climbs(state):
    """Begin a search that has met no point."""
    at = state.at[0]
    state.probe[0].depth[0] = -1e300
    at.patience, at.begun = _FIRST, True


@kernel
def offer(surface, element, state, depth):
    """Make the trial point, which is on an element, the place to climb from if it is deeper.

    Returns whether it is.
    """
    trial, start = state.trial[0], state.probe[0]
    if not depth > start.depth[0]:
        return False
    start.depth[0] = depth
    start.near[0], start.near[1] = trial.near[0], element
    u, v = weights_on(surface, element, trial)
    start.weights[0], start.weights[1] = u, v
    for i in range(3):
        start.place[i], start.way[0, i] = trial.place[i], trial.way[0, i]
    state.at[0].begun = False
    return True


@kernel
def is_time_to_climb(at):
    """Return whether a climb should begin, and if so prepare it."""
    if at.begun or at.points < at.patience:
        return False
    at.patience = _AGAIN * at.points
    at.climbs = _MOST
    at.reach = at.trust = _REACH
    return True


@kernel
def climb(surface, state):
    """Make the next point of a climb the trial point; return False if it promises no gain."""
    at, trial, start = state.at[0], state.trial[0], state.probe[0]
    at.begun = True
    at.climbs -= 1
    if at.climbs < 0:
        return False
    way = (start.way[0, 0], start.way[0, 1], start.way[0, 2])
    most, found = _WORTH * (radius_limit(at) - at.radius), False
    for k in range(4):
        step = at.reach if k < 2 else at.trust
        if k & 1:
            step = -step
        u, v = start.weights[0], start.weights[1]
        u, v = (u + step, v) if k < 2 else (u, v + step)
        place, u, v = move_on(surface, start.near[1], u, v)
        gain = dot(way, sub(place, place_of(start)))
        if gain > most:
            most, found = gain, True
            at.seed = k // 2
            trial.weights[0], trial.weights[1], trial.weights[2] = u, v, 0.0
            trial.place[0], trial.place[1], trial.place[2] = place
    if found:
        at.task, at.height = CLIMB, 0
        at.points += 1
        trial.side[0], trial.near[0] = 0, start.near[0]
    return found


@kernel
def end_step(surface, state, is_on_surface):
    """Go on from the trial point if it is deeper, and choose the length of the next step."""
    at, trial, start = state.at[0], state.trial[0], state.probe[0]
    way = sub(place_of(trial), place_of(start))
    rise = dot(way, (start.way[0, 0], start.way[0, 1], start.way[0, 2]))
    left = dot(way, (trial.way[0, 0], trial.way[0, 1], trial.way[0, 2]))
    share = rise / (rise - left) if left < rise else _FARTHEST  # where the slope vanishes
    depth = certain_depth(trial, 0, at.swept, at.slack)
    if is_on_surface and offer(surface, start.near[1], state, depth):
        share = min(max(abs(share - 1.0), _LEAST), _FARTHEST)
    else:
        share = min(max(share, _LEAST), _FAILED)
    if at.seed == 0:
        at.reach *= share
    else:
        at.trust *= share
