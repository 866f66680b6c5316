"""Bounds of solids of revolution whose axes are nearly one, as of a shaft in a bore.

Let g be the offset of b's axis from a's, across a's axis, beside a point of b. Across a's axis, the
point lies at g + rho_b u, with u a unit vector across b's axis. The part of u across a's axis has a
length between cos(tilt) and 1, along some unit vector u'. So rho >= rho_b cos(tilt) + g . u', and
rho <= sqrt(X² + h²) for X = rho_b + g . u', where h is the part of g perpendicular to u'. The
maximum of g . u' over a sector is convex in z, as g is linear: it is no more than the interpolation
between the ends of an arc. The root is convex in X. So both bounds of rho have bounds linear in
rho_b and z, and the reach of an arc along a vector is known. No small sectors are needed: about one
axis, these bounds are those of the profiles in the plane.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.memory import table_on_stack
from ..base.trees import NONE
from .newton import to_a, to_b
from .reach import arc_at, bulge, most_in, reach_of

ALIKE = 0.98
"""Cosine of the tilt between two axes above which they count as nearly one."""

_ON_AXIS = 1e-6
"""An arc is a ball's if the rho of its centre, times the arc's sine, is below this share of half
the arc's width."""

_ROUND = 0.02
"""Sine of half an arc's angle above which its circle is compared. The radius is then at most 50
times half the chord, and the centre errs by less than 10 u of the radius: see above
`_about_axis`."""


@inlined
def _along_z(arc):
    """Return the middle of an arc's extent along its axis and a bound of half of it, metres."""
    return arc.middle[1], abs(arc.half[1]) + bulge(arc) + arc.error


@inlined
def _beside_axis(motion, z):
    """Return the offset g of b's axis from a's at z of b's axis, metres."""
    return motion[9] + z * motion[2], motion[10] + z * motion[5]


@inlined
def off_axis(arc, motion):
    """Return how far b's axis is off a's beside an arc, at most, metres."""
    middle, half = _along_z(arc)
    x, y = _beside_axis(motion, middle)
    return np.sqrt(x * x + y * y) + half * np.sqrt(motion[2] * motion[2] + motion[5] * motion[5])


@inlined
def sags_about_axis(arc, sector, motion):
    """Estimate how far from straight b's arc and sector are for bounds about an axis, metres.

    Both are infinite if there are no such bounds: see `begin_about_axis`.
    """
    off, wide = off_axis(arc, motion), abs(arc.middle[0]) + abs(arc.half[0])
    if not off < wide:
        return np.inf, np.inf
    tilt = np.sqrt(motion[2] * motion[2] + motion[5] * motion[5])
    varied = 1.0 if sector[2] < 0.0 else sector[3]
    # The root bends most if an arc is near its axis: see `_chord_of_root`.
    middle, near = abs(arc.middle[0]), max(abs(arc.middle[0]) - abs(arc.half[0]), 0.0)
    chord = 0.5 * (np.sqrt(near * near + off * off) + np.sqrt(wide * wide + off * off))
    along = 0.5 * tilt * arc.length + chord - np.sqrt(middle * middle + off * off)
    return along, varied * (off + wide * tilt + off * off / wide)


@inlined
def _most_beside(motion, sector, z):
    """Return a bound of |h|, the part of g perpendicular to u', at z of b's axis, metres."""
    x, y = _beside_axis(motion, z)
    x, y = -y, x
    x, y = motion[0] * x + motion[3] * y, motion[1] * x + motion[4] * y
    return max(most_in(sector, x, y), most_in(sector, -x, -y)) / abs(motion[8])


@inlined
def _most_off(motion, sector, sign, z):
    """Return an upper bound of sign g . u' at z of b's axis, metres."""
    x, y = _beside_axis(motion, z)
    x, y = sign * x, sign * y
    most = most_in(sector, motion[0] * x + motion[3] * y, motion[1] * x + motion[4] * y)
    return most / abs(motion[8]) if most > 0.0 else most


