"""Bounds of a pair of rings: a fat arc of a over the full turn and a fat arc of b in a sector."""

from __future__ import annotations

import math

import numpy as np

from ..base.jit import inlined, kernel
from ..base.trees import NONE
from .arcs import fit_arc
from .bound import begin_of, facing, normal_of_b, spread_of
from .build import NARROW, put_halves
from .certificate import least_around
from .coaxial import ALIKE, between_circles, facing_about_axis, in_ball
from .front import FRONT, keep_ring
from .heap import add_ring
from .minima import find_minimum, measure_rings
from .reach import arc_at, bulge, coarse_of, reach_of

MINIMUM_STEPS = 6
"""Steps of a search that a search for one local minimum counts as."""

MOST = 1 << 18
"""Bounds after which a search opens no more pairs: a quarter of a second."""

_AROUND = 1.5
"""How far from the middle of a sector its minimum may be, as a multiple of half its angle."""

_FINE = 0.5
"""Arcs are fine enough if their errors are below this share of the tolerance that was asked for."""

_COARSE = 0.03
"""How large the errors of arcs may be between two chords, as a share of the chords' distance."""


@inlined
def direction_kept(progress):
    """Return the direction between the nearest points known, in a's plane, and its azimuth."""
    along = progress.along
    return (along[0], along[1]), (along[2], along[3])


@inlined
def fineness(progress):
    """Return the error below which arcs are not looked into, metres."""
    return _FINE * (progress.distance - progress.enough)


@inlined
def coarseness(progress, apart):
    """Return the same for arcs `apart` metres from each other: far arcs need not be as fine."""
    return max(fineness(progress), _COARSE * apart)


@inlined
def beyond(progress):
    """Return the limit plus a slack, metres: a value above it, rounded, is still above the limit.

    The slack only affects how far arcs are looked into: no reach is ever returned too small.
    """
    return progress.limit + progress.bound_slack


@inlined
def gap_along(tree_a, tree_b, state, a, b, sector, motion, n, e, fine):
    """Return the gap of a pair of rings along a direction of a's plane, lowered by the slacks.

    If the gap is beyond the limit, the result may be any value beyond the limit, up to the gap.
    """
    progress, waiting = state.progress[0], state.waiting
    # The coarse reach of a often suffices. If not, b begins before `wanted`, so that `begin` is as
    # good as it can be. The second slack makes up for rounding.
    enough = progress.slack + progress.bound_slack + beyond(progress)
    wanted = coarse_of(tree_a, waiting.arcs_a, a, n[0], n[1]) + (enough + progress.bound_slack)
    begin = begin_of(tree_b, waiting.arcs_b, b, fine, sector, motion, n, e, wanted)
    reach = reach_of(tree_a, waiting.arcs_a, a, fine, n[0], n[1], begin - enough)
    return begin - (reach + progress.slack + progress.bound_slack)


@inlined
def gap_of_circles(progress, arc_a, arc_b, motion):
    """Return the gap of a pair by the circles of its arcs, lowered by the slacks; or -infinity."""
    gap = max(between_circles(arc_a, arc_b, motion), in_ball(arc_a, arc_b, motion))
    return gap - progress.slack - progress.bound_slack


@kernel
def halves_of(tree, own, count, i):
    """Return the first half of arc i, made if need be, and how many arcs `own` then holds.

    The half is NONE if the arc cannot be halved.
    """
    arcs = tree.arcs
    arc = arc_at(arcs, own, i)
    if arc.child != NONE:
        return np.int64(arc.child), count
    if count + 2 > len(own) or not arc.high - arc.low > NARROW:
        return np.int64(NONE), count
    child, size = len(arcs) + count, tree.frame[4, 0]
    curve = tree.curves[arc.curve]
    one, other = own[count], own[count + 1]
    put_halves(arc, one, other)
    fit_arc(curve, one.low, one.high, size, one)
    fit_arc(curve, other.low, other.high, size, other)
    if i >= len(arcs):
        own[i - len(arcs)].child = child
    return child, count + 2


