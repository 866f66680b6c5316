"""Begin a search for the largest ball inside two solids."""

from __future__ import annotations

import numpy as np

from ..base.jit import entry, kernel
from ..base.memory import on_stack
from ..base.motion import deviation, relative_motions
from ..base.rounding import POINT_FLOOR, POINT_MARGIN, POSE_MARGIN
from ..base.trees import SWEPT, MeshTree
from ..base.vectors import dot, moved, sub
from ..elements.errors import joints_err, points_err
from .ball_frame import common_box, in_a_frame, take_axes
from .ball_state import IDLE, NONE, OF_CELLS, ball_at
from .solid_table import solid_at
from .solids import HALF, NOWHERE
from .tolerance import LOOSEST

_TELLING = 1e-6
"""Share of both models' size. If one solid has holes and there is no ball, the upper bound may stay
above 0 by this much: near a hole no plane bounds a depth, and the winding number never decides the
side of every point."""

_LARGE_ENOUGH = 0.5
"""Share of the last ball's radius. If the last centre is now the centre of a ball this large, it is
a good start. If not, it may be far from the largest ball, because the bodies slid along each other.
"""


KIND_A = KIND_B = MeshTree
"""The kinds of both trees. Other entries substitute other kinds (see pairs/balls.py)."""


@entry
def begin_ball(solids, memory, pose_a, pose_b, rel_err, abs_err):
    """Start a search; its first seed is the centre of the ball that the last search found.

    The next seed is the middle of the region that both models share. If they overlap, it mostly
    lies inside both, and then their surfaces need not be compared.

    `solids` (2, n, 2) are the tables of both solids (see solid_table.py), `memory` is the search's
    table.
    """
    tree_a, _, region_a = solid_at(KIND_A, solids[0])
    tree_b, _, region_b = solid_at(KIND_B, solids[1])
    state = ball_at(OF_CELLS, memory)
    at, motions, best = state.at[0], state.motions, state.best[0]
    last = at.radius > 0.0
    at.large_enough = _LARGE_ENOUGH * at.radius if last else np.inf
    b_to_a = on_stack(12, 0.0)
    relative_motions(pose_a, pose_b, b_to_a, motions[1])
    for i in range(12):
        motions[0, i] = 1.0 if i == 0 or i == 4 or i == 8 else 0.0
    size = abs(b_to_a[9]) + abs(b_to_a[10]) + abs(b_to_a[11])
    size += tree_a.scale[2] + 2.0 * tree_a.scale[SWEPT]
    size += tree_b.scale[2] + 2.0 * tree_b.scale[SWEPT]
    error = deviation(pose_a) + deviation(pose_b)
    at.slack = (POINT_MARGIN + POSE_MARGIN * error) * size + POINT_FLOOR
    at.slack += points_err(tree_a) + points_err(tree_b)
    at.joints = max(joints_err(tree_a), joints_err(tree_b))
    holes = region_a.inside == HALF or region_b.inside == HALF
    at.floor = _TELLING * size if holes else 0.0
    at.rel_err, at.abs_err = min(rel_err, LOOSEST), min(abs_err, size)
    at.swept[0], at.swept[1] = tree_a.scale[SWEPT], tree_b.scale[SWEPT]
    at.radius = 0.0
    centre = (region_b.ball[0], region_b.ball[1], region_b.ball[2])
    way = sub(moved(b_to_a, centre), (region_a.ball[0], region_a.ball[1], region_a.ball[2]))
    apart = np.sqrt(dot(way, way)) * (1.0 - 1e-12) - 4.0 * at.slack
    at.dropped = at.ceiling = _largest(region_a, region_b, at, apart)
    at.size = at.climbs = at.newtons = at.seed = at.seeds = at.points = at.cells = 0
    at.task, at.turn, at.height, at.middle = IDLE, 0, 0, NONE
    at.framed = at.begun = False
    if last:
        add_seed(state, (best.place[0], best.place[1], best.place[2]))
    if at.ceiling > 0.0:
        take_axes(at.axes, way)
        middle, half = on_stack(3, 0.0), on_stack(3, 0.0)
        if common_box(tree_a, tree_b, region_a, region_b, state, middle, half):
            at.middle = at.seeds
            add_seed(state, in_a_frame(at.axes, middle))
    take_axes(at.axes, (1.0, 0.0, 0.0))
    for k in range(2):
        best.near[k] = max(best.near[k], 0)


@kernel
def add_seed(state, place):
    """Append a point of a's frame to the seeds, if there is room."""
    at = state.at[0]
    if at.seeds < state.seeds.shape[0]:
        for i in range(3):
            state.seeds[at.seeds, i] = place[i]
        at.seeds += 1


@kernel
def _largest(region_a, region_b, at, apart):
    """Return an upper bound of the radius of a ball in both models.

    The centres of the balls around both models are `apart` metres apart. A point of a model is no
    deeper than its depth in the ball around the model. If the model has no inside, it is no deeper
    than the swept radius. If the model has holes, the depth may reach the diameter of its ball.
    """
    a, b = region_a.ball[3] + at.swept[0], region_b.ball[3] + at.swept[1]
    if apart > a + b:
        return 0.0
    both = 0.5 * (a + b - apart)
    if region_a.inside == HALF or region_b.inside == HALF:
        both = np.inf
    if region_a.inside == NOWHERE:
        a = at.swept[0]
    elif region_a.inside == HALF:
        a += region_a.ball[3]
    if region_b.inside == NOWHERE:
        b = at.swept[1]
    elif region_b.inside == HALF:
        b += region_b.ball[3]
    return min(min(a, b), both) * (1.0 + 1e-12) + at.slack
