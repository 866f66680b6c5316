"""The one search behind every question about two hierarchies.

A depth-first descent of the bounding volume test tree (Larsen et al. 1999, sections 5.1 and 6):
the pair whose bound is smallest comes first, the larger volume of a pair is opened, sixteen bounds
at a time. What has been found and what is still to do lives in `State`, so a search can be run in
slices, cut at any moment with certified bounds, and resumed.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np
from numba import uint64

from ..tolerances import POINT_FLOOR, POINT_MARGIN, POSE_MARGIN
from .build import EMPTY
from .jit import entry, kernel
from .motion import deviation, is_rigid, relative_motions
from .triangles import triangle_distance
from .vectors import moved
from .volumes import STRIDE, WIDTH, far_bound, lower_bounds, place

Tree = namedtuple("Tree", "nodes centres children sizes triangles scale")
"""A hierarchy as the kernels see it.

nodes (float32, flat) the volumes; centres (k, 4) each node's centre and reach in node units;
children (int32, k × 16) a node, ~triangle or EMPTY; sizes (float32, k × 16) each volume's extent
in node units; triangles (m, 9) in tree order, metres; scale (2,) metres in a node unit, and the
largest norm of a vertex in metres.
"""

State = namedtuple("State", "motions reals counts stack bounds contacts")
"""A search. motions (2, 12): b to a, a to b; reals and counts by the indices below; stack (int32,
n × 2) the pairs of volumes still to be looked at, as lanes 16 node + lane, and their lower bounds
(n,) in metres; contacts (int32, n × 2) the triangles that touch, where they are asked for (n > 0).
"""

DISTANCE, SLACK, BOUND_SLACK, LIMIT, REL_ERR, ABS_ERR, STOP = 0, 1, 2, 3, 4, 5, 6
"""Reals: smallest distance found; what rounding may have done to it, and to a moved volume; bound
from which a pair is pruned; the tolerances; distance at which the search may end. All metres."""
WEIGHTS_A, WEIGHTS_B, REALS = 7, 10, 13
"""Reals: barycentric weights of the nearest points, three each."""

DEPTH, TRIANGLE_A, TRIANGLE_B, BOUND_TESTS, PRIMITIVE_TESTS, CONTACTS, COUNTS = 0, 1, 2, 3, 4, 5, 6
"""Counts: pairs on the stack; the nearest triangles so far, in tree order; tests made; contacts
found."""

LOWER, UPPER, POINT_A, POINT_B, ANSWER = 0, 1, 2, 5, 8
"""An answer: the certified bounds, metres, and the witness points in the world."""

ENDED, CUT, BAD_POSE_A, BAD_POSE_B, CONTACTS_FULL = 0, 1, 2, 3, 4
"""What a slice of a search returns."""

@kernel
def _limit(reals):
    """Bound from which a pair cannot improve the answer by more than was asked for."""
    distance, slack = reals[DISTANCE], reals[SLACK]
    upper = distance + slack
    limit = distance - slack
    limit = min(limit, upper / (1.0 + reals[REL_ERR]))
    return min(limit, upper - reals[ABS_ERR])


@kernel
def corners(triangles, t):
    """The three corners of a triangle."""
    return (
        (triangles[t, 0], triangles[t, 1], triangles[t, 2]),
        (triangles[t, 3], triangles[t, 4], triangles[t, 5]),
        (triangles[t, 6], triangles[t, 7], triangles[t, 8]),
    )


@kernel
def _both(tree_a, tree_b, state, ta, tb):
    """The corners of two triangles in a's frame."""
    motion = state.motions[0]
    b = corners(tree_b.triangles, tb)
    b = (moved(motion, b[0]), moved(motion, b[1]), moved(motion, b[2]))
    return corners(tree_a.triangles, ta), b


@kernel
def test_triangles(tree_a, tree_b, state, ta, tb):
    """Exact distance of two triangles; keeps it where it is the smallest. Returns it."""
    reals, counts = state.reals, state.counts
    counts[PRIMITIVE_TESTS] += 1
    a, b = _both(tree_a, tree_b, state, ta, tb)
    known = reals[DISTANCE]
    squared, wa, wb = triangle_distance(a, b, known * known)
    distance = np.sqrt(squared)
    if distance < known:
        reals[DISTANCE] = distance
        counts[TRIANGLE_A], counts[TRIANGLE_B] = ta, tb
        reals[WEIGHTS_A], reals[WEIGHTS_A + 1], reals[WEIGHTS_A + 2] = wa
        reals[WEIGHTS_B], reals[WEIGHTS_B + 1], reals[WEIGHTS_B + 2] = wb
        reals[LIMIT] = min(reals[LIMIT], _limit(reals))
    return distance