@kernel
def bound_rings(tree_a, tree_b, state, motion, a, b, angle, half, sector, bound):
    """Bound a pair of rings with the lower bound `bound`; open it if it may be below the limit.

    If the arcs are near enough to improve the answer, a local minimum is looked for. Returns the
    steps taken.
    """
    progress, waiting = state.progress[0], state.waiting
    progress.bound_tests += 1
    arc_a = arc_at(tree_a.arcs, waiting.arcs_a, a)
    arc_b = arc_at(tree_b.arcs, waiting.arcs_b, b)
    apart, n, e, at = facing(arc_a, arc_b, sector, half, motion)
    if apart > 0.0:
        fine = coarseness(progress, apart)
        bound = max(bound, gap_along(tree_a, tree_b, state, a, b, sector, motion, n, e, fine))
        if bound < progress.limit:
            bound = max(bound, gap_of_circles(progress, arc_a, arc_b, motion))
        if bound < progress.limit and abs(motion[8]) > ALIKE:
            there = facing_about_axis(arc_a, arc_b, sector, motion)
            least = gap_along(tree_a, tree_b, state, a, b, sector, motion, there, e, fine)
            if least > bound:
                bound, n = least, there
        elif bound < progress.limit and -1.0 < at[1] < 1.0:
            there, beside = normal_of_b(arc_b, sector, half, at[2], motion, n, e)
            least = gap_along(tree_a, tree_b, state, a, b, sector, motion, there, beside, fine)
            if least > bound:
                bound, n, e = least, there, beside
        if bound >= progress.limit:
            keep_ring(state, a, b, angle, half, sector, n, e)
            return 1
    steps = 1
    apart += bulge(arc_a) + bulge(arc_b) + spread_of(arc_b, sector, motion)
    if arc_a.curve != NONE and arc_b.curve != NONE and apart < progress.enough:
        steps += MINIMUM_STEPS
        s = arc_a.low + 0.5 * (1.0 + at[0]) * (arc_a.high - arc_a.low)
        t = arc_b.low + 0.5 * (1.0 + at[1]) * (arc_b.high - arc_b.low)
        where = angle + at[2] * min(half, 1.0)
        measure_rings(tree_a, tree_b, state, motion, arc_a.curve, arc_b.curve, s, t, where)
        n, e = direction_kept(progress)
        fine = fineness(progress)
        bound = max(bound, gap_along(tree_a, tree_b, state, a, b, sector, motion, n, e, fine))
        if bound >= progress.limit:
            keep_ring(state, a, b, angle, half, sector, n, e)
            return steps
    slot = progress.slots
    if progress.rings == len(waiting.rings) or progress.bound_tests >= MOST:
        progress.least_cells = min(progress.least_cells, bound)
        progress.recorded = NONE
        return steps
    if progress.rings < slot:
        slot = np.int64(waiting.heap[progress.rings])  # it has become free
    else:
        progress.slots += 1
    ring = waiting.rings[slot]
    ring.bound, ring.a, ring.b, ring.angle, ring.half = bound, a, b, angle, half
    ring.sector[0], ring.sector[1], ring.sector[2], ring.sector[3] = sector
    ring.way[0], ring.way[1], ring.way[2], ring.way[3] = n[0], n[1], e[0], e[1]
    progress.rings = add_ring(waiting.rings, waiting.heap, progress.rings, slot)
    return steps


@inlined
def part_off(tree_a, tree_b, state, motion, a, b, angle, half, sector, bound):
    """Bound a part of a pair along the kept direction; if that does not prune it, by `bound_rings`.

    Returns the steps taken.
    """
    progress = state.progress[0]
    n, e = direction_kept(progress)
    fine = fineness(progress)
    least = gap_along(tree_a, tree_b, state, a, b, sector, motion, n, e, fine)
    if least >= progress.limit:
        progress.bound_tests += 1
        keep_ring(state, a, b, angle, half, sector, n, e)
        return 0
    bound = max(bound, least)
    return bound_rings(tree_a, tree_b, state, motion, a, b, angle, half, sector, bound)


@kernel
def go_over(tree_a, tree_b, state, motion):
    """Bound the pairs of the front, each along its own direction first; return the steps taken."""
    progress, front = state.progress[0], state.waiting.front
    first, steps = FRONT * progress.front_half, 0
    progress.recorded = 0
    for i in range(first, first + progress.front):
        ring = front[i]
        a, b, angle, half = np.int64(ring.a), np.int64(ring.b), ring.angle, ring.half
        sector = (ring.sector[0], ring.sector[1], ring.sector[2], ring.sector[3])
        n, e = (ring.way[0], ring.way[1]), (ring.way[2], ring.way[3])
        fine = coarseness(progress, ring.bound)
        least = gap_along(tree_a, tree_b, state, a, b, sector, motion, n, e, fine)
        steps += 1
        if least >= progress.limit:
            progress.bound_tests += 1
            keep_ring(state, a, b, angle, half, sector, n, e)
        else:
            steps += part_off(tree_a, tree_b, state, motion, a, b, angle, half, sector, least)
    return steps


@kernel
def prove(tree_a, tree_b, state, motion, arc_a, arc_b, angle, half):
    """Return a lower bound by proof that a pair of rings holds only a known minimum; or -1."""
    at = find_minimum(state, arc_a.curve, arc_b.curve)
    if at == NONE:
        return -1.0
    minimum = state.waiting.minima[at]
    aside = minimum.angle - angle
    aside -= 2.0 * math.pi * np.floor(aside / (2.0 * math.pi) + 0.5)
    s, t = minimum.s, minimum.t
    wide_a, wide_b = 0.5 * (arc_a.high - arc_a.low), 0.5 * (arc_b.high - arc_b.low)
    near = abs(aside) <= _AROUND * half
    near = near and arc_a.low - wide_a <= s <= arc_a.high + wide_a
    if not (near and arc_b.low - wide_b <= t <= arc_b.high + wide_b):
        return -1.0
    box = (
        min(arc_a.low, s), max(arc_a.high, s), min(arc_b.low, t), max(arc_b.high, t),
        (abs(aside) + half) * 1.000001,
    )  # fmt: skip
    progress = state.progress[0]
    return least_around(
        tree_a.curves[arc_a.curve], tree_b.curves[arc_b.curve], arc_a, arc_b, motion,
        (s, t, minimum.angle), box, progress.distance, beyond(progress) + progress.slack,
    )  # fmt: skip
