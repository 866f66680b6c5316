"""The open pairs, nearest first: bounded priority queues on a stack.

Larsen et al. 1999, section 6.1: pairs are visited in the order of their bounds, in a queue of fixed
size. When the queue is full, its nearest pair is searched by a new queue on top, until that one is
empty. So memory is bounded by the queue's size times the number of levels of both hierarchies.

Entries `progress.base` to `progress.open` of `pairs` and `bounds` are the present queue, a binary
heap. `frames` holds where the queues below it begin.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel
from ..base.state import Priority
from .stubs import least_open, push, take

QUEUE = 256
"""Most pairs of a queue; the paper's queue has 200."""


@kernel
def _swap(pairs, bounds, i, j):
    bounds[i], bounds[j] = bounds[j], bounds[i]
    pairs[i, 0], pairs[j, 0] = pairs[j, 0], pairs[i, 0]
    pairs[i, 1], pairs[j, 1] = pairs[j, 1], pairs[i, 1]


@implements(push, Priority)
@inlined
def _push(open_pairs, state, first, top, a, b, bound):
    pairs, bounds, base = open_pairs.pairs, open_pairs.bounds, state.progress[0].base
    pairs[top, 0], pairs[top, 1], bounds[top] = a, b, bound
    at = top
    while at > base:  # it rises to its place
        parent = base + (at - base - 1) // 2
        if bounds[parent] <= bounds[at]:
            break
        _swap(pairs, bounds, parent, at)
        at = parent


@implements(take, Priority)
@inlined
def _take(open_pairs, tree_a, tree_b, state):
    return _take_nearest(open_pairs, state)


@implements(least_open, Priority)
@inlined
def _least(open_pairs, state):
    least = np.inf
    for i in range(state.progress[0].open):
        least = min(least, open_pairs.bounds[i])
    return least


@kernel
def _take_nearest(open_pairs, state):
    progress, bounds, frames = state.progress[0], open_pairs.bounds, open_pairs.frames
    pairs = open_pairs.pairs
    while progress.open == progress.base and progress.frames > 0:
        progress.frames -= 1
        progress.base = frames[progress.frames]
    progress.open -= 1
    base, last = progress.base, progress.open
    _swap(pairs, bounds, base, last)
    at = base
    while True:
        child = 2 * at - base + 1
        if child >= last:
            break
        if child + 1 < last and bounds[child + 1] < bounds[child]:
            child += 1
        if bounds[at] <= bounds[child]:
            break
        _swap(pairs, bounds, at, child)
        at = child
    if bounds[last] >= progress.limit:
        progress.open = base  # all other pairs of this queue are pruned, too
        return -1
    if last - base >= QUEUE:
        frames[progress.frames] = base
        progress.frames += 1
        progress.base = last
    return last
