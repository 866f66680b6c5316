"""Triangle pairs of a search: sixteen are gathered, filtered together, and the rest tested."""

from __future__ import annotations

import numpy as np
from numba import float32

from ..base.jit import inlined, kernel, shared
from ..base.lanes import lowest, not_above
from ..base.rounding import OFFSET_MARGIN
from ..base.state import (
    ABS_ERR,
    COLLECTED,
    DEVIATIONS,
    DISTANCE,
    ENOUGH,
    LIMIT,
    RADII,
    REL_ERR,
    SLACK,
    TRIANGLE_A,
    TRIANGLE_B,
    UPPER_SLACK,
    WEIGHTS_A,
    WEIGHTS_B,
)
from ..base.vectors import along, moved, scaled, sub
from ..bounds.gaps import BATCH, gaps, gather, shift
from .aim import gap_along, take_aim
from .swept import reach_of
from .triangles import certainly_cross, distance_apart, triangle_distance

_TIED = 8.0
"""Up to how many times what rounding does to distances two of them count as equal."""


@kernel
def enough(reals):
    """Bound from which a pair cannot improve the answer by more than was asked for."""
    slack, radii = reals[SLACK], reals[RADII]
    distance = max(reals[DISTANCE], radii)
    upper = distance + slack
    share = (upper - radii) / (1.0 + reals[REL_ERR])
    least = min(distance - slack, radii + share - OFFSET_MARGIN * radii)
    return min(least, upper - reals[ABS_ERR])


@inlined
def keep(state, distance, ta, tb, wa, wb, way):
    """Keep two points, by their triangles and weights, as the nearest so far.

    `way` leads from that of a to that of b, in a's frame.
    """
    reals, counts = state.reals, state.counts
    reals[DISTANCE] = distance
    counts[TRIANGLE_A], counts[TRIANGLE_B] = ta, tb
    reals[WEIGHTS_A], reals[WEIGHTS_A + 1], reals[WEIGHTS_A + 2] = wa
    reals[WEIGHTS_B], reals[WEIGHTS_B + 1], reals[WEIGHTS_B + 2] = wb
    least = enough(reals)
    if state.collected.shape[0] > 0:
        # All that may be as near as the upper bound, distance + slack, matters; the second slack,
        # of many units in its last place, has the comparison leave out none.
        least += 2.0 * reals[DEVIATIONS]
        reach = reach_of(distance, reals[RADII], reals[DEVIATIONS])
        reals[ENOUGH] = min(reals[ENOUGH], least)
        reals[LIMIT] = min(reals[LIMIT], reach + 2.0 * reals[SLACK])
    else:
        reals[ENOUGH] = min(reals[ENOUGH], least)
        reals[LIMIT] = reals[ENOUGH]
    take_aim(reals, state.motions[0], way)


@kernel
def collect(state, first, second, distance):
    """Add a row to what is collected."""
    collected, n = state.collected, state.counts[COLLECTED]
    collected[n, 0], collected[n, 1], collected[n, 2] = first, second, distance
    state.counts[COLLECTED] = n + 1


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
def mixed(triangle, weights):
    """The point of a triangle with the given weights."""
    p, q, r = triangle
    return along(along(scaled(p, weights[0]), q, weights[1]), r, weights[2])


@shared
def test_triangles(tree_a, tree_b, state, ta, tb, bound):
    """Exact distance of two triangles; keeps it where it is the smallest. Returns it.

    `bound` is a lower bound of it: where it is positive, they certainly do not cross. Where they
    are as near as others, but in another direction, that is the next to measure along: their
    neighbours are so too.
    """
    reals = state.reals
    a, b = _both(tree_a, tree_b, state, ta, tb)
    known = reals[DISTANCE]
    tied = known + _TIED * reals[SLACK]
    matters = np.inf if state.collected.shape[0] > 0 else tied * tied
    if bound > 0.0:
        squared, wa, wb = distance_apart(a, b, matters)
    else:
        squared, wa, wb = triangle_distance(a, b, matters)
    distance = np.sqrt(squared)
    if distance < tied:
        way = sub(mixed(b, wb), mixed(a, wa))
        if distance < known:
            if distance == 0.0 and certainly_cross(a, b, reals[SLACK]):
                reals[UPPER_SLACK] = 0.0
            keep(state, distance, ta, tb, wa, wb, way)
        else:
            take_aim(reals, state.motions[0], way)
    return distance


@kernel
def _nearest(values, lanes):
    """The lane whose value is smallest among the bits of `lanes`, which is not zero."""
    best = lowest(lanes)
    lanes &= lanes - 1
    while lanes:
        k = lowest(lanes)
        lanes &= lanes - 1
        if values[k] < values[best]:
            best = k
    return best


@kernel
def test_batch(tree_a, tree_b, state, pairs, count, corners, local, found):
    """Test the first `count` pairs of triangles (BATCH, 2), whose corners have been gathered.

    The pair with the smallest lower bound comes first: what it makes of the distance often
    dismisses the others. Returns how many were tested exactly.
    """
    reals = state.reals
    tested = 0
    scale = min(tree_a.scale[1], tree_b.scale[1])
    for k in range(count, BATCH):
        gather(tree_a.triangles, pairs[0, 0], tree_b.triangles, pairs[0, 1], k, corners)
    shift(corners, state.motions[0], scale, local)
    gaps(local, float32(reals[SLACK] * scale * (1.0 + 1e-6)), found)
    remaining = (1 << count) - 1
    while True:
        reach = np.float32(min(reals[LIMIT] * scale * (1.0 + 1e-6), 3e38))
        remaining &= not_above(found, 0, reach)
        if not remaining:
            break
        k = _nearest(found, remaining)
        remaining &= ~(1 << k)
        ta, tb = pairs[k, 0], pairs[k, 1]
        if tested > 0:  # the direction to measure along may have changed since they were gathered
            gap = gap_along(reals, tree_a.triangles, ta, tree_b.triangles, tb)
            if gap >= reals[LIMIT]:
                continue
        distance = test_triangles(tree_a, tree_b, state, ta, tb, np.float64(found[k]))
        tested += 1
        if state.collected.shape[0] > 0 and distance - reals[SLACK] < reals[LIMIT]:
            collect(state, ta, tb, distance)
    return tested
