"""Find a surface's deepest point in a solid: a best-first search.

A heap keeps lanes of the surface's hierarchy and pieces of its elements by an upper bound of their
depth. The first bound comes from the balls around both models. The next is the depth of a point in
the middle plus how far the lane or piece reaches from it. Others come from planes above which the
solid has nothing (`piece_planes`). They are linear, so they also bound the depths of all parts of
the piece, which inherit them (`piece_rows`). The search examines the entry with the largest bound.
Whatever stops the search, no point is deeper than the largest bound in the heap or of a pruned
entry.
"""

from __future__ import annotations

import numpy as np
from numba import uint64

from ..base.jit import kernel, shared
from ..base.memory import on_stack, table_on_stack
from ..base.motion import deviation, relative_motions
from ..base.rounding import POINT_FLOOR, POINT_MARGIN, POSE_MARGIN
from ..base.state import CUT, ENDED
from ..base.tables import tree_at
from ..base.trees import SWEPT
from ..base.vectors import dot, moved, sub
from ..elements.errors import joints_err, points_err
from ..tree.layout import (
    EMPTY,
    STRIDE,
    U_X,
    V_X,
    WIDTH,
    read_vector,
)
from .ball_cells import pop, radius_limit
from .ball_feet import write_foot, write_point, write_surface
from .ball_frame import take_plane
from .ball_point import certain_radius, continue_depth, place_of, possible_depth
from .ball_state import CELL_CENTRE, CLIMB, FULL, IDLE, OF_PIECES, ball_at
from .feet import facet_of
from .nearest import point_triangle
from .piece_climb import climb, end_step, forget_climbs, is_time_to_climb, offer
from .piece_planes import bound_by_planes
from .piece_rows import HULL, ROWS
from .pieces import (
    WHOLE,
    control_of,
    corners_of,
    count_of,
    divide,
    element_of,
    forget,
    has_room,
    hull_of,
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

_STEPS = 8
"""Cost of a piece besides its descents, in steps."""

_WORTH = 0.25
"""Share of the way to the limit by which a piece's bound must fall, or one of its corners is looked
at as well."""


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
    state, parts = ball_at(OF_PIECES, memory), memory_of(surface, memory)
    forget(surface, parts, state.at[0])
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
    at.size = at.climbs = at.seed = at.seeds = at.points = at.cells = at.count = 0
    for i in range(12):  # the best point is in the surface's own frame
        state.motions[1, i] = 1.0 if i == 0 or i == 4 or i == 8 else 0.0
    at.task, at.turn, at.height = IDLE, 0, 0
    forget_climbs(state)
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
            push_lane(surface, parts, state, lane, 0, deepest + at.swept[0] + at.slack)
    at.dropped = max(at.dropped, 0.0)


@kernel
def _keep(surface, element, state):
    """Keep the trial point, which is on an element, if it is the deepest; return its depth."""
    at, trial, best = state.at[0], state.trial[0], state.best[0]
    depth = certain_radius(trial, at.swept, at.slack)
    if depth > max(at.radius, at.joints):
        at.radius = depth
        best.near[0] = trial.near[0]
        best.spot[0, 0], best.spot[0, 1] = trial.spot[0, 0], trial.spot[0, 1]
        best.near[1] = element
        for i in range(3):
            best.place[i], best.weights[i] = trial.place[i], trial.weights[i]
            best.way[0, i] = trial.way[0, i]
    return depth


@kernel
def _begin(surface, parts, state):
    """Make the next point of the piece with the largest bound the trial point; keep it in the heap.

    For a whole element, the corners come first, because they may be its deepest points; the middle
    comes last, at turn 0. A part of an element has its middle alone, a lane its centre. If planes
    bound a piece hardly better than before, another corner follows, at a turn below 0.
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
    place, weights = spot_of(surface, parts, piece, abs(at.turn))
    for i in range(3):
        trial.place[i], trial.weights[i] = place[i], weights[i]


@kernel
def _highest_corner(surface, parts, state, piece):
    """Return the corner of a piece where the smallest of the rows left by it is largest."""
    at = state.at[0]
    found, most = np.int64(0), -np.inf
    for corner in range(1, corners_of(surface, parts, piece) + 1):
        place, _ = spot_of(surface, parts, piece, corner)
        least = np.inf
        for i in range(at.count):
            row = at.rows[i]
            least = min(least, row[3] - dot((row[0], row[1], row[2]), place))
        if least > most:
            found, most = corner, least
    return found


@shared
def _end_lane(tree, region, surface, parts, state, piece, bound):
    """Bound a lane, whose centre is the trial point, and push its children onto the heap."""
    at, trial, lane = state.at[0], state.trial[0], piece.lane
    _, radius = sphere_of(surface, lane)
    steps = 0
    bound = min(bound, possible_depth(trial, 0, region.inside, at.swept[0], radius, at.slack))
    if bound > radius_limit(at):
        base = uint64(lane // WIDTH * STRIDE + lane % WIDTH)
        u, v = read_vector(surface.nodes, base + U_X), read_vector(surface.nodes, base + V_X)
        bound, steps = _by_planes(tree, region, surface, parts, state, piece, u, v, bound)
    if bound <= radius_limit(at):
        at.dropped = max(at.dropped, bound)
        return steps
    near, child = trial.near[0], surface.children[lane]
    if child >= 0:
        for below in range(child * WIDTH, (child + 1) * WIDTH):
            if surface.children[below] != EMPTY:
                push_lane(surface, parts, state, below, near, bound)
    else:
        push_elements(surface, parts, state, child, near, bound)
    return steps


@kernel
def _by_planes(tree, region, surface, parts, state, piece, u, v, bound):
    """Bound a piece, which is about parallel to u and v, by planes; return bound and steps."""
    at = state.at[0]
    rows, hull = table_on_stack(ROWS, 4, 0.0), table_on_stack(HULL, 3, 0.0)
    points, margin = hull_of(surface, parts, piece, hull)
    for i in range(piece.count):
        for j in range(4):
            rows[i, j] = piece.rows[i, j]
    spans = take_plane(at.axes, u, v)
    return bound_by_planes(
        tree, region, state, rows, piece.count, hull, points, margin, spans, bound
    )


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
def _end_piece(tree, region, surface, parts, state):
    """Bound a piece, in which the trial point is, and push its parts onto the heap.

    Returns the steps, and a corner to look at before, or 0.
    """
    at, trial, bound = state.at[0], state.trial[0], state.bounds[0]
    piece = state.cells[state.order[0]]
    middle, count = place_of(trial), count_of(surface, parts, piece)
    margin = margin_of(surface, parts, piece)
    before, steps, square = bound, 0, 0.0
    for i in range(count):
        way = sub(control_of(surface, parts, piece, i), middle)
        square = max(square, dot(way, way))
    radius = np.sqrt(square) * (1.0 + 1e-12) + margin
    bound = min(bound, possible_depth(trial, 0, region.inside, at.swept[0], radius, at.slack))
    limit = radius_limit(at)
    if bound > limit:
        bound = min(bound, _beside_facet(tree, surface, parts, state, piece, margin))
    if bound > limit:
        u, v = span_of(surface, parts, piece)
        bound, steps = _by_planes(tree, region, surface, parts, state, piece, u, v, bound)
    alike = before - bound < _WORTH * (before - limit)
    if bound > limit and alike and at.turn == 0 and at.count > 0 and radius > at.slack:
        # About the same planes again: a corner may lie beyond the edge of a face.
        piece.count = at.count
        for i in range(at.count):
            for j in range(4):
                piece.rows[i, j] = at.rows[i, j]
        return steps, _highest_corner(surface, parts, state, piece)
    piece = state.cells[pop(state)]
    if (
        bound <= limit
        or radius <= at.slack
        or not divide(surface, parts, state, piece, trial.near[0], bound)
    ):
        at.dropped = max(at.dropped, bound)
    return steps, np.int64(0)


def search_deepest(models, memory, steps):
    """Continue a search for about `steps` steps at most; return ENDED, CUT or FULL."""
    tree, _, region = solid_at(SOLID, models[0])
    surface, _ = tree_at(SURFACE, models[1])
    state, parts = ball_at(OF_PIECES, memory), memory_of(surface, memory)
    at = state.at[0]
    trial = state.trial[0]
    while True:
        if steps <= 0:
            return CUT
        if at.task == IDLE:
            if at.size == 0 or state.bounds[0] <= radius_limit(at):
                return ENDED
            if at.size + WIDTH >= state.order.shape[0] or not has_room(surface, parts, at):
                return FULL
            if not (is_time_to_climb(at) and climb(surface, state)):
                _begin(surface, parts, state)
        steps = continue_depth(
            tree, region, state.motions[0], 0, at, trial, state.stack, state.reached, steps
        )
        if at.height > 0:
            return CUT
        if at.task == CLIMB:
            element = state.probe[0].near[1]
            within = is_within_trim(surface, element, trial.weights)
            if within:
                _keep(surface, element, state)
            end_step(surface, state, within)
            if not climb(surface, state):
                at.task = IDLE
            continue
        piece = state.cells[state.order[0]]
        if piece.lane < 0:
            element = element_of(surface, parts, piece)
            if is_within_trim(surface, element, trial.weights):
                depth = _keep(surface, element, state)
                offer(surface, element, state, depth)
        if at.turn > 0:
            at.turn -= 1
            _begin(surface, parts, state)
            continue
        steps -= _STEPS
        if piece.lane >= 0:
            bound = state.bounds[0]
            piece = state.cells[pop(state)]
            steps -= _end_lane(tree, region, surface, parts, state, piece, bound)
        else:
            used, corner = _end_piece(tree, region, surface, parts, state)
            steps -= used
            if corner > 0:
                at.turn = -corner
                _begin(surface, parts, state)
                continue
        at.task = IDLE
        at.cells += 1


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
