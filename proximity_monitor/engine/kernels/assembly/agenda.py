"""Questions about many pairs of bodies: which are open, and what to ask next.

A pair is asked for its distance, to a tolerance, as long as it may be within its range; or for no
more than on which side of some levels it is. What is certain of it (carry.py) may answer that
without a search. All that a moment needs is done here for many pairs in one go: for a single pair a
step with arrays costs microseconds, as much as its search.
"""

from __future__ import annotations

import numpy as np

from ..base import state
from ..base.jit import entry, kernel
from ..elements.swept import surface_points
from . import carry
from .carry import (
    BODY_A,
    BODY_B,
    JUMPING,
    SIGNED,
    UNSIGNED,
    carry_one,
    keep_one,
    was_deformed,
)

LEVELS = 4

QUESTION = np.dtype(
    [
        ("range", np.float64),  # metres; who is farther is not asked for more
        ("levels", np.float64, (LEVELS,)),  # metres
        ("rel_err", np.float64),
        ("abs_err", np.float64),
        ("looked", np.float64),  # seconds: when it was last searched
        ("min_upper", np.float64),  # the smallest bounds of all moments
        ("min_lower", np.float64),
        ("hint", np.int32, (2,)),  # nearest triangles, as a search knows them
        ("status", np.int8),  # of the last search: why it stopped
        ("deciding", np.bool_),  # no more is asked than the side of the levels
        ("ignored", np.bool_),  # nothing is
        ("done", np.bool_),  # the last search answered all that can be asked
        ("hard", np.bool_),  # the last search ran out of time
        ("met", np.bool_),  # it left open, or found, that the models overlap
    ],
    align=True,
)
"""What is asked about a pair, and how its searches went."""

VIEW = np.dtype(
    [
        ("lower", np.float64),  # metres, certified at the present poses
        ("upper", np.float64),
        ("witness", np.float64, (carry.WITNESS,)),
        ("asked", np.float64),  # the level of the last search of this moment; NaN: there was none
        ("known", np.bool_),  # both poses are
        ("stale", np.bool_),  # a pose is not known, or too old
        ("deciding", np.bool_),
        ("answered", np.bool_),  # nothing can be added to what the last search found
        ("urgent", np.bool_),  # the side of a level is open
        ("tolerated", np.bool_),  # the bounds satisfy the tolerance
        ("wanting", np.bool_),  # worth a search
        ("searched", np.bool_),  # at this moment
    ],
    align=True,
)
"""A pair at one moment; searches improve it."""

STATE = np.dtype(
    [
        ("at", np.int64),  # its place among those looked at
        ("bodies", np.int64, (2,)),
        ("lower", np.float64),
        ("upper", np.float64),
        ("points", np.float64, (2, 3)),
        ("weights", np.float64, (2, 3)),
        ("faces", np.int32, (2,)),
        ("age_s", np.float64),
        ("min_upper", np.float64),
        ("min_lower", np.float64),
        ("silent", np.int8, (2,)),  # 1 where it is; a record holds no arrays of bool
        ("status", np.int8),
    ],
    align=True,
)
"""What is known of a listed pair at the end."""

OVERLAPPING, UNKNOWN = 4, 5
"""What the numbers of a pair are, besides the reasons why a search stopped: OUT_OF_TIME stands for
all bounds that are wider than was asked for."""

TOGETHER, ALONE, INSIDE = 0, 1, 2
"""How a pair is to be searched: with others; by itself, as it takes long; or so because a solid may
overlap the other, and the search has to look how deep."""


@kernel
def _judge(question, view):
    """What a view's bounds say about its question.

    A pair that is certainly at a level is asked for its distance then, also where all pairs are
    only to be decided: an estimate of the time that is left, made from bounds that just decide,
    would depend on whether anybody else wanted the distance.
    """
    lower, upper = view.lower, view.upper
    urgent = near = False
    for i in range(LEVELS):
        urgent |= lower <= question.levels[i] < upper
        near |= upper <= question.levels[i]
    if near and not urgent and not question.deciding:
        view.deciding = False
    small, large = min(abs(lower), abs(upper)), max(abs(lower), abs(upper))
    rel_err, abs_err = question.rel_err, question.abs_err
    tolerated = abs_err > 0.0 and upper - lower <= abs_err
    if rel_err > 0.0 and (lower > 0.0 or upper < 0.0):
        tolerated |= large <= (1.0 + rel_err) * small
    view.urgent, view.tolerated = urgent, tolerated
    view.wanting = (
        (urgent if view.deciding else not tolerated)
        and view.known
        and not view.answered
        and not question.ignored
        and lower <= question.range
    )


