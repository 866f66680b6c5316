"""A proof that a local minimum of two turning profiles is the only one in a box around it.

Let d be the vector in a's plane from a's point to b's, n its direction at the minimum x, and tau
the part of d perpendicular to n. Then |d| >= n . d + tau² / 2 U wherever |d| <= U. Expanded at x,
n . d is its tangent plane plus half the quadratic form of a mean of its second derivatives, and tau
is a mean of its derivatives times the step. If the sum of both forms is positive for all means that
are possible over the box, |d| is nowhere less than the tangent plane at x or than U, whichever is
less. At x the derivatives are known; limits of the next derivatives tell how much they may change
over the box. A parameter at the end of its range stays fixed if |d| does not fall along it anywhere
in the box.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from .newton import derivatives_at

_SHARES = 4
"""How many shares of tau² / 2 U are tried: none, all, a fifth, and last a share that makes up for
how t and the angle bend n . d together. A larger share makes the Hessian more positive, but the
Hessian may then also change more."""

_SPARE_SHARE = 4.0
"""The last share tried is this many times the share that just makes up for that bend."""

_LEAST = 0.2
"""b's distance from a's axis has to stay above this share of its value at the minimum."""

SPARE = 1e-9
"""Share of a diagonal entry of the Hessian by which the entry is lowered: more than all
rounding."""

_TILTED = 1e-15
"""How much more the axes may be tilted than a rounded motion says."""

LOST = 1e-13
"""How much rounding changes a derivative, at most, as a share of the derivative's limit."""


@inlined
def _positive(h, v, free_s, free_t):
    """Return whether a symmetric matrix stays positive definite if its entries change by up to `v`.

    The rows of s and t are left out if these are not free.
    """
    h00, h10, h11, h20, h21, h22 = h
    v00, v10, v11, v20, v21, v22 = v
    a, b, c = h00 - v00 - v20, h11 - v11 - v21, h22 - v22
    if free_s and free_t:
        a, b = a - v10, b - v10
    if free_s:
        c -= v20
    else:
        a, h10, h20 = 1.0, 0.0, 0.0
    if free_t:
        c -= v21
    else:
        b, h10, h21 = 1.0, 0.0, 0.0
    a -= SPARE * abs(h00)
    b -= SPARE * abs(h11)
    c -= SPARE * abs(h22)
    if not a > 0.0:
        return False
    p, q = h10 / a, h20 / a
    b -= p * h10
    if not b > 0.0:
        return False
    m = h21 - p * h20
    return c - q * h20 - m * m / b > 0.0


@inlined
def _lost_across(h, v, g_t, g_a, end_t):
    """Return by how much n . d may fall over t and the angle, each from -1 to 1; or infinity.

    Between two lines that are about parallel, n . d need not rise along t. For each t, n . d is no
    less than its value at the middle of the angle minus the square of its slope there over twice
    the least curvature k. The slope is at most g_a plus what t adds to it, and the square of that
    sum is at most twice the sum of the squares. If t is at an end, `end_t`, n . d rises from there
    with the slope g_t, which makes up for the loss by the square of t.
    """
    curved = h[5] - v[5] - SPARE * abs(h[5])
    if not curved > 0.0:
        return np.inf
    both = abs(h[4]) + v[4]
    bent = 0.5 * max(v[2] - h[2], 0.0) + both * both / curved
    across = max(bent - abs(g_t), 0.0) if end_t else bent + abs(g_t)
    return across + g_a * g_a / curved