# Results here err by less than 40 u P, with P the coordinates of both models, and by 2 u of a
# translation along the axes. An arc's error includes 2,048 u P, of which the arc needs about 320:
# see _ROUNDING in arcs.py.
@kernel
def _about_axis(arc, sector, motion, n, m):
    """Return a vector v of b's plane and an offset: b begins beyond offset + v . (rho_b, z)."""
    middle, half = _along_z(arc)
    sign = -1.0 if n > 0.0 else 1.0
    first = _most_off(motion, sector, sign, middle - half)
    last = _most_off(motion, sector, sign, middle + half)
    between, slope = 0.5 * (first + last), 0.0
    if half > 0.0:  # clamped, as rounding may spoil it for short arcs
        slope = min(max((last - first) / (2.0 * half), -1.0), 1.0)
    up, down = most_in(sector, motion[6], motion[7]), most_in(sector, -motion[6], -motion[7])
    between -= slope * middle
    if n > 0.0:
        steepest = max(abs(up), abs(down))
        across = np.sqrt(max(1.0 - steepest * steepest, 0.0))
    else:
        flattest = max(-up, -down, 0.0)
        across = np.sqrt(1.0 - flattest * flattest)
        share, more = _chord_of_root(arc, sector, motion, across, first, last)
        across, slope, between = share * across, share * slope, share * between + more
    v = n * across - abs(m) * (down if m > 0.0 else up)
    return (v, m * motion[8] - abs(n) * slope), m * motion[11] - abs(n) * between


@kernel
def _chord_of_root(arc, sector, motion, across, first, last):
    """Return a line no lower than sqrt(X² + h²) for all X = across rho_b + g . u' of an arc.

    The root is convex in X, so its chord is such a line. Returns the line's slope, and its height
    at X = 0.
    """
    middle, half = _along_z(arc)
    off, tilt = off_axis(arc, motion), np.sqrt(motion[2] * motion[2] + motion[5] * motion[5])
    thick = abs(arc.half[0]) + bulge(arc) + arc.error
    least, most = max(arc.middle[0] - thick, 0.0), arc.middle[0] + thick
    beside = _most_beside(motion, sector, middle) + half * tilt
    if least * abs(motion[8]) <= off:  # X may be negative: rho is no more than |g|
        beside = off
    low = across * least + min(first, last)
    high = across * most + max(first, last)
    begin, end = np.sqrt(low * low + beside * beside), np.sqrt(high * high + beside * beside)
    share = 1.0
    if high > low:  # clamped, as rounding may spoil it for short arcs
        share = min(max((end - begin) / (high - low), -1.0), 1.0)
    return share, max(begin - share * low, end - share * high)


@kernel
def begin_about_axis(tree_b, own_b, b, fine, sector, motion, n, m, wanted):
    """Return where b begins along a normal (n, m) of a's plane, metres; see `begin_of`.

    Minus infinity if b's axis is farther off a's than b's arc is from its own axis.
    """
    arc = arc_at(tree_b.arcs, own_b, b)
    if not off_axis(arc, motion) < abs(arc.middle[0]) + abs(arc.half[0]):
        return -np.inf
    v, begin = _about_axis(arc, sector, motion, n, m)
    return begin - reach_of(tree_b, own_b, b, fine, -v[0], -v[1], begin - wanted)


@kernel
def facing_about_axis(arc_a, arc_b, sector, motion):
    """Estimate the direction between the nearest points of two chords, b's in a sector's middle.

    `facing` takes the width of the sector into account, but may stop far from the nearest points if
    the chords are at a small angle. About one axis the width does not matter.

    Returns:
        A unit vector of a's plane, from a's nearest point to b's; zero if all ends are common. If
        one of the points is inside its chord, the vector is that chord's normal, which rounding
        does not tilt.
    """
    ends = table_on_stack(4, 2, 0.0)
    for k in range(2):
        side = 2.0 * k - 1.0
        ends[k, 0] = arc_a.middle[0] + side * arc_a.half[0]
        ends[k, 1] = arc_a.middle[1] + side * arc_a.half[1]
        rho, z = arc_b.middle[0] + side * arc_b.half[0], arc_b.middle[1] + side * arc_b.half[1]
        x, y, z = to_a(motion, rho * sector[0], rho * sector[1], z)
        x, y = x + motion[9], y + motion[10]
        ends[2 + k, 0], ends[2 + k, 1] = np.sqrt(x * x + y * y), z + motion[11]
    least, n, m = np.inf, 0.0, 0.0
    for k in range(4):  # each end of a chord, and the other chord
        other, sign = (2, -1.0) if k < 2 else (0, 1.0)
        hx, hz = ends[other + 1, 0] - ends[other, 0], ends[other + 1, 1] - ends[other, 1]
        x, z = ends[k, 0] - ends[other, 0], ends[k, 1] - ends[other, 1]
        squared = hx * hx + hz * hz
        s = min(max((x * hx + z * hz) / squared, 0.0), 1.0) if squared > 0.0 else 0.0
        x, z = x - s * hx, z - s * hz
        apart = np.sqrt(x * x + z * z)
        if not 0.0 < apart < least:
            continue
        least, length = apart, apart
        if 0.0 < s < 1.0:
            length = np.sqrt(squared) if hx * z > hz * x else -np.sqrt(squared)
            x, z = -hz, hx
        n, m = sign * x / length, sign * z / length
    return n, m


