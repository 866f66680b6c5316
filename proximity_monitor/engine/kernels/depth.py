"""How deep two solids lie in each other: the deepest vertex of either inside the other.

Let f(x) be the distance of x to a closed surface, positive inside and negative outside. Between
two points of different sign lies the surface, so f changes by no more than x moves. A vertex within
s of a point c is thus at most f(c) + s deep. The search keeps volumes and vertices of both models
in one heap by such bounds and looks at the largest: whatever stops it, no vertex is deeper than the
largest bound left, and the answer is no shallower than the deepest found.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np
from numba import uint64

from ..tolerances import POINT_FLOOR, POINT_MARGIN, POSE_MARGIN
from .build import EMPTY
from .jit import entry, kernel
from .motion import deviation, relative_motions
from .nearest import nearest, point_triangle
from .primitives import corners
from .state import CUT, ENDED
from .vectors import add, dot, moved, scaled, sub
from .volumes import STRIDE, WIDTH, read_vector, row
from .winding import UNKNOWN, winding_number

Depth = namedtuple("Depth", "motions reals counts heap items stack bounds")
"""A search. motions (2, 12): b to a, a to b; reals and counts by the indices below; heap (n,) upper
bounds in metres, the largest first; items (int32, n × 3) what they bound: model (0: a, 1: b), lane
(>= 0) or ~(3 triangle + corner), and side (1 inside, -1 outside, 0 unknown); stack (int32) and
bounds: room for one point's descent.
"""

DEEPEST, SLACK, DOUBT, DROPPED, REL_ERR, ABS_ERR, REALS = 0, 1, 2, 3, 4, 5, 6
"""Reals, metres: depth of the deepest vertex found, -inf before one is; what rounding may have done
to a depth; the most that a vertex of unknown side may be deep; the largest bound that was pruned;
the tolerances."""

SIZE, MODEL, VERTEX, TRIANGLE, UNSURE, TESTS, NEAR, COUNTS = 0, 1, 2, 3, 4, 5, 6, 8
"""Counts: items in the heap; which model the deepest vertex is of, the vertex as 3 triangle +
corner and the nearest triangle of the other model, in tree order; vertices of unknown side; points
tested; the triangle of either model that was nearest last."""


@kernel
def _limit(reals):
    """Bound up to which nothing is worth a look: it differs by rounding or a tolerance alone."""
    certain = max(reals[DEEPEST] - reals[SLACK], 0.0)
    limit = max(reals[DEEPEST] + reals[SLACK], 0.0)
    if certain > 0.0:
        limit = max(limit, certain * (1.0 + reals[REL_ERR]))
    return max(limit, certain + reals[ABS_ERR])


@kernel
def _push(state, bound, model, index, side):
    """Put an item into the heap, unless its bound is not worth a look."""
    reals, counts, heap, items = state.reals, state.counts, state.heap, state.items
    if bound <= _limit(reals):
        reals[DROPPED] = max(reals[DROPPED], bound)
        return
    at = counts[SIZE]
    counts[SIZE] += 1
    while at > 0:
        above = (at - 1) // 2
        if heap[above] >= bound:
            break
        heap[at] = heap[above]
        items[at, 0], items[at, 1], items[at, 2] = items[above, 0], items[above, 1], items[above, 2]
        at = above
    heap[at] = bound
    items[at, 0], items[at, 1], items[at, 2] = model, index, side


@kernel
def _pop(state):
    """Take the item with the largest bound; returns (bound, model, index, side)."""
    counts, heap, items = state.counts, state.heap, state.items
    top = heap[0], np.int64(items[0, 0]), np.int64(items[0, 1]), np.int64(items[0, 2])
    counts[SIZE] -= 1
    n = counts[SIZE]
    bound = heap[n]
    at = 0
    while True:
        below = 2 * at + 1
        if below >= n:
            break
        if below + 1 < n and heap[below + 1] > heap[below]:
            below += 1
        if heap[below] <= bound:
            break
        heap[at] = heap[below]
        items[at, 0], items[at, 1], items[at, 2] = items[below, 0], items[below, 1], items[below, 2]
        at = below
    heap[at] = bound
    items[at, 0], items[at, 1], items[at, 2] = items[n, 0], items[n, 1], items[n, 2]
    return top


@kernel
def _distance_and_side(other, p, model, side, state, found):
    """Distance of p to the surface of `other`, in its frame, metres, and side where it is certain.

    The side of p is that of the exact point too, of which p is the rounded image.
    """
    reals, counts = state.reals, state.counts
    slack = reals[SLACK]
    near = NEAR + 1 - model
    distance, triangle = nearest(other, p, counts[near], slack, state.stack, state.bounds, found)
    counts[near] = triangle
    counts[TESTS] += 1
    if distance <= 2.0 * slack:
        return distance, 0
    if side == 0:
        winding = winding_number(other, p, slack, state.stack, found)
        if winding != UNKNOWN:
            side = -1 if winding == 0 else 1
    return distance, side


@kernel
def _corner(tree, vertex):
    t, i = vertex // 3, vertex % 3
    return (
        tree.triangles[t, 3 * i],
        tree.triangles[t, 3 * i + 1],
        tree.triangles[t, 3 * i + 2],
    )


@kernel
def _keep_vertex(model, vertex, distance, side, state):
    """Note one tested vertex, as 3 triangle + corner: the deepest so far, or of unknown side."""
    reals, counts = state.reals, state.counts
    if side == 0:
        counts[UNSURE] += 1
        reals[DOUBT] = max(reals[DOUBT], distance + reals[SLACK])
    elif side > 0 and distance > reals[DEEPEST]:
        reals[DEEPEST] = distance
        counts[MODEL], counts[VERTEX], counts[TRIANGLE] = model, vertex, counts[NEAR + 1 - model]


@kernel
def _sphere(tree, lane):
    """Centre and radius, metres, of a sphere around one lane's volume."""
    node = lane // WIDTH
    base = uint64(node * STRIDE + lane % WIDTH)
    centre = scaled(add(read_vector(tree.nodes, base), row(tree.centres, node)), tree.scale[0])
    u = read_vector(tree.nodes, base + uint64(3 * WIDTH))
    v = read_vector(tree.nodes, base + uint64(6 * WIDTH))
    # Half the rectangle's diagonal, its edges being perpendicular to float32's rounding.
    radius = np.sqrt(dot(u, u) + dot(v, v)) + tree.nodes[base + uint64(9 * WIDTH)]
    return centre, radius * tree.scale[0] * (1.0 + 1e-4)


