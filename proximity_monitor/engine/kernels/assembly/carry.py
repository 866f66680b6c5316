"""Certified bounds of pairs of bodies that have moved since they were last searched.

A search answers for the poses that it was given. When the bodies move on, that answer still bounds
the distance: it shrinks by at most the motion of B relative to A, and the two closest points,
carried along by their bodies, are still points of the models.

A point of B at y in B's frame moves relative to A by at most ``|T1 c - T0 c| + 2 sin(angle / 2)
|y - c|``, where T0 and T1 are the relative poses, c is the centre of B's ball and the angle is that
of the rotation between them. ``2 sin(angle / 2)`` is the Frobenius norm of R1 - R0 over sqrt 2,
which unlike an arc cosine loses no digits for small angles. The same holds with A and B exchanged;
the smaller of the two counts: call it m. A body whose vertices were moved by up to e changes every
distance by at most e more. The balls give a second lower bound that needs no earlier answer.

The *signed* distance of a solid changes by no more than m either, in both directions. *Two solids*
that overlap hold a ball of radius d / 2 around some x. B is moved by g, and x lies in B's ball, so
|g x - x| <= m. The midpoint of x and g x is m / 2 from x, where A's depth is; and its image under
g⁻¹ is m / 2 from x as well, where B's was: both depths are d / 2 - m / 2 or more, and a ball of
diameter d - m is left. Solids that were apart by d and overlap by D hold then a ball whose points
all were moved by d + D or more, as seen from A, so D <= m - d; and likewise back. *A solid and a
surface*: a point of the surface is moved no farther than m, seen from the solid, and the depth of
the deepest one changes by no more. A body whose vertices were moved by up to e besides changes
depths by e, hence a ball's diameter by 2 e.

Where the balls around two bodies overlap by p, no more than p is in both: a point is no deeper than
it lies below the surface of either ball, which is p together; and the distance of two points of the
surfaces is never less than the signed distance. Of a solid with holes the signed distance jumps, as
what passes a hole is at once as deep as it is far from the faces: nothing is kept of it but the
points, and that their balls do not meet, or that nothing in a ball is deeper than its diameter.

Where balls sweep the models, all of this is about their cores, and every bound of a distance one of
the cores' less both radii, widened by both deviations: a sphere that spins does not move. What is
below zero is about the swept models, whose points lie farther out: it uses the motion of those. At
two core points p and q the models hold balls of both radii, so the signed distance is at most |q -
p| less the radii, but for a ball that lies wholly inside: two solids hold its diameter then, and of
a surface a point is as deep as the solid's radius, so that minus the smaller radius holds for both.
As depth is twice what points have, a deviation counts twice there.
"""

from __future__ import annotations

import math

from ..base.jit import entry, kernel
from ..base.motion import deviation, is_rigid
from ..base.rounding import DOUBLE_EPS
from ..base.vectors import add, dot, sub

ROUNDING = 128.0 * 2.0 * DOUBLE_EPS
NON_RIGID = 16.0
"""Rounding allowance of a bound: (ROUNDING + NON_RIGID d) s, where d is how far the rotation
matrices are from orthogonal (Frobenius norm of RᵀR - I), and s adds up, for both bodies, the
distance of the origin from the model's frame and the reach of the model from that frame's origin.
Worst case, with u = 2^-53 and both moments counted: the relative pose and the image of a centre
under it 32 u + 4 d, their difference and norm 8 u, the rotation's difference 33 u + 5 d, replacing
both matrices by exact rotations 2 d, the subtractions 4 u; and measuring d is itself wrong by up to
9 u. Together 88 · 2 u + 11 d, which includes reserve: both constants are above it. The upper
bound's chain (a witness point to its body's frame and back to the world) is shorter. Smaller ones
could certify a bound that is wrong by rounding; larger ones only blur it.
"""

CORE, SWEPT, DEVIATION, BALL = 3, 4, 5, 6
"""Of a body's ball, after its centre in the model's frame: the radius that holds the core, the one
that sweeps it, and the deviation, metres."""

CENTRE, SIZE, DEFECT, STRETCH, PLACE = 0, 3, 4, 5, 6
"""Of a body: its ball's centre in the world; its share of s; d; metres by which its points have
been moved so far, each time the largest displacement, added rounding up."""

