"""The descent of the bounding volume test tree.

Depth first (Larsen et al. 1999, sections 5.1 and 6): the pair whose bound is smallest comes first,
the larger volume of a pair is opened, sixteen bounds at a time.
"""

from __future__ import annotations

import numpy as np
from numba import uint64

from .build import EMPTY
from .gaps import BATCH, CORNERS, gather
from .jit import entry, inlined
from .lanes import lowest, not_above
from .primitives import test_batch
from .queue import QUEUE, rise, take_nearest
from .state import (
    BASE,
    BOUND_SLACK,
    BOUND_TESTS,
    CONTACTS,
    CONTACTS_FULL,
    CUT,
    DEPTH,
    DEPTH_FIRST,
    DISTANCE,
    ENDED,
    FRAMES,
    LIMIT,
    ORDER,
    PRIMITIVE_TESTS,
    SLACK,
    STOP,
)
from .volumes import STRIDE, WIDTH, far_bound, lower_bounds, place


@inlined
def open_pair(fixed, lane, tree, parent, motion, flip, state, single, found):
    """Bound one lane of the tree `fixed` against the sixteen under lane `parent` of `tree`.

    Pushes the pairs that survive, the nearest on top. `flip` says that `fixed` is tree b.
    """
    reals, counts, stack, bounds = state.reals, state.counts, state.stack, state.bounds
    node = tree.children[parent]
    unit = tree.scale[0]
    limit = reals[LIMIT]
    first = counts[DEPTH]
    inherited = bounds[first]
    counts[BOUND_TESTS] += WIDTH
    reach = np.float32(min(limit * tree.scale[1] * (1.0 + 1e-6), 1e29))
    if place(fixed, lane, motion, tree, node, reals[BOUND_SLACK], single):
        lower_bounds(tree.nodes, uint64(node * STRIDE), single, found)
    else:
        inherited = max(inherited, far_bound(fixed, lane, motion, tree, node, reals[BOUND_SLACK]))
        for k in range(WIDTH):
            empty = tree.children[node * WIDTH + k] == EMPTY
            found[k] = np.float32(1e30) if empty else np.float32(0.0)
    top = first
    order = counts[ORDER]
    survivors = not_above(found, reach)
    while survivors:
        k = lowest(survivors)
        survivors &= survivors - 1
        bound = found[k] * unit
        if not bound > inherited:
            bound = inherited
        if bound >= limit:
            continue
        at = top
        if order == DEPTH_FIRST:
            while at > first and bounds[at - 1] < bound:
                bounds[at] = bounds[at - 1]
                stack[at, 0], stack[at, 1] = stack[at - 1, 0], stack[at - 1, 1]
                at -= 1
        bounds[at] = bound
        child = node * WIDTH + k
        stack[at, 0] = child if flip else lane
        stack[at, 1] = lane if flip else child
        if order != DEPTH_FIRST:
            rise(stack, bounds, counts[BASE], at)
        top += 1
    counts[DEPTH] = top


@entry
def advance(tree_a, tree_b, state, steps):
    """Run at most `steps` steps of a search; returns ENDED, CUT or CONTACTS_FULL."""
    reals, counts, stack, bounds = state.reals, state.counts, state.stack, state.bounds
    single, found = np.empty(16, np.float32), np.empty(WIDTH, np.float32)
    pairs, corners = np.empty((BATCH, 2), np.int32), np.empty(CORNERS)
    local = np.empty(CORNERS - 3 * BATCH, np.float32)
    room = state.contacts.shape[0]
    waiting = 0
    code = ENDED
    while True:
        if waiting == BATCH or (waiting > 0 and (counts[DEPTH] == 0 or steps == 0)):
            test_batch(tree_a, tree_b, state, pairs, waiting, corners, local, found)
            waiting = 0
        if counts[DEPTH] == 0 or reals[DISTANCE] - reals[SLACK] <= reals[STOP]:
            break
        if steps == 0:
            code = CUT
            break
        if room > 0 and counts[CONTACTS] + BATCH > room:
            code = CONTACTS_FULL  # known right after a batch, so none is waiting
            break
        if counts[ORDER] == DEPTH_FIRST:
            counts[DEPTH] -= 1
            top = counts[DEPTH]
            if bounds[top] >= reals[LIMIT]:
                continue
        else:
            take_nearest(state)
            top = counts[DEPTH]
            if bounds[top] >= reals[LIMIT]:
                counts[DEPTH] = counts[BASE]
                continue
            a, b = stack[top, 0], stack[top, 1]
            if top - counts[BASE] >= QUEUE:
                state.frames[counts[FRAMES]] = counts[BASE]
                counts[FRAMES] += 1
                counts[BASE] = top
        steps -= 1
        a, b = stack[top, 0], stack[top, 1]
        child_a, child_b = tree_a.children[a], tree_b.children[b]
        if child_a < 0 and child_b < 0:
            pairs[waiting, 0], pairs[waiting, 1] = ~child_a, ~child_b
            gather(tree_a.triangles, ~child_a, tree_b.triangles, ~child_b, waiting, corners)
            counts[PRIMITIVE_TESTS] += 1
            waiting += 1
        elif child_b < 0 or (
            child_a >= 0 and tree_a.sizes[a] * tree_a.scale[0] > tree_b.sizes[b] * tree_b.scale[0]
        ):
            open_pair(tree_b, b, tree_a, a, state.motions[0], True, state, single, found)
        else:
            open_pair(tree_a, a, tree_b, b, state.motions[1], False, state, single, found)
    return code
