"""Fat arcs: circular arcs, each as thick as it has to be to hold its part of the profile.

Sources: Sederberg, White and Zundel 1989; for bounds of solids of revolution Son, Yoon, Kim and
Elber 2020, sections 3 and 4. When a part is halved, the error of its arc falls to an eighth, that
of its chord only to a quarter. The reach of an arc along a direction is known exactly. So arcs need
not be smooth where they meet, as biarcs are: each arc runs through both ends and the middle of its
part.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.jit import kernel
from ..base.memory import on_stack, table_on_stack
from ..base.rounding import DOUBLE_EPS
from ..base.trees import NONE
from .profile import jet_of, put_part, size_of_part

_ROUNDING = 2048.0 * DOUBLE_EPS
"""What rounding may add to an arc's error, as a share of a length P.

P is the largest coordinate of a point of the profile, and of the control points of the part if all
coordinates were positive (see `size_of_part`): those of a whole piece may be far from it.
De Casteljau's method moves control points by less than 4 u P for each degree and direction, that is
120 u P. The middle point and the chord err by as much. In the chord's own frame, the squared
distance from the centre errs by less than 64 u times the squared length of the chord. The quotient
by the radius, which is at least half the chord, errs by less than 128 u P.
"""

_CURVED, _BENT = 1e-7, 0.1
"""An arc that bulges by no more than _CURVED of half its chord is replaced by the chord. So is an
arc whose half angle has a cosine of no more than _BENT: it is too large a part of a circle to be
useful."""

_CHOOSE = np.array([[float(math.comb(n, k)) for k in range(31)] for n in range(31)])


@kernel
def fit_arc(curve, low, high, size, arc):
    """Fit a fat arc to a part of a piece and write it to `arc`.

    `size`, metres, is no less than the largest coordinate of a point of the profile.
    """
    size = size_of_part(curve, low, high, size)
    rows = table_on_stack(16, 3, 0.0)
    put_part(curve, low, high, rows)
    degree = curve.degree
    last = rows[degree, 2]
    x0, z0 = rows[0, 0] / rows[0, 2], rows[0, 1] / rows[0, 2]
    x1, z1 = rows[degree, 0] / last, rows[degree, 1] / last
    mx, mz, hx, hz = 0.5 * (x0 + x1), 0.5 * (z0 + z1), 0.5 * (x1 - x0), 0.5 * (z1 - z0)
    half = np.sqrt(hx * hx + hz * hz)
    arc.middle[0], arc.middle[1], arc.half[0], arc.half[1] = mx, mz, hx, hz
    arc.sine, arc.cosine, arc.low, arc.high = 0.0, 1.0, low, high
    error, bulge = -1.0, 0.0
    if half > 64.0 * DOUBLE_EPS * size:
        ux, uz = hx / half, hz / half
        point, _, _ = jet_of(curve, 0.5 * (low + high))
        along = (point[0] - mx) * ux + (point[1] - mz) * uz
        bulge = (point[1] - mz) * ux - (point[0] - mx) * uz
        if abs(bulge) > _CURVED * half:
            # In the chord's frame (along, across) the centre is at (0, across).
            across = (bulge * bulge + along * along - half * half) / (2.0 * bulge)
            radius = np.sqrt(half * half + across * across)
            side = 1.0 if bulge > 0.0 else -1.0
            if -across * side > _BENT * radius and _is_before(
                rows, degree, mx, mz, ux, uz, across, side
            ):
                arc.sine, arc.cosine = side * half / radius, -across * side / radius
                error = _arc_error(rows, degree, mx, mz, ux, uz, half, across, radius, side)
                error /= radius
                error += 2.0 * _beyond(rows, degree, mx, mz, ux, uz, across, arc)
        if error < 0.0:
            error = _chord_error(rows, degree, mx, mz, ux, uz, half)
    else:
        hx = hz = 0.0
        arc.half[0], arc.half[1] = 0.0, 0.0
        error = _chord_error(rows, degree, mx, mz, 1.0, 0.0, 0.0)
    arc.error = error * (1.0 + 1e-9) + _ROUNDING * size
    arc.length = 2.0 * (half + abs(bulge) + arc.error)
    _put_limits(curve, low, high, arc)


@kernel
def _arc_error(rows, degree, mx, mz, ux, uz, half, across, radius, side):
    """Return a bound of |d² - r²| over a part; d is the distance from the centre, r the radius.

    d² - r² is a rational Bezier function of twice the degree, so it is no larger than its largest
    coefficient. Since |d² - r²| = |d - r| (d + r), the caller divides it by r to bound |d - r|.
    """
    most = 0.0
    x, y, w = on_stack(16, 0.0), on_stack(16, 0.0), on_stack(16, 0.0)
    for i in range(degree + 1):
        w[i] = rows[i, 2]
        dx, dz = rows[i, 0] - mx * w[i], rows[i, 1] - mz * w[i]
        x[i], y[i] = dx * ux + dz * uz, dz * ux - dx * uz
    for k in range(2 * degree + 1):
        value = weight = 0.0
        for i in range(max(0, k - degree), min(k, degree) + 1):
            j = k - i
            share = _CHOOSE[degree, i] * _CHOOSE[degree, j]
            weight += share * w[i] * w[j]
            value += share * (
                x[i] * x[j] - half * half * w[i] * w[j] + y[i] * (y[j] - 2.0 * across * w[j])
            )
        most = max(most, abs(value) / weight)
    return most


@kernel
def _is_before(rows, degree, mx, mz, ux, uz, across, side):
    """Return whether all control points are on the same side of the centre as the arc."""
    for i in range(degree + 1):
        dx, dz = rows[i, 0] / rows[i, 2] - mx, rows[i, 1] / rows[i, 2] - mz
        if not side * (dz * ux - dx * uz - across) > 0.0:
            return False
    return True


@kernel
def _beyond(rows, degree, mx, mz, ux, uz, across, arc):
    """Return how far, at most, a control point lies beyond the radii at an arc's ends, metres."""
    most = 0.0
    for i in range(degree + 1):
        dx, dz = rows[i, 0] / rows[i, 2] - mx, rows[i, 1] / rows[i, 2] - mz
        x, y = dx * ux + dz * uz, dz * ux - dx * uz - across
        side = 1.0 if arc.sine > 0.0 else -1.0
        most = max(most, abs(x) * arc.cosine - side * y * abs(arc.sine))
    return most


