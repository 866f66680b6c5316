"""The trial point of a search for the largest ball: choose it, and keep it if it is better.

An ascent improves the ball found step by step.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel
from ..base.memory import on_stack
from ..base.vectors import norm, sub
from .ball_cells import radius_limit
from .ball_point import certain_radius, place_of
from .ball_state import CLIMB
from .visit import TO_THE_END

_CLIMBS, _FAILED = 32, 3
"""Maximum number of steps of an ascent; and the extra cost of a step that led to a smaller ball."""

_NEWTONS, _AGAIN = 12, 2
"""Maximum number of Newton's steps; and the number allowed again after a successful ascent step."""

_FARTHEST = 1.9
"""Maximum length of a step as a share of the radius. Longer steps mostly lead to a smaller ball."""


@kernel
def _copy(point, other):
    for k in range(2):
        other.depth[k], other.away[k], other.side[k] = point.depth[k], point.away[k], point.side[k]
        other.clear[k], other.near[k] = point.clear[k], point.near[k]
        other.spot[k, 0], other.spot[k, 1] = point.spot[k, 0], point.spot[k, 1]
        for i in range(3):
            other.way[k, i] = point.way[k, i]
    for i in range(3):
        other.place[i] = point.place[i]


@kernel
def keep(state):
    """Keep the trial point if it is the centre of the largest ball so far; return whether."""
    at, trial = state.at[0], state.trial[0]
    radius = certain_radius(trial, at.swept, at.slack)
    if not radius > max(at.radius, at.joints):
        return False
    at.radius = radius
    _copy(trial, state.best[0])
    return True


@kernel
def try_point(state, task, x, y, z, near, inherited, moved):
    """Make (x, y, z) the trial point; if `inherited`, take the sides of `near`.

    `near` is a POINT or CELL whose centre is `moved` metres away.
    """
    at, trial = state.at[0], state.trial[0]
    at.task, at.turn, at.height, at.patience = task, 0, 0, TO_THE_END
    at.points += 1
    trial.place[0], trial.place[1], trial.place[2] = x, y, z
    for k in range(2):
        trial.near[k] = near.near[k]
        trial.clear[k] = near.clear[k] - moved - 4.0 * at.slack
        trial.side[k] = near.side[k] if inherited and trial.clear[k] > 0.0 else 0


@kernel
def begin_climb(state):
    """Begin one step of the ascent from the best point, or end the ascent if it is not worth it.

    To first order, the depths grow along their ways u and v. Of all steps no longer than `reach`,
    take the one that makes the smaller depth largest.
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
        # The step p u + q v that makes both depths equal.
        part = e / (2.0 * max(1.0 - c, 1e-12))
        whole = 0.0
        if 1.0 + c > 1e-9:
            left = reach * reach - part * part * 2.0 * (1.0 - c)
            whole = np.sqrt(max(left, 0.0) / (2.0 * (1.0 + c)))
        p, q = part + whole, whole - part
        gain = first + p + q * c - min(first, second)
    if not gain > 0.02 * (radius_limit(at) - at.radius):
        at.climbs = 0
        return
    move = 0.0
    step = on_stack(3, 0.0)
    for i in range(3):
        step[i] = p * best.way[0, i] + q * best.way[1, i]
        move += step[i] * step[i]
    move = np.sqrt(move) * (1.0 + 1e-12)
    try_point(
        state, CLIMB, best.place[0] + step[0], best.place[1] + step[1], best.place[2] + step[2],
        best, True, move,
    )  # fmt: skip


@kernel
def end_climb(state):
    """Keep the end of an ascent's step if it is better, and adapt the length of the next step."""
    at = state.at[0]
    before, tolerated = at.radius, radius_limit(at) - at.radius
    if keep(state):
        at.newtons, at.trust = max(at.newtons, _AGAIN), np.inf
        at.reach = min(2.0 * at.reach, _FARTHEST * at.radius)
        if at.radius - before < 0.01 * tolerated:
            at.climbs = 0
    else:
        at.reach = 0.4 * at.reach
        at.climbs = max(at.climbs - _FAILED, 0)


@kernel
def end_newton(state):
    """Keep the end of Newton's step if it is better; otherwise shorten the next step."""
    at, best, trial = state.at[0], state.best[0], state.trial[0]
    way = sub(place_of(trial), place_of(best))
    before, tolerated = at.radius, radius_limit(at) - at.radius
    if keep(state):
        at.reach, at.trust = 0.95 * at.radius, np.inf
        if at.radius - before < 0.01 * tolerated:
            at.newtons = 0
    else:
        at.trust = 0.25 * norm(way)


@kernel
def ascend(state):
    """Begin an ascent from the best point."""
    at = state.at[0]
    at.climbs, at.newtons, at.trust = _CLIMBS, _NEWTONS, np.inf
    at.reach = 0.95 * at.radius
