"""The descent of the bounding volume test tree.

Depth first (Larsen et al. 1999, sections 5.1 and 6): the pair whose bound is smallest comes first;
or the nearest of all (queue.py), or level by level (levels.py). The larger volume of a pair is
opened, sixteen bounds at a time; two lowest nodes are dealt with in one go (cross.py). Where
volumes overlap their bounds are negative, and the deepest comes first.
"""

from __future__ import annotations

import numpy as np
from numba import uint64

from ..base.jit import inlined, shared
from ..base.lanes import lowest, not_above, smallest
from ..base.memory import on_stack, table_on_stack
from ..base.state import (
    BASE,
    BOUND_SLACK,
    BOUND_TESTS,
    BREADTH_FIRST,
    COLLECTED,
    COLLECTED_FULL,
    CUT,
    DEPTH,
    DEPTH_FIRST,
    DISTANCE,
    ENDED,
    ENOUGH,
    LIMIT,
    ORDER,
    PRIMITIVE_TESTS,
    PRIORITY,
    PROVEN,
    SLACK,
    STEPS,
    STOP,
)
from ..bounds.boxes import box_bounds
from ..bounds.cross import Scratch, Waiting, cross_leaves
from ..bounds.gaps import BATCH, CORNERS, gather
from ..bounds.volumes import far_bound, lower_bounds, place
from ..elements.aim import begin_along, end_along, gap_between
from ..elements.primitives import collect, test_batch
from ..tree.layout import EMPTY, LARGEST, STRIDE, WIDTH, first_of, last_of
from .approach import APPROACH_STEPS, approach, far_from_nearest
from .coherence import is_coherent, remember_far, still_far
from .levels import list_pair, take_first
from .queue import rise, take_nearest

_ALL = (1 << WIDTH) - 1
_LOCAL = CORNERS - 3 * BATCH
_CROSSED = WIDTH * WIDTH
_FOUND = WIDTH + _CROSSED
_WAITING = BATCH + _CROSSED
_FILTER_STEPS, _EXACT_STEPS = 5, 4
"""Steps that the filter of a batch of triangles takes as long as, and an exact test: so a slice of
steps is one of time."""


@inlined
def open_pair(
    fixed, lane, tree, parent, motion, flip, state, inherited, scratch, waiting, n, unusual
):
    """Bound one lane of the tree `fixed` against the sixteen under lane `parent` of `tree`.

    Pushes the pairs that survive, in a search depth first the nearest on top; but pairs of
    triangles are appended to the `waiting` ones. `flip` says that `fixed` is tree b, `inherited` is
    a bound of all pairs; where none survives, PROVEN is as good a one or better. Returns how many
    pairs are waiting then, of n before.
    """
    reals, counts, stack, bounds = state.reals, state.counts, state.stack, state.bounds
    single, found = scratch.single, scratch.found
    node = tree.children[parent]
    unit = tree.scale[0]
    limit = reals[LIMIT]
    first = counts[DEPTH]
    counts[BOUND_TESTS] += WIDTH
    reach = np.float32(min(limit * tree.scale[1] * (1.0 + 1e-6), 1e29))
    if place(fixed, lane, motion, tree, node, reals[BOUND_SLACK], single):
        lower_bounds(tree.nodes, uint64(node * STRIDE), single, found, uint64(0))
        if unusual is not None and fixed.scale[3] + tree.scale[3] > 0.0:
            box_bounds(
                fixed, lane, motion, tree, node, reals[BOUND_SLACK], reach, found, np.int64(0)
            )
    else:
        inherited = max(inherited, far_bound(fixed, lane, motion, tree, node, reals[BOUND_SLACK]))
        for k in range(WIDTH):
            empty = tree.children[node * WIDTH + k] == EMPTY
            found[k] = np.float32(1e30) if empty else np.float32(-1.0)
    top = first
    order = counts[ORDER]
    survivors = not_above(found, 0, reach)
    reals[PROVEN] = inherited
    if not survivors:
        reals[PROVEN] = max(inherited, smallest(found, 0, _ALL) * unit)
        return n
    if fixed.children[lane] < 0 and tree.children[node * WIDTH] < 0:
        while survivors:
            k = lowest(survivors)
            survivors &= survivors - 1
            child = node * WIDTH + k
            waiting.lanes[n, 0] = child if flip else lane
            waiting.lanes[n, 1] = lane if flip else child
            waiting.bounds[n] = max(found[k] * unit, inherited)
            n += 1
        return n
    while survivors:
        k = lowest(survivors)
        survivors &= survivors - 1
        bound = found[k] * unit
        if not bound > inherited:
            bound = inherited
        if bound >= limit:
            continue
        child = node * WIDTH + k
        a, b = (child, lane) if flip else (lane, child)
        at = top
        if unusual is None or order == DEPTH_FIRST:
            while at > first and bounds[at - 1] < bound:
                bounds[at] = bounds[at - 1]
                stack[at, 0], stack[at, 1] = stack[at - 1, 0], stack[at - 1, 1]
                at -= 1
        elif order == BREADTH_FIRST:
            at = list_pair(state, top, a, b, bound)
        bounds[at] = bound
        stack[at, 0], stack[at, 1] = a, b
        if unusual is not None and order == PRIORITY:
            rise(stack, bounds, counts[BASE], at)
        top += 1
    counts[DEPTH] = top
    return n