@kernel
def _test_contact(tree_a, tree_b, state, ta, tb):
    """Note two triangles whose contact cannot be excluded."""
    counts, contacts, slack = state.counts, state.contacts, state.reals[SLACK]
    counts[PRIMITIVE_TESTS] += 1
    a, b = _both(tree_a, tree_b, state, ta, tb)
    squared, _, _ = triangle_distance(a, b, np.inf)
    if np.sqrt(squared) <= slack:
        contacts[counts[CONTACTS], 0], contacts[counts[CONTACTS], 1] = ta, tb
        counts[CONTACTS] += 1


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
    size = abs(t[9]) + abs(t[10]) + abs(t[11]) + tree_a.scale[1] + tree_b.scale[1]
    reals[SLACK] = POINT_MARGIN * size + POINT_FLOOR
    reals[BOUND_SLACK] = reals[SLACK] + POSE_MARGIN * (error_a + error_b) * size
    reals[DISTANCE] = np.inf
    reals[REL_ERR], reals[ABS_ERR], reals[STOP], reals[LIMIT] = rel_err, abs_err, stop, limit
    counts[BOUND_TESTS], counts[PRIMITIVE_TESTS], counts[CONTACTS] = 0, 0, 0
    state.stack[0, 0], state.stack[0, 1], state.bounds[0] = 0, 0, 0.0
    counts[DEPTH] = 1
    if state.contacts.shape[0] == 0:
        test_triangles(tree_a, tree_b, state, counts[TRIANGLE_A], counts[TRIANGLE_B])
    return CUT


@kernel
def _open(fixed, lane, tree, parent, motion, flip, state, single, found):
    """Bound one lane of the tree `fixed` against the sixteen under lane `parent` of `tree`.

    Pushes the pairs that survive, the nearest on top. `flip` says that `fixed` is tree b.
    """
    reals, counts, stack, bounds = state.reals, state.counts, state.stack, state.bounds
    node = tree.children[parent]
    own = lane // WIDTH
    fixed_centre = fixed.centres[own]
    centre = tree.centres[node]
    unit = tree.scale[0]
    limit = reals[LIMIT]
    inherited = bounds[counts[DEPTH]]
    counts[BOUND_TESTS] += WIDTH
    if place(
        fixed.nodes, own, lane % WIDTH, fixed_centre, fixed.scale[0], motion,
        centre, unit, centre[3], reals[BOUND_SLACK], single,
    ):  # fmt: skip
        lower_bounds(tree.nodes, uint64(node * STRIDE), single, found)
        reach = np.float32(min(limit / unit * (1.0 + 1e-6), 1e29))
    else:
        far = far_bound(
            fixed.nodes, own, lane % WIDTH, fixed_centre, fixed.scale[0], motion,
            centre, unit, centre[3], reals[BOUND_SLACK],
        )  # fmt: skip
        for k in range(WIDTH):
            empty = tree.children[node * WIDTH + k] == EMPTY
            found[k] = np.float32(1e30) if empty else np.float32(0.0)
        inherited = max(inherited, far)
        reach = np.float32(1e29)
    first = counts[DEPTH]
    top = first
    for k in range(WIDTH):
        if found[k] < reach:
            bound = max(inherited, found[k] * unit)
            if bound < limit:
                at = top
                while at > first and bounds[at - 1] < bound:
                    bounds[at] = bounds[at - 1]
                    stack[at, 0], stack[at, 1] = stack[at - 1, 0], stack[at - 1, 1]
                    at -= 1
                bounds[at] = bound
                child = node * WIDTH + k
                stack[at, 0] = child if flip else lane
                stack[at, 1] = lane if flip else child
                top += 1
    counts[DEPTH] = top


