"""How deep a surface reaches into a solid: its deepest point, best first.

Volumes of the surface's hierarchy and pieces of its triangles are kept in a heap by a bound of how
deep they reach: the depth of their centre and how far they reach from it, or what a plane says
above which the solid has nothing (`ball_caps`), which is linear, hence largest at a corner. The
largest is looked into. Whatever stops the search, no point is deeper than the largest bound that is
left, or was pruned.
"""

from __future__ import annotations

import numpy as np
from numba import uint64

from ..base.jit import entry, kernel, shared
from ..base.memory import on_stack
from ..base.motion import deviation, relative_motions
from ..base.rounding import POINT_FLOOR, POINT_MARGIN, POSE_MARGIN
from ..base.state import CUT, ENDED, SWEPT
from ..base.vectors import add, along, cross, dot, scaled, sub, unit
from ..elements.primitives import corners
from ..tree.layout import (
    EMPTY,
    HALF_U,
    HALF_V,
    RADIUS,
    STRIDE,
    U_X,
    V_X,
    WIDTH,
    first_of,
    last_of,
    read_vector,
)
from .ball_caps import plane
from .ball_cells import limit_of, pop, push
from .ball_frame import take_axes
from .ball_point import certain_radius, possible_depth, sound_some
from .ball_state import CELL_CENTRE, FULL, IDLE, LOOSEST, PIECE, ball_at
from .solid_table import solid_at
from .solids import HALF
from .volumes import sphere_of

_SPARE = 0.1
"""As in ball.py."""

_WHOLE, _PART = -1, -2
"""Lanes of what is none: of a whole triangle, and of a part of one."""

_CENTRE = 3
"""Turn of a piece's centre, after those of its corners."""

_STEPS = 8
"""What a piece costs beside its descents, in steps of these."""


@entry
def begin_deepest(models, memory, pose, pose_surface, rel_err, abs_err):
    """Start a search for the deepest point of a surface in a solid.

    `models` (2, 2, n) are tables of the solid and of the surface (see solid_table.py), and `memory`
    that of a Ball whose cells are PIECE; its motion is from the surface's frame to the solid's.
    """
    tree, _, region = solid_at(models[0])
    surface, _, around = solid_at(models[1])
    state = ball_at(PIECE, memory)
    at, best = state.at[0], state.best[0]
    back = on_stack(12, 0.0)
    relative_motions(pose, pose_surface, state.motions[0], back)
    motion = state.motions[0]
    size = abs(motion[9]) + abs(motion[10]) + abs(motion[11])
    size += tree.scale[2] + surface.scale[2] + 2.0 * tree.scale[SWEPT]
    error = deviation(pose) + deviation(pose_surface)
    at.slack = (POINT_MARGIN + POSE_MARGIN * error) * size + POINT_FLOOR
    at.floor = 0.0
    at.rel_err, at.abs_err = min(rel_err, LOOSEST), min(abs_err, size)
    at.swept[0], at.swept[1] = tree.scale[SWEPT], np.inf
    at.radius, at.dropped = 0.0, 0.0
    at.size = at.climbs = at.seed = at.seeds = at.points = at.cells = 0
    for i in range(12):  # the best point is one of the surface's own frame
        state.motions[1, i] = 1.0 if i == 0 or i == 4 or i == 8 else 0.0
    at.task, at.turn, at.height = IDLE, 0, 0
    best.near[0] = 0
    best.depth[1], best.side[1] = np.inf, 1
    state.trial[0].depth[1], state.trial[0].side[1] = np.inf, 1
    for i in range(state.order.shape[0]):
        state.order[i] = i
    # Nothing lies deeper than below the surface of the ball around the solid.
    ball, other = region.ball, around.ball
    apart = 0.0
    for i in range(3):
        d = ball[i] - motion[9 + i]
        for j in range(3):
            d -= motion[3 * i + j] * other[j]
        apart += d * d
    apart = np.sqrt(apart) - 4.0 * at.slack
    deepest = ball[3] - max(apart - other[3], 0.0)
    if region.inside == HALF and deepest >= 0.0:
        deepest = 2.0 * ball[3]
    for lane in range(WIDTH):
        if surface.children[lane] != EMPTY:
            _push_lane(state, lane, 0, deepest + at.swept[0] + at.slack)
    at.dropped = max(at.dropped, 0.0)