LOWER, UPPER, POINT_A, POINT_B, WITNESS_A, WITNESS_B = 0, 1, 2, 5, 8, 11
ROTATION, TRANSLATION, THEN_SIZE, THEN_DEFECT, THEN_A, THEN_B = 14, 23, 26, 27, 28, 29
FEATURES, ANSWER = 30, 38
"""Of an answer: bounds; the cores' nearest points in the world and in their bodies' frames; the
pose of B in A's frame, s and d then; STRETCH of both bodies then; and where the points lie on their
models, which no motion changes: three parameters (of a triangle, the weights of its corners) and
the element, of A, then of B."""

WITNESS = 14
"""Numbers that say which points are nearest: both points in the world, and their FEATURES."""

BODY_A, BODY_B, SEEN_A, SEEN_B, SIGNED, LABEL = 0, 1, 2, 3, 4, 5
"""Of an answer, whole numbers: the bodies; their versions then; and one of the following."""

UNSIGNED, CONTINUOUS, JUMPING = 0, 1, 2
"""Kinds of distances: of two surfaces; signed, of a solid; or signed, of a solid with holes, which
jumps where a body passes a hole."""

MOVED, STILL, SAME = 0, 1, 2
"""How the bodies of a pair moved relative to each other since its answer: more than rounding, not
more, not at all."""


@kernel
def _row(pose, i):
    return (pose[i, 0], pose[i, 1], pose[i, 2])


@kernel
def _column(pose, j):
    return (pose[0, j], pose[1, j], pose[2, j])


@kernel
def _image(pose, point):
    """A point of the body in the world."""
    return (
        dot(_row(pose, 0), point) + pose[0, 3],
        dot(_row(pose, 1), point) + pose[1, 3],
        dot(_row(pose, 2), point) + pose[2, 3],
    )


@kernel
def _into(pose, vector):
    """A direction of the world in the body's frame."""
    return (
        dot(_column(pose, 0), vector),
        dot(_column(pose, 1), vector),
        dot(_column(pose, 2), vector),
    )


@kernel
def _norm(v):
    return math.sqrt(dot(v, v))


@kernel
def _place(pose, ball, place):
    """Write the place of a body's ball at this pose."""
    centre = (ball[0], ball[1], ball[2])
    place[CENTRE], place[CENTRE + 1], place[CENTRE + 2] = _image(pose, centre)
    reach = ball[CORE] + ball[SWEPT] + ball[DEVIATION]
    place[SIZE] = _norm(_column(pose, 3)) + _norm(centre) + reach
    defect = 0.0
    for i in range(3):
        for j in range(3):
            gram = dot(_column(pose, i), _column(pose, j)) - (1.0 if i == j else 0.0)
            defect += gram * gram
    place[DEFECT] = math.sqrt(defect)


@kernel
def _differ(pose, other):
    """Whether two poses are not the same numbers."""
    for i in range(4):
        for j in range(4):
            if pose[i, j] != other[i, j]:
                return True
    return False


@entry
def place(bodies, given, anew, balls, poses, versions, places):
    """Put bodies (m,) at poses `given` (m, 4, 4) and return how many so got another place.

    Or return -1 - i where given[i] is no rigid motion, with nothing written. Where `anew`, all of
    them count as moved, because their balls (n, BALL) are others. Writes poses (n, 4, 4), versions
    (n,) and places (n, PLACE).
    """
    for i in range(len(bodies)):
        if not is_rigid(deviation(given[i])):
            return -1 - i
    moved = 0
    for i in range(len(bodies)):
        body = bodies[i]
        if anew or _differ(given[i], poses[body]):
            for j in range(4):
                for k in range(4):
                    poses[body, j, k] = given[i, j, k]
            versions[body] += 1
            _place(poses[body], balls[body], places[body])
            moved += 1
    return moved


