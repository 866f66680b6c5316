"""Certified bounds of pairs of bodies that have moved since they were last searched.

A search answers for the poses that it was given. When the bodies move on, its answer still bounds
the distance: the distance changes by at most the motion of B relative to A, and the two closest
points, carried along by their bodies, are still points of the models.

A point of B at y in B's frame moves relative to A by at most ``|T1 c - T0 c| + 2 sin(angle / 2)
|y - c|``, where T0 and T1 are the relative poses, c is the centre of B's ball and the angle is that
of the rotation between them. ``2 sin(angle / 2)`` is the Frobenius norm of R1 - R0 over sqrt 2,
which unlike an arc cosine loses no digits for small angles. The same holds with A and B exchanged.
Let m be the smaller of the two bounds. A body whose vertices were moved by up to e changes every
distance by at most e more. The balls give a second lower bound that needs no earlier answer.

The *signed* distance of a solid changes by at most m as well, in both directions. *Two solids* that
overlap by d both hold a ball of diameter d around some x. B is moved by g, and x lies in B's ball,
so |g x - x| <= m. The midpoint of x and g x is at most m / 2 from x, where A's depth is d / 2. Its
image under g⁻¹ is at most m / 2 from x as well, where B's depth was d / 2. Both depths are at least
d / 2 - m / 2, so both solids hold a ball of diameter d - m. If solids that were apart by d now
overlap by D, they hold a ball whose points all were moved by at least d + D as seen from A, so
D <= m - d; and likewise back. *A solid and a surface*: a point of the surface moves by at most m
relative to the solid, so the depth of the deepest point changes by at most m. If vertices of a body
were moved by up to e as well, depths change by e more, and so the diameter of a ball by 2 e.

If the balls around two bodies overlap by p, the bodies overlap by at most p: the depths of a point
below the surfaces of both balls add up to at most p. The distance of two points of the surfaces is
never less than the signed distance. For a solid with holes in its surface, the signed distance
jumps: a body that passes a hole is at once as deep as it is far from the faces. So the bounds of
its earlier answer are dropped. The upper bound is then the distance of the points. The lower bound
is the distance of the balls; if these meet, it is minus the largest possible overlap, because
nothing inside a ball is deeper than the ball's diameter.

If balls sweep the models, all of this is about the cores. A bound of a distance is the bound of the
cores less both radii, widened by both deviations; so spinning a sphere does not widen it. A bound
below zero is about the swept models, whose points lie farther out, so it uses their motion. At the
core points p and q the models hold balls of both radii, so the signed distance is at most |q - p|
less the radii, unless one ball lies wholly inside the other model. Then two solids both hold the
smaller ball, and a point of a surface is as deep as the solid's radius; so minus the smaller radius
is an upper bound in both cases. An overlap is twice the depth of a point, so a deviation counts
twice there.
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
"""Rounding allowance of a bound: (ROUNDING + NON_RIGID d) s.

d is how far the rotation matrices are from orthogonal (Frobenius norm of RᵀR - I). s is the sum
over both bodies of the distance from the world's origin to the model's frame and the reach of the
model from that frame's origin. Worst case, with u = 2^-53 and both times (search and now) counted:
the relative pose and the image of a centre under it 32 u + 4 d, their difference and norm 8 u, the
rotation's difference 33 u + 5 d, replacing both matrices by exact rotations 2 d, the subtractions
4 u; and measuring d itself errs by up to 9 u. Together 88 · 2 u + 11 d, which includes reserve;
both constants are above it. The upper bound's chain (a witness point to its body's frame and back
to the world) is shorter. Smaller constants could certify a bound that is wrong by rounding. Larger
ones only widen the bounds.
"""

BALL = np.dtype(
    [
        ("centre", np.float64, (3,)),  # in the model's frame
        ("core", np.float64),  # radius of the ball around the core
        ("swept", np.float64),  # radius of the ball that sweeps the core
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
        ("stretch", np.float64),  # how far its points were moved by deformation so far, metres: the
        # sum, rounded up, of each deformation's largest displacement
    ],
    align=True,
)
"""Where a body is; s and d are as for ROUNDING."""

ANSWER = np.dtype(
    [
        ("bodies", np.int64, (2,)),
        ("seen", np.int64, (2,)),  # their versions at that time
        ("kind", np.int64),  # UNSIGNED, CONTINUOUS or JUMPING
        ("lower", np.float64),  # metres
        ("upper", np.float64),
        ("points", np.float64, (2, 3)),  # the cores' nearest points in the world
        ("features", np.float64, (2, 4)),  # where they lie on their models: see `Model.feature`
        ("witness", np.float64, (2, 3)),  # the points in their bodies' frames
        ("rotation", np.float64, (3, 3)),  # of B in A's frame, at that time
        ("translation", np.float64, (3,)),
        ("size", np.float64),  # s at that time
        ("defect", np.float64),  # d at that time
        ("stretch", np.float64, (2,)),  # of both bodies at that time
    ],
    align=True,
)
"""What was known of a pair when it was last searched."""

UNSIGNED, CONTINUOUS, JUMPING = 0, 1, 2
"""Kinds of distances: between two surfaces; signed, with a solid; or signed, with a solid whose
surface has holes, which jumps when a body passes a hole."""

MOVED, STILL, SAME = 0, 1, 2
"""How the bodies of a pair moved relative to each other since its answer: by more than the rounding
allowance, by no more than that, or not at all."""


@kernel
def _row(pose, i):
    return (pose[i, 0], pose[i, 1], pose[i, 2])


@kernel
def _column(pose, j):
    return (pose[0, j], pose[1, j], pose[2, j])


@kernel
def _image(pose, point):
    """Return a point of the body in the world frame."""
    return (
        dot(_row(pose, 0), point) + pose[0, 3],
        dot(_row(pose, 1), point) + pose[1, 3],
        dot(_row(pose, 2), point) + pose[2, 3],
    )


@kernel
def _into(pose, vector):
    """Return a vector of the world frame in the body's frame."""
    return (
        dot(_column(pose, 0), vector),
        dot(_column(pose, 1), vector),
        dot(_column(pose, 2), vector),
    )


