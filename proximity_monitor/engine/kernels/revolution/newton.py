"""Newton's method for the nearest points of two pieces of turning profiles.

Its unknowns are s on a's piece, t on b's, and b's angle; a's angle is that of b's point about a's
axis: see `bound`. The method makes upper bounds only, so any result is valid. If a parameter is at
an end of its range and the gradient presses it outwards, it is held there. If the Hessian is not
positive, it is made so (Levenberg 1944, Marquardt 1963).
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from .profile import jet_of

_MOST, _TRIALS = 24, 8
"""Iterations, and trials of a step, at most."""

_LEAST = 2e-16
"""A step that gains no more than this share of the squared distance is the last: rounding does as
much."""

_ROUNDED = 1e-14
"""Share of the squared distance by which rounding may increase it."""

_SPARE = 1e-7
"""A step that gains no more than this share of the tolerance is the last. The direction between the
points has to be far more exact than the distance: with 1e-4, twice as many bounds are needed."""

_PARALLEL = 1e-6
"""Square of the sine of the axes' tilt above which two straight pieces make no valley."""

_WIDEST = 0.7
"""The largest step of the angle, radians."""


@inlined
def to_a(motion, x, y, z):
    """Turn a vector of b's frame into a's."""
    return (
        motion[0] * x + motion[1] * y + motion[2] * z,
        motion[3] * x + motion[4] * y + motion[5] * z,
        motion[6] * x + motion[7] * y + motion[8] * z,
    )


@inlined
def to_b(motion, v):
    """Turn a vector of a's frame into b's."""
    return (
        motion[0] * v[0] + motion[3] * v[1] + motion[6] * v[2],
        motion[1] * v[0] + motion[4] * v[1] + motion[7] * v[2],
        motion[2] * v[0] + motion[5] * v[1] + motion[8] * v[2],
    )


@kernel
def derivatives_at(curve_a, curve_b, motion, s, t, angle):
    """Return the vector d in a's plane from a's point to b's, and derivatives of its rho and z.

    Returns d; b's distance from a's axis and the cosine and sine of its azimuth there; the first
    derivatives of d by s, t and the angle; the second derivatives of b's point by t twice, t and
    the angle, and the angle twice; the second derivative of a's point; the parts of b's first
    derivatives perpendicular to the half-plane; and b's distance from its own axis and its two
    derivatives by t.
    """
    (rho, height), (rho_s, z_s), second = jet_of(curve_a, s)
    (r, z), (r1, z1), (r2, z2) = jet_of(curve_b, t)
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y, h = to_a(motion, r * cosine, r * sine, z)
    x, y, h = x + motion[9], y + motion[10], h + motion[11]
    far = np.sqrt(x * x + y * y)
    ex, ey = 1.0, 0.0
    if far > 0.0:
        ex, ey = x / far, y / far
    inverse = 1.0 / far if far > 0.0 else 0.0
    t0, t1, tz = to_a(motion, r1 * cosine, r1 * sine, z1)
    a0, a1, az = to_a(motion, -r * sine, r * cosine, 0.0)
    tt0, tt1, ttz = to_a(motion, r2 * cosine, r2 * sine, z2)
    ta0, ta1, taz = to_a(motion, -r1 * sine, r1 * cosine, 0.0)
    aa0, aa1, aaz = to_a(motion, -r * cosine, -r * sine, 0.0)
    rho_t, rho_a = ex * t0 + ey * t1, ex * a0 + ey * a1
    across_t, across_a = ex * t1 - ey * t0, ex * a1 - ey * a0
    rho_tt = ex * tt0 + ey * tt1 + across_t * across_t * inverse
    rho_ta = ex * ta0 + ey * ta1 + across_t * across_a * inverse
    rho_aa = ex * aa0 + ey * aa1 + across_a * across_a * inverse
    return (
        (far - rho, h - height), (far, ex, ey),
        ((-rho_s, -z_s), (rho_t, tz), (rho_a, az)),
        ((rho_tt, ttz), (rho_ta, taz), (rho_aa, aaz)), second, (across_t, across_a), (r, r1, r2),
    )  # fmt: skip


@inlined
def _solved(h, damping, g):
    """Return whether H + damping is positive definite, and the step -(H + damping)^-1 g."""
    h00, h10, h11, h20, h21, h22 = h
    least = 1e-14 * (abs(h00) + abs(h11) + abs(h22))
    none = (0.0, 0.0, 0.0)
    d0 = h00 + damping
    if not d0 > least:
        return False, none
    l10, l20 = h10 / d0, h20 / d0
    d1 = h11 + damping - l10 * h10
    if not d1 > least:
        return False, none
    m = h21 - l10 * h20
    l21 = m / d1
    d2 = h22 + damping - l20 * h20 - l21 * m
    if not d2 > least:
        return False, none
    y0 = -g[0]
    y1 = -g[1] - l10 * y0
    y2 = -g[2] - l20 * y0 - l21 * y1
    x2 = y2 / d2
    x1 = y1 / d1 - l21 * x2
    return True, (y0 / d0 - l10 * x1 - l20 * x2, x1, x2)


