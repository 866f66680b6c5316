"""Triangle pairs of a search: sixteen are gathered, filtered together, and the rest tested."""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel, shared
from ..base.lanes import lowest
from ..base.rounding import OFFSET_MARGIN
from ..base.state import remembers
from ..base.trees import LARGEST
from ..base.vectors import along, moved, scaled, sub
from .direction import take_direction
from .swept import reach_of
from .triangles import certainly_cross, distance_apart, triangle_distance

_LEAP = 0.1
"""Share of the models' sizes."""

_TIED = 8.0
"""Up to how many times what rounding does to distances two of them count as equal."""


@kernel
def enough(progress):
    """Bound from which a pair cannot improve the answer by more than was asked for."""
    slack, radii = progress.slack, progress.radii
    distance = max(progress.distance, radii)
    upper = distance + slack
    share = (upper - radii) / (1.0 + progress.rel_err)
    least = min(distance - slack, radii + share - OFFSET_MARGIN * radii)
    return min(least, upper - progress.abs_err)


@inlined
def has_leapt(tree_a, tree_b, state):
    """Whether the models have moved so far since the last search that other points may be nearest.

    Where nothing is known of that, they have not.
    """
    sizes = tree_a.scale[LARGEST] + tree_b.scale[LARGEST]
    return remembers(state) and state.progress[0].step >= _LEAP * sizes


@inlined
def keep(state, distance, ta, tb, wa, wb, way):
    """Keep two points, by their triangles and weights, as the nearest so far.

    `way` leads from that of a to that of b, in a's frame.
    """
    progress = state.progress[0]
    progress.distance = distance
    progress.element_a, progress.element_b = ta, tb
    progress.weights_a[0], progress.weights_a[1], progress.weights_a[2] = wa
    progress.weights_b[0], progress.weights_b[1], progress.weights_b[2] = wb
    least = enough(progress)
    if state.collected.shape[0] > 0:
        # All that may be as near as the upper bound, distance + slack, matters; the second slack,
        # of many units in its last place, has the comparison leave out none.
        least += 2.0 * progress.deviations
        reach = reach_of(distance, progress.radii, progress.deviations)
        progress.enough = min(progress.enough, least)
        progress.limit = min(progress.limit, reach + 2.0 * progress.slack)
    else:
        progress.enough = min(progress.enough, least)
        progress.limit = progress.enough
    take_direction(progress, state.motions[0], way)


@kernel
def collect(state, first, second, distance):
    """Add a row to what is collected."""
    collected, n = state.collected, state.progress[0].collected
    collected[n, 0], collected[n, 1], collected[n, 2] = first, second, distance
    state.progress[0].collected = n + 1


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
def measure_triangles(tree_a, tree_b, state, ta, tb, bound):
    """Exact distance of two triangles; keeps it where it is the smallest. Returns it.

    `bound` is a lower bound of it: where it is positive, they certainly do not cross. Where they
    are as near as others, but in another direction, that is the next to measure along: their
    neighbours are so too.
    """
    progress = state.progress[0]
    a, b = _both(tree_a, tree_b, state, ta, tb)
    known = progress.distance
    tied = known + _TIED * progress.slack
    matters = np.inf if state.collected.shape[0] > 0 else tied * tied
    if bound > 0.0:
        squared, wa, wb = distance_apart(a, b, matters)
    else:
        squared, wa, wb = triangle_distance(a, b, matters)
    distance = np.sqrt(squared)
    if distance < tied:
        way = sub(mixed(b, wb), mixed(a, wa))
        if distance < known:
            if distance == 0.0 and certainly_cross(a, b, progress.slack):
                progress.upper_slack = 0.0
            keep(state, distance, ta, tb, wa, wb, way)
        else:
            take_direction(progress, state.motions[0], way)
    return distance


@kernel
def nearest_lane(values, lanes):
    """The lane whose value is smallest among the bits of `lanes`, which is not zero."""
    best = lowest(lanes)
    lanes &= lanes - 1
    while lanes:
        k = lowest(lanes)
        lanes &= lanes - 1
        if values[k] < values[best]:
            best = k
    return best
