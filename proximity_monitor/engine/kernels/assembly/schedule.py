"""Queries about many pairs of bodies: which are open, and what to ask next.

While a pair may be within its range, it is asked for its distance to a tolerance, or only for the
side of some levels on which the distance is (the pair is then to be decided). The bounds carried
from an earlier search (carry.py) may answer this without a search. Each function handles all pairs
in one call: with numpy, each step would cost microseconds even for a single pair, as much as its
search.

A tick is one round of `update`, searches and `report`. A view is a pair at one tick.
"""

from __future__ import annotations

import numpy as np

from ..base import state
from ..base.jit import entry, kernel
from ..elements.swept import surface_points
from .carry import CONTINUOUS, JUMPING, MOVED, UNSIGNED, carry_one, keep_one, vector, was_deformed

LEVELS = 4

RECORD = np.dtype(
    [
        ("range", np.float64),  # metres; a pair that is farther apart is not searched
        ("levels", np.float64, (LEVELS,)),  # metres
        ("rel_err", np.float64),
        ("abs_err", np.float64),
        ("searched_s", np.float64),  # when it was last searched
        ("answered_s", np.float64),  # when its numbers were last found at the poses of a tick
        ("min_upper", np.float64),  # the smallest bounds of all ticks
        ("min_lower", np.float64),
        ("widened", np.float64),  # how far motion had widened the bounds at the last tick, metres
        ("hint", np.int32, (2,)),  # nearest triangles, in tree order, for a search to start with
        ("status", np.int8),  # of the last search: why it stopped
        ("deciding", np.bool_),  # only the side of the levels is asked for
        ("ignored", np.bool_),  # nothing is asked
        ("done", np.bool_),  # the last search answered everything that can be asked
        ("hard", np.bool_),  # the last search ran out of time
        ("met", np.bool_),  # the last search found, or left open, that the models may overlap
    ],
    align=True,
)
"""What is asked about a pair, and how its searches went."""

VIEW = np.dtype(
    [
        ("lower", np.float64),  # metres, certified at the present poses
        ("upper", np.float64),
        ("points", np.float64, (2, 3)),  # as in an ANSWER
        ("features", np.float64, (2, 4)),
        ("blur", np.float64),  # metres: how far the bodies moved since the last tick
        ("asked", np.float64),  # the level of the last search of this tick; NaN: there was none
        ("known", np.bool_),  # both poses are known
        ("stale", np.bool_),  # a pose is not known, or too old
        ("deciding", np.bool_),
        ("answered", np.bool_),  # another search can add nothing to what the last one found
        ("urgent", np.bool_),  # the side of a level is open
        ("tolerated", np.bool_),  # the bounds satisfy the tolerance
        ("wanting", np.bool_),  # the pair is worth a search
        ("searched", np.bool_),  # it was searched at this tick
    ],
    align=True,
)
"""A pair at one tick; searches improve it."""

LISTED = np.dtype(
    [
        ("at", np.int64),  # its place among the views
        ("bodies", np.int64, (2,)),
        ("lower", np.float64),
        ("upper", np.float64),
        ("points", np.float64, (2, 3)),
        ("parameters", np.float64, (2, 3)),
        ("elements", np.int32, (2,)),
        ("age_s", np.float64),
        ("min_upper", np.float64),
        ("min_lower", np.float64),
        ("silent", np.int8, (2,)),  # 1 if the body is silent; a record cannot hold arrays of bool
        ("status", np.int8),
    ],
    align=True,
)
"""What is known of a listed pair at the end of a tick."""

OVERLAPPING, UNKNOWN = 4, 5
"""Two more statuses of a listed pair, in addition to the reasons why a search stopped. For a listed
pair, OUT_OF_TIME means that the bounds are wider than was asked for, for whatever reason."""

TOGETHER, ALONE, INSIDE = 0, 1, 2
"""How to search a pair: in one call with others; alone, because it takes long; or alone, because a
solid may overlap the other body and the search has to find how deep."""


