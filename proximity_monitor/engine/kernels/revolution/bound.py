"""Lower bounds of the distance of what two fat arcs sweep, one of them in a sector alone.

Both turn about axes of their own. Which half-plane through a's axis a point of b lies in does not
matter to a: the distance is that of a point (rho, z) in the plane, with rho the distance from a's
axis. So the bounds know no angle about a's axis. Along a unit vector (n_rho, n_z) of that plane the
gap is what b begins at beyond what a ends at, and where b begins is found along n_rho e + n_z z for
one unit vector e across the axis: rho >= e . x, and where n_rho is negative
rho <= e . x + y² / (2 e . x) for what lies y beside e.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.jit import inlined, kernel
from ..base.trees import NONE
from .coaxial import ALIKE, begin_about_axis, bends_about_axis
from .newton import turned
from .reach import bulge, coarse_in, reach_in

_SWEEPS = 2
"""Sweeps of coordinate descent: see `facing`."""


_SHORTER, _NORMAL = 0.01, 0.9
"""Share of the square of a chord up to which another one is far shorter; and the sine of the angle
with a chord from which on a direction is about normal to it."""

_WIDE, _FRONT = 3.0, 0.5
"""Half the angle from which on a sector is all around, and that of what is parted from it."""

_PIECES = 1e-3
"""Share of half its chord that counts as a bend of an arc around several pieces."""


@inlined
def to_b(motion, v):
    """A vector of a's frame in that of b."""
    return (
        motion[0] * v[0] + motion[3] * v[1] + motion[6] * v[2],
        motion[1] * v[0] + motion[4] * v[1] + motion[7] * v[2],
        motion[2] * v[0] + motion[5] * v[1] + motion[8] * v[2],
    )


@kernel
def begin_of(tree_b, own_b, b, fine, sector, motion, normal, azimuth, wanted):
    """Where b begins along a normal of a's plane, at that azimuth; metres.

    Of b what lies under an arc, by arcs of errors below `fine` metres; how wide it is, which counts
    little, is known well enough without. What is left of that beyond what a reaches, `reach_of`, is
    a gap between both. Where it begins beyond what is wanted, that is the answer.
    """
    n, m = normal
    found = -np.inf
    if abs(motion[8]) > ALIKE and n != 0.0:
        found = begin_about_axis(tree_b, own_b, b, fine, sector, motion, n, m, wanted)
        if found >= wanted or (sector[2] < 0.0 and found > -np.inf):
            return found
    x, y = azimuth
    begin = n * (x * motion[9] + y * motion[10]) + m * motion[11]
    if n < 0.0:
        v = to_b(motion, (-y, x, 0.0))
        offset = x * motion[10] - y * motion[9]
        beside = coarse_in(tree_b, own_b, b, sector, v) + offset
        less = coarse_in(tree_b, own_b, b, sector, (-v[0], -v[1], -v[2]))
        beside = max(abs(beside), abs(offset - less))
        v = to_b(motion, (x, y, 0.0))
        near = x * motion[9] + y * motion[10]
        near -= coarse_in(tree_b, own_b, b, sector, (-v[0], -v[1], -v[2]))
        if near > 0.0:
            begin += n * min(beside, beside * beside / (2.0 * near))
        else:
            begin += n * (beside - 2.0 * near)
    v = to_b(motion, (-n * x, -n * y, -m))
    return max(found, begin - reach_in(tree_b, own_b, b, fine, sector, v, begin - wanted))