@kernel
def vector(v):
    """Return an array (3,) as a tuple."""
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
    """Return whether two poses differ in any number."""
    for i in range(4):
        for j in range(4):
            if pose[i, j] != other[i, j]:
                return True
    return False


@entry
def place(bodies, given, anew, balls, poses, versions, places):
    """Put bodies (m,) at poses `given` (m, 4, 4) and return how many changed their place.

    If given[i] is no rigid motion, write nothing and return -1 - i. If `anew`, all the bodies count
    as moved, because their balls (n,), BALL, have changed. Writes poses (n, 4, 4), versions (n,)
    and places (n,), PLACE.
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
    """Return bounds and motion of a pair at the present poses, from its answer at earlier ones.

    The motion is MOVED or STILL. Writes the points (2, 3).
    """
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
    image_b, old_b = shift, before  # B's centre in A's frame, now and before
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
        if apart < 0.0:  # no depth exceeds a ball's diameter, and an overlap is two depths
            apart = -4.0 * max(radius_a, radius_b) - 2.0 * (outer_a + outer_b)
    lower = then_lower - moved
    if signed and not lower > 0.0:
        lower = then_lower - moved_outer - stretched
    # Coordinates too large to be squared give inf or NaN. Then nothing is known.
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
    """Return the vector with component j replaced."""
    x, y, z = vector
    return (value if j == 0 else x, value if j == 1 else y, value if j == 2 else z)


@kernel
def carry_one(poses, versions, balls, places, answer, points):
    """Return bounds of one answer at the present poses, and its motion; write points (2, 3).

    The motion is MOVED, STILL or SAME. If both poses are bit for bit as before, the bounds and
    points are exactly those of the answer.
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
    """Write bounds (k, 2), the cores' points (k, 2, 3) in the world and motions (k,) of answers.

    `rows` (k,) selects them from answers (m,), ANSWER. poses (n, 4, 4), versions (n,), balls (n,),
    BALL, and places (n,), PLACE, are those of the bodies.
    """
    for k in range(len(rows)):
        bounds[k, 0], bounds[k, 1], motions[k] = carry_one(
            poses, versions, balls, places, answers[rows[k]], points[k]
        )


@kernel
def was_deformed(places, answer):
    """Return whether a body of a pair has been deformed since its answer."""
    stretch_a, stretch_b = places[answer.bodies[0]].stretch, places[answer.bodies[1]].stretch
    return stretch_a != answer.stretch[0] or stretch_b != answer.stretch[1]


@kernel
def keep_one(poses, versions, places, answer, lower, upper, points, features, new_points):
    """Write an answer: what is known at the bodies' present poses.

    The points (2, 3) must be points of the models as they are now; `carry_one` relies on it.
    `new_points` says that they are not the points that the answer already holds. If they are, the
    witness points in the bodies' frames stay, with the rounding allowance of that time: converting
    them to the world and back each time would make them drift.
    """
    a, b = answer.bodies[0], answer.bodies[1]
    place_a, place_b = places[a], places[b]
    answer.seen[0], answer.seen[1] = versions[a], versions[b]
    answer.lower, answer.upper = lower, upper
    size, defect = place_a.size + place_b.size, max(place_a.defect, place_b.defect)
    answer.size = size if new_points else max(size, answer.size)
    answer.defect = defect if new_points else max(defect, answer.defect)
    answer.stretch[0], answer.stretch[1] = place_a.stretch, place_b.stretch
    pose_a, pose_b = poses[a], poses[b]
    origin_a, origin_b = _column(pose_a, 3), _column(pose_b, 3)
    witness_a = _into(pose_a, sub(_row(points, 0), origin_a))
    witness_b = _into(pose_b, sub(_row(points, 1), origin_b))
    shift = _into(pose_a, sub(origin_b, origin_a))
    for i in range(3):
        answer.points[0, i], answer.points[1, i] = points[0, i], points[1, i]
        if new_points:
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
