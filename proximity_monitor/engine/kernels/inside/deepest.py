"""How deep a surface reaches into a solid: its deepest point, best first.

Volumes of the surface's hierarchy and pieces of its elements are kept in a heap by a bound of how
deep they reach. At first that is how far the balls around both models let it be; then the depth of
their centre and how far they reach from it, or what a plane says above which the solid has nothing
(`ball_caps`), which is linear, hence largest at a corner. The largest is looked into. Whatever
stops the search, no point is deeper than the largest bound that is left, or was pruned.
"""

from __future__ import annotations

import numpy as np
from numba import uint64

from ..base.jit import kernel, shared
from ..base.memory import on_stack
from ..base.motion import deviation, relative_motions
from ..base.rounding import POINT_FLOOR, POINT_MARGIN, POSE_MARGIN
from ..base.state import CUT, ENDED
from ..base.tables import tree_at
from ..base.trees import SWEPT
from ..base.vectors import along, cross, dot, moved, sub, unit
from ..elements.errors import joints_err, points_err
from ..tree.layout import (
    EMPTY,
    HALF_U,
    HALF_V,
    RADIUS,
    STRIDE,
    U_X,
    V_X,
    WIDTH,
    read_vector,
)
from .ball_caps import plane
from .ball_cells import limit_of, pop
from .ball_feet import write_foot, write_point, write_surface
from .ball_frame import take_axes
from .ball_point import certain_radius, place_of, possible_depth, sound_some
from .ball_state import CELL_CENTRE, FULL, IDLE, OF_PIECES, ball_at
from .feet import facet_of
from .nearest import point_triangle
from .pieces import (
    WHOLE,
    control_of,
    corners_of,
    count_of,
    divide,
    element_of,
    forget,
    has_room,
    is_left,
    margin_of,
    memory_of,
    push_elements,
    push_lane,
    span_of,
    spot_at,
    spot_of,
)
from .solid_table import region_at, solid_at
from .solids import HALF
from .tolerance import LOOSEST
from .volumes import sphere_of

_SPARE = 0.1
"""As in ball.py."""

_STEPS = 8
"""What a piece costs beside its descents, in steps of these."""


SOLID = SURFACE = None
"""The kinds of both trees: others in each entry (see pairs/depths.py)."""


def begin_deepest(models, memory, pose, pose_surface, rel_err, abs_err):
    """Start a search for the deepest point of a surface in a solid.

    `models` (2, n, 2) are tables of the solid and of the surface (see solid_table.py), and `memory`
    that of a Ball whose cells are PIECE; its motion is from the surface's frame to the solid's.
    """
    tree, _, region = solid_at(SOLID, models[0])
    surface, _ = tree_at(SURFACE, models[1])
    around = region_at(models[1])
    state = ball_at(OF_PIECES, memory)
    forget(surface, memory_of(surface, memory), state.at[0])
    at, best = state.at[0], state.best[0]
    back = on_stack(12, 0.0)
    relative_motions(pose, pose_surface, state.motions[0], back)
    motion = state.motions[0]
    size = abs(motion[9]) + abs(motion[10]) + abs(motion[11])
    size += tree.scale[2] + surface.scale[2] + 2.0 * tree.scale[SWEPT]
    error = deviation(pose) + deviation(pose_surface)
    at.slack = (POINT_MARGIN + POSE_MARGIN * error) * size + POINT_FLOOR + points_err(surface)
    at.slack += points_err(tree)
    at.joints = joints_err(tree)
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
            push_lane(state, lane, 0, deepest + at.swept[0] + at.slack)
    at.dropped = max(at.dropped, 0.0)


@kernel
def _keep(surface, parts, state):
    """Keep the trial point, which is one of the surface, where it is the deepest so far."""
    at, trial, best = state.at[0], state.trial[0], state.best[0]
    depth = certain_radius(trial, at.swept, at.slack)
    if depth > max(at.radius, at.joints):
        at.radius = depth
        best.near[0] = trial.near[0]
        best.spot[0, 0], best.spot[0, 1] = trial.spot[0, 0], trial.spot[0, 1]
        best.near[1] = element_of(surface, parts, state.cells[state.order[0]])
        for i in range(3):
            best.place[i], best.weights[i] = trial.place[i], trial.weights[i]
            best.way[0, i] = trial.way[0, i]


@kernel
def _begin(surface, parts, state):
    """Begin with the next point of the piece with the largest bound, which stays in the heap.

    A whole element's corners come first, which may be its deepest points; then its middle, turn 0.
    Of a lane there is a centre alone.
    """
    at, trial = state.at[0], state.trial[0]
    piece = state.cells[state.order[0]]
    if at.task == IDLE:
        at.turn = corners_of(surface, parts, piece) if piece.lane == WHOLE else 0
        trial.near[0] = piece.near
    at.task, at.height = CELL_CENTRE, 0
    at.points += 1
    trial.side[0] = 0
    if piece.lane >= 0:
        place, _ = sphere_of(surface, piece.lane)
        trial.place[0], trial.place[1], trial.place[2] = place
        return
    place, weights = spot_of(surface, parts, piece, at.turn)
    for i in range(3):
        trial.place[i], trial.weights[i] = place[i], weights[i]


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
def _end_lane(tree, region, surface, parts, state, lane, bound):
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
                push_lane(state, below, near, bound)
    else:
        push_elements(surface, parts, state, child, near, bound)
    return steps


