"""What a call of an assembly does before and after its searches, row by row of its pairs.

In numpy, each of these functions would be a dozen calls. After a pause, when the processor's caches
hold other programs, these calls took longer than a short budget.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import entry
from ..base.memory import addresses, records_at
from ..base.state import LOWER, QUERY, STATUS, UNKNOWN, UPPER

QUERY_NUMBERS = QUERY.itemsize // 8
"""Size of a QUERY in numbers of eight bytes: passing records from Python would take longer."""


@entry
def take_pairs(given, solid, pairs, signed):
    """Write pairs (k, 2) as int32, and `signed` (k,): which pairs have a body that is `solid` (n,).

    Returns the index of the first pair with an index that is no body, or k.
    """
    for k in range(len(given)):
        a, b = given[k, 0], given[k, 1]
        if not (0 <= a < len(solid) and 0 <= b < len(solid)):
            return k
        pairs[k, 0], pairs[k, 1] = a, b
        signed[k] = solid[a] or solid[b]
    return len(given)


@entry
def begin_questions(pairs, wanted, hints, signed, queries, answers):
    """Write the queries about pairs of bodies, and their answers as they are before any search.

    Args:
        pairs: (k, 2) int32.
        wanted: (k, 3) rel_err, abs_err and clearance.
        hints: (k, 2) elements to start with, in tree order, used if not negative; or (0, 2).
        signed: (k,) whether the signed distance is asked for, whose lower bound may be negative.
        queries: (2 + k QUERY_NUMBERS,) int64, written: first the table (1, 2) of the queries, then
            the queries as (k,) QUERY. So the table keeps them alive.
        answers: (k, ANSWER) written.

    Returns how many of the pairs are `signed`.
    """
    count = 0
    at, _ = addresses((queries[2:],))
    queries[0], queries[1] = at, len(pairs)
    made = records_at(at, len(pairs), QUERY)
    for k in range(len(pairs)):
        query, clearance = made[k], wanted[k, 2]
        for side in range(2):
            query.bodies[side] = query.poses[side] = pairs[k, side]
            query.nearest[side] = UNKNOWN
        if len(hints) and hints[k, 0] >= 0 and hints[k, 1] >= 0:
            query.nearest[0], query.nearest[1] = hints[k, 0], hints[k, 1]
        query.alone = 0
        query.rel_err, query.abs_err, query.param_err = wanted[k, 0], wanted[k, 1], np.inf
        query.stop = clearance if clearance < np.inf else 0.0
        query.limit = np.nextafter(clearance, np.inf)
        for i in range(answers.shape[1]):
            answers[k, i] = np.nan
        answers[k, LOWER] = -np.inf if signed[k] else 0.0
        answers[k, UPPER] = np.inf
        count += signed[k]
    return count


@entry
def signs_open(answers, wanted, found):
    """Write into `found` which answers (k, ANSWER) leave open whether the bodies overlap.

    These are the searched answers whose lower bound is -inf, unless the upper bound is within a
    finite clearance in `wanted` (k, 3), which is as for `begin_questions`. Looks at the first
    len(found) answers, and returns how many of these are open.
    """
    count = 0
    for k in range(len(found)):
        upper, clearance = answers[k, UPPER], wanted[k, 2]
        found[k] = (
            answers[k, LOWER] == -np.inf
            and not np.isnan(answers[k, STATUS])
            and (upper > clearance or clearance == np.inf)
        )
        count += found[k]
    return count