@kernel
def facing(arc_a, arc_b, sector, half_angle, motion):
    """About where a's chord and b's, which turns, are nearest; a box quadratic programme.

    Returns their distance there, metres, the normal and the azimuth; and where along the chords, -1
    to 1, and in the sector.
    """
    cosine, sine = sector[0], sector[1]
    rho, z = arc_b.middle[0], arc_b.middle[1]
    x, y = rho * cosine, rho * sine
    px = motion[0] * x + motion[1] * y + motion[2] * z + motion[9]
    py = motion[3] * x + motion[4] * y + motion[5] * z + motion[10]
    pz = motion[6] * x + motion[7] * y + motion[8] * z + motion[11]
    far = np.sqrt(px * px + py * py)
    ex, ey = 1.0, 0.0
    if far > 0.0:
        ex, ey = px / far, py / far
    x, y, z = arc_b.half[0] * cosine, arc_b.half[0] * sine, arc_b.half[1]
    ux = motion[0] * x + motion[1] * y + motion[2] * z
    uy = motion[3] * x + motion[4] * y + motion[5] * z
    uz = motion[6] * x + motion[7] * y + motion[8] * z
    width = min(half_angle, 1.0) * rho
    x, y = -width * sine, width * cosine
    wx = motion[0] * x + motion[1] * y
    wy = motion[3] * x + motion[4] * y
    wz = motion[6] * x + motion[7] * y
    d0, d1 = far - arc_a.middle[0], pz - arc_a.middle[1]
    a0, a1 = arc_a.half[0], arc_a.half[1]
    u0, u1, w0, w1 = ux * ex + uy * ey, uz, wx * ex + wy * ey, wz
    aa, uu, ww = a0 * a0 + a1 * a1 + 1e-300, u0 * u0 + u1 * u1 + 1e-300, w0 * w0 + w1 * w1 + 1e-300
    per_a, per_u, per_w = 1.0 / aa, 1.0 / uu, 1.0 / ww
    s = t = q = 0.0
    for _ in range(_SWEEPS):
        r0, r1 = d0 + t * u0 + q * w0, d1 + t * u1 + q * w1
        s = min(max((r0 * a0 + r1 * a1) * per_a, -1.0), 1.0)
        r0, r1 = d0 - s * a0 + q * w0, d1 - s * a1 + q * w1
        t = min(max(-(r0 * u0 + r1 * u1) * per_u, -1.0), 1.0)
        r0, r1 = d0 - s * a0 + t * u0, d1 - s * a1 + t * u1
        q = min(max(-(r0 * w0 + r1 * w1) * per_w, -1.0), 1.0)
    r0, r1 = d0 - s * a0 + t * u0 + q * w0, d1 - s * a1 + t * u1 + q * w1
    px, py = px + t * ux + q * wx, py + t * uy + q * wy
    far = np.sqrt(px * px + py * py)
    if far > 0.0:
        ex, ey = px / far, py / far
    apart = np.sqrt(r0 * r0 + r1 * r1)
    if not apart > 0.0:
        return apart, (0.0, 0.0), (ex, ey), (s, t, q)
    # What is tilted along a chord makes a bound that is worse by the tilt times its length: within
    # the longer one, or the one of which an inner point was found, the way is normal to it.
    n, m = r0 / apart, r1 / apart
    within_a, within_b = -1.0 < s < 1.0, -1.0 < t < 1.0
    if within_a and (not within_b or uu < _SHORTER * aa):
        n, m = _normal_near(n, m, a0, a1, aa)
    elif within_b and (not within_a or aa < _SHORTER * uu):
        n, m = _normal_near(n, m, u0, u1, uu)
    return apart, (n, m), (ex, ey), (s, t, q)


@inlined
def _normal_near(n, m, x, z, squared):
    """The unit normal of a chord where a direction is about that; else the direction."""
    across = (m * x - n * z) / np.sqrt(squared)
    if not abs(across) > _NORMAL:
        return n, m
    length = np.sqrt(squared) if across > 0.0 else -np.sqrt(squared)
    return -z / length, x / length


@inlined
def sector_of(angle, half):
    """The cosine and sine of a sector's middle, and of half its angle."""
    if half >= math.pi:
        return (1.0, 0.0, -1.0, 0.0)
    return (math.cos(angle), math.sin(angle), math.cos(half), math.sin(half))


@inlined
def half_of(angle, half, which):
    """The middle of one of two parts of a sector, and half its angle.

    What turns all around, or almost, is nearest in the middle: that is parted from all else.
    """
    if half > _WIDE:
        if which == 0:
            return angle, _FRONT
        return angle + math.pi, (math.pi - _FRONT) * (1.0 + 1e-15)
    half *= 0.5
    return angle + (half if which else -half), half * (1.0 + 1e-15)


@inlined
def spread_of(arc, sector, motion):
    """How far from each other b's points in a sector are for a, about, metres."""
    spread = (1.0 - max(sector[2], 0.0)) * (abs(arc.middle[0]) + abs(arc.half[0]))
    if abs(motion[8]) > ALIKE:
        spread = min(spread, bends_about_axis(arc, sector, motion)[1])
    return spread


@inlined
def bends(arc_a, arc_b, sector, half, motion):
    """How far from straight the arcs are, and b's sector, metres.

    In a's plane what is long and near a's axis is bent, too: a chord by its length's square over
    eight times its distance. Where b's arc begins on its axis, all sectors have that point, and to
    divide them does not help: so of circles about it the smallest counts.
    """
    rho, z = arc_b.middle[0], arc_b.middle[1]
    x, y, _ = turned(motion, rho * sector[0], rho * sector[1], z)
    x, y = x + motion[9], y + motion[10]
    far = np.sqrt(x * x + y * y)
    rho = abs(rho) + abs(arc_b.half[0])
    width = 2.0 * min(half, 1.5) * rho
    long = arc_b.length
    bent = long * long / (8.0 * max(far, 0.5 * long) + 1e-300)
    around = width * width / (8.0 * max(far, 0.5 * width) + 1e-300)
    around += (1.0 - sector[2]) * max(rho - 2.0 * abs(arc_b.half[0]), 0.0)
    if abs(motion[8]) > ALIKE:
        along, varied = bends_about_axis(arc_b, sector, motion)
        bent, around = min(bent, along), min(around, varied)
    of_b = arc_b.error + bulge(arc_b) + bent
    return max(arc_a.error + bulge(arc_a), _apart(arc_a)), max(of_b, _apart(arc_b)), around


@inlined
def _apart(arc):
    """What counts as a bend of an arc around several pieces, metres.

    Only of single pieces are the nearest points looked for, so straight ones must come to that.
    """
    half = np.sqrt(arc.half[0] * arc.half[0] + arc.half[1] * arc.half[1])
    return _PIECES * half if arc.curve == NONE else 0.0
