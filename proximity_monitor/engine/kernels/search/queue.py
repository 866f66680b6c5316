"""The pairs still to be looked at, nearest first: a bounded priority queue inside the stack.

Larsen et al. 1999, section 6.1: pairs are visited in the order of their bounds, in a queue of fixed
size. When it is full its nearest pair is searched by a queue of its own on top, until that is
empty: so the memory is bounded by the queue's size times the levels of both hierarchies.

Entries base to DEPTH of `stack` and `bounds` are the present queue, a binary heap; `frames` holds
where the queues below it begin.
"""

from __future__ import annotations

from ..base.jit import inlined, kernel
from ..base.state import BASE, DEPTH, FRAMES, LIMIT

QUEUE = 256
"""Pairs of a queue; the paper's is 200."""


@kernel
def _swap(stack, bounds, i, j):
    bounds[i], bounds[j] = bounds[j], bounds[i]
    stack[i, 0], stack[j, 0] = stack[j, 0], stack[i, 0]
    stack[i, 1], stack[j, 1] = stack[j, 1], stack[i, 1]


@inlined
def rise(stack, bounds, base, at):
    """Let a new last entry rise to its place."""
    while at > base:
        parent = base + (at - base - 1) // 2
        if bounds[parent] <= bounds[at]:
            break
        _swap(stack, bounds, parent, at)
        at = parent


@kernel
def take_nearest(state):
    """Take the nearest pair of the present queue; returns where it stands, or -1: it is pruned."""
    counts, stack, bounds = state.counts, state.stack, state.bounds
    while counts[DEPTH] == counts[BASE] and counts[FRAMES] > 0:
        counts[FRAMES] -= 1
        counts[BASE] = state.frames[counts[FRAMES]]
    counts[DEPTH] -= 1
    base, last = counts[BASE], counts[DEPTH]
    _swap(stack, bounds, base, last)
    at = base
    while True:
        child = 2 * at - base + 1
        if child >= last:
            break
        if child + 1 < last and bounds[child + 1] < bounds[child]:
            child += 1
        if bounds[at] <= bounds[child]:
            break
        _swap(stack, bounds, at, child)
        at = child
    if bounds[last] >= state.reals[LIMIT]:
        counts[DEPTH] = base  # and so are all others
        return -1
    if last - base >= QUEUE:
        state.frames[counts[FRAMES]] = base
        counts[FRAMES] += 1
        counts[BASE] = last
    return last