@kernel
def _length(v):
    return np.sqrt(dot(v, v))


@kernel
def _open_lane(body, owned, model, lane, bound, centre, radius, distance, side, state):
    """Bound what stands under one lane of `body`, by the distance and side of its centre."""
    slack = state.reals[SLACK]
    depth = slack - distance if side < 0 else distance + slack
    bound = min(bound, depth + radius + slack)
    node = body.children[lane]
    first, last = node * WIDTH, (node + 1) * WIDTH
    if node < 0:
        first, last = lane, lane + 1
    for below in range(first, last):
        child = body.children[below]
        if child == EMPTY:
            continue
        if child >= 0:
            c, s = _sphere(body, below)
            away = _length(sub(c, centre))
            kept = side if away + 4.0 * slack < distance else 0
            _push(state, min(bound, depth + away + s + slack), model, below, kept)
            continue
        for corner in range(3):
            if owned[~child] >> corner & 1:
                vertex = 3 * ~child + corner
                away = _length(sub(_corner(body, vertex), centre))
                kept = side if away + 4.0 * slack < distance else 0
                _push(state, min(bound, depth + away + slack), model, ~vertex, kept)


@kernel
def _step(body, other, motion, owned, model, index, bound, side, state, found):
    """Look at one item of the heap: a lane of `body` (index >= 0) or a vertex."""
    if index >= 0:
        centre, radius = _sphere(body, index)
    else:
        centre, radius = _corner(body, ~index), 0.0
    distance, side = _distance_and_side(other, moved(motion, centre), model, side, state, found)
    if index >= 0:
        _open_lane(body, owned, model, index, bound, centre, radius, distance, side, state)
    else:
        _keep_vertex(model, ~index, distance, side, state)