DEPTH_ERR = 0.01
"""Relative error with which a depth is reported, the default of `engine.signed_distance`."""


@kernel
def _is_close(view):
    """Return whether the bounds of a depth are as close as DEPTH_ERR demands."""
    return view.upper < 0.0 and -view.lower <= -view.upper * (1.0 + DEPTH_ERR)


@kernel
def _judge(record, view):
    """Set the flags of a view that follow from its bounds and its record.

    A pair that is certainly within a level is asked for its distance, even if all pairs are only to
    be decided. Otherwise an estimate of the time until the next threshold is reached, made from
    bounds that just decide, would depend on whether anyone else wanted the distance.
    """
    lower, upper = view.lower, view.upper
    urgent = near = False
    for i in range(LEVELS):
        urgent |= lower <= record.levels[i] < upper
        near |= upper <= record.levels[i]
    if near and not urgent and not record.deciding:
        view.deciding = False
    small, large = min(abs(lower), abs(upper)), max(abs(lower), abs(upper))
    rel_err, abs_err = record.rel_err, record.abs_err
    tolerated = abs_err > 0.0 and upper - lower <= abs_err
    if rel_err > 0.0 and (lower > 0.0 or upper < 0.0):
        tolerated |= large <= (1.0 + rel_err) * small
    tolerated |= _is_close(view) or (upper < 0.0 and upper - lower <= view.blur)
    view.urgent, view.tolerated = urgent, tolerated
    view.wanting = (
        (urgent if view.deciding else not tolerated)
        and view.known
        and not view.answered
        and not record.ignored
        and lower <= record.range
    )


@kernel
def _blur(record, answer, widened, motion):
    """Return how far the bodies moved since the last tick (m), and store `widened` in the record.

    `widened` is by how much motion has lowered the answer's lower bound so far, metres.
    """
    if not (answer.kind == CONTINUOUS and 0.0 < widened < np.inf):
        widened = 0.0
    more = widened - record.widened
    record.widened = widened
    return max(more, 0.0) if motion == MOVED else 0.0


@entry
def update(poses, versions, balls, places, answers, known, silent, rows, records, distances, views):
    """Write the views of the rows (k,), as they are before any search.

    The first five arguments are as for `carry`. known (n,) and silent (n,) are about the bodies,
    records (m,) RECORD about all rows. If not `distances`, pairs are only decided, except those
    within a level.
    """
    for k in range(len(rows)):
        row = rows[k]
        answer, record, view = answers[row], records[row], views[k]
        a, b = answer.bodies[0], answer.bodies[1]
        view.lower, view.upper, motion = carry_one(
            poses, versions, balls, places, answer, view.points
        )
        for i in range(2):
            for j in range(4):
                view.features[i, j] = answer.features[i, j]
        view.blur = _blur(record, answer, answer.lower - view.lower, motion)
        view.known = known[a] and known[b]
        view.stale = silent[a] or silent[b]
        view.deciding = record.deciding or not distances
        # The last search ended with a tolerance, so a level may lie between its bounds.
        open_yet = view.deciding and record.status == state.WITHIN_TOLERANCE
        view.answered = record.done and motion != MOVED and not open_yet
        view.asked = np.nan
        view.searched = False
        _judge(record, view)


_LAST = 1e300
"""A sort key (m) above all lower bounds and below infinity."""


@entry
def pending(rows, records, views, at, kind, keys):
    """Write the views that want a search into `at`, and their sort keys; return how many.

    `kind` is 0 if the side of a level is open, otherwise 1; 2 is added for stale pairs. keys (2, k)
    are the lower bounds and the times of the last search. If models meet or overlap, a larger
    number replaces the lower bound.
    """
    count = 0
    for k in range(len(rows)):
        view = views[k]
        if view.wanting:
            at[count] = k
            kind[count] = 2 * view.stale + (not view.urgent)
            # If models meet, the distance is known. It is open whether they overlap, and how deep.
            # Finding that takes longer than many distances, so it comes last.
            keys[0, count] = view.lower
            if view.upper <= 0.0:
                keys[0, count] = np.inf if view.upper < 0.0 else _LAST
            keys[1, count] = records[rows[k]].searched_s
            count += 1
    return count


