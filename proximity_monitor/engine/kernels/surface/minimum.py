"""The nearest point of a part to a given one: Newton's method, and a proof that none is nearer.

Let F = |S - p|² / 2 for a point p and the points S of a part. With g its gradient and

    F_uu = S_u² + (S - p) S_uu,   F_uv = S_u S_v + (S - p) S_uv,

balls around the part's points and derivatives bound both all over it (see derivatives.py).

- Where F_u has one sign, F is least where u ends: then u is held there, and v alone is left.
- Where F_uu >= a > 0, F_vv >= b > 0 and |F_uv| <= h with r = h / sqrt(a b) < 1, the Hessian is at
  least (1 - r) times diag(a, b), as 2 h |x y| <= r (a x² + b y²). So for any point of the part and
  steps d from there to another of its points,

      F >= F_0 + sum of g_i d_i + (1 - r) a_i d_i² / 2,

  of which each term has a least value in closed form. At the minimum that is F itself, whatever the
  gradient's rounding e is, but for e² / 2 a: such a part needs no division, however near p is. Where
  the parts are farther than another point that was found, the first step often tells.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import inlined, kernel
from ..base.vectors import dot, sub
from .evaluate import jet_at

Rectangle = namedtuple("Rectangle", "low_u high_u low_v high_v bend_u bend_v")
"""Where a minimum is looked for, in a piece's parameters. The Hessian is no less than the diagonal
matrix of both bends, where these are known; else these are negative, and no bound is found."""

_NEWTON = 16
_LEAST_STEP = 1e-15
"""Iterations; and the share of the squared distance below which a step's gain is nothing."""

_FULL = 1.0 - 1e-9
_TWIST = 0.999
"""The largest r (see above) that is of use."""


@kernel
def everywhere(piece):
    """The rectangle of a piece, with no proof."""
    return Rectangle(0.0, 1.0, 0.0, 1.0 if piece.degree_v > 0 else 0.0, -1.0, -1.0)


@inlined
def _slopes(place, away, reach, ball):
    """The middle of a product's range, that of vectors to a place with those of a ball; its half.

    The vectors are as long as `away`, and within `reach`.
    """
    middle = dot(place.middle, ball.middle)
    return middle, away * ball.spread + reach * (ball.length + ball.spread)


@kernel
def proven(part, low_u, high_u, low_v, high_v, error):
    """The rectangle of a part whose derivatives are `part`, its place as seen from a point.

    It is as large as the part, or no larger than what holds its nearest point. Bends are known, if
    that can be proven of the part. `error` is what rounding did to its place.
    """
    place, u, v = part.place, part.u, part.v
    away, reach = place.length, place.spread + error
    wide_u, wide_v = high_u - low_u, high_v - low_v
    flat_u, flat_v = False, wide_v == 0.0
    slope, loss = _slopes(place, away, reach, u)
    if slope > loss:
        high_u, flat_u = low_u, True
    elif slope < -loss:
        low_u, flat_u = high_u, True
    if not flat_v:
        slope, loss = _slopes(place, away, reach, v)
        if slope > loss:
            high_v, flat_v = low_v, True
        elif slope < -loss:
            low_v, flat_v = high_v, True
    a = b = 1.0
    if not flat_u:
        least = max(u.length * (1.0 - 4e-9) - u.spread, 0.0)
        bend, loss = _slopes(place, away, reach, part.uu)
        a = least * least + bend - loss
    if not flat_v:
        least = max(v.length * (1.0 - 4e-9) - v.spread, 0.0)
        bend, loss = _slopes(place, away, reach, part.vv)
        b = least * least + bend - loss
    if not (a > 0.0 and b > 0.0):
        return Rectangle(low_u, high_u, low_v, high_v, -1.0, -1.0)
    share = _FULL
    if not (flat_u or flat_v):
        bend, loss = _slopes(place, away, reach, part.uv)
        h = abs(dot(u.middle, v.middle) + bend) + loss
        h += u.length * v.spread + v.length * u.spread + u.spread * v.spread
        twist = h / np.sqrt(a * b)
        if not twist < _TWIST:
            return Rectangle(low_u, high_u, low_v, high_v, -1.0, -1.0)
        share -= twist
    a = 1.0 if flat_u else share * a / (wide_u * wide_u)
    b = 1.0 if flat_v else share * b / (wide_v * wide_v)
    return Rectangle(low_u, high_u, low_v, high_v, a, b)


@inlined
def _least_rise(slope, error, bend, low, high):
    """The least of slope d + bend d² / 2 for steps d from low to high, slope being right to error.

    low is not positive, high not negative; nor is the result positive.
    """
    down, up = slope - error, -slope - error
    d = min(max(-down / bend, 0.0), high)
    least = d * (down + 0.5 * bend * d)
    d = min(max(-up / bend, 0.0), -low)
    return min(least, d * (up + 0.5 * bend * d))


@kernel
def bound_at(piece, at, u, v, squared, gu, gv, aa, cc, slack):
    """A lower bound of the distance to all of a rectangle from what is known at one of its points.

    A derivative errs by no more than `piece.slope` times its degree times what a point does, which
    is within `slack`; that is doubled for what products and sums lose.
    """
    distance = np.sqrt(squared)
    turn = 2.0 * slack * distance * piece.slope
    error_u = 2.0 * slack * np.sqrt(aa) + turn * piece.degree_u
    error_v = 2.0 * slack * np.sqrt(cc) + turn * piece.degree_v
    less = _least_rise(gu, error_u, at.bend_u, at.low_u - u, at.high_u - u)
    less += _least_rise(gv, error_v, at.bend_v, at.low_v - v, at.high_v - v)
    return np.sqrt(max(squared + 2.0 * less, 0.0)) - slack


@kernel
def minimum_in(piece, nets, p, at, u, v, distance, share, spare, slack):
    """The distance from p, metres, and the parameters, of a point nearest among those near by.

    It is looked for in a rectangle of a piece, from u and v on. The last number is a lower bound of
    the distance to all of that, or minus infinity. The search ends where nothing in it is nearer
    than `distance`, or than its result, by more than a share of that and what is spared, metres.
    """
    u, v = min(max(u, at.low_u), at.high_u), min(max(v, at.low_v), at.high_v)
    squared, damping, bound = np.inf, 0.0, -np.inf
    gu = gv = a = b = c = aa = cc = 0.0
    new_u, new_v = u, v
    for _ in range(_NEWTON):
        place, du, dv, duu, duv, dvv = jet_at(piece, nets, new_u, new_v)
        way = sub(place, p)
        new_squared = dot(way, way)
        if squared == np.inf and not (at.bend_u > 0.0 or new_squared < distance * distance):
            return np.sqrt(new_squared), u, v, bound
        if new_squared < squared:
            u, v, squared = new_u, new_v, new_squared
            gu, gv, aa, cc = dot(way, du), dot(way, dv), dot(du, du), dot(dv, dv)
            a, b, c = aa + dot(way, duu), dot(du, dv) + dot(way, duv), cc + dot(way, dvv)
            damping = 0.1 * damping if damping > 1e-6 else 0.0
            if at.bend_u > 0.0:
                bound = max(bound, bound_at(piece, at, u, v, squared, gu, gv, aa, cc, slack))
                least = min(distance, np.sqrt(squared))
                if bound >= least - max(share * least, spare):
                    break
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
        new_u = min(max(u + step_u, at.low_u), at.high_u)
        new_v = min(max(v + step_v, at.low_v), at.high_v)
        gain = -gu * (new_u - u) - gv * (new_v - v)
        if not gain > _LEAST_STEP * squared:
            break
    return np.sqrt(squared), u, v, bound