@entry
def begin_depth(tree_a, tree_b, solid_a, solid_b, pose_a, pose_b, rel_err, abs_err, state):
    """Start a search: both models' roots, bounded by the balls around them.

    A point inside a solid is no deeper than it lies below the surface of the solid's ball, and no
    vertex of the other model lies nearer to that ball's centre than its own ball does.
    """
    motions, reals, counts = state.motions, state.reals, state.counts
    relative_motions(pose_a, pose_b, motions[0], motions[1])
    t = motions[0]
    size = abs(t[9]) + abs(t[10]) + abs(t[11]) + tree_a.scale[2] + tree_b.scale[2]
    error = deviation(pose_a) + deviation(pose_b)
    reals[SLACK] = (POINT_MARGIN + POSE_MARGIN * error) * size + POINT_FLOOR
    reals[DEEPEST] = -np.inf
    reals[DOUBT], reals[DROPPED] = 0.0, 0.0
    reals[REL_ERR], reals[ABS_ERR] = rel_err, abs_err
    counts[:] = 0
    ball_a, ball_b = solid_a.ball, solid_b.ball
    apart = _length(sub(
        moved(t, (ball_b[0], ball_b[1], ball_b[2])), (ball_a[0], ball_a[1], ball_a[2])
    )) - 2.0 * reals[SLACK]  # fmt: skip
    _push(state, ball_b[3] - max(apart - ball_a[3], 0.0) + reals[SLACK], 0, 0, 0)
    _push(state, ball_a[3] - max(apart - ball_b[3], 0.0) + reals[SLACK], 1, 0, 0)


@entry
def search_depth(tree_a, tree_b, solid_a, solid_b, state, samples, model, steps):
    """Test `samples`, vertices of one model as in Solid, then run at most `steps` steps.

    Fewer than 0 steps: run to the end. Returns ENDED or CUT.
    """
    counts = state.counts
    found = np.empty(WIDTH, np.float32)
    at = 0
    while True:
        if at < samples.shape[0]:
            bound, owner, index, side = np.inf, model, ~np.int64(samples[at]), 0
            at += 1
        elif counts[SIZE] == 0 or state.heap[0] <= _limit(state.reals):
            return ENDED
        elif steps == 0:
            return CUT
        else:
            steps -= 1
            bound, owner, index, side = _pop(state)
        # One call, so that the long code of a step is compiled once.
        if owner == 0:
            body, other, motion, owned = tree_a, tree_b, state.motions[1], solid_a.owned
        else:
            body, other, motion, owned = tree_b, tree_a, state.motions[0], solid_b.owned
        _step(body, other, motion, owned, owner, index, bound, side, state, found)


@entry
def deepest(tree_a, tree_b, state, weights):
    """Write into weights (3,) where on its triangle the point nearest to the deepest vertex lies.

    Returns the certified bounds of the depth, metres.
    """
    reals, counts = state.reals, state.counts
    upper = max(reals[DOUBT], max(reals[DROPPED], reals[DEEPEST] + reals[SLACK]))
    if counts[SIZE] > 0:
        upper = max(upper, state.heap[0])
    if reals[DEEPEST] > 0.0:
        if counts[MODEL] == 0:
            body, other, motion = tree_a, tree_b, state.motions[1]
        else:
            body, other, motion = tree_b, tree_a, state.motions[0]
        p = moved(motion, _corner(body, counts[VERTEX]))
        a, b, c = corners(other.triangles, counts[TRIANGLE])
        _, v, w = point_triangle(p, a, b, c)
        weights[0], weights[1], weights[2] = max(1.0 - v - w, 0.0), v, w
    return max(reals[DEEPEST] - reals[SLACK], 0.0), max(upper, 0.0)