@inlined
def between_circles(arc_a, arc_b, motion):
    """Return a bound of two arcs' distance by their circles, without a slack; or -infinity.

    A point of one circle is no nearer to the other than the difference of the radii minus the
    distance of the centres. If the centres coincide, that is the distance of all points.
    """
    round_ = arc_a.curve != NONE and is_round(arc_a) and is_round(arc_b)
    if not (round_ and (abs(motion[8]) > ALIKE or _is_ball(arc_a))):
        return -np.inf
    return _between_circles(arc_a, arc_b, motion)


@inlined
def _is_ball(arc):
    """Return whether a round arc's centre is about on the axis; for others the bounds are wide."""
    off = abs(arc.middle[0] * arc.sine + arc.cosine * arc.half[1])
    return off < _ON_AXIS * abs(arc.half[0])


@kernel
def _between_circles(arc_a, arc_b, motion):
    (x, z, radius_a), (rho, height, radius_b) = circle_of(arc_a), circle_of(arc_b)
    between = abs(radius_b - radius_a) - arc_a.error - arc_b.error
    # First as for balls: move both centres onto the axes, and subtract how far they move.
    off, beside = _beside_axis(motion, height)
    along = motion[11] + height * motion[8] - z
    lost = np.sqrt(off * off + beside * beside + along * along) + abs(x) + abs(rho)
    if abs(motion[8]) > ALIKE:
        along = motion[11] + (height if motion[8] > 0.0 else -height) - z
        apart = np.sqrt((rho - x) * (rho - x) + along * along)
        # Add how far b's points are from where they would be if both axes were one.
        middle, half = _along_z(arc_b)
        wide = abs(arc_b.middle[0]) + abs(arc_b.half[0]) + bulge(arc_b) + arc_b.error
        tilt = np.sqrt(motion[2] * motion[2] + motion[5] * motion[5])
        apart += off_axis(arc_b, motion) + wide * tilt
        lost = min(lost, apart + (wide + abs(middle) + half) * tilt * tilt)
    return between - lost


@inlined
def in_ball(arc_a, arc_b, motion):
    """Return a bound of two arcs' distance if one of them is of a ball around the other; else < 0.

    A point p in a ball of radius R around c is R - |p - c| from the ball's surface, however the
    ball is turned.
    """
    found = -np.inf
    if is_round(arc_b) and _is_ball(arc_b):
        x, z, radius = circle_of(arc_b)
        px, py, pz = to_a(motion, 0.0, 0.0, z)
        px, py, pz = px + motion[9], py + motion[10], pz + motion[11]
        far = _farthest(arc_a, np.sqrt(px * px + py * py), pz)
        found = radius - abs(x) - arc_b.error - far
    if is_round(arc_a) and _is_ball(arc_a):
        x, z, radius = circle_of(arc_a)
        px, py, pz = to_b(motion, (-motion[9], -motion[10], z - motion[11]))
        far = _farthest(arc_b, np.sqrt(px * px + py * py), pz)
        found = max(found, radius - abs(x) - arc_a.error - far)
    return found


@inlined
def _farthest(arc, rho, z):
    """Return how far the points that an arc sweeps are from a point of a plane, at most, metres.

    The farthest point of the sweep is across the axis. Along the chord the distance is convex; on a
    circle it is at most the distance of the centre and the radius.
    """
    x, y = arc.middle[0] + rho, arc.middle[1] - z
    low = np.sqrt((x - arc.half[0]) ** 2 + (y - arc.half[1]) ** 2)
    high = np.sqrt((x + arc.half[0]) ** 2 + (y + arc.half[1]) ** 2)
    far = max(low, high) + bulge(arc)
    if is_round(arc):
        x, y, radius = circle_of(arc)
        x, y = x + rho, y - z
        far = min(far, np.sqrt(x * x + y * y) + radius)
    return far + arc.error


@inlined
def is_round(arc):
    """Return whether an arc is bent so much that its circle is of use; see `circle_of`."""
    return abs(arc.sine) > _ROUND


@inlined
def circle_of(arc):
    """Return the centre of a round arc, rho and z, and its radius; metres."""
    half = np.sqrt(arc.half[0] * arc.half[0] + arc.half[1] * arc.half[1])
    radius = half / abs(arc.sine)
    across = -arc.cosine / arc.sine
    return arc.middle[0] - across * arc.half[1], arc.middle[1] + across * arc.half[0], radius
