"""The nearest point of a part to a given one: Newton's method, and a proof that none is nearer.

Let F = |S - p|² / 2 for a point p and the points S of a rectangle of a piece. Let g be its gradient
and H its Hessian at one of these points:

    F_u = (S - p) S_u,   F_uu = S_u² + (S - p) S_uu,   F_uv = S_u S_v + (S - p) S_uv,
    F_uuu = 3 S_u S_uu + (S - p) S_uuu,   F_uuv = 2 S_u S_uv + S_uu S_v + (S - p) S_uuv,

and so on. If no step from that point within the rectangle is longer than k in u and l in v,
Taylor's formula says of steps (x, y)

    F >= F_0 + g_u x + g_v y + (a x² + b y²) / 2
    a = F_uu - |F_uv| t - (k max |F_uuu| / 3 + l max |F_uuv|),   b = F_vv - |F_uv| / t - ...

for any t > 0, because 2 |x y| <= t x² + y² / t, and |x²y| <= l x². Each term has a least value in
closed form. If a and b are positive, the bound at the minimum itself is F, less e² / 2 a if g errs
by e. So such a part needs no division, however near p is. If another point is nearer than the part,
any point of the part is often enough to prove it. If F_u has one sign all over the rectangle, F is
least at one end of u, and only v is left: the same formula, without steps in u. Third derivatives
are bounded by the Limits of the piece: see limits.py.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import inlined, kernel
from ..base.vectors import dot, norm, sub
from .evaluate import jet_at

Rectangle = namedtuple("Rectangle", "low_u high_u low_v high_v")
"""The range of a piece's parameters in which a minimum is looked for."""

_NEWTON = 16
_LEAST_STEP = 1e-15
"""Most iterations; and the share of the squared distance below which a step's gain is nothing."""

_HOPELESS = 16.0
"""If a bound of the squared distance is more negative than this many times the squared distance
plus the rectangle's squared size, its halves are not worth a look: a division of both parameters
makes the deficit four to eight times less."""

_NEARER = 0.25
"""The search goes on from a point only if it is nearer by this share of the tolerance."""


@inlined
def least_rise(slope, error, bend, low, high):
    """Return the least of slope d + bend d² / 2 for steps d from low to high; slope errs by error.

    low is not positive and high is not negative, so the result is not positive.
    """
    up, down, back = slope - error, -slope - error, -low
    d, e = high, back
    if bend > 0.0:
        d, e = min(max(-up / bend, 0.0), high), min(max(-down / bend, 0.0), back)
    return min(min(d * (up + 0.5 * bend * d), e * (down + 0.5 * bend * e)), 0.0)


@inlined
def least_around(gu, slope_u, a, gv, slope_v, b, h, at, u, v):
    """Return the least rise of F in a rectangle from one of its points u, v; not positive.

    That is the least of g_u x + g_v y + (a x² + b y²) / 2 - h |x y|, where g_u errs by at most
    `slope_u`, and g_v by at most `slope_v`. t is chosen so that what is left of a and b is most
    useful.
    """
    k, m = max(u - at.low_u, at.high_u - u), max(v - at.low_v, at.high_v - v)
    if k > 0.0 and m > 0.0 and h > 0.0:
        t = 1.0
        if a > 0.0 and b > 0.0 and a * b > h * h:
            t = np.sqrt(a / b)
        elif b > 0.0 and not (a > 0.0 and abs(gu) * k < abs(gv) * m):
            t = 2.0 * h / b
        elif a > 0.0:
            t = a / (2.0 * h)
        a, b = a - h * t, b - h / t
    less = least_rise(gu, slope_u, a, at.low_u - u, at.high_u - u)
    less += least_rise(gv, slope_v, b, at.low_v - v, at.high_v - v)
    return less


@kernel
def bound_at(piece, limits, jet, way, at, u, v, slack):
    """Return a lower bound of the distance to a rectangle, from the jet at one of its points u, v.

    Also returns the part of the rectangle that may hold its nearest point, to which the bound
    applies; and whether steps in u, rather than in v, make the bound so low.

    `way` leads from p to the point, and points err by at most the slack. First derivatives err by
    the slack times `piece.slope` times their degree. Second derivatives err by the slack times
    twice the square of `slope` times their degrees: their control points are differences of four,
    and the quotient rule takes two more products with ratios of weights. Errors of first
    derivatives are doubled, to cover the rounding of sums of products here.
    """
    _, du, dv, duu, duv, dvv = jet
    p, q = float(piece.degree_u), float(piece.degree_v)
    error_u, error_v = 2.0 * piece.slope * p * slack, 2.0 * piece.slope * q * slack
    k, m = max(u - at.low_u, at.high_u - u), max(v - at.low_v, at.high_v - v)
    distance = norm(way)
    far = distance + limits.u * k + limits.v * m + slack
    # Bounds of F's third derivatives; then its gradient and Hessian, and the errors of these.
    uuu, uuv = limits.of_uuu + far * limits.uuu, limits.of_uuv + far * limits.uuv
    uvv, vvv = limits.of_uvv + far * limits.uvv, limits.of_vvv + far * limits.vvv
    gu, gv = dot(way, du), dot(way, dv)
    slope_u = 2.0 * slack * limits.u + distance * error_u
    slope_v = 2.0 * slack * limits.v + distance * error_v
    a, b = dot(du, du) + dot(way, duu), dot(dv, dv) + dot(way, dvv)
    less_a = (2.0 * limits.u + error_u + distance * piece.slope * p) * error_u + slack * limits.uu
    less_b = (2.0 * limits.v + error_v + distance * piece.slope * q) * error_v + slack * limits.vv
    h = abs(dot(du, dv) + dot(way, duv)) + limits.u * error_v + limits.v * error_u
    h += (error_u + distance * piece.slope * p) * error_v + slack * limits.uv
    change = (abs(a) + less_a + 0.5 * uuu * k) * k + (h + uuv * k + 0.5 * uvv * m) * m
    low_u, high_u, low_v, high_v = at
    if abs(gu) > change + slope_u:
        low_u = high_u = low_u if gu > 0.0 else high_u
    change = (abs(b) + less_b + 0.5 * vvv * m) * m + (h + uvv * m + 0.5 * uuv * k) * k
    if abs(gv) > change + slope_v:
        low_v = high_v = low_v if gv > 0.0 else high_v
    left = Rectangle(low_u, high_u, low_v, high_v)
    if low_u <= u <= high_u and low_v <= v <= high_v:
        at = left
        k, m = max(u - low_u, high_u - u), max(v - low_v, high_v - v)
    # What steps in u, and in v, cost the bound that steps half as long would gain back.
    lost_u = (uuu * k + 0.25 * uuv * m + max(-3.0 * a, 0.0)) * k * k
    lost_v = (vvv * m + 0.25 * uvv * k + max(-3.0 * b, 0.0)) * m * m
    a -= less_a + uuu * k * (1.0 / 3.0) + uuv * m
    b -= less_b + uvv * k + vvv * m * (1.0 / 3.0)
    less = least_around(gu, slope_u, a, gv, slope_v, b, h, at, u, v)
    across_u, across_v = limits.u * k, limits.v * m
    if not less > -_HOPELESS * (distance * distance + across_u * across_u + across_v * across_v):
        return -np.inf, left, lost_u >= lost_v
    # Subtract the slack before the root: what is left of the square may be far smaller than it.
    nearest = max(distance - slack, 0.0)
    bound = np.sqrt(max(nearest * nearest + 2.0 * less, 0.0))
    return bound, left, lost_u >= lost_v