@kernel
def _push_lane(state, lane, near, bound):
    at = state.at[0]
    cell = state.cells[state.order[at.size]]
    cell.lane, cell.near = lane, near
    push(state, at.size, bound)


@kernel
def _corner(piece, i):
    return (piece.corners[i, 0], piece.corners[i, 1], piece.corners[i, 2])


@kernel
def _push_piece(state, p, q, r, triangle, kind, near, bound):
    at = state.at[0]
    cell = state.cells[state.order[at.size]]
    cell.lane, cell.near, cell.triangle = kind, near, triangle
    for i in range(3):
        cell.corners[0, i], cell.corners[1, i], cell.corners[2, i] = p[i], q[i], r[i]
    push(state, at.size, bound)


@kernel
def _keep(state):
    """Keep the trial point, which is one of the surface, where it is the deepest so far."""
    at, trial, best = state.at[0], state.trial[0], state.best[0]
    depth = certain_radius(trial, at.swept, at.slack)
    if depth > at.radius:
        at.radius = depth
        best.near[0], best.near[1] = trial.near[0], state.cells[state.order[0]].triangle
        for i in range(3):
            best.place[i] = trial.place[i]


@kernel
def _begin(surface, state):
    """Begin with the next point of the piece with the largest bound, which stays in the heap.

    A whole triangle's corners come first, which may be its deepest points; then its centre. Of a
    lane there is a centre alone.
    """
    at, trial = state.at[0], state.trial[0]
    piece = state.cells[state.order[0]]
    if at.task == IDLE:
        at.turn = 0 if piece.lane == _WHOLE else _CENTRE
        trial.near[0] = piece.near
    at.task, at.height = CELL_CENTRE, 0
    at.points += 1
    if piece.lane >= 0:
        place, _ = sphere_of(surface, piece.lane)
    elif at.turn < _CENTRE:
        place = _corner(piece, at.turn)
    else:
        place = _middle(piece)
    trial.place[0], trial.place[1], trial.place[2] = place
    trial.side[0] = 0


@kernel
def _middle(piece):
    corner = _corner(piece, 0)
    return scaled(add(add(corner, _corner(piece, 1)), _corner(piece, 2)), 1.0 / 3.0)


@kernel
def _bound(tree, region, state, centre, half, row):
    """The bound of the cuboid (centre, half) along the present axes, by a plane: (row?, steps)."""
    at, trial = state.at[0], state.trial[0]
    tolerated = limit_of(at) - at.radius
    most = max(limit_of(at) - trial.depth[0], 2.0 * _SPARE * tolerated)
    return plane(
        tree, region, state.motions[0], 0, at, trial, centre, half, _SPARE * tolerated, most, row,
        state.stack,
    )  # fmt: skip


@kernel
def _axes_in(axes, u, v):
    """Make the first two axes those of a plane that two vectors lie in, if they tell one."""
    take_axes(axes, u)
    first = (axes[0, 0], axes[0, 1], axes[0, 2])
    second = unit(along(v, first, -dot(v, first)))
    second = unit(along(second, first, -dot(second, first)))
    if dot(second, second) > 0.5:
        third = cross(first, second)
        for i in range(3):
            axes[1, i], axes[2, i] = second[i], third[i]


@kernel
def _into_axes(axes, v, out):
    for i in range(3):
        out[i] = axes[i, 0] * v[0] + axes[i, 1] * v[1] + axes[i, 2] * v[2]