@entry
def look(
    poses, versions, balls, places, labels, answers, known, silent, rows, book, distances, views
):
    """Write the views of the rows (k,), as they are before any search.

    The first six are those of `carry`; known (n,) and silent (n,) are of the bodies, book (m,)
    QUESTION is of all rows. If not `distances`, pairs beyond their levels are only decided.
    """
    for k in range(len(rows)):
        row = rows[k]
        label, answer, question, view = labels[row], answers[row], book[row], views[k]
        a, b = label[BODY_A], label[BODY_B]
        view.lower, view.upper, motion = carry_one(
            poses, versions, balls, places, label, answer, view.witness
        )
        for i in range(carry.ANSWER - carry.FEATURES):
            view.witness[6 + i] = answer[carry.FEATURES + i]
        view.known = known[a] and known[b]
        view.stale = silent[a] or silent[b]
        view.deciding = question.deciding or not distances
        # What a tolerance left may have a level in it.
        open_yet = view.deciding and question.status == state.WITHIN_TOLERANCE
        view.answered = question.done and motion != carry.MOVED and not open_yet
        view.asked = np.nan
        view.searched = False
        _judge(question, view)


@entry
def wanting(rows, book, views, at, kind, keys):
    """Write which views want a search into `at`, and by what they are ordered; return how many.

    `kind` is 0 where the side of a level is open, 1 elsewhere, and 2 more for stale pairs; keys
    (2, k) are the lower bounds, infinite for models that overlap, and when they were last searched.
    """
    count = 0
    for k in range(len(rows)):
        view = views[k]
        if view.wanting:
            at[count] = k
            kind[count] = 2 * view.stale + (not view.urgent)
            # Of models that surely meet no more than the depth is open, which takes long to say.
            keys[0, count] = view.lower if view.upper > 0.0 else np.inf
            keys[1, count] = book[rows[k]].looked
            count += 1
    return count


@kernel
def _level(question, view):
    """What a search may end at: metres; infinity for nothing but the tolerance.

    A pair that is to be decided is asked for the largest level that is open: most pairs are beyond
    all of them, and that one question tells. One whose number is wanted is asked for its range
    first, while it may be farther: that costs an eighth of a distance, and who is farther is done
    with. Where an earlier search for the same level ended, rounding alone keeps it open; then all
    there is to know is asked.
    """
    level = np.inf
    if view.deciding:
        level = -np.inf
        for i in range(LEVELS):
            if view.lower <= question.levels[i] < view.upper:
                level = max(level, question.levels[i])
    elif view.upper > question.range:
        level = question.range
    return np.inf if level == view.asked else level


@entry
def ask(rows, labels, book, views, at, bodies, wanted, hints, signed, how):
    """Write the questions about the views `at` (m,).

    bodies (m, 2), wanted (m, 3), hints (m, 2) and signed (m,) are those of `Assembly.rows`; `how`
    (m,) is one of TOGETHER, ALONE and INSIDE. Whose side of a level alone is asked for has no
    tolerance: the level ends its search. A solid that is certainly apart from the other is as far
    apart as the surfaces are; the sign of others is asked for, and nearly all turn out apart.
    """
    for i in range(len(at)):
        row, view = rows[at[i]], views[at[i]]
        label, question = labels[row], book[row]
        bodies[i, 0], bodies[i, 1] = label[BODY_A], label[BODY_B]
        wanted[i, 0] = 0.0 if view.deciding else question.rel_err
        wanted[i, 1] = 0.0 if view.deciding else question.abs_err
        wanted[i, 2] = _level(question, view)
        hints[i, 0], hints[i, 1] = question.hint[0], question.hint[1]
        signed[i] = label[SIGNED] != UNSIGNED and view.lower <= 0.0
        how[i] = ALONE if question.hard else TOGETHER
        if signed[i]:
            # Whether models that met still do, the surfaces tell first, which costs far less.
            again = question.met and not view.searched and view.upper > 0.0
            inside = label[SIGNED] == JUMPING or question.hard or question.met
            how[i] = INSIDE if inside and not again else TOGETHER


