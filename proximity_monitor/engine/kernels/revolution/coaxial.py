"""Bounds of solids of revolution whose axes are nearly one, as of a shaft in a bore.

A point of b lies at g + rho_b u across a's axis, with g what the point of b's axis beside it is off
a's, and u a unit vector across b's. Of u a part between cos(tilt) and 1 is across a's axis, along
some u'. So rho >= rho_b cos(tilt) + g . u', and rho <= sqrt(X² + h²) for X = rho_b + g . u', where
h is what g extends across u'. The most that g . u' is in a sector is convex in z, as g is linear:
no more than what is interpolated between the ends of an arc. The root is convex in X. So both are
bounded by what is linear in rho_b and z, and what an arc reaches along a vector is known. No small
sectors are needed: about one axis, these bounds are those of the profiles in the plane.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.trees import NONE
from .reach import arc_at, bulge, most_in, reach_of

ALIKE = 0.98
"""Cosine of the tilt of the axes from which on these are nearly one."""

_ON_AXIS = 1e-6
"""Share of an arc's width by which its centre may be off the axis."""

_ROUND = 0.02
"""Sine of half the angle of an arc from which on its circle is compared. The radius is at most 50
times half the chord there, and the centre errs by less than 10 u of it: see `_about_axis`."""


@inlined
def _along_z(arc):
    """The middle of what an arc extends along its axis, and no less than half of that, metres."""
    return arc.middle[1], abs(arc.half[1]) + bulge(arc) + arc.error


@inlined
def _beside_axis(motion, z):
    """What the point at z of b's axis is off a's, metres."""
    return motion[9] + z * motion[2], motion[10] + z * motion[5]


@inlined
def off_axis(arc, motion):
    """How far b's axis is off a's beside an arc, at most, metres."""
    middle, half = _along_z(arc)
    x, y = _beside_axis(motion, middle)
    return np.sqrt(x * x + y * y) + half * np.sqrt(motion[2] * motion[2] + motion[5] * motion[5])


@inlined
def bends_about_axis(arc, sector, motion):
    """How far from straight b's arc and its sector are to bounds about an axis, about, metres.

    Infinity where there are none: see `begin_about_axis`.
    """
    off, wide = off_axis(arc, motion), abs(arc.middle[0]) + abs(arc.half[0])
    if not off < wide:
        return np.inf, np.inf
    tilt = np.sqrt(motion[2] * motion[2] + motion[5] * motion[5])
    varied = 1.0 if sector[2] < 0.0 else sector[3]
    # The root is bent most where an arc is near its axis: see `_chord_of_root`.
    middle, near = abs(arc.middle[0]), max(abs(arc.middle[0]) - abs(arc.half[0]), 0.0)
    chord = 0.5 * (np.sqrt(near * near + off * off) + np.sqrt(wide * wide + off * off))
    along = 0.5 * tilt * arc.length + chord - np.sqrt(middle * middle + off * off)
    return along, varied * (off + wide * tilt + off * off / wide)


@inlined
def _most_beside(motion, sector, z):
    """No less than what the point at z of b's axis is off a's across u', metres."""
    x, y = _beside_axis(motion, z)
    x, y = -y, x
    x, y = motion[0] * x + motion[3] * y, motion[1] * x + motion[4] * y
    return max(most_in(sector, x, y), most_in(sector, -x, -y)) / abs(motion[8])


@inlined
def _most_off(motion, sector, sign, z):
    """No less than sign g . u' for what the point at z of b's axis is off a's, metres."""
    x, y = _beside_axis(motion, z)
    x, y = sign * x, sign * y
    most = most_in(sector, motion[0] * x + motion[3] * y, motion[1] * x + motion[4] * y)
    return most / abs(motion[8]) if most > 0.0 else most