@kernel
def _carried(pose_a, pose_b, ball_a, ball_b, place_a, place_b, signed, answer, points):
    """Bounds and points of a pair at the present poses, from its answer at earlier ones."""
    slack = (
        ROUNDING + NON_RIGID * max(place_a[DEFECT], place_b[DEFECT], answer[THEN_DEFECT])
    ) * max(place_a[SIZE] + place_b[SIZE], answer[THEN_SIZE])
    radius_a, radius_b = ball_a[CORE], ball_b[CORE]
    outer_a = ball_a[SWEPT] + ball_a[DEVIATION]
    outer_b = ball_b[SWEPT] + ball_b[DEVIATION]
    centre_a = (ball_a[0], ball_a[1], ball_a[2])
    centre_b = (ball_b[0], ball_b[1], ball_b[2])
    shift = _into(pose_a, sub(_column(pose_b, 3), _column(pose_a, 3)))
    before = (answer[TRANSLATION], answer[TRANSLATION + 1], answer[TRANSLATION + 2])
    turn = 0.0
    image_b, old_b = shift, before  # of B's centre in A's frame
    origin_a, old_a = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)  # A's centre in B's frame
    back, old_back = sub(centre_a, shift), sub(centre_a, before)
    for j in range(3):
        new = _into(pose_a, _column(pose_b, j))
        old = (answer[ROTATION + j], answer[ROTATION + 3 + j], answer[ROTATION + 6 + j])
        change = sub(new, old)
        turn += dot(change, change)
        image_b = add(image_b, (new[0] * centre_b[j], new[1] * centre_b[j], new[2] * centre_b[j]))
        old_b = add(old_b, (old[0] * centre_b[j], old[1] * centre_b[j], old[2] * centre_b[j]))
        origin_a = _with(origin_a, j, dot(new, back))
        old_a = _with(old_a, j, dot(old, old_back))
    turn = math.sqrt(turn / 2.0)
    move_b = _norm(sub(image_b, old_b)) + turn * radius_b
    move_a = _norm(sub(origin_a, old_a)) + turn * radius_a
    stretched = place_a[STRETCH] - answer[THEN_A] + (place_b[STRETCH] - answer[THEN_B])
    stretched *= 1.0 + 8.0 * DOUBLE_EPS
    moved = min(move_a, move_b) + stretched
    moved_outer = min(move_a + turn * outer_a, move_b + turn * outer_b) + stretched

    world_a = (place_a[CENTRE], place_a[CENTRE + 1], place_a[CENTRE + 2])
    world_b = (place_b[CENTRE], place_b[CENTRE + 1], place_b[CENTRE + 2])
    apart = _norm(sub(world_b, world_a)) - radius_a - radius_b - outer_a - outer_b
    then_lower, then_upper = answer[LOWER], answer[UPPER]
    if signed == JUMPING:
        then_lower, then_upper = -math.inf, math.inf
        if apart < 0.0:  # no two points of a ball are farther apart, and a diameter is two depths
            apart = -4.0 * max(radius_a, radius_b) - 2.0 * (outer_a + outer_b)
    lower = then_lower - moved
    if signed and not lower > 0.0:
        lower = then_lower - moved_outer - stretched
    # Coordinates too large to be squared give inf or NaN: then nothing is known.
    if not lower >= apart:
        lower = apart
    lower -= slack
    if not (lower < math.inf):
        lower = -math.inf
    if not signed:
        lower = max(lower, 0.0)
    point_a = _image(pose_a, (answer[WITNESS_A], answer[WITNESS_A + 1], answer[WITNESS_A + 2]))
    point_b = _image(pose_b, (answer[WITNESS_B], answer[WITNESS_B + 1], answer[WITNESS_B + 2]))
    for i in range(3):
        points[i], points[3 + i] = point_a[i], point_b[i]
    between = _norm(sub(point_b, point_a)) + stretched - ball_a[SWEPT] - ball_b[SWEPT]
    if signed:
        between = max(between, -min(ball_a[SWEPT], ball_b[SWEPT]))
        between += 2.0 * max(ball_a[DEVIATION], ball_b[DEVIATION])
    else:
        between = max(between, 0.0) + ball_a[DEVIATION] + ball_b[DEVIATION]
    upper = then_upper + (moved if then_upper >= 0.0 else moved_outer + stretched)
    if not upper < between:
        upper = between
    upper += slack
    if not upper < math.inf:
        upper = math.inf
    return lower, upper, STILL if moved <= slack and signed != JUMPING else MOVED


