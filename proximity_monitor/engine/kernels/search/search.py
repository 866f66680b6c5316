"""The one search behind every question about two hierarchies.

Exact, approximate, tolerance, collision and budgeted queries differ only in the rule that stops the
refinement. `State` holds what has been found and what is still to do. So a search can run in
slices, stop at any moment with certified bounds, and resume.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel
from ..base.memory import table_on_stack
from ..base.motion import deviation, is_rigid, relative_motions
from ..base.state import (
    ANSWER,
    BAD_POSE_A,
    BAD_POSE_B,
    CELLS_FULL,
    CUT,
    CUT_BETWEEN,
    ENDED,
    EXACT,
    FEATURE_A,
    FEATURE_B,
    INTERSECTING,
    KEEP,
    LOWER,
    OUT_OF_TIME,
    POINT_A,
    POINT_B,
    RADIUS_A,
    RADIUS_B,
    STATUS,
    SURFACE_A,
    TESTS,
    TREE_A,
    TREE_B,
    UPPER,
    WITHIN_TOLERANCE,
    remembers,
)
from ..base.tables import is_tree_of, queries_at, state_at, tree_at
from ..base.trees import DEVIATION, NONE, SWEPT
from ..base.vectors import dot, moved, sub
from ..elements.direction import forget_direction
from ..elements.primitives import keep
from ..elements.swept import core_of, lower_of, upper_of
from . import levels, queue, stack, undivided  # noqa: F401 - each implements some stubs
from .approach import begin_near
from .coherence import travel
from .descent import advance
from .stubs import (
    compare,
    least_open,
    least_undivided,
    measure,
    parameters,
    prepare,
    resolution,
    slacks,
    witness,
)

KIND_A = KIND_B = ORDER = WAITING = None
"""Placeholders. Each compiled entry substitutes its own types; see `answer_queries`."""

_POINTS, _FEATURES = (POINT_A, POINT_B), (FEATURE_A, FEATURE_B)
_TREES, _RADII = (TREE_A, TREE_B), (RADIUS_A, RADIUS_B)
"""Offsets in an answer of the fields about the first and the second model of the query."""

_ONE_QUERY = 8
"""Steps that the fixed cost of a query counts for, in addition to those of its descent."""


@kernel
def begin(tree_a, tree_b, state, pose_a, pose_b, query):
    """Start a search from the pair of elements that `state` remembers.

    Their distance is the first upper bound (triangle caching, Larsen et al. 1999, section 6.2).
    Returns CUT, or BAD_POSE_A or BAD_POSE_B if that pose is no rigid motion.
    """
    motions, progress = state.motions, state.progress[0]
    error_a, error_b = deviation(pose_a), deviation(pose_b)
    if not is_rigid(error_a):
        return BAD_POSE_A
    if not is_rigid(error_b):
        return BAD_POSE_B
    before = table_on_stack(2, 12, 0.0)
    for i in range(12):
        before[0, i], before[1, i] = motions[0, i], motions[1, i]
    slack = progress.bound_slack
    relative_motions(pose_a, pose_b, motions[0], motions[1])
    t = motions[0]
    apart = np.sqrt(t[9] * t[9] + t[10] * t[10] + t[11] * t[11])
    progress.slack, progress.bound_slack = slacks(tree_a, tree_b, apart, error_a + error_b)
    prepare(state.waiting, tree_a, tree_b, state)
    if remembers(state):
        travel(tree_a, tree_b, state, before, slack)
    progress.upper_slack = progress.slack
    last = progress.distance
    progress.distance = np.inf
    forget_direction(progress)
    progress.radii = tree_a.scale[SWEPT] + tree_b.scale[SWEPT]
    progress.deviations = tree_a.scale[DEVIATION] + tree_b.scale[DEVIATION]
    progress.rel_err = query.rel_err
    progress.abs_err = max(query.abs_err, resolution(state.waiting, tree_a, tree_b, progress.slack))
    progress.stop, progress.param_err = query.stop + progress.radii, query.param_err
    progress.volumes = query.limit == np.inf and query.param_err == np.inf
    limit = core_of(query.limit, progress.radii, progress.deviations)
    progress.limit, progress.enough = limit, limit
    progress.spent += progress.bound_tests
    progress.bound_tests, progress.primitive_tests, progress.collected = 0, 0, 0
    progress.waiting = 0
    pairs, bounds = state.open.pairs, state.open.bounds
    pairs[0, 0], pairs[0, 1], bounds[0] = 0, 0, -np.inf
    progress.open, progress.put_off, progress.base, progress.frames = 1, NONE, 0, 0
    progress.level_end, progress.nearest_a, progress.nearest_b = 0, 0, 0
    progress.level_lower, progress.next_lower = 0.0, 0.0
    ta, tb = progress.element_a, progress.element_b
    if 0.0 < last < np.inf:
        # The points that were nearest are still near each other. Measuring them takes a tenth of
        # the time that measuring their elements takes. Their distance errs by
        # 8.5 u |a| + 14.9 u |b| + 5.5 u |t|, which `slack` covers.
        p, q = witness(tree_a, ta, progress.weights_a), witness(tree_b, tb, progress.weights_b)
        way = sub(moved(motions[0], q), p)
        wa, wb = progress.weights_a, progress.weights_b
        wa, wb = (wa[0], wa[1], wa[2]), (wb[0], wb[1], wb[2])
        keep(state, np.sqrt(dot(way, way)), ta, tb, wa, wb, way)
    else:
        progress.primitive_tests = 1
        measure(tree_a, tree_b, state, ta, tb, 0.0)
    if query.alone:
        progress.open = 0
        compare(state.waiting, tree_a, tree_b, state, ta, tb)
    else:
        begin_near(tree_a, tree_b, state, last)
    return CUT


@kernel
def finish(tree_a, tree_b, labels_a, labels_b, state, pose_a, pose_b, turned, code, answer):
    """Write what is certain at this moment into `answer` (see state.py).

    The lower bound is the least of three: that of the distance found, of everything pruned, and of
    everything still to do. If `turned`, tree b is that of the first model of the query. `code` is
    the one that the search returned last.
    """
    progress = state.progress[0]
    certain = progress.distance - progress.slack
    lower = min(min(certain, progress.enough), least_open(state.open, state))
    lower = min(lower, least_undivided(state.waiting, progress))
    for i in range(progress.waiting):
        lower = min(lower, state.waiting.bounds[i])
    radii, deviations = progress.radii, progress.deviations
    answer[LOWER] = max(lower_of(lower, radii, deviations), 0.0)
    answer[UPPER] = upper_of(progress.distance + progress.upper_slack, radii, deviations)
    ta, tb = progress.element_a, progress.element_b
    p = witness(tree_a, ta, progress.weights_a)
    q = witness(tree_b, tb, progress.weights_b)
    first, second = (1, 0) if turned else (0, 1)
    _put_in_world(pose_a, p, answer, _POINTS[first])
    _put_in_world(pose_b, q, answer, _POINTS[second])
    at_a, at_b = _FEATURES[first], _FEATURES[second]
    answer[at_a], answer[at_a + 1], answer[at_a + 2] = parameters(tree_a, ta, progress.weights_a)
    answer[at_b], answer[at_b + 1], answer[at_b + 2] = parameters(tree_b, tb, progress.weights_b)
    answer[at_a + 3], answer[at_b + 3] = labels_a[ta], labels_b[tb]
    answer[_TREES[first]], answer[_TREES[second]] = ta, tb
    answer[TESTS], answer[TESTS + 1] = progress.bound_tests, progress.primitive_tests
    answer[_RADII[first]] = tree_a.scale[SWEPT]
    answer[_RADII[second]] = tree_b.scale[SWEPT]
    for i in range(SURFACE_A, ANSWER):
        answer[i] = 0.0
    if code != ENDED:
        answer[STATUS] = OUT_OF_TIME
    elif lower_of(certain, radii, deviations) <= 0.0:
        answer[STATUS] = INTERSECTING
    else:
        finest = progress.enough + resolution(state.waiting, tree_a, tree_b, progress.slack)
        enough = finest < certain or progress.open > 0
        answer[STATUS] = WITHIN_TOLERANCE if enough else EXACT


@kernel
def _put_in_world(pose, x, answer, at):
    for i in range(3):
        answer[at + i] = pose[i, 0] * x[0] + pose[i, 1] * x[1] + pose[i, 2] * x[2] + pose[i, 3]


def answer_queries(
    models, memory, poses_a, poses_b, asked, first, last, every, steps, fresh, answers,
):  # fmt: skip
    """Answer the queries first, first + every, ... below last, with `steps` steps for all.

    Each kind of pair and each order has an entry made from this function (see `specialised`).
    KIND_A and KIND_B become the types of both trees, ORDER the type of `State.open` and WAITING
    that of `State.waiting`. If KIND_A and KIND_B differ, a query's models may come in either order.

    Args:
        models: (n, m, 2) the models' tables (see tables.py).
        memory: the table of a state with room enough for any two of the models.
        poses_a: (4 n, 4) poses of first models, model to world, one below the other.
        poses_b: the same for second models; the two may be one array.
        asked: the table of one array (k,) QUERY; or (1,), one query for all pairs of poses: its
            pose indices increase by one from each pair to the next. Elements to start with that do
            not exist count as UNKNOWN.
        first: the first query; if not `fresh`, the state holds its search, which is resumed.
        last: one after the last query.
        every: the distance between the queries of this call.
        steps: the most that one query may take at a time, and about the most for all. So `steps`
            alone determines where a search is interrupted, and which of several nearest pairs it
            finds.
        fresh: whether the first query's search has not begun.
        answers: (k ANSWER,) written, one after the other.

    Returns:
        ENDED and `last`; or another code and the query to which it applies.
    """
    state = state_at(ORDER, WAITING, memory)
    (queries,) = queries_at(asked)
    progress = state.progress[0]
    left = steps
    for k in range(first, last, every):
        ahead = k if len(queries) == 1 else 0
        query = queries[k - ahead]
        turned = not is_tree_of(KIND_A, models[query.bodies[0]])
        i, j = (1, 0) if turned else (0, 1)
        tree_a, labels_a = tree_at(KIND_A, models[query.bodies[i]])
        tree_b, labels_b = tree_at(KIND_B, models[query.bodies[j]])
        at_a, at_b = 4 * (query.poses[i] + ahead), 4 * (query.poses[j] + ahead)
        pose_a, pose_b = poses_a[at_a : at_a + 4], poses_b[at_b : at_b + 4]
        if turned:
            pose_a, pose_b = poses_b[at_a : at_a + 4], poses_a[at_b : at_b + 4]
        if fresh or k > first:
            if left <= 0:
                return CUT_BETWEEN, k
            left -= _ONE_QUERY
            ta, tb = query.nearest[i], query.nearest[j]
            if ta != KEEP:  # what the state found last may be about other models
                known = 0 <= ta < len(labels_a) and 0 <= tb < len(labels_b)
                progress.element_a, progress.element_b = ta if known else 0, tb if known else 0
                progress.distance = np.inf if known else 0.0
            progress.steps = steps
            code = begin(tree_a, tree_b, state, pose_a, pose_b, query)
            if code != CUT:
                if turned:
                    code = BAD_POSE_B if code == BAD_POSE_A else BAD_POSE_A
                return code, k
        progress.steps = steps
        code = advance(tree_a, tree_b, state)
        left -= steps - progress.steps
        answer = answers[ANSWER * k : ANSWER * (k + 1)]
        finish(tree_a, tree_b, labels_a, labels_b, state, pose_a, pose_b, turned, code, answer)
        if code != ENDED and code != CELLS_FULL:
            return code, k
    return ENDED, last
