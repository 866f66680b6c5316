"""The search for the least distance of two turning profiles: pairs of rings, the nearest first.

A ring is what a fat arc sweeps about its axis. A pair of rings is a fat arc of a over the full turn
and one of b in a sector. First the whole pair, of both profiles over the full turn, is divided into
a small pair around the nearest known minimum, and the rest of both arcs and of the sector. Most of
the rest is farther along one direction. Then the open pair with the least bound is taken. If it
holds a known local minimum, try to prove that it holds no other (`certificate`). Else halve one of
both arcs and the sector, whichever is farthest from straight.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.jit import inlined, kernel
from ..base.lazy import lazy
from ..base.memory import on_stack
from ..base.state import CELLS_FULL, CUT, ENDED, Turning
from ..base.trees import NONE, RevolutionTree
from .around import part_around
from .bound import facing, half_of, normal_of_a, normal_of_b, sags, sector_of
from .bounded import MINIMUM_STEPS, MOST, fineness, gap_along, halves_of, part_off, prove
from .front import begin_front, end_front, keep_ring
from .heap import drop_ring
from .minima import SMALL, find_minimum, measure_rings, nearest_minimum, relative
from .newton import derivatives_at
from .reach import arc_at

_CLEARANCE = 0.9
"""If the limit is below this share of the distance, the question is about a clearance."""

_SHORT = 1e-13
"""Bend, as a share of both models' sizes, up to which neither arcs nor sectors are halved."""


@kernel
def begin_rings(tree_a, tree_b, state):
    """Start with the whole pair: all of a's profile and of b's, over the full turn."""
    progress, waiting = state.progress[0], state.waiting
    progress.rings, progress.slots, progress.least_cells = 1, 1, np.inf
    progress.minima = 0
    begin_front(tree_a, tree_b, state)
    progress.dividing, progress.aside = 0, 0
    ring = waiting.rings[0]
    ring.bound, ring.a, ring.b, ring.angle, ring.half = -np.inf, 0, 0, 0.0, math.pi
    ring.sector[0], ring.sector[1], ring.sector[2], ring.sector[3] = 1.0, 0.0, -1.0, 0.0
    waiting.heap[0] = 0


@kernel
def _take_apart(tree_a, tree_b, state, motion):
    """Prove or divide the pair of rings with the least bound; return the steps taken."""
    progress, waiting = state.progress[0], state.waiting
    ring = waiting.rings[waiting.heap[0]]
    if ring.half >= math.pi and ring.a == 0 and ring.b == 0:
        nearest = nearest_minimum(state)
        if nearest != NONE:
            return part_around(tree_a, tree_b, state, motion, waiting.minima[nearest])
    bound, a, b = ring.bound, np.int64(ring.a), np.int64(ring.b)
    angle, half = ring.angle, ring.half
    sector = (ring.sector[0], ring.sector[1], ring.sector[2], ring.sector[3])
    n, e = (ring.way[0], ring.way[1]), (ring.way[2], ring.way[3])
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
        least = prove(tree_a, tree_b, state, motion, arc_a, arc_b, angle, half)
        steps += 1
        if least >= 0.0:
            bound = max(bound, least - progress.slack - progress.bound_slack)
    progress.rings = drop_ring(waiting.rings, waiting.heap, progress.rings)
    if bound >= progress.limit:
        keep_ring(state, a, b, angle, half, sector, n, e)
        return steps
    # Halve what is farthest from straight: for straight chords at one angle the bounds are exact.
    short = _SHORT * (tree_a.scale[2] + tree_b.scale[2])
    long_a, long_b, around = sags(arc_a, arc_b, sector, half, motion)
    of_a = of_b = np.int64(NONE)
    while max(long_a, long_b, around) > short:
        if around >= max(long_a, long_b):
            break
        if long_a >= long_b:
            of_a, progress.arcs_a = halves_of(tree_a, waiting.arcs_a, progress.arcs_a, a)
            if of_a != NONE:
                break
            long_a = 0.0
        else:
            of_b, progress.arcs_b = halves_of(tree_b, waiting.arcs_b, progress.arcs_b, b)
            if of_b != NONE:
                break
            long_b = 0.0
    else:
        bound = max(bound, _along_own(tree_a, tree_b, state, motion, a, b, angle, half, sector))
        if bound < progress.limit:
            progress.least_cells = min(progress.least_cells, bound)
        progress.recorded = NONE
        return steps + MINIMUM_STEPS
    for k in range(2):
        next_a, next_b, next_angle, next_half, next_sector = a, b, angle, half, sector
        if of_a != NONE:
            next_a = of_a + k
        elif of_b != NONE:
            next_b = of_b + k
        else:
            next_angle, next_half = half_of(angle, half, k)
            next_sector = sector_of(next_angle, next_half)
        steps += part_off(
            tree_a, tree_b, state, motion, next_a, next_b, next_angle, next_half, next_sector, bound
        )
    return steps