@kernel
def _with(vector, j, value):
    """The vector with another component j."""
    x, y, z = vector
    return (value if j == 0 else x, value if j == 1 else y, value if j == 2 else z)


@kernel
def carry_one(poses, versions, balls, places, label, answer, points):
    """Bounds of one answer at the present poses, and how its bodies moved; writes points (6,).

    A pair whose bodies stand still bit by bit keeps the very numbers of its answer.
    """
    a, b = label[BODY_A], label[BODY_B]
    if versions[a] == label[SEEN_A] and versions[b] == label[SEEN_B]:
        for i in range(6):
            points[i] = answer[POINT_A + i]
        return answer[LOWER], answer[UPPER], SAME
    return _carried(
        poses[a], poses[b], balls[a], balls[b], places[a], places[b],
        label[SIGNED], answer, points,
    )  # fmt: skip


@entry
def carry(poses, versions, balls, places, rows, labels, answers, bounds, points, motions):
    """Bounds (k, 2), the cores' points (k, 6) in the world and motions (k,) of answers `rows` (k,).

    poses (n, 4, 4), versions (n,), balls (n, BALL) and places (n, PLACE) are of the bodies, labels
    (m, LABEL) and answers (m, ANSWER) the table.
    """
    for k in range(len(rows)):
        bounds[k, 0], bounds[k, 1], motions[k] = carry_one(
            poses, versions, balls, places, labels[rows[k]], answers[rows[k]], points[k]
        )


@kernel
def was_deformed(places, label, answer):
    """Whether a body of a pair has been deformed since its answer."""
    stretch_a, stretch_b = places[label[BODY_A], STRETCH], places[label[BODY_B], STRETCH]
    return stretch_a != answer[THEN_A] or stretch_b != answer[THEN_B]


@kernel
def keep_one(poses, versions, places, label, answer, lower, upper, witness, others):
    """Write an answer: what is known at the bodies' present poses.

    The witness points must be of the models as they are now: `carry_one` counts on it. Where they
    are no `others` than those of the answer, these stay what they are in their bodies' frames, with
    what rounding did to them then: turned there and back each time, they would drift.
    """
    a, b = label[BODY_A], label[BODY_B]
    label[SEEN_A], label[SEEN_B] = versions[a], versions[b]
    answer[LOWER], answer[UPPER] = lower, upper
    size, defect = places[a, SIZE] + places[b, SIZE], max(places[a, DEFECT], places[b, DEFECT])
    answer[THEN_SIZE] = size if others else max(size, answer[THEN_SIZE])
    answer[THEN_DEFECT] = defect if others else max(defect, answer[THEN_DEFECT])
    answer[THEN_A], answer[THEN_B] = places[a, STRETCH], places[b, STRETCH]
    pose_a, pose_b = poses[a], poses[b]
    origin_a, origin_b = _column(pose_a, 3), _column(pose_b, 3)
    point_a = (witness[0], witness[1], witness[2])
    point_b = (witness[3], witness[4], witness[5])
    witness_a = _into(pose_a, sub(point_a, origin_a))
    witness_b = _into(pose_b, sub(point_b, origin_b))
    shift = _into(pose_a, sub(origin_b, origin_a))
    for i in range(3):
        answer[POINT_A + i], answer[POINT_B + i] = point_a[i], point_b[i]
        if others:
            answer[WITNESS_A + i], answer[WITNESS_B + i] = witness_a[i], witness_b[i]
        answer[TRANSLATION + i] = shift[i]
        column = _into(pose_a, _column(pose_b, i))
        for j in range(3):
            answer[ROTATION + 3 * j + i] = column[j]
    for i in range(ANSWER - FEATURES):
        answer[FEATURES + i] = witness[6 + i]


@entry
def keep(poses, versions, places, rows, bounds, witness, labels, answers):
    """Write the answers `rows` (k,): their bounds (k, 2) and witness (k, WITNESS)."""
    for k in range(len(rows)):
        keep_one(
            poses, versions, places, labels[rows[k]], answers[rows[k]],
            bounds[k, 0], bounds[k, 1], witness[k], True,
        )  # fmt: skip