@inlined
def nearest_last(waiting, first, last):
    """Bring the pair with the smallest bound of waiting[first:last] to their end."""
    lanes, bounds = waiting
    best = first
    for k in range(first + 1, last):
        if bounds[k] < bounds[best]:
            best = k
    last -= 1
    bounds[best], bounds[last] = bounds[last], bounds[best]
    lanes[best, 0], lanes[last, 0] = lanes[last, 0], lanes[best, 0]
    lanes[best, 1], lanes[last, 1] = lanes[last, 1], lanes[best, 1]


@inlined
def take_batch(tree_a, tree_b, state, waiting, n, pairs, corners):
    """Gather the triangles of the last of n waiting pairs of leaves that still matter.

    Returns how many pairs of triangles were taken, and how many pairs of leaves wait.
    """
    reals, a, b = state.reals, tree_a.triangles, tree_b.triangles
    limit = reals[LIMIT]
    taken = np.int64(0)  # a literal would have `gather` compiled twice
    while n > 0 and taken <= BATCH - LARGEST * LARGEST:
        n -= 1
        if waiting.bounds[n] >= limit:
            continue
        leaf_a = np.int64(tree_a.children[waiting.lanes[n, 0]])
        leaf_b = np.int64(tree_b.children[waiting.lanes[n, 1]])
        # The gaps along the aim of all their triangles, each of which is measured once.
        first_a, last_a = first_of(leaf_a), last_of(leaf_a)
        first_b, last_b = first_of(leaf_b), last_of(leaf_b)
        state.counts[PRIMITIVE_TESTS] += (last_a - first_a + 1) * (last_b - first_b + 1)
        end, other_end = end_along(reals, a, first_a), end_along(reals, a, last_a)
        begin, other_begin = begin_along(reals, b, first_b), begin_along(reals, b, last_b)
        if gap_between(reals, max(end, other_end), min(begin, other_begin)) >= limit:
            continue
        for ta in range(first_a, last_a + 1):
            ends = end if ta == first_a else other_end
            for tb in range(first_b, last_b + 1):
                begins = begin if tb == first_b else other_begin
                if gap_between(reals, ends, begins) < limit:
                    pairs[taken, 0], pairs[taken, 1] = ta, tb
                    gather(a, ta, b, tb, taken, corners)
                    taken += 1
    return taken, n


@inlined
def take_pair(tree_a, tree_b, state, unusual):
    """Take the next pair off the stack, queue or list, where it still stands.

    Returns its place, or -1 where it is pruned.
    """
    counts = state.counts
    if unusual is not None:
        if counts[ORDER] == PRIORITY:
            return take_nearest(state)
        if counts[ORDER] == BREADTH_FIRST:
            at = take_first(tree_a, tree_b, state)
            return at if state.bounds[at] < state.reals[LIMIT] else -1
    counts[DEPTH] -= 1
    at = counts[DEPTH]
    return at if state.bounds[at] < state.reals[LIMIT] else -1