@kernel
def advance(tree_a, tree_b, state, steps):
    """Run at most `steps` steps of a search; returns ENDED, CUT or CONTACTS_FULL."""
    reals, counts, stack, bounds = state.reals, state.counts, state.stack, state.bounds
    single, found = np.empty(16, np.float32), np.empty(WIDTH, np.float32)
    room = state.contacts.shape[0]
    while counts[DEPTH] > 0:
        if reals[DISTANCE] - reals[SLACK] <= reals[STOP]:
            return ENDED
        if steps == 0:
            return CUT
        if room > 0 and counts[CONTACTS] == room:
            return CONTACTS_FULL
        counts[DEPTH] -= 1
        top = counts[DEPTH]
        if bounds[top] >= reals[LIMIT]:
            continue
        steps -= 1
        a, b = stack[top, 0], stack[top, 1]
        child_a, child_b = tree_a.children[a], tree_b.children[b]
        if child_a < 0 and child_b < 0:
            if room > 0:
                _test_contact(tree_a, tree_b, state, ~child_a, ~child_b)
            else:
                test_triangles(tree_a, tree_b, state, ~child_a, ~child_b)
        elif child_b < 0 or (
            child_a >= 0 and tree_a.sizes[a] * tree_a.scale[0] > tree_b.sizes[b] * tree_b.scale[0]
        ):
            _open(tree_b, b, tree_a, a, state.motions[0], True, state, single, found)
        else:
            _open(tree_a, a, tree_b, b, state.motions[1], False, state, single, found)
    return ENDED


@kernel
def finish(tree_a, tree_b, state, pose_a, pose_b, answer):
    """Write the certified bounds at this moment, and the witness points, into `answer`.

    The lower bound is the least of what was found, what was pruned and what is still to do.
    """
    reals, counts = state.reals, state.counts
    lower = min(reals[DISTANCE] - reals[SLACK], reals[LIMIT])
    for i in range(counts[DEPTH]):
        lower = min(lower, state.bounds[i])
    answer[LOWER] = max(lower, 0.0)
    # A crossing was proven by signs of determinants, up to the rounding of the motion.
    answer[UPPER] = reals[DISTANCE] + reals[SLACK]
    _witness(tree_a.triangles, counts[TRIANGLE_A], reals, WEIGHTS_A, pose_a, answer, POINT_A)
    _witness(tree_b.triangles, counts[TRIANGLE_B], reals, WEIGHTS_B, pose_b, answer, POINT_B)


@kernel
def _witness(triangles, t, reals, weights, pose, answer, at):
    """The point of triangle t with the given weights, in the world."""
    for i in range(3):
        answer[at + i] = pose[i, 3]
    for j in range(3):
        x = 0.0
        for corner in range(3):
            x += reals[weights + corner] * triangles[t, 3 * corner + j]
        for i in range(3):
            answer[at + i] += pose[i, j] * x


@entry
def search(
    tree_a, tree_b, state, pose_a, pose_b, rel_err, abs_err, stop, limit, steps, fresh, answer
):  # fmt: skip
    """Run a slice of a search, from its start where `fresh`, and write the answer so far."""
    if fresh:
        code = begin(tree_a, tree_b, state, pose_a, pose_b, rel_err, abs_err, stop, limit)
        if code != CUT:
            return code
    code = advance(tree_a, tree_b, state, steps)
    finish(tree_a, tree_b, state, pose_a, pose_b, answer)
    return code


@entry
def search_many(
    tree_a, tree_b, state, poses_a, poses_b, rel_err, abs_err, first, last, answers, triangles, tests
):  # fmt: skip
    """Answer the queries first to last, each starting from the last one's triangles.

    Writes answers (k, 8), triangles (k, 2) and tests (k, 2). Returns ENDED, or a code and the query
    where a pose is no rigid motion.
    """
    counts = state.counts
    counts[TRIANGLE_A], counts[TRIANGLE_B] = 0, 0
    for k in range(first, last):
        pose_a, pose_b = poses_a[k], poses_b[k]
        code = begin(tree_a, tree_b, state, pose_a, pose_b, rel_err, abs_err, 0.0, np.inf)
        if code != CUT:
            return code, k
        advance(tree_a, tree_b, state, -1)
        finish(tree_a, tree_b, state, pose_a, pose_b, answers[k])
        triangles[k, 0], triangles[k, 1] = counts[TRIANGLE_A], counts[TRIANGLE_B]
        tests[k, 0], tests[k, 1] = counts[BOUND_TESTS], counts[PRIMITIVE_TESTS]
    return ENDED, last
