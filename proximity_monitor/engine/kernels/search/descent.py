"""The descent of the bounding volume test tree.

Three orders exist: depth first (Larsen et al. 1999, sections 5.1 and 6), where the nearest pair of
an opening comes first (stack.py); the nearest of all open pairs first (queue.py); and level by
level (levels.py). To open a pair is to bound one of its volumes against the sixteen children of the
other. The larger volume is opened, or the one that promises more (promise.py). A lowest node is one
whose lanes are leaves; two lowest nodes are compared in one go (cross.py). If volumes overlap,
their bounds are negative, and the deepest overlap comes first.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, shared
from ..base.lanes import lowest, not_above, smallest
from ..base.memory import on_stack
from ..base.state import COLLECTED_FULL, CUT, ENDED, SOME
from ..bounds.cross import Scratch, left_between
from ..bounds.gaps import BATCH
from ..elements.primitives import collect, enough
from ..tree.layout import EXTENT, LARGEST, PROMISE, STRIDE, WIDTH
from .approach import APPROACH_STEPS, LONG, come_nearer, far_from_nearest
from .coherence import is_coherent, near_under, open_again, remember_far
from .stubs import (
    cross_leaves,
    divide,
    lane_bounds,
    look_ahead,
    open_whole,
    push,
    resolve,
    take,
)

_ALL = (1 << WIDTH) - 1
_CROSSED = WIDTH * WIDTH
_FOUND = WIDTH + _CROSSED
WAITING_ROOM = BATCH + _CROSSED
"""Room for waiting pairs of leaves."""

_SURE = 0.9
"""Share of the limit below which lanes are likely to be near again in the next search. Several
lanes that are less certain are not kept: opening their pair again costs one opening and may prune
them all, while kept lanes cost one opening each. A single lane costs one opening either way."""

_HOPE = 1.25
"""Most growth of a pair's bound, as a multiple of what a volume promises: its children promise
something, too."""


@inlined
def open_pair(fixed, lane, tree, parent, motions, flip, state, inherited, scratch, n):
    """Bound one lane of the tree `fixed` against the sixteen under lane `parent` of `tree`.

    Surviving pairs become open; surviving pairs of leaves wait. `flip` says that `fixed` is tree b.
    `inherited` is a lower bound of all sixteen pairs. If no leaves are added, `progress.kept` holds
    the lanes of the surviving pairs if these are likely to survive again soon, else SOME;
    `progress.least` is a lower bound of these lanes and `progress.proven` one of the others.
    Returns how many pairs wait now; n waited before.
    """
    progress, waiting = state.progress[0], state.waiting
    found = scratch.found
    node = tree.children[parent]
    unit = tree.scale[0]
    limit = progress.limit
    first = progress.open
    progress.bound_tests += WIDTH
    reach = np.float32(min(limit * tree.scale[1] * (1.0 + 1e-6), 1e29))
    inherited = lane_bounds(
        fixed, tree, lane, motions, node, progress.bound_slack, reach, inherited, scratch
    )
    top = first
    survivors = not_above(found, 0, reach)
    survivors &= left_between(waiting, tree, node, progress, limit, scratch.lows)
    progress.kept = 0
    if not survivors:
        progress.proven = max(inherited, smallest(found, 0, _ALL) * unit)
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
    kept, largest = survivors, -np.inf
    while survivors:
        k = lowest(survivors)
        survivors &= survivors - 1
        bound = found[k] * unit
        if not bound > inherited:
            bound = inherited
        if bound >= limit:
            kept &= ~(1 << k)
            continue
        largest = max(largest, bound)
        child = node * WIDTH + k
        a, b = (child, lane) if flip else (lane, child)
        push(state.open, state, first, top, a, b, bound)
        top += 1
    progress.open = top
    progress.kept = kept if top - first <= 1 or largest < _SURE * limit else SOME
    progress.proven = max(inherited, smallest(found, 0, _ALL & ~kept) * unit)
    progress.least = max(inherited, smallest(found, 0, kept) * unit)
    return n


@inlined
def nearest_last(waiting, first, last):
    """Swap the pair with the smallest bound of waiting[first:last] to the end of this range."""
    lanes, bounds = waiting.lanes, waiting.bounds
    best = first
    for k in range(first + 1, last):
        if bounds[k] < bounds[best]:
            best = k
    last -= 1
    bounds[best], bounds[last] = bounds[last], bounds[best]
    lanes[best, 0], lanes[last, 0] = lanes[last, 0], lanes[best, 0]
    lanes[best, 1], lanes[last, 1] = lanes[last, 1], lanes[best, 1]


@inlined
def _open_next(tree_a, tree_b, state, coherent, larger, inner, n, steps, scratch):
    """Take the next open pair, and open it unless it is pruned; n pairs of leaves wait.

    Returns how many pairs wait now, and how many of the steps are left.
    """
    progress, waiting = state.progress[0], state.waiting
    at = take(state.open, tree_a, tree_b, state)
    if at < 0:
        return n, steps
    steps -= 1
    pairs = state.open.pairs
    a, b, bound = np.int64(pairs[at, 0]), np.int64(pairs[at, 1]), state.open.bounds[at]
    near = state.collected.shape[0] > 0 and bound >= progress.enough + 3.0 * progress.slack
    if near and progress.volumes:
        # The pair may hold the minimum, and no more than that was asked. In searches for contacts
        # `volumes` is False: contacts are pairs of triangles, and rounding of the swept radii may
        # let a volume lie between `enough` and `limit`.
        collect(state, ~a, ~b, bound)
        return n, steps
    if coherent:
        kept, least = near_under(state, a, b)
        if kept != SOME:
            open_again(tree_a, tree_b, state, a, b, max(bound, least), kept)
            return n, steps
    opened, taken = open_whole(waiting, tree_a, tree_b, state, a, b, bound, scratch)
    if opened:
        return n, steps - min(steps, taken)
    child_a, child_b = tree_a.children[a], tree_b.children[b]
    if child_a < 0 and child_b < 0:
        waiting.lanes[n, 0], waiting.lanes[n, 1], waiting.bounds[n] = a, b, bound
        return n + 1, steps
    # Lane 0 of a node holds a leaf only in a lowest node.
    lowest_a = child_a < 0 or tree_a.children[child_a * WIDTH] < 0
    lowest_b = child_b < 0 or tree_b.children[child_b * WIDTH] < 0
    size_a = tree_a.sizes[a, EXTENT] * tree_a.scale[0]
    size_b = tree_b.sizes[b, EXTENT] * tree_b.scale[0]
    if bound > 0.0 and lowest_a + lowest_b < inner:
        # The volumes are apart: compare promises instead of sizes, if the bound may grow by one of
        # them to the limit.
        promise_a = tree_a.sizes[a, PROMISE] * tree_a.scale[0]
        promise_b = tree_b.sizes[b, PROMISE] * tree_b.scale[0]
        if bound + _HOPE * max(promise_a, promise_b) >= progress.limit:
            size_a, size_b = promise_a, promise_b
    before = n
    if lowest_a and lowest_b and child_a >= 0 and child_b >= 0:
        tests = progress.bound_tests
        flip = not size_a > size_b
        if flip:
            n = cross_leaves(
                tree_b, tree_a, child_b, a, state.motions[0], flip, state, bound, progress.limit,
                scratch, n,
            )  # fmt: skip
        else:
            n = cross_leaves(
                tree_a, tree_b, child_a, b, state.motions[1], flip, state, bound, progress.limit,
                scratch, n,
            )  # fmt: skip
        steps -= min(steps, (progress.bound_tests - tests) // WIDTH)
        if n > before + BATCH:
            nearest_last(waiting, before, n)
        if n >= 0:
            if coherent and n == before:
                progress.kept = 0
                remember_far(state, a, b, flip)
            return n, steps
        n = before
    # Opening two lowest nodes together costs less. So open the volume that is not lowest first,
    # unless the other is far larger.
    if lowest_a != lowest_b:
        size_a, size_b = (size_a, larger * size_b) if lowest_a else (larger * size_a, size_b)
    flip = child_b < 0 or (child_a >= 0 and size_a > size_b)
    if flip:
        motions = state.motions[0], state.motions[1]
        n = open_pair(tree_b, b, tree_a, a, motions, flip, state, bound, scratch, n)
    else:
        motions = state.motions[1], state.motions[0]
        n = open_pair(tree_a, a, tree_b, b, motions, flip, state, bound, scratch, n)
    if coherent and n == before:
        remember_far(state, a, b, flip)
    return n, steps


@shared
def advance(tree_a, tree_b, state):
    """Run a search for the steps that it has left.

    Returns ENDED, CUT, COLLECTED_FULL or CELLS_FULL.
    """
    progress, waiting = state.progress[0], state.waiting
    steps = progress.steps
    scratch = Scratch(
        on_stack(16, np.float32(0.0)), on_stack(_FOUND, np.float32(0.0)),
        on_stack(16, np.float32(0.0)), on_stack(STRIDE, np.float32(0.0)),
        on_stack(WIDTH, 0), on_stack(WIDTH, np.float32(0.0)), on_stack(WIDTH, np.float32(0.0)),
    )  # fmt: skip
    room = state.collected.shape[0]
    n = progress.waiting
    coherent = is_coherent(state)
    code = ENDED
    # Leaves are resolved in batches, except in two cases. With a tolerance, a nearer pair found
    # early lowers the limit, which is worth more than a full batch; in a long search it hardly
    # falls any more. If a clearance is asked for (the limit is then the clearance), any pair within
    # it is the answer. With a tolerance, also fewer leaves have to be compared, so opening two
    # lowest nodes together saves less.
    tolerant = progress.rel_err + progress.abs_err > 0.0
    many = 1 if tolerant or progress.limit < enough(progress) else BATCH
    larger = 1.8 if tolerant else 4.0
    # If one node of a pair is lowest, compare sizes only, so that two lowest nodes meet soon. If
    # only a clearance is asked for, compare promises in this case, too.
    inner = 2 if progress.limit < enough(progress) else 1
    opens = False
    while True:
        # Numba compiles callees in the order of the calls in the source. This call stands first,
        # because worker processes compile parts of the later calls ahead.
        if opens:
            n, steps = _open_next(tree_a, tree_b, state, coherent, larger, inner, n, steps, scratch)
        if tolerant and progress.bound_tests >= LONG:
            many = BATCH
        full = room > 0 and progress.collected + LARGEST * LARGEST * (n + _CROSSED) > room
        while n >= many or (
            n > 0
            and (progress.open == 0 or full or progress.distance - progress.slack <= progress.stop)
        ):
            if steps == 0:
                break
            n, steps = resolve(tree_a, tree_b, state, n, steps, scratch)
        if far_from_nearest(progress):
            come_nearer(tree_a, tree_b, state, scratch.found)
            steps -= min(steps, APPROACH_STEPS)
        steps -= min(steps, look_ahead(waiting, tree_a, tree_b, state))
        # If no pair is open any more, resolve the waiting pairs first.
        opens = not (n > 0 and progress.open == 0 and steps > 0)
        if not opens:
            continue
        if n == 0 and (progress.open == 0 or progress.distance - progress.slack <= progress.stop):
            code, steps = divide(waiting, tree_a, tree_b, state, steps)
            break
        if steps == 0:
            code = CUT
            break
        if full:
            code = COLLECTED_FULL
            break
    progress.steps, progress.waiting = steps, n
    return code
