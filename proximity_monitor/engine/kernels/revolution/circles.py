"""The distance of two circles in space, with a certified lower bound.

A point p of one circle, at an angle, is sqrt((rho - R)² + z²) from the other, which has the radius
R and the axis z; rho is the distance of p from that axis. The square g of that distance has up to
four minima, and the least of them is not easy to tell from the others. So the full turn is divided
into intervals. Taylor's formula with a bound of g'' gives a bound of each: if g'' is positive and
g' is almost zero, as around a minimum, the bound is exact. If the circles have one axis, both
derivatives are zero, and few intervals suffice as well. All points of a circle are equally far from
the other circle also if the centre lies on the other circle and the axis is tangent to it there, as
of links of a chain. Then the centre gives the better bound.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..base.jit import inlined, kernel
from ..base.memory import on_stack
from ..base.rounding import DOUBLE_EPS

_PARTS = 12
"""Intervals of the full turn that a search begins with."""

_ROOM = 64
"""Intervals that there is room for."""

_LOOKS = 512
"""Intervals that are looked at, at most."""

_STEPS, _STRIDE = 8, 0.3
"""Steps of Newton's method towards a minimum, at most, and the largest step, radians."""

_SETTLED = 1e-9
"""A step no larger than this, radians, is the last: the next one would be as small as rounding."""

_WIDER = 4e-15
"""How much half an interval is widened, radians, because angles are rounded."""

# The next constants bound the errors of what is computed for a point. Let S be the sum of the
# lengths of the circles' offset and of both radii, r the radius of the point's circle and 1 + 3 u
# the length of its axes. Cosines and sines err by 2 u, so x', y' and z' err by 8 u r. In x, y and z
# the offset errs by 5 u S besides: together 14 u S.
_SLOPE = 8.0 * DOUBLE_EPS
"""Error of x', y', z' and of x'', y'', z'', as a share of r."""

_PLACE = 32.0 * DOUBLE_EPS
"""Error of the distance, of rho - R and of z, as a share of S: 14 u S in each of two, and
roundings."""

_TURN = 64.0 * DOUBLE_EPS
"""Error of rho' = (x x' + y y') / rho, as a share of S r / rho: 20 u from the point's place, 16 u
from slopes and roundings, 22 u from the divisor."""

_BEND = 96.0 * DOUBLE_EPS
"""Error of (rho²)'' / 2, as a share of S r."""

_REST = 8.0 * DOUBLE_EPS
"""Error of sums of a few terms, as a share of the terms."""


class Circles(NamedTuple):
    """Two circles: the first about the axis z in the plane z = 0, the second with the points.

    A point lies at `centre` + `radius` (cos angle · u + sin angle · v). The second radius is the
    smaller one.
    """

    around: float
    radius: float
    centre: tuple[float, float, float]
    u: tuple[float, float, float]
    v: tuple[float, float, float]
    reach: float
    """How far a point is from the centre, at most."""
    size: float
    """At least S, see above, metres."""
    once: float
    """At least b in rho² = a + b cos(angle - c) + d cos(2 angle - e)."""
    twice: float
    """At least d in the same formula."""
    up: float
    """How far z differs from the centre's z, at most; it bounds each derivative of z as well."""


@inlined
def _first(radius, centre, u, v):
    """Return b of `Circles.once`."""
    x = centre[0] * u[0] + centre[1] * u[1]
    y = centre[0] * v[0] + centre[1] * v[1]
    return 2.0 * radius * math.sqrt(x * x + y * y)


@inlined
def _second(radius, u, v):
    """Return d of `Circles.twice`."""
    uu, vv = u[0] * u[0] + u[1] * u[1], v[0] * v[0] + v[1] * v[1]
    x, y = 0.5 * (uu - vv), u[0] * v[0] + u[1] * v[1]
    return radius * radius * math.sqrt(x * x + y * y)


@kernel
def circles_of(motion, around, height, radius, other):
    """Return the Circles of two circles about the axes z of two frames, a and b.

    Args:
        motion: (12,) from b's frame to a's, rotation by rows and translation, metres.
        around: radius of the circle about a's axis, metres.
        height: z of that circle, metres.
        radius: radius of the circle about b's axis, metres.
        other: z of that circle in b's frame, metres.
    """
    u, v = (motion[0], motion[3], motion[6]), (motion[1], motion[4], motion[7])
    centre = (
        motion[9] + other * motion[2],
        motion[10] + other * motion[5],
        motion[11] + other * motion[8] - height,
    )
    size = around + radius + abs(height) + abs(other)
    size += math.sqrt(motion[9] * motion[9] + motion[10] * motion[10] + motion[11] * motion[11])
    uu, vv = u[0] * u[0] + u[1] * u[1] + u[2] * u[2], v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    uv = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
    reach = radius * math.sqrt(max(uu, vv) + abs(uv)) * (1.0 + _REST)
    # Rounding may make b and d too small by a few units.
    more = _PLACE * size * radius
    return Circles(
        around, radius, centre, u, v, reach, size * (1.0 + _REST),
        _first(radius, centre, u, v) + more, _second(radius, u, v) + more,
        radius * math.sqrt(u[2] * u[2] + v[2] * v[2]) * (1.0 + _REST),
    )  # fmt: skip