@kernel
def least_around(curve_a, curve_b, arc_a, arc_b, motion, minimum, box, upper, wanted):
    """Return a lower bound of the distance over a box around a minimum, at most `upper`; or -1.

    Args:
        curve_a: a's piece.
        curve_b: b's piece.
        arc_a: an arc of a; the limits of its derivatives hold over the box.
        arc_b: the same of b.
        motion: (12,) from b's frame to a's.
        minimum: s, t and the angle; near a minimum, or at the end of a range.
        box: the lowest and highest s, then t, and how far the angle may differ either way.
        upper: metres; larger distances do not matter.
        wanted: metres; the bound that the caller needs.
    """
    s, t, angle = minimum
    a0, a1, b0, b1, ra = box
    way, (far, _, _), first, second, bend, across, radii = derivatives_at(
        curve_a, curve_b, motion, s, t, angle
    )
    distance = (way[0] * way[0] + way[1] * way[1]) ** 0.5
    if not distance > 0.0:
        return -1.0
    n0, n1 = way[0] / distance, way[1] / distance
    rs, rt = max(a1 - s, s - a0), max(b1 - t, t - b0)
    if not (rs > 0.0 and rt > 0.0 and ra > 0.0):
        return -1.0
    la, lb = arc_a.limits, arc_b.limits
    # Limits over the box: r0, r1 and r2 of b's distance from its axis and its derivatives by t; c1
    # and c2 of the parts of b's derivatives across a's axis. `moved` is how far b moves across a's
    # axis.
    r1, r2 = min(abs(radii[1]) + lb[1] * rt, lb[0]), min(abs(radii[2]) + lb[2] * rt, lb[1])
    r0 = abs(radii[0]) + r1 * rt
    tilt = (motion[2] * motion[2] + motion[5] * motion[5]) ** 0.5 + _TILTED
    c1, c2 = min(r1 + tilt * lb[0], lb[0]), min(r2 + tilt * lb[1], lb[1])
    moved = c1 * rt + r0 * ra
    least = far - moved
    if not least > _LEAST * far:
        return -1.0
    turn = moved / least
    (t0, t1), (ta0, ta1), (aa0, aa1) = first[1], second[1], second[2]
    d_t, d_a = lb[1] * rt + r1 * ra, r1 * rt + r0 * ra
    d_tt, d_ta, d_aa = lb[2] * rt + r2 * ra, r2 * rt + r1 * ra, r1 * rt + r0 * ra
    pt, pa = abs(across[0]), abs(across[1])
    d_pt, d_pa = d_t + turn * c1, d_a + turn * r0
    inverse = 1.0 / least
    d_inverse = inverse - 1.0 / (far + moved)
    most_t, most_a = pt + d_pt, pa + d_pa
    v_tt = d_tt + turn * c2 + (2.0 * pt + d_pt) * d_pt * inverse + most_t * most_t * d_inverse
    v_ta = d_ta + turn * r1 + (pt * d_pa + pa * d_pt + d_pt * d_pa) * inverse
    v_ta += most_t * most_a * d_inverse
    v_aa = d_aa + turn * r0 + (2.0 * pa + d_pa) * d_pa * inverse + most_a * most_a * d_inverse
    v_tt += LOST * (r2 + c1 * c1 * inverse)
    v_ta += LOST * (r1 + c1 * r0 * inverse)
    v_aa += LOST * (r0 + r0 * r0 * inverse)
    (s0, s1), (h0, h1), (tt0, tt1) = first[0], first[2], second[0]
    g_s, g_t, g_a = n0 * s0 + n1 * s1, n0 * t0 + n1 * t1, n0 * h0 + n1 * h1
    # The parts perpendicular to n.
    b_s, b_t, b_a = n0 * s1 - n1 * s0, n0 * t1 - n1 * t0, n0 * h1 - n1 * h0
    d_s, d_bt, d_ba = la[1] * rs, d_t + turn * lb[0], d_a + turn * r0
    g_s, g_t, g_a = g_s * rs, g_t * rt, g_a * ra
    for k in range(_SHARES):
        mu = (0.0 if k == 0 else (1.0 if k == 1 else 0.2)) / max(upper, distance)
        if k == _SHARES - 1:
            both, around = abs(n0 * ta0 + n1 * ta1) + v_ta, n0 * aa0 + n1 * aa1
            if not (around > 0.0 and _SPARE_SHARE * both * both < mu * around * b_t * b_t):
                break
            mu = _SPARE_SHARE * both * both / (around * b_t * b_t)
        h00 = mu * b_s * b_s - n0 * bend[0] - n1 * bend[1]
        v00 = la[2] * rs + mu * (2.0 * abs(b_s) + d_s) * d_s
        h11 = mu * b_t * b_t + n0 * tt0 + n1 * tt1
        v11 = v_tt + mu * (2.0 * abs(b_t) + d_bt) * d_bt
        h22 = mu * b_a * b_a + n0 * aa0 + n1 * aa1
        v22 = v_aa + mu * (2.0 * abs(b_a) + d_ba) * d_ba
        h10 = mu * b_s * b_t
        v10 = mu * (abs(b_s) * d_bt + abs(b_t) * d_s + d_s * d_bt)
        h20 = mu * b_s * b_a
        v20 = mu * (abs(b_s) * d_ba + abs(b_a) * d_s + d_s * d_ba)
        h21 = mu * b_t * b_a + n0 * ta0 + n1 * ta1
        v21 = v_ta + mu * (abs(b_t) * d_ba + abs(b_a) * d_bt + d_bt * d_ba)
        h = (
            h00 * rs * rs, h10 * rs * rt, h11 * rt * rt, h20 * rs * ra, h21 * rt * ra, h22 * ra * ra
        )  # fmt: skip
        v = (
            v00 * rs * rs, v10 * rs * rt, v11 * rt * rt, v20 * rs * ra, v21 * rt * ra, v22 * ra * ra
        )  # fmt: skip
        free_s, free_t = True, True
        # If a's piece is a line, n . d is linear in s.
        level = mu == 0.0 and la[1] == 0.0 and la[2] == 0.0
        if level:
            free_s = False
        elif (s <= a0 and g_s > 0.0) or (s >= a1 and g_s < 0.0):
            free_s = not abs(g_s) > 1.001 * (
                abs(h[0]) + v[0] + abs(h[1]) + v[1] + abs(h[3]) + v[3] + LOST * la[0] * rs
            )
        if (t <= b0 and g_t > 0.0) or (t >= b1 and g_t < 0.0):
            free_t = not abs(g_t) > 1.001 * (
                abs(h[2]) + v[2] + abs(h[1]) + v[1] + abs(h[4]) + v[4] + LOST * lb[0] * rt
            )
        rounded = LOST * (la[0] * rs + lb[0] * rt + r0 * ra)
        if level:
            end_t = (t <= b0 and g_t > 0.0) or (t >= b1 and g_t < 0.0)
            lost = _lost_across(h, v, g_t, abs(g_a) + LOST * r0 * ra, end_t) + rounded
            lost += max(-g_s * (a0 - s), -g_s * (a1 - s), 0.0) / rs
            if min(distance - lost, upper) >= wanted:
                return min(distance - lost, upper)
        if _positive(h, v, free_s, free_t):
            lost = abs(g_a) + rounded
            if free_s or level:
                lost += max(-g_s * (a0 - s), -g_s * (a1 - s), 0.0) / rs
            if free_t:
                lost += max(-g_t * (b0 - t), -g_t * (b1 - t), 0.0) / rt
            return min(distance - lost, upper)
    return -1.0
