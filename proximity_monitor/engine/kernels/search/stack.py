"""The open pairs, depth first: a stack, with the nearest pair of each opening on top.

If nothing is known that is near, the first limit is far too large. Then a pair with a bound near
the limit is put off, to be opened after all others. By then nearer elements have mostly been found,
and the lower limit prunes it. Such pairs wait at the end of the arrays. This saves an eighth of
the openings at random poses in a cave.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel, shared
from ..base.state import DepthFirst
from ..base.trees import NONE
from .stubs import least_open, push, take

PUT_OFF = 128
"""Most pairs that are put off."""

_SHARE = 0.7
"""A pair is put off if its bound is at least this share of the limit."""


@implements(push, DepthFirst)
@inlined
def _push(open_pairs, state, first, top, a, b, bound):
    """Put the pair on top, or below the top pair of the same opening if that one is nearer.

    The others are in no order. Sorting them takes longer, for its branches are hard to predict.
    """
    pairs, bounds = open_pairs.pairs, open_pairs.bounds
    pairs[top, 0], pairs[top, 1], bounds[top] = a, b, bound
    below = max(top - 1, first)
    c, d, other = pairs[below, 0], pairs[below, 1], bounds[below]
    nearer = bound < other
    pairs[below, 0], pairs[top, 0] = (c, a) if nearer else (a, c)
    pairs[below, 1], pairs[top, 1] = (d, b) if nearer else (b, d)
    bounds[below], bounds[top] = (other, bound) if nearer else (bound, other)


@inlined
def _push_sorted(open_pairs, top, a, b, bound):
    pairs, bounds = open_pairs.pairs, open_pairs.bounds
    at = top
    while at > 0 and bounds[at - 1] < bound:
        bounds[at] = bounds[at - 1]
        pairs[at, 0], pairs[at, 1] = pairs[at - 1, 0], pairs[at - 1, 1]
        at -= 1
    bounds[at] = bound
    pairs[at, 0], pairs[at, 1] = a, b


@implements(take, DepthFirst)
@inlined
def _take(open_pairs, tree_a, tree_b, state):
    progress = state.progress[0]
    if progress.put_off != NONE:
        return _take_or_put_off(open_pairs, state)
    progress.open -= 1
    at = progress.open
    return at if open_pairs.bounds[at] < progress.limit else -1


@shared
def _take_or_put_off(open_pairs, state):
    """Do as `take`, but put off pairs from the top of the stack whose bounds are near the limit.

    Before the stack gets empty, those put off come back, below the last pair if that is taken. From
    then on none is put off.
    """
    progress, pairs, bounds = state.progress[0], open_pairs.pairs, open_pairs.bounds
    at, end = progress.open - 1, len(bounds)
    while at >= 0 and _SHARE * progress.limit <= bounds[at] and progress.put_off < PUT_OFF:
        if bounds[at] < progress.limit:
            progress.put_off += 1
            k = end - progress.put_off
            pairs[k, 0], pairs[k, 1], bounds[k] = pairs[at, 0], pairs[at, 1], bounds[at]
        at -= 1
    if at <= 0 and progress.put_off > 0:
        a, b, bound = pairs[0, 0], pairs[0, 1], bounds[0]
        top = _take_back(open_pairs, progress)
        if at == 0:
            pairs[top, 0], pairs[top, 1], bounds[top] = a, b, bound
            top += 1
        at = top - 1
    progress.open = max(at, 0)
    return at if at >= 0 and bounds[at] < progress.limit else -1


@kernel
def _take_back(open_pairs, progress):
    """Make a stack of the pairs put off, the nearest on top; return how many there are."""
    pairs, bounds = open_pairs.pairs, open_pairs.bounds
    end, top = len(bounds), 0
    for k in range(end - progress.put_off, end):
        if bounds[k] < progress.limit:
            _push_sorted(open_pairs, top, pairs[k, 0], pairs[k, 1], bounds[k])
            top += 1
    progress.put_off = NONE
    return top


@implements(least_open, DepthFirst)
@inlined
def _least(open_pairs, state):
    progress, bounds = state.progress[0], open_pairs.bounds
    least = np.inf
    for i in range(progress.open):
        least = min(least, bounds[i])
    for k in range(1, progress.put_off + 1):
        least = min(least, bounds[len(bounds) - k])
    return least


@inlined
def close_all(progress):
    """Close all open and waiting pairs: nothing under them is nearer than the limit."""
    progress.open = progress.put_off = progress.waiting = 0
