"""The one search behind every question about two hierarchies.

Exact, approximate, tolerance, collision and budgeted queries are stopping rules of one refinement.
What has been found and what is still to do lives in `State`, so a search can be run in slices, cut
at any moment with certified bounds, and resumed.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import entry, kernel
from ..base.memory import table_on_stack
from ..base.motion import deviation, is_rigid, relative_motions
from ..base.rounding import MARGIN_A, MARGIN_B, MARGIN_T, POINT_FLOOR, POINT_MARGIN, POSE_MARGIN
from ..base.state import (
    ABS_ERR,
    ANSWER,
    APPROACHED,
    BAD_POSE_A,
    BAD_POSE_B,
    BASE,
    BOUND_SLACK,
    BOUND_TESTS,
    BREADTH_FIRST,
    COLLECTED,
    CUT,
    CUT_BETWEEN,
    DEPTH,
    DEVIATION,
    DEVIATIONS,
    DISTANCE,
    ENDED,
    ENOUGH,
    EXACT,
    FEATURE_A,
    FEATURE_B,
    FRAMES,
    INTERSECTING,
    LEVEL_END,
    LEVEL_LOWER,
    LIMIT,
    LOWER,
    NEAREST_A,
    NEAREST_B,
    NEXT_LOWER,
    ORDER,
    OUT_OF_TIME,
    POINT_A,
    POINT_B,
    PRIMITIVE_TESTS,
    RADII,
    RADIUS_A,
    RADIUS_B,
    REL_ERR,
    SLACK,
    STATUS,
    STEPS,
    STOP,
    SWEPT,
    TESTS,
    TREE_A,
    TREE_B,
    TRIANGLE_A,
    TRIANGLE_B,
    UPPER,
    UPPER_SLACK,
    WEIGHTS_A,
    WEIGHTS_B,
    WITHIN_TOLERANCE,
)
from ..base.tables import state_at, tree_at
from ..elements.aim import no_aim
from ..elements.primitives import corners, mixed, test_triangles
from ..elements.swept import core_of, lower_of, upper_of
from ..inside.contain import settle_sign
from .approach import guess
from .coherence import travel
from .descent import advance

_ONE_QUERY = 8
"""Steps that a query takes as long as besides those of its descent."""


@kernel
def begin(tree_a, tree_b, state, pose_a, pose_b, rel_err, abs_err, stop, limit):
    """Start a search from the triangle pair that `state` remembers.

    Their distance is the first upper bound (triangle caching, section 6.2). Returns CUT, or which
    pose is no rigid motion.
    """
    motions, reals, counts = state.motions, state.reals, state.counts
    error_a, error_b = deviation(pose_a), deviation(pose_b)
    if not is_rigid(error_a):
        return BAD_POSE_A
    if not is_rigid(error_b):
        return BAD_POSE_B
    before = table_on_stack(2, 12, 0.0)
    for i in range(12):
        before[0, i], before[1, i] = motions[0, i], motions[1, i]
    slack = reals[BOUND_SLACK]
    relative_motions(pose_a, pose_b, motions[0], motions[1])
    t = motions[0]
    apart = np.sqrt(t[9] * t[9] + t[10] * t[10] + t[11] * t[11])
    size_a, size_b = tree_a.scale[2], tree_b.scale[2]
    reals[SLACK] = MARGIN_A * size_a + MARGIN_B * size_b + MARGIN_T * apart + POINT_FLOOR
    imperfect = POINT_MARGIN + POSE_MARGIN * (error_a + error_b)
    reals[BOUND_SLACK] = imperfect * (size_a + size_b + apart) + POINT_FLOOR
    if state.keys.shape[0] > 0:
        travel(tree_a, tree_b, state, before, slack)
    reals[UPPER_SLACK] = reals[SLACK]
    last = reals[DISTANCE]
    reals[DISTANCE] = np.inf
    no_aim(reals)
    reals[RADII] = tree_a.scale[SWEPT] + tree_b.scale[SWEPT]
    reals[DEVIATIONS] = tree_a.scale[DEVIATION] + tree_b.scale[DEVIATION]
    reals[REL_ERR], reals[ABS_ERR], reals[STOP] = rel_err, abs_err, stop + reals[RADII]
    limit = core_of(limit, reals[RADII], reals[DEVIATIONS])
    reals[LIMIT], reals[ENOUGH] = limit, limit
    counts[BOUND_TESTS], counts[PRIMITIVE_TESTS], counts[COLLECTED] = 0, 1, 0
    state.stack[0, 0], state.stack[0, 1], state.bounds[0] = 0, 0, -np.inf
    counts[DEPTH], counts[BASE], counts[FRAMES] = 1, 0, 0
    counts[LEVEL_END], counts[NEAREST_A], counts[NEAREST_B] = 0, 0, 0
    reals[LEVEL_LOWER], reals[NEXT_LOWER] = 0.0, 0.0
    test_triangles(tree_a, tree_b, state, counts[TRIANGLE_A], counts[TRIANGLE_B], 0.0)
    reals[APPROACHED] = guess(tree_a, tree_b, state, last)
    return CUT


@kernel
def finish(tree_a, tree_b, faces_a, faces_b, state, pose_a, pose_b, code, answer):
    """Write what is certain at this moment into `answer` (see state.py).

    The lower bound is the least of what was found, what was pruned and what is still to do. `code`
    is what the search returned last.
    """
    reals, counts = state.reals, state.counts
    certain = reals[DISTANCE] - reals[SLACK]
    lower = min(certain, reals[ENOUGH])
    if counts[ORDER] != BREADTH_FIRST:
        for i in range(counts[DEPTH]):
            lower = min(lower, state.bounds[i])
    elif counts[DEPTH] > 0:
        # There may be a million of them.
        lower = min(lower, reals[LEVEL_LOWER])
    radii, deviations = reals[RADII], reals[DEVIATIONS]
    answer[LOWER] = max(lower_of(lower, radii, deviations), 0.0)
    answer[UPPER] = upper_of(reals[DISTANCE] + reals[UPPER_SLACK], radii, deviations)
    ta, tb = counts[TRIANGLE_A], counts[TRIANGLE_B]
    _witness(tree_a.triangles, ta, reals, WEIGHTS_A, pose_a, answer, POINT_A)
    _witness(tree_b.triangles, tb, reals, WEIGHTS_B, pose_b, answer, POINT_B)
    for i in range(3):
        answer[FEATURE_A + i] = reals[WEIGHTS_A + i]
        answer[FEATURE_B + i] = reals[WEIGHTS_B + i]
    answer[FEATURE_A + 3], answer[FEATURE_B + 3] = faces_a[ta], faces_b[tb]
    answer[TREE_A], answer[TREE_B] = ta, tb
    answer[TESTS], answer[TESTS + 1] = counts[BOUND_TESTS], counts[PRIMITIVE_TESTS]
    answer[RADIUS_A], answer[RADIUS_B] = tree_a.scale[SWEPT], tree_b.scale[SWEPT]
    if code != ENDED:
        answer[STATUS] = OUT_OF_TIME
    elif lower_of(certain, radii, deviations) <= 0.0:
        answer[STATUS] = INTERSECTING
    else:
        enough = reals[ENOUGH] < certain or counts[DEPTH] > 0
        answer[STATUS] = WITHIN_TOLERANCE if enough else EXACT


@kernel
def _witness(triangles, t, reals, weights, pose, answer, at):
    """The point of triangle t with the given weights, in the world."""
    x = mixed(corners(triangles, t), reals[weights : weights + 3])
    for i in range(3):
        answer[at + i] = pose[i, 0] * x[0] + pose[i, 1] * x[1] + pose[i, 2] * x[2] + pose[i, 3]


@entry
def search(
    model_a, model_b, memory,
    poses_a, poses_b, first, last, rel_err, abs_err, stop, limit, steps, fresh, answers, unusual,
):  # fmt: skip
    """Answer the queries first to last at poses (4 k, 4), each with at most `steps` steps.

    No query begins once they took about as many together. It starts from the triangles that the
    last one left in the state; where not `fresh`, the first goes on with the search that the state
    holds. Models and state come as tables (see tables.py); `unusual` is as for `advance`. Writes
    answers (k ANSWER,). Returns ENDED, or another code and the query that it is about.
    """
    tree_a, faces_a = tree_at(model_a)
    tree_b, faces_b = tree_at(model_b)
    state = state_at(memory)
    left = steps
    for k in range(first, last):
        pose_a, pose_b = poses_a[4 * k : 4 * k + 4], poses_b[4 * k : 4 * k + 4]
        answer = answers[k * ANSWER : (k + 1) * ANSWER]
        if fresh or k > first:
            if left <= 0:
                return CUT_BETWEEN, k
            left -= _ONE_QUERY
            code = begin(tree_a, tree_b, state, pose_a, pose_b, rel_err, abs_err, stop, limit)
            if code != CUT:
                return code, k
        state.counts[STEPS] = steps
        code = advance(tree_a, tree_b, state, unusual)
        left -= steps - state.counts[STEPS]
        finish(tree_a, tree_b, faces_a, faces_b, state, pose_a, pose_b, code, answer)
        if code != ENDED:
            return code, k
    return ENDED, last


@entry
def search_pairs(
    models, memory, poses, pairs, hints, wanted, signed, insides,
    first, last, every, steps, fresh, answers, unusual,
):  # fmt: skip
    """Answer for the pairs first, first + every, ... below last, with `steps` steps for all.

    Args:
        models: (n, 2, 7) the bodies' tables (see tables.py).
        memory: that of a state whose stack suffices for any two of them.
        poses: (n, 4, 4) model to world.
        pairs: (k, 2) bodies.
        hints: (k, 2) triangles in tree order to start from; others than there are count as 0.
        wanted: (k, 3) rel_err, abs_err, and the clearance on one side of which a distance is known
            to be when its search may end; infinity for none.
        signed: (k,) whether the sign of the distance is wanted as well (see contain.py).
        insides: what the bodies enclose, where it is.
        first: where to begin; if not `fresh`, with the search that the state holds.
        last: one after the last pair.
        every: how far apart the pairs of this call are.
        steps: what a query may take in one go, and about how many all of them: so where a search
            is interrupted, and which of several nearest pairs it finds, depends on it alone.
        fresh: whether the first pair's search has not begun.
        answers: (k, ANSWER) written.
        unusual: as for `advance`.

    Returns:
        ENDED and `last`; or another code and the pair that it is about.
    """
    state = state_at(memory)
    counts = state.counts
    left = steps
    for k in range(first, last, every):
        i, j = pairs[k, 0], pairs[k, 1]
        tree_a, faces_a = tree_at(models[i])
        tree_b, faces_b = tree_at(models[j])
        if fresh or k > first:
            if left <= 0:
                return CUT_BETWEEN, k
            left -= _ONE_QUERY
            ta, tb = hints[k, 0], hints[k, 1]
            counts[TRIANGLE_A] = ta if 0 <= ta < len(faces_a) else 0
            counts[TRIANGLE_B] = tb if 0 <= tb < len(faces_b) else 0
            rel_err, abs_err, clearance = wanted[k]
            stop = 0.0 if clearance == np.inf else clearance
            limit = np.inf if clearance == np.inf else np.nextafter(clearance, np.inf)
            code = begin(tree_a, tree_b, state, poses[i], poses[j], rel_err, abs_err, stop, limit)
            if code != CUT:
                return code, k
        counts[STEPS] = steps
        code = advance(tree_a, tree_b, state, unusual)
        left -= steps - counts[STEPS]
        finish(tree_a, tree_b, faces_a, faces_b, state, poses[i], poses[j], code, answers[k])
        if signed[k]:
            settle_sign(insides, i, j, state, wanted[k, 2], code, answers[k])
        if code != ENDED:
            return code, k
    return ENDED, last