@kernel
def nearest_rings(curve_a, curve_b, motion, s, t, angle, rel_err, abs_err):
    """Find the local minimum near s, t and an angle; return its distance, metres, s, t and angle.

    The search ends when the next step would gain little compared with the tolerance.
    """
    damping = 0.0
    found = derivatives_at(curve_a, curve_b, motion, s, t, angle)
    squared = found[0][0] * found[0][0] + found[0][1] * found[0][1]
    for _ in range(_MOST):
        way, _, (f0, f1, f2), (tt, ta, aa), bend, _, _ = found
        g0 = way[0] * f0[0] + way[1] * f0[1]
        g1 = way[0] * f1[0] + way[1] * f1[1]
        g2 = way[0] * f2[0] + way[1] * f2[1]
        h00 = f0[0] * f0[0] + f0[1] * f0[1] - way[0] * bend[0] - way[1] * bend[1]
        h10 = f0[0] * f1[0] + f0[1] * f1[1]
        h20 = f0[0] * f2[0] + f0[1] * f2[1]
        h11 = f1[0] * f1[0] + f1[1] * f1[1] + way[0] * tt[0] + way[1] * tt[1]
        h21 = f1[0] * f2[0] + f1[1] * f2[1] + way[0] * ta[0] + way[1] * ta[1]
        h22 = f2[0] * f2[0] + f2[1] * f2[1] + way[0] * aa[0] + way[1] * aa[1]
        scale = abs(h00) + abs(h11) + abs(h22)
        if (s <= 0.0 and g0 > 0.0) or (s >= 1.0 and g0 < 0.0):
            g0, h00, h10, h20 = 0.0, scale, 0.0, 0.0
        if (t <= 0.0 and g1 > 0.0) or (t >= 1.0 and g1 < 0.0):
            g1, h11, h10, h21 = 0.0, scale, 0.0, 0.0
        better = False
        for _ in range(_TRIALS):
            positive, step = _solved((h00, h10, h11, h20, h21, h22), damping, (g0, g1, g2))
            if positive:
                # The squared distance falls by this gain if it is nearly quadratic.
                gain = -(g0 * step[0] + g1 * step[1] + g2 * step[2])
                distance = np.sqrt(squared)
                tolerated = 2.0 * distance * max(abs_err, rel_err * distance)
                last = gain <= max(_LEAST * squared, _SPARE * tolerated)
                new_s = min(max(s + step[0], 0.0), 1.0)
                new_t = min(max(t + step[1], 0.0), 1.0)
                new_angle = angle + min(max(step[2], -_WIDEST), _WIDEST)
                trial = derivatives_at(curve_a, curve_b, motion, new_s, new_t, new_angle)
                way = trial[0]
                new = way[0] * way[0] + way[1] * way[1]
                if last:  # it reduces the gradient much, even if not the distance
                    if new <= squared * (1.0 + _ROUNDED):
                        return np.sqrt(new), new_s, new_t, new_angle
                    return np.sqrt(squared), s, t, angle
                if new < squared:
                    squared, better, found = new, True, trial
                    s, t, angle = new_s, new_t, new_angle
                    damping = 0.1 * damping if damping > 1e-6 * scale else 0.0
                    break
            damping = max(4.0 * damping, 1e-3 * scale)
        if not better:
            break
    return np.sqrt(squared), s, t, angle


@kernel
def nearest_at_ends(curve_a, curve_b, motion, found, rel_err, abs_err):
    """Return the nearest of a minimum from `nearest_rings` and those at the ends of two lines.

    Between lines that are about parallel the distance has a valley, along which Newton's method
    hardly moves: the minimum is at one of the valley's ends.
    """
    _, s, t, angle = found
    valley = curve_a.degree == 1 and curve_b.degree == 1 and 0.0 < s < 1.0 and 0.0 < t < 1.0
    if not valley or motion[2] * motion[2] + motion[5] * motion[5] > _PARALLEL:
        return found
    for end in (0.0, 1.0):
        (rho, z), _, _ = jet_of(curve_a, end)
        beside = _beside(curve_b, rho, (z - motion[11]) * motion[8])
        if 0.0 <= beside <= 1.0:
            trial = nearest_rings(curve_a, curve_b, motion, end, beside, angle, rel_err, abs_err)
            if trial[0] < found[0]:
                found = trial
        (rho, z), _, _ = jet_of(curve_b, end)
        beside = _beside(curve_a, rho, z * motion[8] + motion[11])
        if 0.0 <= beside <= 1.0:
            trial = nearest_rings(curve_a, curve_b, motion, beside, end, angle, rel_err, abs_err)
            if trial[0] < found[0]:
                found = trial
    return found


@inlined
def _beside(curve, rho, z):
    """Return the parameter at the foot of a point of the half-plane on a straight piece's line."""
    (x0, z0), (x, y), _ = jet_of(curve, 0.0)
    return ((rho - x0) * x + (z - z0) * y) / max(x * x + y * y, 1e-300)