@shared
def advance(tree_a, tree_b, state, unusual):
    """Run a search for the steps that it has left; returns ENDED, CUT or COLLECTED_FULL.

    `unusual` is None for a search depth first between swept spheres: numba sees that at compile
    time and leaves out the code of the others, of which a quarter of the compiling would be.
    """
    reals, counts, stack, bounds = state.reals, state.counts, state.stack, state.bounds
    steps = counts[STEPS]
    scratch = Scratch(
        on_stack(16, np.float32(0.0)), on_stack(_FOUND, np.float32(0.0)),
        on_stack(16, np.float32(0.0)), on_stack(STRIDE, np.float32(0.0)),
        on_stack(WIDTH, 0), on_stack(WIDTH, np.float32(0.0)), on_stack(WIDTH, np.float32(0.0)),
    )  # fmt: skip
    waiting = Waiting(table_on_stack(_WAITING, 2, np.int32(0)), on_stack(_WAITING, 0.0))
    pairs, corners = table_on_stack(BATCH, 2, 0), on_stack(CORNERS, 0.0)
    local = on_stack(_LOCAL, np.float32(0.0))
    room = state.collected.shape[0]
    n = np.int64(0)
    coherent = is_coherent(state)
    code = ENDED
    while True:
        full = room > 0 and counts[COLLECTED] + LARGEST * LARGEST * (n + _CROSSED) > room
        while n >= BATCH or (
            n > 0
            and (
                counts[DEPTH] == 0
                or steps == 0
                or full
                or reals[DISTANCE] - reals[SLACK] <= reals[STOP]
            )
        ):
            taken, n = take_batch(tree_a, tree_b, state, waiting, n, pairs, corners)
            if taken > 0:
                exact = test_batch(
                    tree_a, tree_b, state, pairs, taken, corners, local, scratch.found
                )
                steps -= min(steps, _FILTER_STEPS + _EXACT_STEPS * exact)
        if far_from_nearest(reals, counts):
            approach(tree_a, tree_b, state, scratch.found)
            steps -= min(steps, APPROACH_STEPS)
        if counts[DEPTH] == 0 or reals[DISTANCE] - reals[SLACK] <= reals[STOP]:
            break
        if steps == 0:
            code = CUT
            break
        if full:
            code = COLLECTED_FULL
            break
        at = take_pair(tree_a, tree_b, state, unusual)
        if at < 0:
            continue
        steps -= 1
        a, b, bound = np.int64(stack[at, 0]), np.int64(stack[at, 1]), bounds[at]
        if room > 0 and bound >= reals[ENOUGH] + 3.0 * reals[SLACK]:
            # It may hold the minimum, and that is all that was asked: without tolerances this
            # is LIMIT, and only pairs of triangles are collected.
            collect(state, ~a, ~b, bound)
            continue
        if coherent and still_far(state, a, b):
            continue
        child_a, child_b = tree_a.children[a], tree_b.children[b]
        if child_a < 0 and child_b < 0:
            waiting.lanes[n, 0], waiting.lanes[n, 1], waiting.bounds[n] = a, b, bound
            n += 1
            continue
        # Lane 0 of a lowest node, and of no other, holds a triangle.
        lowest_a = child_a < 0 or tree_a.children[child_a * WIDTH] < 0
        lowest_b = child_b < 0 or tree_b.children[child_b * WIDTH] < 0
        size_a = tree_a.sizes[a] * tree_a.scale[0]
        size_b = tree_b.sizes[b] * tree_b.scale[0]
        if lowest_a and lowest_b and child_a >= 0 and child_b >= 0:
            before, tests = n, counts[BOUND_TESTS]
            flip = not size_a > size_b
            if flip:
                n = cross_leaves(
                    tree_b, child_b, tree_a, a, state.motions[0], flip, state, bound,
                    reals[LIMIT], scratch, waiting, n, unusual,
                )  # fmt: skip
            else:
                n = cross_leaves(
                    tree_a, child_a, tree_b, b, state.motions[1], flip, state, bound,
                    reals[LIMIT], scratch, waiting, n, unusual,
                )  # fmt: skip
            steps -= min(steps, (counts[BOUND_TESTS] - tests) // WIDTH)
            if n > before + BATCH:
                nearest_last(waiting, before, n)
            if n >= 0:
                if coherent and n == before:
                    remember_far(state, a, b, reals[PROVEN])
                continue
            n = before
        # Two lowest nodes together are the better bargain, unless one is far larger.
        if lowest_a != lowest_b:
            size_a, size_b = (size_a, 4.0 * size_b) if lowest_a else (4.0 * size_a, size_b)
        flip = child_b < 0 or (child_a >= 0 and size_a > size_b)
        before, depth = n, counts[DEPTH]
        if flip:
            n = open_pair(
                tree_b, b, tree_a, a, state.motions[0], flip, state, bound, scratch, waiting, n,
                unusual,
            )  # fmt: skip
        else:
            n = open_pair(
                tree_a, a, tree_b, b, state.motions[1], flip, state, bound, scratch, waiting, n,
                unusual,
            )  # fmt: skip
        if coherent and n == before and counts[DEPTH] == depth:
            remember_far(state, a, b, reals[PROVEN])
    counts[STEPS] = steps
    return code
