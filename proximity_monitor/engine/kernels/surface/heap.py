"""Pairs of cells, the one with the least bound first: a binary heap."""

from __future__ import annotations

from ..base.jit import inlined, kernel


@kernel
def add_pair(pairs, count, a, b, bound, normal):
    """Add a pair; returns how many there are then."""
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
    """Take the first pair off; returns how many there are then."""
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
    """Take the first pair off, or the last; returns how many there are then."""
    return drop_first(pairs, count) if at == 0 else count - 1


@kernel
def put_aside(pairs, aside, a, b, bound):
    """Add a pair to those that are set aside; returns how many they are then."""
    pair = pairs[len(pairs) - 1 - aside]
    pair.a, pair.b, pair.bound = a, b, bound
    return aside + 1


@inlined
def place(pairs, count, k):
    """Where the k-th pair stands of the `count` of the heap and those set aside after them."""
    return k if k < count else len(pairs) - 1 - (k - count)


@kernel
def rebuilt(pairs, count, limit):
    """Leave out the pairs whose bound is not below a limit; returns how many are left."""
    kept = 0
    for k in range(count):
        pair = pairs[k]
        if pair.bound < limit:
            normal = (pair.normal[0], pair.normal[1], pair.normal[2])
            kept = add_pair(pairs, kept, pair.a, pair.b, pair.bound, normal)
    return kept


@kernel
def kept_aside(pairs, aside, limit):
    """The same of those that are set aside."""
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