@kernel
def _chord_error(rows, degree, mx, mz, ux, uz, half):
    """Return the largest distance of a control point from a chord, metres."""
    most = 0.0
    for i in range(degree + 1):
        dx, dz = rows[i, 0] / rows[i, 2] - mx, rows[i, 1] / rows[i, 2] - mz
        x, y = max(abs(dx * ux + dz * uz) - half, 0.0), dz * ux - dx * uz
        most = max(most, np.sqrt(x * x + y * y))
    return most


@kernel
def _put_limits(curve, low, high, arc):
    """Write limits of the first three derivatives over a part and half its length beyond each end.

    The limits come from differences of the control points. With weights, the quotient rule for C =
    N / W gives them: with c the largest distance from the point that N is measured from, |C'| <=
    (|N'| + c |W'|) / W, |C''| <= (|N''| + 2 |C'| |W'| + c |W''|) / W, and so on.
    """
    rows = table_on_stack(16, 3, 0.0)
    begin = max(low - 0.5 * (high - low), 0.0)
    end = min(high + 0.5 * (high - low), 1.0)
    put_part(curve, begin, end, rows)
    degree = curve.degree
    width = end - begin
    mx, mz = arc.middle[0], arc.middle[1]
    far, least = 0.0, rows[0, 2]
    for i in range(degree + 1):
        rows[i, 0] -= mx * rows[i, 2]
        rows[i, 1] -= mz * rows[i, 2]
        x, z = rows[i, 0] / rows[i, 2], rows[i, 1] / rows[i, 2]
        far, least = max(far, np.sqrt(x * x + z * z)), min(least, rows[i, 2])
    n1, w1 = _largest_difference(rows, degree, 1)
    n2, w2 = _largest_difference(rows, degree, 2)
    n3, w3 = _largest_difference(rows, degree, 3)
    first = (n1 + far * w1) / least
    second = (n2 + 2.0 * first * w1 + far * w2) / least
    third = (n3 + 3.0 * (second * w1 + first * w2) + far * w3) / least
    arc.limits[0] = 1.000001 * first / width
    arc.limits[1] = 1.000001 * second / (width * width)
    arc.limits[2] = 1.000001 * third / (width * width * width)


