"""The descent through a single hierarchy, shared by all queries, and the visit of a node.

Each kind of query has its own type: the nearest point (nearest.py), the crossings of a ray
(winding.py), or the height of a cap (ball_caps.py). From the type, numba chooses at compile time
the implementations of the stubs below, as for kinds of pairs (see search/stubs.py). Every query has
a `place`, metres in the tree's frame, and a `slack`, metres by which rounding may have moved the
place.

Three searches descend in their own way. The sum of solid angles (angles.py) reads the moments of
a lane's triangles, not the lane's volume. The search for contained parts (contain.py) tests whether
a volume is so small that one of its points decides for all. The search for the deepest point
(deepest.py) always takes the best lane of the whole tree, and bounds each lane with other queries.
"""

from __future__ import annotations

import numpy as np
from numba import float32, uint64

from ..base.jit import inlined
from ..base.lanes import lowest, not_above
from ..base.rounding import SINGLE_LIMIT, SINGLE_MARGIN
from ..tree.layout import EMPTY, STRIDE, WIDTH, first_of, last_of

ROOM = 512
"""Size of the stack of open volumes. On each level a step replaces one volume by at most sixteen. A
tree has at most ten levels, because its nodes are full (see tree/build.py)."""

BEYOND = float32(1e30)
"""Bound of a lane that is unused or irrelevant: beyond every limit."""

TO_THE_END = 1 << 62
"""A number of steps that suffices for every descent."""


def lane_gaps(query, nodes, base, x, y, z, margin, gaps):
    """Write to `gaps` each lane's lower bound for the query, for the node at `base`. A stub.

    (x, y, z) is the query's place in the node's frame. It and the gaps are in node units. `margin`
    covers the error of a distance through float32 and the slack.
    """


def limit(query, answer):
    """Return the bound, metres, from which on a volume cannot change the answer. A stub."""


def meet(query, tree, t, answer):
    """Return the answer updated with triangle t. A stub."""


@inlined
def visit(query, tree, node, most, gaps):
    """Bound the sixteen lanes of a node; return the bits of those that may be below `most`."""
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
        # The node is too far away, or too small, for float32: keep every used lane.
        for k in range(WIDTH):
            gaps[k] = BEYOND if tree.children[node * WIDTH + k] == EMPTY else float32(-np.inf)
    most = most / unit
    return not_above(gaps, 0, np.float32(min(most + 1e-6 * abs(most), 1e29)))


@inlined
def at_root(stack, bounds):
    """Begin a descent with the root; return the number of open volumes, 1."""
    stack[0], bounds[0] = 0, -np.inf
    return 1


@inlined
def descend(query, tree, answer, top, stack, bounds, gaps, steps):
    """Continue a descent for at most `steps` steps; return (answer, open volumes, steps left).

    Depth first; of the lanes of each visit, the one with the least bound comes first.
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