@entry
def take(
    poses, versions, places, labels, answers, rows, book, views, at, wanted, found, now_s, reached
):
    """Take what searches of the views `at` (m,) found, and return how many there were.

    found (m, state.ANSWER) has NaN as status where there was none, and as triangles where they are
    no hints, and -inf as lower bound where the sign stayed open; reached (m,) is written.
    """
    count = 0
    for i in range(len(at)):
        answer = found[i]
        reached[i] = not np.isnan(answer[state.STATUS])
        if not reached[i]:
            continue
        count += 1
        row, view, level = rows[at[i]], views[at[i]], wanted[i, 2]
        question, status = book[row], int(answer[state.STATUS])
        ended, unsure = status != state.OUT_OF_TIME, answer[state.LOWER] == -np.inf
        final = ended and level == np.inf
        # Points that were carried through a deformation are none of the models any more.
        nearer = final or was_deformed(places, labels[row], answers[row])
        nearer |= answer[state.UPPER] <= view.upper
        if nearer:
            view.upper = answer[state.UPPER]
            for j in range(carry.WITNESS):
                view.witness[j] = answer[state.POINT_A + j]
        if final or answer[state.LOWER] > view.lower:
            view.lower = answer[state.LOWER]
        view.asked = level if ended else np.nan
        intersecting = status == state.INTERSECTING
        view.answered = final or (intersecting and not unsure)
        view.searched = True
        decided = view.lower > level or view.upper <= level < np.inf
        question.hard = not ended and not decided
        question.met = not ended if unsure else view.lower <= 0.0
        question.done, question.status, question.looked = view.answered, status, now_s
        if answer[state.TREE_A] >= 0.0:
            question.hint[0] = int(answer[state.TREE_A])
            question.hint[1] = int(answer[state.TREE_B])
        keep_one(
            poses, versions, places, labels[row], answers[row],
            view.lower, view.upper, view.witness, nearer,
        )  # fmt: skip
        _judge(question, view)
    return count


@kernel
def _status(question, view):
    if not view.known:
        return UNKNOWN
    if view.upper < 0.0:
        return OVERLAPPING
    if view.answered:
        return int(question.status)
    if view.upper == 0.0:
        return state.INTERSECTING
    return state.WITHIN_TOLERANCE if view.tolerated else state.OUT_OF_TIME


@entry
def report(rows, labels, balls, silent, book, views, now_s, states):
    """Write the states of the listed views; return how many, and how many want a search yet.

    Listed are those that may be within their range, as far as is known. The smallest bounds of all
    moments count where both poses are certain.
    """
    listed = left = 0
    for k in range(len(rows)):
        row, view = rows[k], views[k]
        question, label = book[row], labels[row]
        if view.known and not view.stale:
            question.min_upper = min(question.min_upper, view.upper)
            question.min_lower = min(question.min_lower, view.lower)
        left += view.wanting
        if question.ignored or not (view.stale or view.lower <= question.range):
            continue
        made = states[listed]
        listed += 1
        made.at = k
        made.lower = view.lower if view.known else np.nan
        made.upper = view.upper if view.known else np.nan
        made.status = _status(question, view)
        made.age_s = 0.0 if view.answered or view.searched else now_s - question.looked
        made.min_upper, made.min_lower = question.min_upper, question.min_lower
        witness = view.witness
        points = surface_points(
            (witness[0], witness[1], witness[2]), (witness[3], witness[4], witness[5]),
            balls[label[BODY_A], carry.SWEPT], balls[label[BODY_B], carry.SWEPT],
        )  # fmt: skip
        for side in range(2):
            body = label[BODY_A + side]
            made.bodies[side], made.silent[side] = body, silent[body]
            made.faces[side] = int(witness[9 + 4 * side])
            for i in range(3):
                made.points[side, i] = points[side][i] if view.known else np.nan
                made.weights[side, i] = witness[6 + 4 * side + i]
    return listed, left
