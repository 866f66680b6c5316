"""A binary heap of pairs of cells: the pair with the least bound comes first."""

from __future__ import annotations

from ..base.jit import inlined, kernel


@kernel
def add_pair(pairs, count, a, b, bound, normal):
    """Add a pair; return how many pairs the heap then has."""
    at = count
    while at > 0:
        parent = (at - 1) // 2
        if pairs[parent].bound <= bound:
            break
        _copy(pairs, parent, at)
        at = parent
    pair = pairs[at]
    pair.a, pair.b, pair.bound = a, b, bound
    pair.normal[0], pair.normal[1], pair.normal[2] = normal
    return count + 1


@kernel
def drop_first(pairs, count):
    """Remove the first pair; return how many are left."""
    last = count - 1
    bound = pairs[last].bound
    at = 0
    while True:
        child = 2 * at + 1
        if child >= last:
            break
        if child + 1 < last and pairs[child + 1].bound < pairs[child].bound:
            child += 1
        if bound <= pairs[child].bound:
            break
        _copy(pairs, child, at)
        at = child
    if at != last:
        _copy(pairs, last, at)
    return last


@inlined
def drop(pairs, count, at):
    """Remove the first pair (`at` 0) or the last; return how many are left."""
    return drop_first(pairs, count) if at == 0 else count - 1


@kernel
def put_aside(pairs, aside, a, b, bound):
    """Add a pair to those set aside, at the end of `pairs`; return how many are then set aside."""
    pair = pairs[len(pairs) - 1 - aside]
    pair.a, pair.b, pair.bound = a, b, bound
    return aside + 1


@inlined
def place(pairs, count, k):
    """Return the index of pair k: first the `count` pairs of the heap, then those set aside."""
    return k if k < count else len(pairs) - 1 - (k - count)


@kernel
def rebuilt(pairs, count, limit):
    """Drop the pairs whose bound is not below a limit; return how many are left."""
    kept = 0
    for k in range(count):
        pair = pairs[k]
        if pair.bound < limit:
            normal = (pair.normal[0], pair.normal[1], pair.normal[2])
            kept = add_pair(pairs, kept, pair.a, pair.b, pair.bound, normal)
    return kept


@kernel
def kept_aside(pairs, aside, limit):
    """As `rebuilt`, for the pairs set aside."""
    kept = 0
    for k in range(aside):
        if pairs[place(pairs, 0, k)].bound < limit:
            _copy(pairs, place(pairs, 0, k), place(pairs, 0, kept))
            kept += 1
    return kept


@inlined
def _copy(pairs, source, target):
    one, other = pairs[source], pairs[target]
    other.a, other.b, other.bound = one.a, one.b, one.bound
    for i in range(3):
        other.normal[i] = one.normal[i]
