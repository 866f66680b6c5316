"""The search for the least distance of two profiles that turn: rings, the nearest pair first.

A pair of rings is a fat arc of a, which turns all around, and one of b in a sector. The pair with
the least bound is taken; where it holds a local minimum that is known, it is tried whether no other
is in it (`certificate`); else the longest of both arcs and the sector is halved.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.jit import inlined, kernel, shared
from ..base.memory import on_stack
from ..base.state import CELLS_FULL, CUT, ENDED, NONE
from .arcs import fit_arc
from .bound import arc_at, bends, bulge, facing, gap, sector_of
from .build import NARROW, put_halves
from .certificate import least_around
from .heap import add_ring, drop_ring
from .minima import SMALL, find_minimum, measure_rings, relative, take_plane

MINIMUM_STEPS = 6
"""Steps of a search that a search for a local minimum takes as long as."""

_AROUND = 1.5
"""How far beyond a sector its minimum may be, as a multiple of half its angle."""

_SHORT = 1e-13
"""Share of the models' sizes below which an arc is not halved."""

_FINE = 0.25
"""Share of the distance that was asked for as a tolerance that the errors of arcs may be."""

_COARSE = 0.01
"""Share of two chords' distance that they may be along the way between these."""


@inlined
def _gap_along(tree_a, tree_b, state, a, b, sector, motion, n, e, fine):
    """The gap of a pair of rings along a direction of a's plane, but for what rounding may do."""
    progress, waiting = state.progress[0], state.waiting
    found = gap(
        tree_a.arcs, waiting.arcs_a, a, tree_b.arcs, waiting.arcs_b, b, fine, sector, motion, n, e
    )
    return found - progress.slack - progress.bound_slack


@inlined
def _along(progress):
    """The direction between the nearest points, and its azimuth."""
    along = progress.along
    return (along[0], along[1]), (along[2], along[3])


@kernel
def _halves(tree, own, count, i):
    """The first of the halves of an arc, and how many arcs there are then; NONE if none can be."""
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
def _bound_rings(tree_a, tree_b, state, motion, a, b, angle, half, sector, bound):
    """Bound a pair of rings, of which `bound` is a lower bound; add it where it may be nearer.

    Where the arcs are nearer than all that is known, a minimum is looked for. Returns the steps
    that it took.
    """
    progress, waiting = state.progress[0], state.waiting
    progress.bound_tests += 1
    n, e = _along(progress)
    fine = _FINE * (progress.distance - progress.enough)
    bound = max(bound, _gap_along(tree_a, tree_b, state, a, b, sector, motion, n, e, fine))
    if bound >= progress.limit:
        return 1
    arc_a = arc_at(tree_a.arcs, waiting.arcs_a, a)
    arc_b = arc_at(tree_b.arcs, waiting.arcs_b, b)
    apart, n, e, at = facing(arc_a, arc_b, sector, half, motion)
    if apart > 0.0:
        fine = max(fine, _COARSE * apart)
        bound = max(bound, _gap_along(tree_a, tree_b, state, a, b, sector, motion, n, e, fine))
        if bound >= progress.limit:
            return 1
    steps = 1
    apart += bulge(arc_a) + bulge(arc_b)
    apart += (1.0 - max(sector[2], 0.0)) * (abs(arc_b.middle[0]) + abs(arc_b.half[0]))
    if arc_a.curve != NONE and arc_b.curve != NONE and apart < progress.enough:
        steps += MINIMUM_STEPS
        s = arc_a.low + 0.5 * (1.0 + at[0]) * (arc_a.high - arc_a.low)
        t = arc_b.low + 0.5 * (1.0 + at[1]) * (arc_b.high - arc_b.low)
        where = angle + at[2] * min(half, 1.0)
        measure_rings(tree_a, tree_b, state, motion, arc_a.curve, arc_b.curve, s, t, where)
        n, e = _along(progress)
        bound = max(bound, _gap_along(tree_a, tree_b, state, a, b, sector, motion, n, e, fine))
        if bound >= progress.limit:
            return steps
    slot = progress.slots
    if slot == len(waiting.rings):
        progress.least_cells = min(progress.least_cells, bound)
        return steps
    progress.slots += 1
    ring = waiting.rings[slot]
    ring.bound, ring.a, ring.b, ring.angle, ring.half = bound, a, b, angle, half
    ring.sector[0], ring.sector[1], ring.sector[2], ring.sector[3] = sector
    progress.rings = add_ring(waiting.rings, waiting.heap, progress.rings, slot)
    return steps


@kernel
def begin_rings(tree_a, tree_b, state):
    """Open the pair of all that turns."""
    progress, waiting = state.progress[0], state.waiting
    progress.rings, progress.slots, progress.least_cells = 1, 1, np.inf
    progress.arcs_a, progress.arcs_b, progress.minima = 0, 0, 0
    progress.dividing, progress.aside = 0, 0
    ring = waiting.rings[0]
    ring.bound, ring.a, ring.b, ring.angle, ring.half = -np.inf, 0, 0, 0.0, math.pi
    ring.sector[0], ring.sector[1], ring.sector[2], ring.sector[3] = 1.0, 0.0, -1.0, 0.0
    waiting.heap[0] = 0