@inlined
def point_at(circles, angle):
    """Return a point of the second circle, metres, in the frame with the first one at z = 0."""
    c, s = math.cos(angle), math.sin(angle)
    u, v, centre, r = circles.u, circles.v, circles.centre, circles.radius
    return (
        centre[0] + r * (c * u[0] + s * v[0]),
        centre[1] + r * (c * u[1] + s * v[1]),
        centre[2] + r * (c * u[2] + s * v[2]),
    )


@kernel
def _apart(circles, angle):
    """Return how far a point of the second circle is from the first, metres."""
    x, y, z = point_at(circles, angle)
    off = math.sqrt(x * x + y * y) - circles.around
    return math.sqrt(off * off + z * z)


@inlined
def _least_near(circles, apart, half):
    """Return a bound, metres, in an interval around an angle with the distance `apart`.

    No point is nearer by more than the length of the way to it.
    """
    return apart - _PLACE * circles.size - circles.reach * half * (1.0 + _REST)


@kernel
def _bound(circles, angle, half):
    """Return the distance at an angle, and a lower bound in an interval around it, metres.

    Returns also the step of Newton's method to a nearer place, radians; 0 if g'' is not positive.
    """
    c, s = math.cos(angle), math.sin(angle)
    u, v, centre, r = circles.u, circles.v, circles.centre, circles.radius
    bx, by, bz = r * (c * u[0] + s * v[0]), r * (c * u[1] + s * v[1]), r * (c * u[2] + s * v[2])
    x, y, z = centre[0] + bx, centre[1] + by, centre[2] + bz
    x1, y1, z1 = r * (c * v[0] - s * u[0]), r * (c * v[1] - s * u[1]), r * (c * v[2] - s * u[2])
    rho = math.sqrt(x * x + y * y)
    off = rho - circles.around
    apart = math.sqrt(off * off + z * z)
    place, slope = _PLACE * circles.size, _SLOPE * r
    # The distance from the axis is bounded in the same way.
    least, low = _least_near(circles, apart, half), _least_near(circles, rho, half)
    if not low > 0.0:
        return apart, least, 0.0
    rho1 = (x * x1 + y * y1) / rho
    square = x1 * x1 + y1 * y1 - x * bx - y * by
    rho2 = (square - rho1 * rho1) / rho
    of_rho1 = _TURN * circles.size * r / rho
    of_rho2 = (_BEND * circles.size * r + (2.0 * abs(rho1) + of_rho1) * of_rho1) / rho
    of_rho2 += abs(rho2) * (place / rho + _REST)
    along, across = abs(off), abs(z)
    g1 = 2.0 * (off * rho1 + z * z1)
    of_g1 = along * of_rho1 + (abs(rho1) + of_rho1) * place + across * slope
    of_g1 += (abs(z1) + slope) * place + _REST * (along * abs(rho1) + across * abs(z1))
    steep = abs(g1) + 2.0 * of_g1
    g2 = 2.0 * (rho1 * rho1 + off * rho2 + z1 * z1 - z * bz)
    of_g2 = (2.0 * abs(rho1) + of_rho1) * of_rho1 + along * of_rho2
    of_g2 += (abs(rho2) + of_rho2) * place + (2.0 * abs(z1) + slope) * slope + across * slope
    of_g2 += (abs(bz) + slope) * place
    of_g2 += _REST * (rho1 * rho1 + along * abs(rho2) + z1 * z1 + across * abs(bz))
    # Bounds of |rho'|, |rho''| and |rho'''| in the interval, by the derivatives of rho². Half of
    # g''' is (rho - R) rho''' + 3 rho' rho'' + z z''' + 3 z' z''.
    first = min(0.5 * (circles.once + 2.0 * circles.twice) / low, circles.reach)
    second = (0.5 * circles.once + 2.0 * circles.twice + first * first) / low
    third = (0.5 * circles.once + 4.0 * circles.twice + 3.0 * first * second) / low
    up = circles.up
    changes = (along + place + first * half) * third + 3.0 * first * second
    changes += up * (across + place + up * half + 3.0 * up)
    bend = g2 - 2.0 * of_g2 - 2.0 * half * changes * (1.0 + 4.0 * _REST)
    nearest = max(apart - place, 0.0)
    if bend > 0.0 and steep < bend * half:
        lost = 0.5 * steep * steep / bend
    else:
        lost = (steep - 0.5 * bend * half) * half
    lost = nearest * nearest - lost * (1.0 + _REST)
    if lost > 0.0:
        least = max(least, math.sqrt(lost) * (1.0 - _REST))
    return apart, least, -g1 / g2 if g2 > 0.0 else 0.0