# What is computed here errs by less than 40 u P, with P the coordinates of both models, and by 2 u
# of a translation along the axes. An arc's error holds 2,048 u P, of which it needs some 320: see
# _ROUNDING of arcs.
@kernel
def _about_axis(arc, sector, motion, n, m):
    """A vector v of b's plane, and what v . (rho_b, z) is added to: no point of b is less far."""
    middle, half = _along_z(arc)
    sign = -1.0 if n > 0.0 else 1.0
    first = _most_off(motion, sector, sign, middle - half)
    last = _most_off(motion, sector, sign, middle + half)
    between, slope = 0.5 * (first + last), 0.0
    if half > 0.0:  # whatever rounding does to short arcs
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
    """A line no lower than sqrt(X² + h²) for all X = across rho_b + g . u' of an arc.

    That is convex in X, so its chord is one. Returns the line's slope, and its height at zero.
    """
    middle, half = _along_z(arc)
    off, tilt = off_axis(arc, motion), np.sqrt(motion[2] * motion[2] + motion[5] * motion[5])
    thick = abs(arc.half[0]) + bulge(arc) + arc.error
    least, most = max(arc.middle[0] - thick, 0.0), arc.middle[0] + thick
    beside = _most_beside(motion, sector, middle) + half * tilt
    if least * abs(motion[8]) <= off:  # where X may be negative, rho is no more than |g|
        beside = off
    low = across * least + min(first, last)
    high = across * most + max(first, last)
    begin, end = np.sqrt(low * low + beside * beside), np.sqrt(high * high + beside * beside)
    share = 1.0
    if high > low:  # whatever rounding does to short arcs
        share = min(max((end - begin) / (high - low), -1.0), 1.0)
    return share, max(begin - share * low, end - share * high)


@kernel
def begin_about_axis(tree_b, own_b, b, fine, sector, motion, n, m, wanted):
    """Where b begins along a normal (n, m) of a's plane, metres; see `begin_of`.

    Minus infinity where b's axis is farther off a's than b's arc is from its own.
    """
    arc = arc_at(tree_b.arcs, own_b, b)
    if not off_axis(arc, motion) < abs(arc.middle[0]) + abs(arc.half[0]):
        return -np.inf
    v, begin = _about_axis(arc, sector, motion, n, m)
    return begin - reach_of(tree_b, own_b, b, fine, -v[0], -v[1], begin - wanted)


@inlined
def between_circles(arc_a, arc_b, motion):
    """A lower bound of the distance of two arcs by their circles, but for rounding; or -infinity.

    No point of one circle is nearer to the other than both radii differ, less by how far their
    centres are from each other. Where these are one, that is the distance of all points.
    """
    round_ = arc_a.curve != NONE and min(abs(arc_a.sine), abs(arc_b.sine)) > _ROUND
    if not (round_ and (abs(motion[8]) > ALIKE or _is_ball(arc_a))):
        return -np.inf
    return _between_circles(arc_a, arc_b, motion)


@inlined
def _is_ball(arc):
    """Whether the centre of a round arc is on the axis, about: all else has wide bounds."""
    off = abs(arc.middle[0] * arc.sine + arc.cosine * arc.half[1])
    return off < _ON_AXIS * abs(arc.half[0])


@kernel
def _between_circles(arc_a, arc_b, motion):
    (x, z, radius_a), (rho, height, radius_b) = _circle(arc_a), _circle(arc_b)
    between = abs(radius_b - radius_a) - arc_a.error - arc_b.error
    # Of balls both centres are on the axes.
    off, beside = _beside_axis(motion, height)
    along = motion[11] + height * motion[8] - z
    lost = np.sqrt(off * off + beside * beside + along * along) + abs(x) + abs(rho)
    if abs(motion[8]) > ALIKE:
        along = motion[11] + (height if motion[8] > 0.0 else -height) - z
        apart = np.sqrt((rho - x) * (rho - x) + along * along)
        # How far b's points are from where they would be if both axes were one.
        middle, half = _along_z(arc_b)
        wide = abs(arc_b.middle[0]) + abs(arc_b.half[0]) + bulge(arc_b) + arc_b.error
        tilt = np.sqrt(motion[2] * motion[2] + motion[5] * motion[5])
        apart += off_axis(arc_b, motion) + wide * tilt
        lost = min(lost, apart + (wide + abs(middle) + half) * tilt * tilt)
    return between - lost


@inlined
def _circle(arc):
    """The centre of an arc that is round, rho and z, and its radius; metres."""
    half = np.sqrt(arc.half[0] * arc.half[0] + arc.half[1] * arc.half[1])
    radius = half / abs(arc.sine)
    across = -arc.cosine / arc.sine
    return arc.middle[0] - across * arc.half[1], arc.middle[1] + across * arc.half[0], radius
