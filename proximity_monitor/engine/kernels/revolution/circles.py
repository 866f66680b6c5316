"""The distance of two circles in space, with proven bounds however they lie.

Let circle A have the radius R around the axis z, at the height z_A. A point p(t) of circle B, of
the radius r, is at the height h(t) above A's plane and as far as rho(t) from A's axis. Its distance
from A is d(t), with

    d² = h² + (rho - R)².

So the distance is the least value of a function of one angle (Vranek 2002). It has as many as four
minima, and no angle to begin with is safe. Here the angles are cut into cells, on each of which d²
is bounded by its value and its slope in the middle and the least value of its second derivative. A
cell on which that is positive has one minimum, which Newton's method finds; what may hold something
nearer is halved. h and rho² are trigonometric polynomials of degree 1 and 2, whose coefficients
bound all their derivatives. For circles about one axis these vanish, and so does what the bounds
lose. A polynomial for the angle (Neff 1990) would have no coefficients left there.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import entry, inlined, kernel
from ..base.memory import table_on_stack
from ..base.rounding import DOUBLE_EPS, RIGID_TOLERANCE

Turn = namedtuple("Turn", "x y h square sway first second radius turned error noise")
"""How the points of circle B turn around A's axis: x, y and h (3,), the constant, and what cos t
and sin t are multiplied with; square (4,), the factors of cos t, sin t, cos 2t and sin 2t in rho²;
the amplitudes of h and of both degrees of rho²; R; how far a radian moves a point at most; metres
that a distance may err by; and square metres that a coefficient in `square` may."""

_CELLS = 16
_TABLE = 2.0 * np.pi / _CELLS * np.arange(_CELLS)
_COS, _SIN = np.cos(_TABLE), np.sin(_TABLE)
"""The cells to begin with, by their middles."""

_ROOM, _HALVINGS = 64, 40.0
"""Cells that may wait, more than halving ever makes of those; and the most halvings of one."""

_NEWTON, _STEP = 16, 0.4
"""Iterations, and the longest step of one, radians."""

_ERROR = 24.0 * DOUBLE_EPS
"""What rounding may do to a distance, as a share of all lengths together: moving a point errs by
11 u of them (see POINT_MARGIN), h and rho by 3 u more, their distance by 4 u."""

_NOISE = 16.0 * DOUBLE_EPS
"""What it may do to a coefficient of rho², a sum of two to four products, as a share of them."""

_WIDER = 1.0 + 1e-9
"""A half cell is taken for so much wider: more than rounding does to its middle."""

_LONGER = 1.0 + 2.0 * RIGID_TOLERANCE
"""By how much a pose may make a circle larger."""


@kernel
def turn_of(motion, turned, height_b, radius, height_a):
    """How a circle of B, of the radius `turned`, turns around one of A, of `radius`.

    Both are about their own frame's z, at those heights; `motion` (12,) moves B's frame into A's.
    """
    t, w, r = motion, height_b, turned
    x = (t[9] + w * t[2], r * t[0], r * t[1])
    y = (t[10] + w * t[5], r * t[3], r * t[4])
    h = (t[11] + w * t[8] - height_a, r * t[6], r * t[7])
    square = (
        2.0 * (x[0] * x[1] + y[0] * y[1]),
        2.0 * (x[0] * x[2] + y[0] * y[2]),
        0.5 * ((x[1] * x[1] + y[1] * y[1]) - (x[2] * x[2] + y[2] * y[2])),
        x[1] * x[2] + y[1] * y[2],
    )
    size = abs(t[9]) + abs(t[10]) + abs(t[11]) + abs(w) + abs(height_a) + r + radius
    return Turn(
        x, y, h, square,
        np.sqrt(h[1] * h[1] + h[2] * h[2]),
        np.sqrt(square[0] * square[0] + square[1] * square[1]),
        np.sqrt(square[2] * square[2] + square[3] * square[3]),
        radius, r * _LONGER, _ERROR * size, _NOISE * r * (2.0 * (abs(x[0]) + abs(y[0])) + r),
    )  # fmt: skip


@kernel
def circle_distance(turn, enough):
    """Bounds of the distance of two circles, and where on B it is least.

    What is farther than `enough` metres need not be known better than that. Returns (lower, upper,
    cos t, sin t), metres; the upper bound is that of this point of B.
    """
    cells = table_on_stack(_ROOM, 4, 0.0)
    nearest = np.inf
    c, s = 1.0, 0.0
    for k in range(_CELLS):
        cells[k, 0], cells[k, 1], cells[k, 2], cells[k, 3] = _COS[k], _SIN[k], np.pi / _CELLS, 0.0
        d, _, _ = _apart(turn, _COS[k], _SIN[k])
        if d < nearest:
            c, s, nearest = _COS[k], _SIN[k], d
    c, s, nearest = _descend(turn, c, s, nearest, np.pi)
    count, lower = _CELLS, np.inf
    while count > 0:
        count -= 1
        at, up, half, depth = cells[count, 0], cells[count, 1], cells[count, 2], cells[count, 3]
        beyond = min(nearest - turn.error, enough)
        d, h, rho = _apart(turn, at, up)
        bound = d - turn.turned * half
        if bound < beyond:
            bend = _least_bend(turn, at, up, h, rho, half)
            bound = max(bound, _least_near(turn, at, up, d, h, rho, bend, -half, half))
            if bound < beyond and bend > 0.0:
                other, away, d = _descend(turn, at, up, d, half)
                if d < nearest:
                    c, s, nearest = other, away, d
                aside = np.arctan2(away * at - other * up, other * at + away * up)
                d, h, rho = _apart(turn, other, away)
                low, high = -half - aside, half - aside
                bound = max(bound, _least_near(turn, other, away, d, h, rho, bend, low, high))
                beyond = min(beyond, bound)  # all that is left is rounding
        if bound < beyond and depth < _HALVINGS:
            half *= 0.5
            dc, ds = np.cos(half), np.sin(half)
            for _ in range(2):
                cells[count, 0], cells[count, 1] = at * dc - up * ds, up * dc + at * ds
                cells[count, 2], cells[count, 3] = half * _WIDER, depth + 1.0
                count, ds = count + 1, -ds
        else:
            lower = min(lower, bound)
    upper = nearest + turn.error
    return max(min(lower, nearest) - turn.error, 0.0), upper, c, s


@inlined
def _apart(turn, c, s):
    """The distance of a point of B from circle A, its height, and how far it is from A's axis."""
    x = turn.x[0] + turn.x[1] * c + turn.x[2] * s
    y = turn.y[0] + turn.y[1] * c + turn.y[2] * s
    h = turn.h[0] + turn.h[1] * c + turn.h[2] * s
    rho = np.sqrt(x * x + y * y)
    beside = rho - turn.radius
    return np.sqrt(h * h + beside * beside), h, rho