@kernel
def _beside_facet(tree, surface, parts, state, piece, margin):
    """A bound of how deep a piece reaches, by how far it is from the facet nearest to its middle.

    That is a convex function of the place (see ball_tangents.py), and so largest at a control
    point. Along an edge that points into the solid, other bounds shrink no faster than pieces do.
    """
    at, motion = state.at[0], state.motions[0]
    a, b, c = facet_of(tree, 0, state.trial[0])
    square = 0.0
    for i in range(count_of(surface, parts, piece)):
        p = moved(motion, control_of(surface, parts, piece, i))
        square = max(square, point_triangle(p, a, b, c)[0])
    return np.sqrt(square) + at.swept[0] + 4.0 * at.slack + margin


@shared
def _end_piece(tree, region, surface, parts, state, piece, bound):
    """Bound a piece, whose middle is the trial point, and put its parts into the heap."""
    at, trial = state.at[0], state.trial[0]
    middle, count = place_of(trial), count_of(surface, parts, piece)
    margin = margin_of(surface, parts, piece)
    steps, square = 0, 0.0
    for i in range(count):
        way = sub(control_of(surface, parts, piece, i), middle)
        square = max(square, dot(way, way))
    radius = np.sqrt(square) * (1.0 + 1e-12) + margin
    bound = min(bound, possible_depth(trial, 0, region.inside, at.swept[0], radius, at.slack))
    limit = limit_of(at)
    if bound > limit:
        bound = min(bound, _beside_facet(tree, surface, parts, state, piece, margin))
    if bound > limit:
        axes = at.axes
        u, v = span_of(surface, parts, piece)
        _axes_in(axes, u, v)
        around, half, row = on_stack(3, 0.0), on_stack(3, 0.0), on_stack(4, 0.0)
        corner = on_stack(3, 0.0)
        _into_axes(axes, middle, around)
        half[0] = half[1] = half[2] = 0.0
        for i in range(count):
            _into_axes(axes, control_of(surface, parts, piece, i), corner)
            for j in range(3):
                half[j] = max(half[j], abs(corner[j] - around[j]) + at.slack + margin)
        found, cost = _bound(tree, region, state, around, half, row)
        steps += cost
        if found:
            high = -np.inf
            for i in range(count):
                _into_axes(axes, control_of(surface, parts, piece, i), corner)
                value = row[3] + at.slack
                for j in range(3):
                    value -= row[j] * corner[j]
                high = max(high, value)
            bound = min(bound, high + margin)
    if (
        bound <= limit
        or radius <= at.slack
        or not divide(surface, parts, state, piece, trial.near[0], bound)
    ):
        at.dropped = max(at.dropped, bound)
    return steps


def search_deepest(models, memory, steps):
    """Go on with a search for at most about `steps` steps; returns ENDED, CUT or FULL."""
    tree, _, region = solid_at(SOLID, models[0])
    surface, _ = tree_at(SURFACE, models[1])
    state, parts = ball_at(OF_PIECES, memory), memory_of(surface, memory)
    at = state.at[0]
    while True:
        if steps <= 0:
            return CUT
        if at.task == IDLE:
            if at.size == 0 or state.bounds[0] <= limit_of(at):
                return ENDED
            if at.size + WIDTH >= state.order.shape[0] or not has_room(surface, parts, at):
                return FULL
            _begin(surface, parts, state)
        steps = sound_some(
            tree, region, state.motions[0], 0, at, state.trial[0], state.stack, state.reached,
            steps,
        )  # fmt: skip
        if at.height > 0:
            return CUT
        piece = state.cells[state.order[0]]
        if piece.lane < 0 and is_left(surface, parts, piece, state.trial[0].weights):
            _keep(surface, parts, state)
        if at.turn > 0:
            at.turn -= 1
            _begin(surface, parts, state)
            continue
        at.task = IDLE
        at.cells += 1
        steps -= _STEPS
        bound = state.bounds[0]
        piece = state.cells[pop(state)]
        if piece.lane >= 0:
            steps -= _end_lane(tree, region, surface, parts, state, piece.lane, bound)
        else:
            steps -= _end_piece(tree, region, surface, parts, state, piece, bound)


def write_deepest(models, memory, solid, pose, pose_surface, row):
    """Write the deepest point of a surface, and the solid's nearest to it, into an answer.

    Args:
        models: (2, n, 2) tables, that of the solid first.
        memory: that of a search for the deepest point.
        solid: which of the two models of the answer the solid is, 0 or 1.
        pose: (4, 4) the solid's, model to world.
        pose_surface: (4, 4) the surface's.
        row: (ANSWER,) written.
    """
    tree, names, _ = solid_at(SOLID, models[0])
    surface, labels = tree_at(SURFACE, models[1])
    state = ball_at(OF_PIECES, memory)
    best = state.best[0]
    element = best.near[1]
    place, parameters = spot_at(surface, element, best)
    write_foot(tree, names, state, 0, pose, row, solid)
    write_point(pose_surface, place, parameters, labels[element], row, 1 - solid)
    write_surface(best.way[0], pose_surface, tree.scale[SWEPT], row, solid)
    write_surface(best.way[0], pose_surface, 0.0, row, 1 - solid)  # its own points, not the sweep's
