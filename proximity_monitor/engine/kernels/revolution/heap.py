"""A binary heap of pairs of rings, as their slots in `rings`; the least bound is first.

Slots that have become free follow those of the heap.
"""

from __future__ import annotations

from ..base.jit import kernel


@kernel
def add_ring(rings, heap, count, slot):
    """Add the pair in a slot; return how many pairs there are then."""
    bound, at = rings[slot].bound, count
    while at > 0:
        parent = (at - 1) // 2
        if rings[heap[parent]].bound <= bound:
            break
        heap[at] = heap[parent]
        at = parent
    heap[at] = slot
    return count + 1


@kernel
def drop_ring(rings, heap, count):
    """Remove the first pair; return how many pairs there are then."""
    last = count - 1
    slot, free, at = heap[last], heap[0], 0
    bound = rings[slot].bound
    while True:
        child = 2 * at + 1
        if child >= last:
            break
        if child + 1 < last and rings[heap[child + 1]].bound < rings[heap[child]].bound:
            child += 1
        if bound <= rings[heap[child]].bound:
            break
        heap[at] = heap[child]
        at = child
    heap[at] = slot
    heap[last] = free
    return last