@shared
def _end_lane(tree, region, surface, state, lane, bound):
    """Bound what is under a lane, whose centre is the trial point, and put it into the heap."""
    at, trial = state.at[0], state.trial[0]
    centre, radius = sphere_of(surface, lane)
    steps = 0
    bound = min(bound, possible_depth(trial, 0, region.inside, at.swept[0], radius, at.slack))
    if bound > limit_of(at):
        base = uint64(lane // WIDTH * STRIDE + lane % WIDTH)
        axes, scale = at.axes, surface.scale[0]
        u, v = read_vector(surface.nodes, base + U_X), read_vector(surface.nodes, base + V_X)
        _axes_in(axes, u, v)
        around, half, row = on_stack(3, 0.0), on_stack(3, 0.0), on_stack(4, 0.0)
        _into_axes(axes, centre, around)
        thick = np.float64(surface.nodes[base + RADIUS])
        extra = (1e-4 * radius / scale) + thick
        half[0] = (np.float64(surface.nodes[base + HALF_U]) + extra) * scale
        half[1] = (np.float64(surface.nodes[base + HALF_V]) + extra) * scale
        half[2] = extra * scale
        found, cost = _bound(tree, region, state, around, half, row)
        steps += cost
        if found:
            high = row[3] + at.slack
            for i in range(3):
                high += abs(row[i]) * half[i] - row[i] * around[i]
            bound = min(bound, high)
    if bound <= limit_of(at):
        at.dropped = max(at.dropped, bound)
        return steps
    near, child = trial.near[0], surface.children[lane]
    if child >= 0:
        for below in range(child * WIDTH, (child + 1) * WIDTH):
            if surface.children[below] != EMPTY:
                _push_lane(state, below, near, bound)
    else:
        for t in range(first_of(child), last_of(child) + 1):
            p, q, r = corners(surface.triangles, t)
            _push_piece(state, p, q, r, t, _WHOLE, near, bound)
    return steps


@shared
def _end_piece(tree, region, state, piece, bound):
    """Bound a piece, whose centre is the trial point, and put its halves into the heap."""
    at, trial = state.at[0], state.trial[0]
    p, q, r = _corner(piece, 0), _corner(piece, 1), _corner(piece, 2)
    triangle, centre = piece.triangle, _middle(piece)
    steps = 0
    e, f, g = sub(p, centre), sub(q, centre), sub(r, centre)
    radius = np.sqrt(max(dot(e, e), max(dot(f, f), dot(g, g)))) * (1.0 + 1e-12)
    bound = min(bound, possible_depth(trial, 0, region.inside, at.swept[0], radius, at.slack))
    limit = limit_of(at)
    near = trial.near[0]
    if bound > limit:
        axes = at.axes
        _axes_in(axes, e, f)
        around, half, row = on_stack(3, 0.0), on_stack(3, 0.0), on_stack(4, 0.0)
        corner = on_stack(3, 0.0)
        _into_axes(axes, centre, around)
        half[0] = half[1] = half[2] = 0.0
        for each in (p, q, r):
            _into_axes(axes, each, corner)
            for i in range(3):
                half[i] = max(half[i], abs(corner[i] - around[i]) + at.slack)
        found, cost = _bound(tree, region, state, around, half, row)
        steps += cost
        if found:
            high = -np.inf
            for each in (p, q, r):
                _into_axes(axes, each, corner)
                value = row[3] + at.slack
                for i in range(3):
                    value -= row[i] * corner[i]
                high = max(high, value)
            bound = min(bound, high)
    if bound <= limit or radius <= at.slack:
        at.dropped = max(at.dropped, bound)
        return steps
    # Across the longest edge.
    pq, qr, rp = sub(p, q), sub(q, r), sub(r, p)
    a, b, c = dot(pq, pq), dot(qr, qr), dot(rp, rp)
    if b >= a and b >= c:
        p, q, r = q, r, p
    elif c >= a and c >= b:
        p, q, r = r, p, q
    middle = scaled(add(p, q), 0.5)
    _push_piece(state, p, middle, r, triangle, _PART, near, bound)
    _push_piece(state, middle, q, r, triangle, _PART, near, bound)
    return steps


@entry
def search_deepest(models, memory, steps):
    """Go on with a search for at most about `steps` steps; returns ENDED, CUT or FULL."""
    tree, _, region = solid_at(models[0])
    surface, _, _ = solid_at(models[1])
    state = ball_at(PIECE, memory)
    at = state.at[0]
    while True:
        if steps <= 0:
            return CUT
        if at.task == IDLE:
            if at.size == 0 or state.bounds[0] <= limit_of(at):
                return ENDED
            if at.size + WIDTH >= state.order.shape[0]:
                return FULL
            _begin(surface, state)
        steps = sound_some(
            tree, region, state.motions[0], 0, at, state.trial[0], state.stack, state.reached,
            steps,
        )  # fmt: skip
        if at.height > 0:
            return CUT
        if state.cells[state.order[0]].lane < 0:
            _keep(state)
        if at.turn < _CENTRE:
            at.turn += 1
            _begin(surface, state)
            continue
        at.task = IDLE
        at.cells += 1
        steps -= _STEPS
        bound = state.bounds[0]
        piece = state.cells[pop(state)]
        if piece.lane >= 0:
            steps -= _end_lane(tree, region, surface, state, piece.lane, bound)
        else:
            steps -= _end_piece(tree, region, state, piece, bound)
