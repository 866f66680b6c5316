"""Lower bounds of the distance between the surfaces that two fat arcs sweep, b's only in a sector.

Each arc turns about its own axis. For a, it does not matter in which half-plane through a's axis a
point of b lies: the distance is that of the point (rho, z) in the plane, with rho its distance from
a's axis. So the bounds need no angle about a's axis. Along a unit vector (n_rho, n_z) of that
plane, the gap is where b begins minus where a ends. Where b begins is found along n_rho e + n_z z
for one unit vector e across the axis: rho >= e . x. If n_rho is negative, an upper bound of rho is
used instead: rho <= e . x + y² / (2 e . x), where y is how far x lies beside e.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.jit import inlined, kernel
from ..base.trees import NONE
from .coaxial import ALIKE, begin_about_axis, sags_about_axis
from .newton import to_a, to_b
from .reach import bulge, coarse_in, reach_in

_SWEEPS = 2
"""Sweeps of coordinate descent: see `facing`."""


_NORMAL = 0.9
"""A direction is about normal to a chord if the sine of the angle between them is above this."""

_WIDE, _FRONT = 3.0, 0.5
"""Half the angle from which on a sector counts as the full turn, and half the angle of the part
that is then split from it, radians."""

_PIECES = 1e-3
"""What counts as the sag of an arc around several pieces, as a share of half its chord."""


@kernel
def begin_of(tree_b, own_b, b, fine, sector, motion, normal, azimuth, wanted):
    """Return where b begins along a normal of a's plane, at that azimuth; metres.

    Only the part of b under the arc `b` counts, bounded by arcs with errors below `fine` metres.
    How wide it is beside the azimuth matters little, so coarse reaches suffice for that. The result
    minus the reach of a, `reach_of`, is a gap between both. If b begins beyond `wanted`, the result
    is at least `wanted`, but may be less than the best bound.
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
    """Estimate where a's chord and b's chord, which turns, are nearest: a box quadratic programme.

    Returns their distance there, metres, the normal and the azimuth; and where the nearest points
    are along both chords and in the sector, each -1 to 1, in the sector as a share of
    min(half_angle, 1).
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
    # If the direction is tilted against a chord's normal, the bound is worse by the tilt times the
    # chord's length. So the direction is made normal to the chord that has its nearest point
    # inside; if both have, to the longer one.
    n, m = r0 / apart, r1 / apart
    within_a, within_b = -1.0 < s < 1.0, -1.0 < t < 1.0
    if within_a and not (within_b and aa < uu):
        n, m = _normal_near(n, m, a0, a1, aa)
    elif within_b:
        n, m = _normal_near(n, m, u0, u1, uu)
    return apart, (n, m), (ex, ey), (s, t, q)


@inlined
def normal_of_a(arc, normal):
    """Return the unit normal of a chord on a direction's side; the direction if it has none."""
    x, z = arc.half[0], arc.half[1]
    length = np.sqrt(x * x + z * z)
    if not length > 0.0:
        return normal
    if normal[1] * x < normal[0] * z:
        length = -length
    return (-z / length, x / length)


@kernel
def normal_of_b(arc_b, sector, half_angle, q, motion, normal, azimuth):
    """Return the normal and the azimuth of b's surface in the middle of b's chord.

    Where b is flat, the azimuth between nearest points is known to half the digits only, but this
    one is exact. `q` is the place in the sector that `facing` returns; the direction with the
    normal and the azimuth given has to be about the same.
    """
    turn = q * min(half_angle, 1.0)
    c, s = math.cos(turn), math.sin(turn)
    c, s = sector[0] * c - sector[1] * s, sector[1] * c + sector[0] * s
    x, y, z = to_a(motion, -arc_b.half[1] * c, -arc_b.half[1] * s, arc_b.half[0])
    n, (ex, ey) = normal[0], azimuth
    length = np.sqrt(x * x + y * y + z * z)
    across = np.sqrt(x * x + y * y)
    if not across > 0.0:
        return normal, azimuth
    if n * (x * ex + y * ey) + normal[1] * z < 0.0:
        length = -length
    sign = 1.0 if n * length > 0.0 else -1.0
    return (sign * across / length, z / length), (sign * x / across, sign * y / across)


@inlined
def _normal_near(n, m, x, z, squared):
    """Return a chord's unit normal if a direction is about normal to it; else the direction."""
    across = (m * x - n * z) / np.sqrt(squared)
    if not abs(across) > _NORMAL:
        return n, m
    length = np.sqrt(squared) if across > 0.0 else -np.sqrt(squared)
    return -z / length, x / length


@inlined
def sector_of(angle, half):
    """Return the cosine and sine of a sector's middle, and of half its angle."""
    if half >= math.pi:
        return (1.0, 0.0, -1.0, 0.0)
    return (math.cos(angle), math.sin(angle), math.cos(half), math.sin(half))


@inlined
def half_of(angle, half, which):
    """Return the middle of one of two parts of a sector, and half its angle.

    In a sector of the full turn, or almost, the nearest points are expected at the middle. So a
    part around the middle is split from the rest.
    """
    if half > _WIDE:
        if which == 0:
            return angle, _FRONT
        return angle + math.pi, (math.pi - _FRONT) * (1.0 + 1e-15)
    half *= 0.5
    return angle + (half if which else -half), half * (1.0 + 1e-15)


@inlined
def spread_of(arc, sector, motion):
    """Estimate how far apart b's points in a sector are as seen from a, metres."""
    spread = (1.0 - max(sector[2], 0.0)) * (abs(arc.middle[0]) + abs(arc.half[0]))
    if abs(motion[8]) > ALIKE:
        spread = min(spread, sags_about_axis(arc, sector, motion)[1])
    return spread


@inlined
def sags(arc_a, arc_b, sector, half, motion):
    """Return how far from straight a's arc, b's arc and b's sector are, metres.

    In a's plane a long arc of b near a's axis bends, too: its chord by the squared length over
    eight times the distance from the axis. If b's arc begins on b's axis, all sectors share that
    point, and dividing them does not help. So the smallest circle of the arc about b's axis counts.
    """
    rho, z = arc_b.middle[0], arc_b.middle[1]
    x, y, _ = to_a(motion, rho * sector[0], rho * sector[1], z)
    x, y = x + motion[9], y + motion[10]
    far = np.sqrt(x * x + y * y)
    rho = abs(rho) + abs(arc_b.half[0])
    width = 2.0 * min(half, 1.5) * rho
    long = arc_b.length
    sag = long * long / (8.0 * max(far, 0.5 * long) + 1e-300)
    around = width * width / (8.0 * max(far, 0.5 * width) + 1e-300)
    around += (1.0 - sector[2]) * max(rho - 2.0 * abs(arc_b.half[0]), 0.0)
    if abs(motion[8]) > ALIKE:
        along, varied = sags_about_axis(arc_b, sector, motion)
        sag, around = min(sag, along), min(around, varied)
    of_b = arc_b.error + bulge(arc_b) + sag
    return max(arc_a.error + bulge(arc_a), _apart(arc_a)), max(of_b, _apart(arc_b)), around


@inlined
def _apart(arc):
    """Return what counts as the sag of an arc around several pieces, metres; 0 for a single piece.

    Nearest points are only looked for on single pieces. So even a straight arc around several
    pieces has to be divided down to these.
    """
    half = np.sqrt(arc.half[0] * arc.half[0] + arc.half[1] * arc.half[1])
    return _PIECES * half if arc.curve == NONE else 0.0