@inlined
def _around_tube(circles):
    """Return a lower bound of the circles' distance, metres, from the second one's centre c alone.

    The bound is exact if c lies on the first circle, and the second circle's axis is tangent to the
    first there. Let b be the vector from c to a point, and tau the most that b extends along that
    tangent. In the half-plane of c, the point is no less than sqrt(b² - tau²) from c. A point out
    of that half-plane is farther from the axis by less than tau, and by less than tau² over twice
    its distance.
    """
    u, v, centre, r = circles.u, circles.v, circles.centre, circles.radius
    rho, place = math.sqrt(centre[0] * centre[0] + centre[1] * centre[1]), _PLACE * circles.size
    if not rho > place:
        return 0.0
    x, y = -centre[1] / rho, centre[0] / rho
    tu, tv = u[0] * x + u[1] * y, v[0] * x + v[1] * y
    tau = r * math.sqrt(tu * tu + tv * tv) + place
    uu, vv = u[0] * u[0] + u[1] * u[1] + u[2] * u[2], v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    uv = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
    squared = r * r * (min(uu, vv) - abs(uv)) * (1.0 - _REST) - tau * tau
    if not squared > 0.0:
        return 0.0
    off, z, low = rho - circles.around, centre[2], rho - circles.reach - place
    beside = min(tau, 0.5 * tau * tau / low) if low > 0.0 else tau - 2.0 * low
    return math.sqrt(squared) - math.sqrt(off * off + z * z) - beside - 2.0 * place


@inlined
def _towards_axis(circles):
    """Return the angle of the point that is farthest from the centre towards the axis."""
    u, v, centre = circles.u, circles.v, circles.centre
    x, y = centre[0] * u[0] + centre[1] * u[1], centre[0] * v[0] + centre[1] * v[1]
    return math.atan2(-y, -x)


@inlined
def _is_hollow(found, k):
    """Return whether no neighbour's middle is nearer than the middle of an interval."""
    return found[k] <= found[(k + 1) % _PARTS] and found[k] <= found[k - 1]


@kernel
def _minimum_near(circles, angle, best, at):
    """Go to a minimum by Newton's method; return the least distance known, metres, and its angle.

    `best` and `at` are the least distance known before, and its angle. Nothing is proven, so the
    search may fail.
    """
    apart, _, step = _bound(circles, angle, 0.0)
    for _ in range(_STEPS):
        if apart < best:
            best, at = apart, angle
        if not abs(step) > _SETTLED:
            break
        angle += min(max(step, -_STRIDE), _STRIDE)
        apart, _, step = _bound(circles, angle, 0.0)
    return (apart, angle) if apart < best else (best, at)


@kernel
def distance_of_circles(circles, spare):
    """Return a lower bound of the distance of two circles, usually within `spare` of it, metres.

    Returns also the angle of the second circle's point that is nearest, about how far that is, and
    how many intervals were looked at.
    """
    if circles.radius == 0.0:
        apart = _apart(circles, 0.0)
        return max(apart - _PLACE * circles.size, 0.0), 0.0, apart, 1
    middles, halves = on_stack(_ROOM, 0.0), on_stack(_ROOM, 0.0)
    found, half = on_stack(_PARTS, 0.0), math.pi / _PARTS
    for k in range(_PARTS):
        found[k] = _apart(circles, (2 * k + 1) * half)
    best, at = np.inf, 0.0
    for k in range(_PARTS):
        if _is_hollow(found, k):
            best, at = _minimum_near(circles, (2 * k + 1) * half, best, at)
    # Near the axis, rho changes so fast that no step leads to this point.
    angle = _towards_axis(circles)
    if _apart(circles, angle) < best:
        best, at = _minimum_near(circles, angle, best, at)
    around = _around_tube(circles)
    if around >= best - spare:
        return around, at, best, 1
    least, count, looks = np.inf, 0, 0
    for k in range(_PARTS):
        low = _least_near(circles, found[k], half + _WIDER)
        if low >= best:
            least = min(least, low)
            continue
        middles[count], halves[count] = (2 * k + 1) * half, half + _WIDER
        count += 1
    while count > 0:
        count -= 1
        angle, half = middles[count], halves[count]
        looks += 1
        apart, low, step = _bound(circles, angle, half)
        if apart < best:
            best, at = _minimum_near(circles, angle, best, at)
        moved = angle + step
        if low < best - spare and step != 0.0 and abs(step) <= half:
            # The bound of an interval is best if it is taken from the minimum.
            for _ in range(2):
                looks += 1
                _, more, step = _bound(circles, moved, half + abs(moved - angle) + _WIDER)
                low = max(low, more)
                moved += step
                if low >= best - spare or not abs(moved - angle) <= half:
                    break
        if low >= best - spare or count + 2 > _ROOM or looks > _LOOKS:
            least = min(least, low)
            continue
        for k in range(2):
            middles[count] = angle + (k - 0.5) * half
            halves[count] = 0.5 * half + _WIDER
            count += 1
    return max(least, around, 0.0), at, best, looks
