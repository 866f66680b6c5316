"""How deep two models lie in each other: the deepest vertex of either inside the other.

A vertex within s of a point c is at most f(c) + s deep, f being the signed distance of `probe`; or
|f(c)| + s where the other's surface is open and f no more continuous, unless all points within s
are known to lie outside. The search keeps volumes and vertices of both models in one heap by such
bounds and looks at the largest: whatever stops it, no vertex is deeper than the largest bound left,
and the answer is no shallower than the deepest found. Inside a surface there is nothing.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np
from numba import uint64

from ..base.jit import entry, kernel
from ..base.memory import on_stack
from ..base.motion import deviation, relative_motions
from ..base.rounding import POINT_FLOOR, POINT_MARGIN, POSE_MARGIN
from ..base.state import CUT, ENDED
from ..base.vectors import add, moved, scaled, sub
from ..elements.primitives import corners
from ..tree.layout import EMPTY, STRIDE, WIDTH, first_of, last_of, read_vector, row
from .nearest import point_triangle
from .probe import NEAR, TESTS, TOP, descend, length, remembered, result, start
from .solids import NOWHERE, WHOLE

Depth = namedtuple("Depth", "motions reals counts heap items probe")
"""A search. motions (2, 12): b to a, a to b; reals and counts by the indices below; heap (n,) upper
bounds in metres, the largest first; items (int32, n × 3) what they bound: model (0: a, 1: b), lane
(>= 0) or ~(3 triangle + corner), and side (1 inside, -1 outside, 0 unknown); probe: the test of the
item that is on top, or of a sample.
"""

DEEPEST, SLACK, DOUBT, DROPPED, REL_ERR, ABS_ERR, REALS = 0, 1, 2, 3, 4, 5, 6
"""Reals, metres: depth of the deepest vertex found, -inf before one is; what rounding may have done
to a depth; the most that a vertex of unknown side may be deep; the largest bound that was pruned;
the tolerances."""

SIZE, MODEL, VERTEX, TRIANGLE, UNSURE, SAMPLED, COUNTS = 0, 1, 2, 3, 4, 5, 6
"""Counts: items in the heap; which model the deepest vertex is of, the vertex as 3 triangle +
corner and the nearest triangle of the other model, in tree order; vertices of unknown side; the
sample that is next, of a first, -1 being the vertex that was deepest in the search before."""

_SPARE = 0.125
"""Share of a volume's radius to which the distance of its centre is found. The volume's bound is
that much worse, and a centre that is much the same distance from everything is found sooner."""

_STALE = 0.25
"""Share of a volume's radius that what is remembered of its centre may be wrong by; else it is
tested anew."""

_ITEM_STEPS = 16
"""What an item costs beside the descent of its test, in steps of that."""


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
    """Take away the item with the largest bound."""
    counts, heap, items = state.counts, state.heap, state.items
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
        counts[MODEL], counts[VERTEX] = model, vertex
        counts[TRIANGLE] = state.probe.counts[NEAR + 1 - model]


@kernel
def sphere_of(tree, lane):
    """Centre and radius, metres, of a sphere around one lane's volume."""
    node = lane // WIDTH
    base = uint64(node * STRIDE + lane % WIDTH)
    centre = scaled(add(read_vector(tree.nodes, base), row(tree.centres, node)), tree.scale[0])
    a = np.float64(tree.nodes[base + uint64(10 * WIDTH)])
    b = np.float64(tree.nodes[base + uint64(11 * WIDTH)])
    # Half the rectangle's diagonal, its axes being perpendicular to float32's rounding.
    radius = np.sqrt(a * a + b * b) + tree.nodes[base + uint64(9 * WIDTH)]
    return centre, radius * tree.scale[0] * (1.0 + 1e-4)


@kernel
def _push_below(bound, model, index, side, away, radius, deep, clear, state):
    """Put what stands below a lane into the heap, unless it surely lies outside.

    It lies within `radius` of a point that is `away` from the lane's centre.
    """
    slack = state.reals[SLACK]
    if side < 0 and away + radius + slack < clear:
        return
    kept = side if away < clear else 0
    _push(state, min(bound, deep + away + radius + slack), model, index, kept)


