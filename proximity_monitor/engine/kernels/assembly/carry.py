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

import numpy as np

from ..base.jit import entry, kernel
from ..base.motion import deviation, is_rigid
from ..base.rounding import DOUBLE_EPS
from ..base.vectors import add, dot, norm, sub

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

BALL = np.dtype(
    [
        ("centre", np.float64, (3,)),  # in the model's frame
        ("core", np.float64),  # the radius that holds the core
        ("swept", np.float64),  # the one that sweeps it
        ("deviation", np.float64),
    ],
    align=True,
)
"""A ball around a body, metres."""

PLACE = np.dtype(
    [
        ("centre", np.float64, (3,)),  # of its ball, in the world
        ("size", np.float64),  # its share of s
        ("defect", np.float64),  # d
        ("stretch", np.float64),  # metres by which its points have been moved so far, each time the
        # largest displacement, added rounding up
    ],
    align=True,
)
"""Where a body is."""

ANSWER = np.dtype(
    [
        ("bodies", np.int64, (2,)),
        ("seen", np.int64, (2,)),  # their versions then
        ("kind", np.int64),  # one of the following
        ("lower", np.float64),  # metres
        ("upper", np.float64),
        ("points", np.float64, (2, 3)),  # the cores' nearest points in the world
        ("features", np.float64, (2, 4)),  # where they lie on their models: see `Model.feature`
        ("witness", np.float64, (2, 3)),  # the points in their bodies' frames
        ("rotation", np.float64, (3, 3)),  # of B in A's frame, then
        ("translation", np.float64, (3,)),
        ("size", np.float64),  # s then
        ("defect", np.float64),  # d then
        ("stretch", np.float64, (2,)),  # of both bodies then
    ],
    align=True,
)
"""What was known of a pair when it was last searched."""

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
def vector(v):
    """Three numbers of an array (3,)."""
    return (v[0], v[1], v[2])


@kernel
def _place(pose, ball, place):
    """Write the place of a body's ball at this pose."""
    centre = vector(ball.centre)
    place.centre[0], place.centre[1], place.centre[2] = _image(pose, centre)
    reach = ball.core + ball.swept + ball.deviation
    place.size = norm(_column(pose, 3)) + norm(centre) + reach
    defect = 0.0
    for i in range(3):
        for j in range(3):
            gram = dot(_column(pose, i), _column(pose, j)) - (1.0 if i == j else 0.0)
            defect += gram * gram
    place.defect = math.sqrt(defect)


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
    them count as moved, because their balls (n,), BALL, are others. Writes poses (n, 4, 4),
    versions (n,) and places (n,), PLACE.
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
def _carried(pose_a, pose_b, ball_a, ball_b, place_a, place_b, answer, points):
    """Bounds and points of a pair at the present poses, from its answer at earlier ones."""
    slack = (ROUNDING + NON_RIGID * max(place_a.defect, place_b.defect, answer.defect)) * max(
        place_a.size + place_b.size, answer.size
    )
    signed = answer.kind
    radius_a, radius_b = ball_a.core, ball_b.core
    outer_a = ball_a.swept + ball_a.deviation
    outer_b = ball_b.swept + ball_b.deviation
    centre_a, centre_b = vector(ball_a.centre), vector(ball_b.centre)
    shift = _into(pose_a, sub(_column(pose_b, 3), _column(pose_a, 3)))
    before = vector(answer.translation)
    turn = 0.0
    image_b, old_b = shift, before  # of B's centre in A's frame
    origin_a, old_a = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)  # A's centre in B's frame
    back, old_back = sub(centre_a, shift), sub(centre_a, before)
    for j in range(3):
        new = _into(pose_a, _column(pose_b, j))
        old = _column(answer.rotation, j)
        change = sub(new, old)
        turn += dot(change, change)
        image_b = add(image_b, (new[0] * centre_b[j], new[1] * centre_b[j], new[2] * centre_b[j]))
        old_b = add(old_b, (old[0] * centre_b[j], old[1] * centre_b[j], old[2] * centre_b[j]))
        origin_a = _with(origin_a, j, dot(new, back))
        old_a = _with(old_a, j, dot(old, old_back))
    turn = math.sqrt(turn / 2.0)
    move_b = norm(sub(image_b, old_b)) + turn * radius_b
    move_a = norm(sub(origin_a, old_a)) + turn * radius_a
    stretched = place_a.stretch - answer.stretch[0] + (place_b.stretch - answer.stretch[1])
    stretched *= 1.0 + 8.0 * DOUBLE_EPS
    moved = min(move_a, move_b) + stretched
    moved_outer = min(move_a + turn * outer_a, move_b + turn * outer_b) + stretched

    between = norm(sub(vector(place_b.centre), vector(place_a.centre)))
    apart = between - radius_a - radius_b - outer_a - outer_b
    then_lower, then_upper = answer.lower, answer.upper
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
    point_a = _image(pose_a, _row(answer.witness, 0))
    point_b = _image(pose_b, _row(answer.witness, 1))
    for i in range(3):
        points[0, i], points[1, i] = point_a[i], point_b[i]
    between = norm(sub(point_b, point_a)) + stretched - ball_a.swept - ball_b.swept
    if signed:
        between = max(between, -min(ball_a.swept, ball_b.swept))
        between += 2.0 * max(ball_a.deviation, ball_b.deviation)
    else:
        between = max(between, 0.0) + ball_a.deviation + ball_b.deviation
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
def carry_one(poses, versions, balls, places, answer, points):
    """Bounds of one answer at the present poses, and how its bodies moved; writes points (2, 3).

    A pair whose bodies stand still bit by bit keeps the very numbers of its answer.
    """
    a, b = answer.bodies[0], answer.bodies[1]
    if versions[a] == answer.seen[0] and versions[b] == answer.seen[1]:
        for i in range(2):
            for j in range(3):
                points[i, j] = answer.points[i, j]
        return answer.lower, answer.upper, SAME
    return _carried(poses[a], poses[b], balls[a], balls[b], places[a], places[b], answer, points)