@inlined
def _slopes(turn, c, s):
    """The derivatives of h, the first and the second, and those of rho²."""
    h, g = turn.h, turn.square
    c2, s2 = (c - s) * (c + s), 2.0 * s * c
    return (
        h[2] * c - h[1] * s,
        -h[1] * c - h[2] * s,
        g[1] * c - g[0] * s + 2.0 * (g[3] * c2 - g[2] * s2),
        -g[0] * c - g[1] * s - 4.0 * (g[2] * c2 + g[3] * s2),
    )


@kernel
def _descend(turn, c, s, nearest, most):
    """Newton's method from an angle, no farther than `most` radians: where it ends, and d there."""
    gone = 0.0
    for _ in range(_NEWTON):
        _, h, rho = _apart(turn, c, s)
        h1, h2, g1, g2 = _slopes(turn, c, s)
        if not rho > 0.0:
            break
        rho1 = 0.5 * g1 / rho
        beside = rho - turn.radius
        slope = h * h1 + beside * rho1
        bend = h1 * h1 + h * h2 + rho1 * rho1 + beside * (0.5 * g2 - rho1 * rho1) / rho
        step = -slope / bend if bend > 0.0 else -_STEP * np.sign(slope)
        step = min(max(min(max(step, -_STEP), _STEP), -most - gone), most - gone)
        while True:
            dc, ds = np.cos(step), np.sin(step)
            other, away = c * dc - s * ds, s * dc + c * ds
            d, _, _ = _apart(turn, other, away)
            if d < nearest or abs(step) < 1e-9:
                break
            step *= 0.5
        if not d < nearest:
            break
        size = 1.0 / np.sqrt(other * other + away * away)
        c, s, nearest, gone = other * size, away * size, d, gone + step
    return c, s, nearest


@inlined
def _least_product(a, b, c, d):
    """The least product of a number from a to b and one from c to d."""
    return min(min(a * c, a * d), min(b * c, b * d))


@kernel
def _least_bend(turn, c, s, h, rho, half):
    """A lower bound of half the second derivative of d² within `half` radians of an angle.

    That is h'² + h h'' + rho'² + (rho - R) rho'', with rho'' = ((rho²)'' / 2 - rho'²) / rho.
    Minus infinity where rho may be too small to tell.
    """
    near = rho - turn.turned * half
    if not near > 0.1 * rho:
        return -np.inf
    far = rho + turn.turned * half
    h1, h2, g1, g2 = _slopes(turn, c, s)
    shift = turn.sway * half
    level = _least_product(h - shift, h + shift, h2 - shift, h2 + shift)
    level += max(abs(h1) - shift, 0.0) ** 2
    noise = 8.0 * turn.noise
    shift = (turn.first + 4.0 * turn.second) * half + noise
    least, most = 0.5 * max(abs(g1) - shift, 0.0) / far, 0.5 * (abs(g1) + shift) / near
    shift = (turn.first + 8.0 * turn.second) * half + noise
    low = (0.5 * (g2 - shift) - most * most) / (far if g2 - shift > 2.0 * most * most else near)
    high = (0.5 * (g2 + shift) - least * least) / (
        near if g2 + shift > 2.0 * least * least else far
    )
    beside = rho - turn.radius
    bend = turn.turned * half + turn.error
    return level + least * least + _least_product(beside - bend, beside + bend, low, high)


@kernel
def _least_near(turn, c, s, d, h, rho, bend, low, high):
    """A lower bound of d from `low` to `high` radians beside an angle, of which these are known.

    There d² is no less than f + f' x + bend x²; what rounding did to f is left out.
    """
    if not bend > -np.inf:
        return 0.0
    h1, _, g1, _ = _slopes(turn, c, s)
    beside = rho - turn.radius
    slope = 2.0 * h * h1 + beside * g1 / rho
    loose = turn.error * (2.0 * abs(h1) + abs(g1) / rho)
    loose += 4.0 * turn.noise * abs(beside) / rho + 8.0 * DOUBLE_EPS * abs(h) * turn.sway
    wide = max(abs(low), abs(high))
    least = min(slope * low + bend * low * low, slope * high + bend * high * high)
    if bend > 0.0 and low * bend < -0.5 * slope < high * bend:
        least = -0.25 * slope * slope / bend
    least = min(least, 0.0) - loose * wide
    return np.sqrt(max(d * d + least, 0.0))


@entry
def circles_apart(motion, turned, height_b, radius, height_a):
    """Bounds of the distance of two circles, metres, and cos t and sin t: see `turn_of`."""
    return circle_distance(turn_of(motion, turned, height_b, radius, height_a), np.inf)
