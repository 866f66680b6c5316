"""Whether one of two bodies whose surfaces are apart lies inside the other: for many pairs at once.

A connected part whose surface does not meet a closed one lies wholly on the side of any of its
points. So where the surfaces are apart, the winding number around one vertex of each part tells.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from .jit import kernel, shared
from .memory import on_stack
from .primitives import corners
from .solids import HALF, WHOLE
from .state import BOUND_SLACK, ENDED, LOWER, OUT_OF_TIME, STATUS, UPPER
from .vectors import moved
from .volumes import WIDTH
from .winding import winding_number

Insides = namedtuple("Insides", "where spans samples")
"""What n bodies enclose: where (int8, n), their Region.inside; samples (int32, k) of all of them;
and spans (int64, n × 2), which of these are a body's: the first, and one after the last.
"""


@shared
def holds(holder, body, samples, motion, slack, stack):
    """Whether a part of `body` may lie inside `holder`, a closed mesh that its surface is off.

    The samples are of the body, `motion` brings them to the frame of the holder, and its surface is
    farther than 2 `slack` from each.
    """
    gaps = on_stack(WIDTH, np.float32(0.0))
    for i in range(len(samples)):
        p = moved(motion, corners(body.triangles, samples[i] // 3)[0])
        if winding_number(holder, p, slack, stack, gaps) != 0:  # or unknown
            return True
    return False


@kernel
def settle_sign(tree_a, tree_b, insides, i, j, state, clearance, code, answer):
    """Make the answer about the surfaces of bodies i and j one about their signed distance.

    Where the surfaces may meet, or one body lie inside the other, its sign is open, and `lower` is
    -inf. Then the search counts as cut, unless its upper bound has decided about the clearance.
    """
    slack, where = state.reals[BOUND_SLACK], insides.where
    certain = code == ENDED and answer[LOWER] > 2.0 * slack
    certain = certain and where[i] != HALF and where[j] != HALF
    stack = state.stack[:, 0]
    if certain and where[j] == WHOLE:
        samples = insides.samples[insides.spans[i, 0] : insides.spans[i, 1]]
        certain = not holds(tree_b, tree_a, samples, state.motions[1], slack, stack)
    if certain and where[i] == WHOLE:
        samples = insides.samples[insides.spans[j, 0] : insides.spans[j, 1]]
        certain = not holds(tree_a, tree_b, samples, state.motions[0], slack, stack)
    if not certain:
        answer[LOWER] = -np.inf
        if not answer[UPPER] <= clearance < np.inf:
            answer[STATUS] = OUT_OF_TIME
