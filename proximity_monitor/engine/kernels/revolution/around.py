"""Divide the whole pair around a known local minimum.

The whole pair is both profiles over the full turn; for pairs of rings see rings.py. The minimum is
usually the nearest one. Then one direction proves that all is farther except a small pair of rings
around the minimum. First the reach of each part of a is compared with where b as a whole begins,
then the reach of one piece of a with where the parts of b begin, and last with where one piece of b
begins in sectors. The small pair is narrowed in the same way until it is proven to hold no other
minimum.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.jit import inlined, kernel
from ..base.trees import NONE
from .bound import begin_of, sags, sector_of
from .bounded import (
    beyond,
    bound_rings,
    direction_kept,
    fineness,
    gap_of_circles,
    go_over,
    halves_of,
    part_off,
    prove,
)
from .front import forget_front, has_front, keep_ring
from .reach import arc_at, coarse_of, reach_of
from .tube import are_tubes, least_beside_tube

_NEAR = 0.1
"""Half the angle of the sector around a minimum in which a proof is tried first, radians."""

_BEHIND = (math.pi - _NEAR) * (1.0 + 1e-15)
_BEHIND_COSINE, _BEHIND_SINE = math.cos(_BEHIND), math.sin(_BEHIND)
"""The cosine and sine of half the angle of the rest of the turn, `_BEHIND`."""

_NARROWED = 40
"""How often the small pair is narrowed, at most."""


@inlined
def _half_with(tree, i, first, end, curve):
    """Return the half of arc i that holds the piece `curve`, and the other half.

    The arc holds the pieces `first` to `end`, which `build_arcs` has divided. Returns also the
    range of pieces of the first half returned.
    """
    child, middle = np.int64(tree.arcs[i].child), (first + end) // 2
    if curve >= middle:
        return child + 1, child, middle, end
    return child, child + 1, first, middle


@kernel
def part_around(tree_a, tree_b, state, motion, minimum):
    """Divide the whole pair around a minimum; return the steps taken."""
    progress, waiting = state.progress[0], state.waiting
    curve_a, curve_b = minimum.curve_a, minimum.curve_b
    s, t, angle = minimum.s, minimum.t, minimum.angle
    own_a, own_b = waiting.arcs_a, waiting.arcs_b
    progress.rings = progress.slots = 0
    n, e = direction_kept(progress)
    fine, lost = fineness(progress), progress.slack + progress.bound_slack
    whole = sector_of(angle, math.pi)
    # If b begins beyond this, all of a is farther than the limit: see `gap_along`.
    wanted = coarse_of(tree_a, own_a, 0, n[0], n[1])
    wanted += lost + beyond(progress) + progress.bound_slack
    begin = begin_of(tree_b, own_b, 0, fine, whole, motion, n, e, wanted) - lost
    floor = begin - beyond(progress)
    least = begin - reach_of(tree_a, own_a, 0, fine, n[0], n[1], floor)
    progress.bound_tests += 1
    if least >= progress.limit:
        return 1
    if has_front(tree_a, tree_b, state):
        return 1 + go_over(tree_a, tree_b, state, motion)
    steps, a, b = 1, np.int64(0), np.int64(0)
    if are_tubes(tree_a, tree_b):
        beside, more = least_beside_tube(tree_a, tree_b, state, motion)
        least, steps = max(least, beside), steps + more
        if least >= progress.limit:
            return steps
    forget_front(tree_a, tree_b, state)
    first, end = 0, len(tree_a.curves)
    while tree_a.arcs[a].curve == NONE:
        a, beside, first, end = _half_with(tree_a, a, first, end, curve_a)
        floor = begin - beyond(progress)
        bound = max(begin - reach_of(tree_a, own_a, beside, fine, n[0], n[1], floor), least)
        if bound >= progress.limit:
            progress.bound_tests += 1
            keep_ring(state, beside, b, angle, math.pi, whole, n, e)
        else:
            steps += bound_rings(
                tree_a, tree_b, state, motion, beside, b, angle, math.pi, whole, bound
            )
    first, end = 0, len(tree_b.curves)
    while tree_b.arcs[b].curve == NONE:
        b, beside, first, end = _half_with(tree_b, b, first, end, curve_b)
        steps += part_off(tree_a, tree_b, state, motion, a, beside, angle, math.pi, whole, least)
    near = sector_of(angle, _NEAR)
    behind = (-near[0], -near[1], _BEHIND_COSINE, _BEHIND_SINE)
    steps += part_off(tree_a, tree_b, state, motion, a, b, angle + math.pi, _BEHIND, behind, least)
    return steps + _narrow(tree_a, tree_b, state, motion, a, b, s, t, angle, near, least)


@kernel
def _narrow(tree_a, tree_b, state, motion, a, b, s, t, angle, sector, bound):
    """Narrow a pair of rings around a minimum until it is proven to hold no other one.

    The minimum is at s, t and the angle; `sector` is the sector to begin with. A proof is first
    tried one step before the step at which it held in the search before. Returns the steps taken.
    """
    progress, waiting = state.progress[0], state.waiting
    own_a, own_b = waiting.arcs_a, waiting.arcs_b
    steps, half, before = 0, _NEAR, progress.narrowed
    progress.narrowed = 0
    arc_a, arc_b = arc_at(tree_a.arcs, own_a, a), arc_at(tree_b.arcs, own_b, b)
    bound = max(bound, gap_of_circles(progress, arc_a, arc_b, motion))
    for k in range(_NARROWED):
        if bound >= progress.limit:
            break
        arc_a, arc_b = arc_at(tree_a.arcs, own_a, a), arc_at(tree_b.arcs, own_b, b)
        if k >= before - 1:
            steps += 1
            least = prove(tree_a, tree_b, state, motion, arc_a, arc_b, angle, half)
            if least >= 0.0:
                bound = max(bound, least - progress.slack - progress.bound_slack)
                progress.narrowed = k
                break
        long_a, long_b, around = sags(arc_a, arc_b, sector, half, motion)
        if around >= max(long_a, long_b):
            half *= 0.5
            sector = (sector[0], sector[1], math.cos(half), math.sin(half))
            for side in (-1.5, 1.5):
                middle = angle + side * half
                wide = 0.5 * half * (1.0 + 1e-15)
                beside = sector_of(middle, wide)
                steps += part_off(tree_a, tree_b, state, motion, a, b, middle, wide, beside, bound)
            continue
        beside_a, beside_b = a, b
        if long_a >= long_b:
            child, progress.arcs_a = halves_of(tree_a, own_a, progress.arcs_a, a)
            if child == NONE:
                break
            later = s >= arc_at(tree_a.arcs, own_a, child).high
            a, beside_a = (child + 1, child) if later else (child, child + 1)
        else:
            child, progress.arcs_b = halves_of(tree_b, own_b, progress.arcs_b, b)
            if child == NONE:
                break
            later = t >= arc_at(tree_b.arcs, own_b, child).high
            b, beside_b = (child + 1, child) if later else (child, child + 1)
        steps += part_off(
            tree_a, tree_b, state, motion, beside_a, beside_b, angle, half, sector, bound
        )
    if bound >= progress.limit:
        n, e = direction_kept(progress)
        keep_ring(state, a, b, angle, half, sector, n, e)
    else:
        steps += bound_rings(tree_a, tree_b, state, motion, a, b, angle, half, sector, bound)
    return steps