@kernel
def _largest_difference(rows, degree, order):
    """Return bounds of the derivatives of that order of N and of W, by the control points."""
    if order > degree:
        return 0.0, 0.0
    factor = float(degree)
    if order > 1:
        factor *= degree - 1.0
    if order > 2:
        factor *= degree - 2.0
    most = weight = 0.0
    for i in range(degree + 1 - order):
        x, z, w = _difference(rows, i, order)
        most, weight = max(most, np.sqrt(x * x + z * z)), max(weight, abs(w))
    return factor * most, factor * weight


@kernel
def _difference(rows, i, order):
    """Return the forward difference of that order from row i."""
    if order == 1:
        return (
            rows[i + 1, 0] - rows[i, 0],
            rows[i + 1, 1] - rows[i, 1],
            rows[i + 1, 2] - rows[i, 2],
        )
    if order == 2:
        return (
            rows[i + 2, 0] - 2.0 * rows[i + 1, 0] + rows[i, 0],
            rows[i + 2, 1] - 2.0 * rows[i + 1, 1] + rows[i, 1],
            rows[i + 2, 2] - 2.0 * rows[i + 1, 2] + rows[i, 2],
        )
    return (
        rows[i + 3, 0] - 3.0 * (rows[i + 2, 0] - rows[i + 1, 0]) - rows[i, 0],
        rows[i + 3, 1] - 3.0 * (rows[i + 2, 1] - rows[i + 1, 1]) - rows[i, 1],
        rows[i + 3, 2] - 3.0 * (rows[i + 2, 2] - rows[i + 1, 2]) - rows[i, 2],
    )


@kernel
def hold(curves, first, end, size, arc):
    """Write the fat chord around several pieces, as long and thin as their control points allow."""
    low, high = (np.inf, np.inf), (-np.inf, -np.inf)
    for k in range(first, end):
        curve = curves[k]
        for i in range(curve.degree + 1):
            w = curve.control[3 * i + 2]
            x, z = curve.control[3 * i] / w, curve.control[3 * i + 1] / w
            low = min(low[0], x), min(low[1], z)
            high = max(high[0], x), max(high[1], z)
    size = max(size, max(max(-low[0], high[0]), max(-low[1], high[1])))
    hx, hz = 0.5 * (high[0] - low[0]), 0.5 * (high[1] - low[1])
    mx, mz = low[0] + hx, low[1] + hz
    upright = hz > hx
    ux, uz = (0.0, 1.0) if upright else (1.0, 0.0)
    half = max(abs(hz - hx), 1e-300)
    error = 0.0
    rows = table_on_stack(16, 3, 0.0)
    for k in range(first, end):
        curve = curves[k]
        for i in range(curve.degree + 1):
            for c in range(3):
                rows[i, c] = curve.control[3 * i + c]
        error = max(error, _chord_error(rows, curve.degree, mx, mz, ux, uz, half))
    arc.middle[0], arc.middle[1] = mx, mz
    arc.half[0], arc.half[1] = half * ux, half * uz
    arc.sine, arc.cosine, arc.low, arc.high = 0.0, 1.0, 0.0, 1.0
    arc.error = error * (1.0 + 1e-9) + _ROUNDING * size
    arc.length = 2.0 * (half + arc.error)
    arc.limits[0], arc.limits[1], arc.limits[2] = np.inf, np.inf, np.inf
    arc.curve, arc.child = NONE, NONE
