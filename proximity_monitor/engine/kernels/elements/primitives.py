"""Measure triangle pairs exactly and keep the nearest points of a search."""

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

LEAP = 0.1
"""A motion by this share of both models' sizes is a leap; see `has_leapt`."""

_TIED = 8.0
"""Two distances that differ by less than this multiple of the slack count as equal."""


@kernel
def enough(progress):
    """Return the bound, metres, from which a pair cannot improve the answer by more than asked."""
    slack, radii = progress.slack, progress.radii
    distance = max(progress.distance, radii)
    upper = distance + slack
    share = (upper - radii) / (1.0 + progress.rel_err)
    least = min(distance - slack, radii + share - OFFSET_MARGIN * radii)
    return min(least, upper - progress.abs_err)


@inlined
def has_leapt(tree_a, tree_b, state, share):
    """Return whether the models moved so far that the nearest points may have jumped.

    That is a motion since the last search by at least a `share` of both models' sizes. If the
    search has no memory of one, returns False.
    """
    sizes = tree_a.scale[LARGEST] + tree_b.scale[LARGEST]
    return remembers(state) and state.progress[0].step >= share * sizes


@inlined
def keep(state, distance, ta, tb, wa, wb, way):
    """Keep two points, given by their triangles and weights, as the nearest so far.

    `way` is the vector from a's point to b's, in a's frame.
    """
    progress = state.progress[0]
    progress.distance = distance
    progress.element_a, progress.element_b = ta, tb
    progress.weights_a[0], progress.weights_a[1], progress.weights_a[2] = wa
    progress.weights_b[0], progress.weights_b[1], progress.weights_b[2] = wb
    least = enough(progress)
    if state.collected.shape[0] > 0:
        # Every pair that may be as near as the upper bound, distance + slack, matters. The second
        # slack is many units in the last place, so rounding the comparison loses no pair.
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
    """Append a row to `state.collected`."""
    collected, n = state.collected, state.progress[0].collected
    collected[n, 0], collected[n, 1], collected[n, 2] = first, second, distance
    state.progress[0].collected = n + 1


@kernel
def corners(triangles, t):
    """Return the three corners of a triangle."""
    return (
        (triangles[t, 0], triangles[t, 1], triangles[t, 2]),
        (triangles[t, 3], triangles[t, 4], triangles[t, 5]),
        (triangles[t, 6], triangles[t, 7], triangles[t, 8]),
    )


@kernel
def _both(tree_a, tree_b, state, ta, tb):
    """Return the corners of two triangles in a's frame."""
    motion = state.motions[0]
    b = corners(tree_b.triangles, tb)
    b = (moved(motion, b[0]), moved(motion, b[1]), moved(motion, b[2]))
    return corners(tree_a.triangles, ta), b


@kernel
def mixed(triangle, weights):
    """Return the point of a triangle that has the given barycentric weights."""
    p, q, r = triangle
    return along(along(scaled(p, weights[0]), q, weights[1]), r, weights[2])


@shared
def measure_triangles(tree_a, tree_b, state, ta, tb, bound):
    """Return the exact distance of two triangles; keep it if it is the smallest so far.

    `bound` is a lower bound of the distance: if it is positive, the triangles certainly do not
    cross. If the pair ties with the smallest distance, its direction becomes the search direction,
    because the neighbours of the pair tie as well.
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
    """Return the lane with the smallest value among the set bits of `lanes`, which is not zero."""
    best = lowest(lanes)
    lanes &= lanes - 1
    while lanes:
        k = lowest(lanes)
        lanes &= lanes - 1
        if values[k] < values[best]:
            best = k
    return best