@inlined
def _within(at, u, v):
    """Return the place in a rectangle that is nearest to u, v."""
    return min(max(u, at.low_u), at.high_u), min(max(v, at.low_v), at.high_v)


@kernel
def minimum_in(piece, nets, limits, p, at, u, v, distance, share, spare, slack):
    """Find a point nearest to p among those near by, in a rectangle of a piece, from u and v on.

    Returns its distance, metres, and its u and v; a lower bound of the distance to the whole
    rectangle, minus infinity if it is too poor to go on from; the part of the rectangle that may
    hold its nearest point; and whether that part is better halved in u. The search ends if nothing
    in the rectangle is nearer than `distance`, or than its own result, by more than the tolerance:
    a share of that distance or `spare` metres, whichever is larger.
    """
    u, v = _within(at, u, v)
    squared, damping, bound = np.inf, 0.0, -np.inf
    gu = gv = a = b = c = aa = cc = 0.0
    in_u = True
    new_u, new_v = u, v
    beyond = distance - _NEARER * max(share * distance, spare)
    for turn in range(_NEWTON):
        jet = jet_at(piece, nets, new_u, new_v)
        place, du, dv, duu, duv, dvv = jet
        way = sub(place, p)
        new_squared = dot(way, way)
        if new_squared < squared:
            u, v, squared = new_u, new_v, new_squared
            found = np.sqrt(squared)
            least = min(distance, found)
            least -= max(share * least, spare)
            done = bound >= least or found >= beyond  # else one more step improves it
            here, at, in_u = bound_at(piece, limits, jet, way, at, u, v, slack)
            bound = max(bound, here)
            if done and (bound >= least or turn > 0 or bound == -np.inf):
                break
            gu, gv, aa, cc = dot(way, du), dot(way, dv), dot(du, du), dot(dv, dv)
            a, b, c = aa + dot(way, duu), dot(du, dv) + dot(way, duv), cc + dot(way, dvv)
            damping = 0.1 * damping if damping > 1e-6 else 0.0
        else:
            damping = max(1e-3, 10.0 * damping)
        held_u = (u <= at.low_u and gu >= 0.0) or (u >= at.high_u and gu <= 0.0)
        held_v = (v <= at.low_v and gv >= 0.0) or (v >= at.high_v and gv <= 0.0)
        step_u = step_v = 0.0
        while True:
            d, f = a + damping * aa, c + damping * cc
            under = d * f - b * b
            if not held_u and not held_v and d > 0.0 and under > 1e-14 * d * f:
                step_u, step_v = (b * gv - f * gu) / under, (b * gu - d * gv) / under
            elif held_v and not held_u and d > 0.0:
                step_u = -gu / d
            elif held_u and not held_v and f > 0.0:
                step_v = -gv / f
            elif not (held_u and held_v) and damping < 1e9:
                damping = max(1e-3, 10.0 * damping)
                continue
            break
        new_u, new_v = _within(at, u + step_u, v + step_v)
        gain = -gu * (new_u - u) - gv * (new_v - v)
        if not gain > _LEAST_STEP * squared:
            break
    if at.low_u == at.high_u or at.low_v == at.high_v:
        in_u = at.low_u < at.high_u
    return np.sqrt(squared), u, v, bound, at, in_u


@inlined
def half_of(at, half, in_u):
    """Return half 0 or 1 of a rectangle, halved in u or in v."""
    if in_u:
        u = 0.5 * (at.low_u + at.high_u)
        low, high = (at.low_u, u) if half == 0 else (u, at.high_u)
        return Rectangle(low, high, at.low_v, at.high_v)
    v = 0.5 * (at.low_v + at.high_v)
    low, high = (at.low_v, v) if half == 0 else (v, at.high_v)
    return Rectangle(at.low_u, at.high_u, low, high)