@kernel
def _proven(tree_a, tree_b, state, motion, ring, arc_a, arc_b):
    """A lower bound by a proof that a known minimum is the only one in a pair of rings; or -1."""
    at = find_minimum(state, arc_a.curve, arc_b.curve)
    if at == NONE:
        return -1.0
    minimum = state.waiting.minima[at]
    beyond = minimum.angle - ring.angle
    beyond -= 2.0 * math.pi * np.floor(beyond / (2.0 * math.pi) + 0.5)
    s, t = minimum.s, minimum.t
    wide_a, wide_b = 0.5 * (arc_a.high - arc_a.low), 0.5 * (arc_b.high - arc_b.low)
    near = abs(beyond) <= _AROUND * ring.half
    near = near and arc_a.low - wide_a <= s <= arc_a.high + wide_a
    if not (near and arc_b.low - wide_b <= t <= arc_b.high + wide_b):
        return -1.0
    box = (
        min(arc_a.low, s), max(arc_a.high, s), min(arc_b.low, t), max(arc_b.high, t),
        (abs(beyond) + ring.half) * 1.000001,
    )  # fmt: skip
    return least_around(
        tree_a.curves[arc_a.curve], tree_b.curves[arc_b.curve], arc_a, arc_b, motion,
        (s, t, minimum.angle), box, state.progress[0].distance,
    )  # fmt: skip


@kernel
def _take_apart(tree_a, tree_b, state, motion):
    """Deal with the pair of rings that has the least bound; returns the steps that took."""
    progress, waiting = state.progress[0], state.waiting
    ring = waiting.rings[waiting.heap[0]]
    bound, a, b = ring.bound, np.int64(ring.a), np.int64(ring.b)
    angle, half = ring.angle, ring.half
    sector = (ring.sector[0], ring.sector[1], ring.sector[2], ring.sector[3])
    arc_a, arc_b = arc_at(tree_a.arcs, waiting.arcs_a, a), arc_at(tree_b.arcs, waiting.arcs_b, b)
    steps = 1
    if arc_a.curve != NONE and arc_b.curve != NONE and half <= SMALL:
        if find_minimum(state, arc_a.curve, arc_b.curve) == NONE:
            _, _, _, at = facing(arc_a, arc_b, sector, half, motion)
            s = arc_a.low + 0.5 * (1.0 + at[0]) * (arc_a.high - arc_a.low)
            t = arc_b.low + 0.5 * (1.0 + at[1]) * (arc_b.high - arc_b.low)
            measure_rings(
                tree_a, tree_b, state, motion, arc_a.curve, arc_b.curve, s, t,
                angle + at[2] * half,
            )  # fmt: skip
            steps += MINIMUM_STEPS
        least = _proven(tree_a, tree_b, state, motion, ring, arc_a, arc_b)
        steps += 1
        if least >= 0.0:
            bound = max(bound, least - progress.slack - progress.bound_slack)
    progress.rings = drop_ring(waiting.rings, waiting.heap, progress.rings)
    if bound >= progress.limit:
        return steps
    # What is farthest from straight is halved: bounds of chords that turn nowhere are exact.
    short = _SHORT * (tree_a.scale[2] + tree_b.scale[2])
    long_a, long_b, around = bends(arc_a, arc_b, sector, half, motion)
    of_a = of_b = np.int64(NONE)
    while max(long_a, long_b, around) > short:
        if around >= max(long_a, long_b):
            break
        if long_a >= long_b:
            of_a, progress.arcs_a = _halves(tree_a, waiting.arcs_a, progress.arcs_a, a)
            if of_a != NONE:
                break
            long_a = 0.0
        else:
            of_b, progress.arcs_b = _halves(tree_b, waiting.arcs_b, progress.arcs_b, b)
            if of_b != NONE:
                break
            long_b = 0.0
    else:
        progress.least_cells = min(progress.least_cells, bound)
        return steps
    for k in range(2):
        next_a, next_b, next_angle, next_half, next_sector = a, b, angle, half, sector
        if of_a != NONE:
            next_a = of_a + k
        elif of_b != NONE:
            next_b = of_b + k
        else:
            next_half = 0.5 * half
            next_angle = angle + (next_half if k else -next_half)
            next_half *= 1.0 + 1e-15
            next_sector = sector_of(next_angle, next_half)
        steps += _bound_rings(
            tree_a, tree_b, state, motion, next_a, next_b, next_angle, next_half, next_sector, bound
        )
    return steps


@shared
def search_rings(tree_a, tree_b, state):
    """Run a search for the steps that it has left.

    Returns ENDED, CUT, or CELLS_FULL where bounds cannot be improved as far as was asked for.
    """
    progress = state.progress[0]
    progress.open, progress.waiting = 0, 0
    motion = on_stack(12, 0.0)
    relative(tree_a, tree_b, state.motions[0], motion)
    take_plane(tree_a, state)
    waiting, steps = state.waiting, progress.steps
    code = ENDED
    while progress.rings > 0 and progress.distance - progress.slack > progress.stop:
        if waiting.rings[waiting.heap[0]].bound >= progress.limit:
            progress.rings = 0
            break
        if steps == 0:
            code = CUT
            break
        steps -= min(steps, _take_apart(tree_a, tree_b, state, motion))
    progress.steps = steps
    apart = progress.distance - progress.slack > progress.stop
    if code == ENDED and apart and progress.least_cells < progress.enough:
        code = CELLS_FULL
    return code
