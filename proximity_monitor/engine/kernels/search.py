"""The one search behind every question about two hierarchies.

Exact, approximate, tolerance, collision and budgeted queries are stopping rules of one refinement.
What has been found and what is still to do lives in `State`, so a search can be run in slices, cut
at any moment with certified bounds, and resumed.
"""

from __future__ import annotations

import numpy as np

from ..tolerances import MARGIN_A, MARGIN_B, MARGIN_T, POINT_FLOOR, POINT_MARGIN, POSE_MARGIN
from .aim import no_aim
from .descent import advance
from .jit import entry, kernel
from .motion import deviation, is_rigid, relative_motions
from .primitives import corners, mixed, test_triangles
from .state import (
    ABS_ERR,
    BAD_POSE_A,
    BAD_POSE_B,
    BASE,
    BOUND_SLACK,
    BOUND_TESTS,
    BREADTH_FIRST,
    COLLECTED,
    CUT,
    DEPTH,
    DISTANCE,
    ENDED,
    ENOUGH,
    FRAMES,
    LEVEL_END,
    LEVEL_LOWER,
    LIMIT,
    LOWER,
    NEAREST_A,
    NEAREST_B,
    NEXT_LOWER,
    ORDER,
    POINT_A,
    POINT_B,
    PRIMITIVE_TESTS,
    REL_ERR,
    SLACK,
    STOP,
    TRIANGLE_A,
    TRIANGLE_B,
    UPPER,
    UPPER_SLACK,
    WEIGHTS_A,
    WEIGHTS_B,
    State,
    Tree,
)


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
    relative_motions(pose_a, pose_b, motions[0], motions[1])
    t = motions[0]
    apart = np.sqrt(t[9] * t[9] + t[10] * t[10] + t[11] * t[11])
    size_a, size_b = tree_a.scale[2], tree_b.scale[2]
    reals[SLACK] = MARGIN_A * size_a + MARGIN_B * size_b + MARGIN_T * apart + POINT_FLOOR
    imperfect = POINT_MARGIN + POSE_MARGIN * (error_a + error_b)
    reals[BOUND_SLACK] = imperfect * (size_a + size_b + apart) + POINT_FLOOR
    reals[UPPER_SLACK] = reals[SLACK]
    reals[DISTANCE] = np.inf
    no_aim(reals)
    reals[REL_ERR], reals[ABS_ERR], reals[STOP] = rel_err, abs_err, stop
    reals[LIMIT], reals[ENOUGH] = limit, limit
    counts[BOUND_TESTS], counts[PRIMITIVE_TESTS], counts[COLLECTED] = 0, 1, 0
    state.stack[0, 0], state.stack[0, 1], state.bounds[0] = 0, 0, -np.inf
    counts[DEPTH], counts[BASE], counts[FRAMES] = 1, 0, 0
    counts[LEVEL_END], counts[NEAREST_A], counts[NEAREST_B] = 0, 0, 0
    reals[LEVEL_LOWER], reals[NEXT_LOWER] = 0.0, 0.0
    test_triangles(tree_a, tree_b, state, counts[TRIANGLE_A], counts[TRIANGLE_B])
    return CUT


@kernel
def finish(tree_a, tree_b, state, pose_a, pose_b, answer):
    """Write the certified bounds at this moment, and the witness points, into `answer`.

    The lower bound is the least of what was found, what was pruned and what is still to do.
    """
    reals, counts = state.reals, state.counts
    lower = min(reals[DISTANCE] - reals[SLACK], reals[ENOUGH])
    if counts[ORDER] != BREADTH_FIRST:
        for i in range(counts[DEPTH]):
            lower = min(lower, state.bounds[i])
    elif counts[DEPTH] > 0:
        # There may be a million of them.
        lower = min(lower, reals[LEVEL_LOWER])
    answer[LOWER] = max(lower, 0.0)
    answer[UPPER] = reals[DISTANCE] + reals[UPPER_SLACK]
    _witness(tree_a.triangles, counts[TRIANGLE_A], reals, WEIGHTS_A, pose_a, answer, POINT_A)
    _witness(tree_b.triangles, counts[TRIANGLE_B], reals, WEIGHTS_B, pose_b, answer, POINT_B)


@kernel
def _witness(triangles, t, reals, weights, pose, answer, at):
    """The point of triangle t with the given weights, in the world."""
    x = mixed(corners(triangles, t), reals[weights : weights + 3])
    for i in range(3):
        answer[at + i] = pose[i, 0] * x[0] + pose[i, 1] * x[1] + pose[i, 2] * x[2] + pose[i, 3]


@entry
def search(
    nodes_a, centres_a, children_a, sizes_a, triangles_a, scale_a,
    nodes_b, centres_b, children_b, sizes_b, triangles_b, scale_b,
    motions, reals, counts, stack, bounds, frames, collected, spread_a, spread_b,
    poses_a, poses_b, first, last, rel_err, abs_err, stop, limit, steps, fresh,
    answers, triangles, tests,
):  # fmt: skip
    """Answer the queries first to last at poses (k, 4, 4), each with at most `steps` steps.

    A query starts from the triangles that the last one left in `counts`; where not `fresh`, the
    first goes on with the search that `reals` to `frames` hold. Writes answers (k, 8), triangles
    (k, 2) in tree order and tests (k, 2). Returns ENDED, or another code and the query that it is
    about. (The trees and the state come field by field, which costs Python a third as much time.)
    """
    tree_a = Tree(nodes_a, centres_a, children_a, sizes_a, triangles_a, scale_a)
    tree_b = Tree(nodes_b, centres_b, children_b, sizes_b, triangles_b, scale_b)
    state = State(motions, reals, counts, stack, bounds, frames, collected, spread_a, spread_b)
    for k in range(first, last):
        pose_a, pose_b = poses_a[k], poses_b[k]
        if fresh or k > first:
            code = begin(tree_a, tree_b, state, pose_a, pose_b, rel_err, abs_err, stop, limit)
            if code != CUT:
                return code, k
        code = advance(tree_a, tree_b, state, steps)
        finish(tree_a, tree_b, state, pose_a, pose_b, answers[k])
        triangles[k, 0], triangles[k, 1] = counts[TRIANGLE_A], counts[TRIANGLE_B]
        tests[k, 0], tests[k, 1] = counts[BOUND_TESTS], counts[PRIMITIVE_TESTS]
        if code != ENDED:
            return code, k
    return ENDED, last