@entry
def carry(poses, versions, balls, places, rows, answers, bounds, points, motions):
    """Bounds (k, 2), the cores' points (k, 2, 3) in the world and motions (k,) of answers `rows`.

    poses (n, 4, 4), versions (n,), balls (n,), BALL, and places (n,), PLACE, are of the bodies;
    answers (m,), ANSWER, are the table.
    """
    for k in range(len(rows)):
        bounds[k, 0], bounds[k, 1], motions[k] = carry_one(
            poses, versions, balls, places, answers[rows[k]], points[k]
        )


@kernel
def was_deformed(places, answer):
    """Whether a body of a pair has been deformed since its answer."""
    stretch_a, stretch_b = places[answer.bodies[0]].stretch, places[answer.bodies[1]].stretch
    return stretch_a != answer.stretch[0] or stretch_b != answer.stretch[1]


@kernel
def keep_one(poses, versions, places, answer, lower, upper, points, features, others):
    """Write an answer: what is known at the bodies' present poses.

    The points (2, 3) must be of the models as they are now: `carry_one` counts on it. Where they
    are no `others` than those of the answer, these stay what they are in their bodies' frames, with
    what rounding did to them then: turned there and back each time, they would drift.
    """
    a, b = answer.bodies[0], answer.bodies[1]
    place_a, place_b = places[a], places[b]
    answer.seen[0], answer.seen[1] = versions[a], versions[b]
    answer.lower, answer.upper = lower, upper
    size, defect = place_a.size + place_b.size, max(place_a.defect, place_b.defect)
    answer.size = size if others else max(size, answer.size)
    answer.defect = defect if others else max(defect, answer.defect)
    answer.stretch[0], answer.stretch[1] = place_a.stretch, place_b.stretch
    pose_a, pose_b = poses[a], poses[b]
    origin_a, origin_b = _column(pose_a, 3), _column(pose_b, 3)
    witness_a = _into(pose_a, sub(_row(points, 0), origin_a))
    witness_b = _into(pose_b, sub(_row(points, 1), origin_b))
    shift = _into(pose_a, sub(origin_b, origin_a))
    for i in range(3):
        answer.points[0, i], answer.points[1, i] = points[0, i], points[1, i]
        if others:
            answer.witness[0, i], answer.witness[1, i] = witness_a[i], witness_b[i]
        answer.translation[i] = shift[i]
        column = _into(pose_a, _column(pose_b, i))
        for j in range(3):
            answer.rotation[j, i] = column[j]
    for i in range(2):
        for j in range(4):
            answer.features[i, j] = features[i, j]


@entry
def keep(poses, versions, places, rows, bounds, points, features, answers):
    """Write the answers `rows` (k,): bounds (k, 2), points (k, 2, 3) and features (k, 2, 4)."""
    for k in range(len(rows)):
        keep_one(
            poses, versions, places, answers[rows[k]], bounds[k, 0], bounds[k, 1], points[k],
            features[k], True,
        )  # fmt: skip