@kernel
def _open_lane(body, owned, model, lane, bound, centre, radius, deep, clear, side, state):
    """Bound what stands under one lane of `body`, whose centre is `deep` deep or less.

    All points less than `clear` away from that are on its side, if it is known.
    """
    bound = min(bound, deep + radius + state.reals[SLACK])
    node = body.children[lane]
    first, last = node * WIDTH, (node + 1) * WIDTH
    if node < 0:
        first, last = lane, lane + 1
    for below in range(first, last):
        child = body.children[below]
        if child == EMPTY:
            continue
        if child >= 0:
            c, s = sphere_of(body, below)
            away = length(sub(c, centre))
            _push_below(bound, model, below, side, away, s, deep, clear, state)
            continue
        for vertex in range(3 * first_of(child), 3 * last_of(child) + 3):
            if owned[vertex // 3] >> vertex % 3 & 1:
                away = length(sub(_corner(body, vertex), centre))
                _push_below(bound, model, ~vertex, side, away, 0.0, deep, clear, state)


@kernel
def _step(
    body, other, region, motion, owned, model, index, bound, side, sample, state, found, steps
):
    """Look at a lane of `body` (index >= 0) or a vertex: the top of the heap, or a sample.

    `region` is that of the other. Returns how many of the steps are left; none where its test is
    not over.
    """
    reals, counts, probe = state.reals, state.counts, state.probe
    slack = reals[SLACK]
    if index >= 0:
        centre, radius = sphere_of(body, index)
    else:
        centre, radius = _corner(body, ~index), 0.0
    p = moved(motion, centre)
    key, spare = 2 * index + model, _SPARE * radius
    test = True
    error, value, known, clear = np.inf, 0.0, 0, 0.0
    if probe.counts[TOP] == 0:
        error, value, known, clear = remembered(probe, region, p, key, slack)
        if sample:
            test = known >= 0
        elif index >= 0:
            test = error > _STALE * radius
        else:
            test = value + error > _limit(reals)
        if test:
            start(probe, other, p, model)
            side = known if known != 0 else side
    if test:
        steps = descend(probe, other, p, model, slack, spare, found, steps)
        if probe.counts[TOP] > 0:
            return 0
        error, value, side, clear = result(probe, other, region, p, key, slack, spare, side, found)
    elif known != 0:
        side = known
    # The vertex that was deepest before is a guess: that its side is uncertain says nothing yet.
    guess = sample and counts[SAMPLED] < 0
    if sample:
        counts[SAMPLED] += 1
    else:
        _pop(state)
    if index >= 0:
        deep = value + error
        clear -= 4.0 * slack
        if region.inside != WHOLE:
            deep = abs(value) + error
        _open_lane(body, owned, model, index, bound, centre, radius, deep, clear, side, state)
    elif test and not (guess and side == 0):
        _keep_vertex(model, ~index, value, side, state)
    elif not test and not sample:
        reals[DROPPED] = max(reals[DROPPED], min(bound, value + error))
    return steps - _ITEM_STEPS


@kernel
def _deepest_possible(region, apart, radius):
    """Bound of the depth in a region of a body within `radius` of a point `apart` from its centre.

    A point inside a closed surface is no deeper than it lies below the surface of its ball; one
    inside an open one is no farther from it than two points of the ball are. Below 0 there is none.
    """
    ball = region.ball
    below = ball[3] - max(apart - radius, 0.0)
    return 2.0 * ball[3] if below >= 0.0 and region.inside != WHOLE else below


@entry
def begin_depth(tree_a, tree_b, region_a, region_b, pose_a, pose_b, rel_err, abs_err, state):
    """Start a search: the roots of what may lie inside the other, bounded by the balls around them.

    No vertex of one model lies nearer to the centre of the other's ball than its own ball does.
    What was deepest in the search before, if anything, is the first sample.
    """
    motions, reals, counts = state.motions, state.reals, state.counts
    relative_motions(pose_a, pose_b, motions[0], motions[1])
    t = motions[0]
    size = abs(t[9]) + abs(t[10]) + abs(t[11]) + tree_a.scale[2] + tree_b.scale[2]
    error = deviation(pose_a) + deviation(pose_b)
    counts[SAMPLED] = -1 if reals[DEEPEST] > reals[SLACK] else 0
    reals[SLACK] = (POINT_MARGIN + POSE_MARGIN * error) * size + POINT_FLOOR
    reals[DEEPEST] = -np.inf
    reals[DOUBT], reals[DROPPED] = 0.0, 0.0
    reals[REL_ERR], reals[ABS_ERR] = rel_err, abs_err
    counts[SIZE], counts[UNSURE] = 0, 0
    state.probe.counts[TESTS], state.probe.counts[TOP] = 0, 0
    ball_a, ball_b = region_a.ball, region_b.ball
    apart = length(sub(
        moved(t, (ball_b[0], ball_b[1], ball_b[2])), (ball_a[0], ball_a[1], ball_a[2])
    )) - 2.0 * reals[SLACK]  # fmt: skip
    if region_b.inside != NOWHERE:
        _push(state, _deepest_possible(region_b, apart, ball_a[3]) + reals[SLACK], 0, 0, 0)
    if region_a.inside != NOWHERE:
        _push(state, _deepest_possible(region_a, apart, ball_b[3]) + reals[SLACK], 1, 0, 0)


@kernel
def _sample(state, region_a, region_b, first):
    """The vertex that is tested next before any search: (bound, model, index, side).

    The first so many are of a.
    """
    i = state.counts[SAMPLED]
    if i < 0:
        return np.inf, state.counts[MODEL], ~state.counts[VERTEX], 0
    if i < first:
        return np.inf, 0, ~np.int64(region_a.samples[i]), 0
    return np.inf, 1, ~np.int64(region_b.samples[i - first]), 0


@entry
def search_depth(tree_a, tree_b, region_a, region_b, state, samples_alone, steps):
    """Test the samples until one lies inside, then search for the deepest vertex.

    At most `steps` steps, and no search where `samples_alone`. Returns ENDED or CUT.
    """
    counts, reals = state.counts, state.reals
    found = on_stack(WIDTH, np.float32(0.0))
    first = region_a.samples.shape[0] if region_b.inside != NOWHERE else 0
    last = first + (region_b.samples.shape[0] if region_a.inside != NOWHERE else 0)
    while True:
        sample = counts[SAMPLED] < last and reals[DEEPEST] <= reals[SLACK]
        if sample:
            bound, owner, index, side = _sample(state, region_a, region_b, first)
        elif samples_alone or counts[SIZE] == 0 or state.heap[0] <= _limit(reals):
            return ENDED
        else:
            bound, owner = state.heap[0], np.int64(state.items[0, 0])
            index, side = np.int64(state.items[0, 1]), np.int64(state.items[0, 2])
        if steps <= 0:
            return CUT
        # One call, so that the long code of a step is compiled once.
        if owner == 0:
            body, other, motion = tree_a, tree_b, state.motions[1]
            owned, region = region_a.owned, region_b
        else:
            body, other, motion = tree_b, tree_a, state.motions[0]
            owned, region = region_b.owned, region_a
        steps = _step(
            body, other, region, motion, owned, owner, index, bound, side, sample, state, found,
            steps,
        )  # fmt: skip


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
