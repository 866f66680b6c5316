"""Find a surface's deepest point in a solid: a best-first search.

A heap keeps lanes of the surface's hierarchy and pieces of its elements by an upper bound of their
depth. The first bound comes from the balls around both models. The next is the depth of the centre
plus how far the lane or piece reaches from it. Another comes from a plane above which the solid has
nothing (`ball_caps`); it is linear, so it is largest at a corner. The search examines the entry
with the largest bound. Whatever stops the search, no point is deeper than the largest bound in the
heap or of a pruned entry.
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
from .ball_cells import pop, radius_limit
from .ball_feet import write_foot, write_point, write_surface
from .ball_frame import take_axes
from .ball_point import certain_radius, continue_depth, place_of, possible_depth
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
    is_within_trim,
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
"""Cost of a piece besides its descents, in steps."""


SOLID = SURFACE = None
"""Placeholders. Each entry substitutes the kinds of both trees (see pairs/depths.py)."""


def begin_deepest(models, memory, pose, pose_surface, rel_err, abs_err):
    """Start a search for the deepest point of a surface in a solid.

    `models` (2, n, 2) are the tables of the solid and of the surface (see solid_table.py). `memory`
    is the table of a Ball whose cells are PIECE. Its motion 0 is from the surface's frame to the
    solid's. The surface's frame takes the place of a's frame.
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
    for i in range(12):  # the best point is in the surface's own frame
        state.motions[1, i] = 1.0 if i == 0 or i == 4 or i == 8 else 0.0
    at.task, at.turn, at.height = IDLE, 0, 0
    best.near[0] = 0
    best.depth[1], best.side[1] = np.inf, 1
    state.trial[0].depth[1], state.trial[0].side[1] = np.inf, 1
    for i in range(state.order.shape[0]):
        state.order[i] = i
    # No point of the surface is deeper in the solid than in the ball around the solid.
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
    """Keep the trial point, a point of the surface, if it is the deepest so far."""
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
    """Make the next point of the piece with the largest bound the trial point; keep it in the heap.

    For a whole element, the corners come first, because they may be its deepest points; the middle
    comes last, at turn 0. A part of an element has its middle alone, a lane its centre.
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
    """Write to `row` a bound of the cuboid (centre, half) by a plane; return (found, steps).

    The cuboid is in the search's frame.
    """
    at, trial = state.at[0], state.trial[0]
    tolerated = radius_limit(at) - at.radius
    most = max(radius_limit(at) - trial.depth[0], 2.0 * _SPARE * tolerated)
    return plane(
        tree, region, state.motions[0], 0, at, trial, centre, half, _SPARE * tolerated, most, row,
        state.stack,
    )  # fmt: skip


@kernel
def _axes_in(axes, u, v):
    """Set the first axis along u, and the second in the plane of u and v if they span one."""
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
    """Bound a lane, whose centre is the trial point, and push its children onto the heap."""
    at, trial = state.at[0], state.trial[0]
    centre, radius = sphere_of(surface, lane)
    steps = 0
    bound = min(bound, possible_depth(trial, 0, region.inside, at.swept[0], radius, at.slack))
    if bound > radius_limit(at):
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
    if bound <= radius_limit(at):
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
    """Return a bound of a piece's depth: its largest distance from the facet nearest to its middle.

    The distance is a convex function of the place (see ball_tangents.py), so it is largest at a
    control point. Along an edge that points into the solid, other bounds shrink no faster than the
    pieces do.
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
    """Bound a piece, whose middle is the trial point, and push its parts onto the heap."""
    at, trial = state.at[0], state.trial[0]
    middle, count = place_of(trial), count_of(surface, parts, piece)
    margin = margin_of(surface, parts, piece)
    steps, square = 0, 0.0
    for i in range(count):
        way = sub(control_of(surface, parts, piece, i), middle)
        square = max(square, dot(way, way))
    radius = np.sqrt(square) * (1.0 + 1e-12) + margin
    bound = min(bound, possible_depth(trial, 0, region.inside, at.swept[0], radius, at.slack))
    limit = radius_limit(at)
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
    """Continue a search for about `steps` steps at most; return ENDED, CUT or FULL."""
    tree, _, region = solid_at(SOLID, models[0])
    surface, _ = tree_at(SURFACE, models[1])
    state, parts = ball_at(OF_PIECES, memory), memory_of(surface, memory)
    at = state.at[0]
    while True:
        if steps <= 0:
            return CUT
        if at.task == IDLE:
            if at.size == 0 or state.bounds[0] <= radius_limit(at):
                return ENDED
            if at.size + WIDTH >= state.order.shape[0] or not has_room(surface, parts, at):
                return FULL
            _begin(surface, parts, state)
        steps = continue_depth(
            tree, region, state.motions[0], 0, at, state.trial[0], state.stack, state.reached,
            steps,
        )  # fmt: skip
        if at.height > 0:
            return CUT
        piece = state.cells[state.order[0]]
        if piece.lane < 0 and is_within_trim(surface, parts, piece, state.trial[0].weights):
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
    """Write the deepest point of a surface, and its foot on the solid, to an answer.

    Args:
        models: (2, n, 2) tables, that of the solid first.
        memory: the table of a search for the deepest point.
        solid: which of the two models of the answer the solid is, 0 or 1.
        pose: (4, 4) of the solid, model to world.
        pose_surface: (4, 4) of the surface, model to world.
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
