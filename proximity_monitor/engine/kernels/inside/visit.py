"""The one way down a single hierarchy, whatever is asked of it, and the visit of a node.

A query is of a type of its own: for the nearest point (nearest.py), the crossings of a ray
(winding.py), or the height of a cap (ball_caps.py). Numba sees from its type, when it compiles,
which implementation of the stubs below is meant, as for kinds of pairs (see search/stubs.py). Every
query has a `place`, metres in the tree's frame, and a `slack`, metres that rounding may have moved
it by.

Three searches go down a hierarchy in ways of their own. The sum of solid angles (angles.py) asks
for the moments of what is under a lane, not for its volume. That for parts (contain.py) asks
whether a volume is so small that one of its points tells for all. That for the deepest point
(deepest.py) takes the best lane of all, and bounds each by queries of its own.
"""

from __future__ import annotations

import numpy as np
from numba import float32, uint64

from ..base.jit import inlined
from ..base.lanes import lowest, not_above
from ..base.rounding import SINGLE_LIMIT, SINGLE_MARGIN
from ..tree.layout import EMPTY, STRIDE, WIDTH, first_of, last_of

ROOM = 512
"""Volumes that may be open: a step replaces one by at most sixteen, on each level of a tree, which
has ten levels at most, as its nodes are full (see tree/build.py)."""

BEYOND = float32(1e30)
"""Bound of a lane that is unused, or of no interest: beyond every limit."""

TO_THE_END = 1 << 62
"""Steps that suffice for every descent."""


def lane_gaps(query, nodes, base, x, y, z, margin, gaps):
    """Write a lower bound of what each lane of the node at `base` adds to the answer: a stub.

    (x, y, z) is the query's place in the node's frame, in node units as the gaps are; `margin` is
    what float32 and the slack may do to a distance.
    """


def limit(query, answer):
    """The bound, metres, from which on a volume cannot change the answer any more: a stub."""


def meet(query, tree, t, answer):
    """The answer when triangle t has been looked at as well: a stub."""


@inlined
def visit(query, tree, node, most, gaps):
    """Bound the sixteen lanes of a node; returns the bits of those that may be below `most`."""
    unit = tree.scale[0]
    p = query.place
    x = p[0] / unit - tree.centres[node, 0]
    y = p[1] / unit - tree.centres[node, 1]
    z = p[2] / unit - tree.centres[node, 2]
    size = abs(x) + abs(y) + abs(z) + tree.centres[node, 3]
    slack = query.slack / unit
    if size + slack < SINGLE_LIMIT:
        margin = float32(SINGLE_MARGIN * size + slack)
        base = uint64(node * STRIDE)
        lane_gaps(query, tree.nodes, base, float32(x), float32(y), float32(z), margin, gaps)
    else:
        # Too far away for float32, or too small: then every lane is as good as the next.
        for k in range(WIDTH):
            gaps[k] = BEYOND if tree.children[node * WIDTH + k] == EMPTY else float32(-np.inf)
    most = most / unit
    return not_above(gaps, 0, np.float32(min(most + 1e-6 * abs(most), 1e29)))


@inlined
def at_root(stack, bounds):
    """Begin a descent; returns how many volumes are open then."""
    stack[0], bounds[0] = 0, -np.inf
    return 1


@inlined
def descend(query, tree, answer, top, stack, bounds, gaps, steps):
    """Go on with a descent, at most `steps` steps: (answer, how many are open, steps left).

    Depth first, the volume with the least bound of each visit on top.
    """
    while top > 0 and steps > 0:
        top -= 1
        most = limit(query, answer)
        if bounds[top] >= most:
            continue
        steps -= 1
        child = stack[top]
        if child < 0:
            for t in range(first_of(child), last_of(child) + 1):
                answer = meet(query, tree, t, answer)
            continue
        first = top
        survivors = visit(query, tree, child, most, gaps)
        while survivors:
            k = lowest(survivors)
            survivors &= survivors - 1
            bound = gaps[k] * tree.scale[0]
            at = top
            while at > first and bounds[at - 1] < bound:
                bounds[at], stack[at] = bounds[at - 1], stack[at - 1]
                at -= 1
            bounds[at], stack[at] = bound, tree.children[child * WIDTH + k]
            top += 1
    return answer, top, steps