@kernel
def _level(record, view, inside):
    """Return the clearance (m) at which a search may end; infinity if only the tolerance ends it.

    If a pair is only to be decided, ask for the largest open level: most pairs are beyond all
    levels, and this one query settles them. The same applies to a pair whose distance takes long,
    if a level is open. If a distance is wanted, first check whether the pair is within range: that
    costs an eighth of a full query and settles most pairs. If a search for the same level has ended
    and left it open, only rounding keeps it open: then ask for everything. If a solid may overlap
    the other body (`inside`), ask for the sign first, which is far cheaper than the depth.
    """
    level = np.inf
    if view.deciding or (record.hard and view.urgent):
        level = -np.inf
        for i in range(LEVELS):
            if view.lower <= record.levels[i] < view.upper:
                level = max(level, record.levels[i])
        if level == view.asked:
            level = np.inf
    elif view.upper > record.range and np.isnan(view.asked):
        level = record.range
    elif inside and view.upper >= 0.0 and view.asked != 0.0:
        level = 0.0
    return level


@entry
def query(rows, answers, records, views, at, bodies, wanted, hints, signed, how):
    """Write the queries about the views `at` (m,).

    bodies (m, 2), wanted (m, 3), hints (m, 2) and signed (m,) are those of `Assembly.rows`; `how`
    (m,) is TOGETHER, ALONE or INSIDE. A pair that is only to be decided has no tolerance: the level
    ends its search. If two solids are certainly apart, their distance is that of their surfaces.
    Otherwise the sign is asked for, and nearly all pairs turn out to be apart. A depth is asked for
    with the accuracy of DEPTH_ERR, but not more accurately than the bodies moved since the last
    tick: at the next tick it will be blurred by as much.
    """
    for i in range(len(at)):
        row, view = rows[at[i]], views[at[i]]
        answer, record = answers[row], records[row]
        bodies[i, 0], bodies[i, 1] = answer.bodies[0], answer.bodies[1]
        hints[i, 0], hints[i, 1] = record.hint[0], record.hint[1]
        signed[i] = answer.kind != UNSIGNED and view.lower <= 0.0
        how[i] = ALONE if record.hard else TOGETHER
        if signed[i]:
            # If the models met, first find from the surfaces whether they still do: that costs far
            # less.
            again = record.met and not view.searched and view.upper > 0.0
            inside = answer.kind == JUMPING or record.hard or record.met
            how[i] = INSIDE if inside and not again else TOGETHER
        wanted[i, 0] = 0.0 if view.deciding else record.rel_err
        wanted[i, 1] = 0.0 if view.deciding else record.abs_err
        wanted[i, 2] = _level(record, view, how[i] == INSIDE)
        if view.upper < 0.0:
            wanted[i, 1] = max(wanted[i, 1], view.blur)


