"""The nearest point of a part to a given one: Newton's method, and a proof that none is nearer.

Let F = |S - p|² / 2 for a point p and the points S of a part. With g its gradient and

    F_uu = S_u² + (S - p) S_uu,   F_uv = S_u S_v + (S - p) S_uv,

balls around the part's points and derivatives bound both all over it (see derivatives.py).

- Where F_u has one sign, F is least where u ends: then u is held there, and v alone is left.
- Where F_uu >= a, F_vv >= b and |F_uv| <= h, the Hessian is at least diag(a - h t, b - h / t) for
  any t > 0, as 2 |x y| <= t x² + y² / t. So from one point of the part to any other, by steps d,

      F >= F_0 + sum of g_i d_i + a_i d_i² / 2,

  of which each term has a least value in closed form. If these a_i are positive, that is F itself
  at the minimum, but for e² / 2 a where the gradient errs by e: so such a part needs no division,
  however near p is. Where another point is nearer than the part, the first step often tells, even
  if the a_i are negative.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import inlined, kernel
from ..base.vectors import dot, sub
from .evaluate import jet_at

Rectangle = namedtuple("Rectangle", "low_u high_u low_v high_v bend_u bend_v")
"""Where a minimum is looked for, in a piece's parameters. The Hessian of F is no less than the
diagonal matrix of both bends."""

_NEWTON = 16
_LEAST_STEP = 1e-15
"""Iterations; and the share of the squared distance below which a step's gain is nothing."""

_NEARER = 0.25
"""Share of what is tolerated that a point must be nearer by for a search from there on, where the
Hessian may be negative."""

_LOSS = 1e-9
"""Share of a Hessian's bounds by which rounding may have changed them."""


@inlined
def _slopes(place, away, reach, ball):
    """The middle of a product's range, that of vectors to a place with those of a ball; its half.

    The vectors are as long as `away`, and within `reach`.
    """
    middle = dot(place.middle, ball.middle)
    return middle, away * ball.spread + reach * (ball.length + ball.spread)


@kernel
def rectangle_of(part, low_u, high_u, low_v, high_v, error):
    """The rectangle of a part whose derivatives are `part`, its place as seen from a point.

    Or no more of it than what holds its nearest point. `error` is what rounding did to its place.
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
    a = b = 0.0
    if not flat_u:
        least = max(u.length * (1.0 - 4.0 * _LOSS) - u.spread, 0.0)
        bend, loss = _slopes(place, away, reach, part.uu)
        a = least * least + bend - loss
    if not flat_v:
        least = max(v.length * (1.0 - 4.0 * _LOSS) - v.spread, 0.0)
        bend, loss = _slopes(place, away, reach, part.vv)
        b = least * least + bend - loss
    if not (flat_u or flat_v):
        bend, loss = _slopes(place, away, reach, part.uv)
        h = abs(dot(u.middle, v.middle) + bend) + loss
        h += u.length * v.spread + v.length * u.spread + u.spread * v.spread
        t = np.sqrt(a / b) if a > 0.0 and b > 0.0 else 1.0
        a, b = a - h * t - _LOSS * (abs(a) + h * t), b - h / t - _LOSS * (abs(b) + h / t)
    if not flat_u:
        a /= wide_u * wide_u
    if not flat_v:
        b /= wide_v * wide_v
    return Rectangle(low_u, high_u, low_v, high_v, a, b)


@inlined
def _least_rise(slope, error, bend, low, high):
    """The least of slope d + bend d² / 2 for steps d from low to high, slope being right to error.

    low is not positive, high not negative; nor is the result positive.
    """
    up, down, back = slope - error, -slope - error, -low
    d, e = high, back
    if bend > 0.0:
        d, e = min(max(-up / bend, 0.0), high), min(max(-down / bend, 0.0), back)
    return min(min(d * (up + 0.5 * bend * d), e * (down + 0.5 * bend * e)), 0.0)


@kernel
def bound_at(piece, at, u, v, squared, gu, gv, aa, cc, slack):
    """A lower bound of the distance to all of a rectangle from what is known at one of its points.

    A derivative errs by no more than `piece.slope` times its degree times what a point does, which
    is within `slack`; that is doubled for what products and sums lose.
    """
    if not (at.bend_u > -np.inf and at.bend_v > -np.inf):
        return -np.inf
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
    the distance to all of that. The search ends where nothing in it is nearer than `distance`, or
    than its result, by more than a share of that and what is spared, metres.
    """
    u, v = min(max(u, at.low_u), at.high_u), min(max(v, at.low_v), at.high_v)
    squared, damping, bound = np.inf, 0.0, -np.inf
    gu = gv = a = b = c = aa = cc = 0.0
    new_u, new_v = u, v
    convex = (at.bend_u > 0.0 or at.low_u == at.high_u) and (
        at.bend_v > 0.0 or at.low_v == at.high_v
    )
    beyond = distance - _NEARER * max(share * distance, spare)
    for turn in range(_NEWTON):
        place, du, dv, duu, duv, dvv = jet_at(piece, nets, new_u, new_v)
        way = sub(place, p)
        new_squared = dot(way, way)
        if new_squared < squared:
            u, v, squared = new_u, new_v, new_squared
            gu, gv, aa, cc = dot(way, du), dot(way, dv), dot(du, du), dot(dv, dv)
            a, b, c = aa + dot(way, duu), dot(du, dv) + dot(way, duv), cc + dot(way, dvv)
            damping = 0.1 * damping if damping > 1e-6 else 0.0
            found = np.sqrt(squared)
            if turn == 0 and not (convex or found < beyond):
                return found, u, v, bound_at(piece, at, u, v, squared, gu, gv, aa, cc, slack)
            least = min(distance, found)
            least -= max(share * least, spare)
            done = bound >= least or found >= beyond  # else it is made better by one more step
            bound = max(bound, bound_at(piece, at, u, v, squared, gu, gv, aa, cc, slack))
            if done and bound >= least:
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