@kernel
def _along_own(tree_a, tree_b, state, motion, a, b, angle, half, sector):
    """Return a lower bound of a pair that cannot be halved, along the direction at its minimum.

    The minimum is looked for here: if chords are long and at an angle, `facing` may be far off, and
    the chords seem too far apart to look for it even if they cross. Minus infinity if there is no
    direction.
    """
    arc_a = arc_at(tree_a.arcs, state.waiting.arcs_a, a)
    arc_b = arc_at(tree_b.arcs, state.waiting.arcs_b, b)
    if arc_a.curve == NONE or arc_b.curve == NONE:
        return -np.inf
    _, _, _, at = facing(arc_a, arc_b, sector, half, motion)
    s = arc_a.low + 0.5 * (1.0 + at[0]) * (arc_a.high - arc_a.low)
    t = arc_b.low + 0.5 * (1.0 + at[1]) * (arc_b.high - arc_b.low)
    angle += at[2] * min(half, 1.0)
    measure_rings(tree_a, tree_b, state, motion, arc_a.curve, arc_b.curve, s, t, angle)
    found = state.waiting.minima[find_minimum(state, arc_a.curve, arc_b.curve)]
    curve_a, curve_b = tree_a.curves[arc_a.curve], tree_b.curves[arc_b.curve]
    way, (_, x, y), _, _, _, _, _ = derivatives_at(
        curve_a, curve_b, motion, found.s, found.t, found.angle
    )
    apart = np.sqrt(way[0] * way[0] + way[1] * way[1])
    if not apart > 0.0:
        return -np.inf
    n, fine = (way[0] / apart, way[1] / apart), fineness(state.progress[0])
    bound = gap_along(tree_a, tree_b, state, a, b, sector, motion, n, (x, y), fine)
    # Rounding tilts that direction by its share of the distance, which is much for long arcs that
    # are near each other. The normals of the arcs are exact.
    there = normal_of_a(arc_a, n)
    least = gap_along(tree_a, tree_b, state, a, b, sector, motion, there, (x, y), fine)
    own = sector_of(found.angle, 0.0)
    there, beside = normal_of_b(arc_b, own, 0.0, 0.0, motion, n, (x, y))
    other = gap_along(tree_a, tree_b, state, a, b, sector, motion, there, beside, fine)
    return max(bound, max(least, other))


@inlined
def _is_enough(progress):
    """Return whether the distance found is the answer, whatever the bounds are.

    No distance is negative. So if the tolerance is as large as the distance, no lower bound is
    needed.
    """
    met = progress.distance - progress.slack <= progress.stop
    return met or progress.distance + progress.slack <= progress.abs_err


@inlined
def _is_over(progress, bound):
    """Return whether the search is over, with `bound` as the least bound of all open pairs.

    The least bound of those that could not be halved limits the lower bound. Beyond it, only nearer
    points can be found, which may decide whether a clearance is kept.
    """
    if bound >= progress.limit:
        return True
    decides = progress.limit < _CLEARANCE * progress.distance
    return bound >= progress.least_cells and not (decides and progress.bound_tests < MOST)


@lazy((RevolutionTree,), (RevolutionTree,), Turning, nothing=(CUT,))
def search_rings(tree_a, tree_b, state):
    """Run a search for the steps that it has left.

    Returns ENDED, CUT, or CELLS_FULL if bounds cannot be improved as far as was asked for.
    """
    progress = state.progress[0]
    progress.open, progress.waiting = 0, 0
    motion = on_stack(12, 0.0)
    relative(tree_a, tree_b, state.motions[0], motion)
    waiting, steps = state.waiting, progress.steps
    code = ENDED
    while progress.rings > 0 and not _is_enough(progress):
        if _is_over(progress, waiting.rings[waiting.heap[0]].bound):
            break
        if steps == 0:
            code = CUT
            break
        steps -= min(steps, _take_apart(tree_a, tree_b, state, motion))
    progress.steps = steps
    apart = not _is_enough(progress)
    if code == ENDED and apart:
        end_front(state)
        progress.rings = 0
    if code == ENDED and apart and progress.least_cells < progress.enough:
        code = CELLS_FULL
    return code