@entry
def commit(
    poses,
    versions,
    places,
    answers,
    rows,
    records,
    views,
    at,
    wanted,
    found,
    now_s,
    reached,
):
    """Store what searches of the views `at` (m,) found, and return how many were searched.

    In found (m, state.ANSWER), the status is NaN if the view was not searched, the triangles are
    NaN if they are no hints, and the lower bound is -inf if the sign stayed open. Writes
    reached (m,): which views were searched.
    """
    count = 0
    for i in range(len(at)):
        answer = found[i]
        reached[i] = not np.isnan(answer[state.STATUS])
        if not reached[i]:
            continue
        count += 1
        row, view, level = rows[at[i]], views[at[i]], wanted[i, 2]
        record, status = records[row], int(answer[state.STATUS])
        ended, unsure = status != state.OUT_OF_TIME, answer[state.LOWER] == -np.inf
        signed = answers[row].kind != UNSIGNED
        final = ended and (level == np.inf or status == state.EXACT) and not unsure
        # Points that were carried through a deformation no longer lie on the models.
        nearer = final or was_deformed(places, answers[row])
        nearer |= answer[state.UPPER] <= view.upper
        if nearer:
            view.upper = answer[state.UPPER]
            for side in range(2):
                for j in range(3):
                    view.points[side, j] = answer[state.POINT_A + 3 * side + j]
                for j in range(4):
                    view.features[side, j] = answer[state.FEATURE_A + 4 * side + j]
        if final or answer[state.LOWER] > view.lower:
            view.lower = answer[state.LOWER]
        view.asked = level if ended else np.nan
        intersecting = status == state.INTERSECTING
        # The search for a sign may find the depth as well.
        view.answered = final or (intersecting and not signed) or _is_close(view)
        view.searched = True
        decided = view.lower > level or view.upper <= level < np.inf
        cut = not (ended or decided or unsure)
        # A decided level does not tell how long the distance takes, so the pair may still be hard.
        record.hard = cut or (record.hard and not (final or unsure or view.deciding))
        record.met = not ended if unsure else view.lower <= 0.0
        # A depth blurred by motion is refined once the bodies stand still.
        blurred = view.upper < 0.0 < view.blur and not _is_close(view)
        record.done = view.answered and not blurred
        record.status, record.searched_s, record.widened = status, now_s, 0.0
        if answer[state.TREE_A] >= 0.0:
            record.hint[0] = int(answer[state.TREE_A])
            record.hint[1] = int(answer[state.TREE_B])
        keep_one(
            poses, versions, places, answers[row], view.lower, view.upper, view.points,
            view.features, nearer,
        )  # fmt: skip
        _judge(record, view)
    return count


@kernel
def _status(record, view):
    if not view.known:
        return UNKNOWN
    if view.upper < 0.0:
        return OVERLAPPING
    if view.answered:
        return int(record.status)
    if view.upper == 0.0:
        return state.INTERSECTING
    return state.WITHIN_TOLERANCE if view.tolerated else state.OUT_OF_TIME


@entry
def report(rows, answers, balls, silent, records, views, now_s, listed):
    """Write what is known of the listed views; return how many, and how many still want a search.

    Stale views and views that may be within their range are listed. The smallest bounds of all
    ticks count only ticks at which both poses are certain.
    """
    count = left = 0
    for k in range(len(rows)):
        row, view = rows[k], views[k]
        record, answer = records[row], answers[row]
        if view.known and not view.stale and not record.ignored:
            record.min_upper = min(record.min_upper, view.upper)
            record.min_lower = min(record.min_lower, view.lower)
        if view.answered or view.searched:
            record.answered_s = now_s
        left += view.wanting
        if record.ignored or not (view.stale or view.lower <= record.range):
            continue
        made = listed[count]
        count += 1
        made.at = k
        made.lower = view.lower if view.known else np.nan
        made.upper = view.upper if view.known else np.nan
        made.status = _status(record, view)
        made.age_s = now_s - record.answered_s
        made.min_upper, made.min_lower = record.min_upper, record.min_lower
        points = surface_points(
            vector(view.points[0]), vector(view.points[1]),
            balls[answer.bodies[0]].swept, balls[answer.bodies[1]].swept,
        )  # fmt: skip
        for side in range(2):
            body = answer.bodies[side]
            made.bodies[side], made.silent[side] = body, silent[body]
            made.elements[side] = int(view.features[side, 3])
            for i in range(3):
                made.points[side, i] = points[side][i] if view.known else np.nan
                made.parameters[side, i] = view.features[side, i]
    return count, left
