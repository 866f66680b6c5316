"""A lower bound of the distance over two cells, from how it bends around the nearest points.

Let n be a vector no longer than a unit vector. Let D(p) be the way between two points, with p the
parameters of both, and tau = D - n (n D) the part of D across n. If |D| <= U, then
|D| - n D = tau^2 / (|D| + n D) is at least tau^2 / 2U. So for any m in 0 to 1/U

    F(p) = n D + m tau^2 / 2

is a lower bound of |D|. Let p0 be the nearest points, n along D(p0), and x = p - p0. Then

    n D(p) = n D(p0) + n D' x + x B x / 2        tau(p) = tau(p0) + J x

where B is a mean of the second derivatives of n D, and J a mean of the derivatives of tau, between
p0 and p. Each lies in its range over the cells. Except for rounding, n D' vanishes at a minimum,
and tau(p0) vanishes always. So if the form B + m J^2 is positive for all B and J in their ranges, F
is at least F(p0) all over the two cells, and the pair is done. This holds in cells of a fixed size
however near the surfaces are, because m may be less than 1/U. A bound of the gap alone would need
cells as small as the square root of the allowed error.

The smaller m is, the sooner a parameter is known to stay where it is. So the first m that is tried
just outweighs the bends away from the other surface. It is 0 between cells that bulge towards each
other.

If a point lies at an end of a parameter, F rises from there by F' x. Beside a saddle, the form is
not positive when both points move along it. But for steps x of 0 to L, the linear term is at least
the quadratic F' x^2 / L, and outweighs that. So the linear term counts as 2 F' / L in the form.

If a tolerance leaves room below |D(p0)|, the form may be as negative as that room allows over the
cells' extent.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel, shared
from ..base.memory import on_stack, table_on_stack
from ..base.rounding import DOUBLE_EPS
from ..base.vectors import along, cross, dot, norm, rotated, scaled

ACROSS, SPREAD, MIDDLE, HALF = 0, 6, 8, 10
SECOND, HALVES = 12, 15
SLOPE, ENDS, ERRORS, CORNER, APART = 18, 24, 28, 30, 31
SIDE = 33
_ACROSS, _SPREAD, _SLOPE, _SLANT, _RISE, _ERROR, _ROW = 0, 3, 4, 5, 6, 7, 8
"""Offsets in a Side: numbers about a cell and a point of it. Parameters run from 0 to 1 over the
cell. For u and then v, of the first derivative (see `Ranges`): across, 3 numbers each; spread;
middle; half. For uu, uv and vv, of the second derivatives: middle; half. At the point: the
derivative (SLOPE, 3 numbers each); how far back and forth the parameter may go (ENDS); how many
times a point's rounding the derivative may err by (ERRORS); whether the sum of both parameters is
also at most 1 (CORNER). For u and v: how far apart points are while the parameter stays at its end
(APART): tiny at a pole such as a cone's apex, infinite if unknown.

The last line of names is the layout of a row of `_put_rows`."""

_STRETCH, _TILT = 1.0 + 1e-5, 1e-5
"""Factor for lengths of b; and the share of a component along n that may appear across n. A pose
may change either by RIGID_TOLERANCE."""

_OUTWEIGHING = 4.0
"""The first m is this many times what outweighs the largest bend away from the other surface."""

_SPARE, _MOST_SPARE = 1e-3, 0.03125
"""Share of the form's diagonal that outweighs the gradient left at the points: least and most."""

_ROOM_SHARE = 0.125
"""Share of the room below the distance that the gradient left may take for each parameter."""

_LOOSE = 0.125
"""By this share the variation of J counts for more, so that tau(p0) counts separately: with E for
the variation and C for tau(p0), (E + C)^2 is at most (1 + s) E^2 + (1 + 1/s) C^2."""

_SHORTER = 4.0 * DOUBLE_EPS
"""A direction is shorter than a unit vector by this much, to cover its rounding."""

_ROUNDING = 1e-9
"""Share of the form's diagonal that is left out, to cover its rounding."""

_SHARE, _LARGEST = 0.5, 0.99
"""Share of m |J x|^2 that is left because J varies over the cells: for the first m; and at most for
the largest m. For the largest m, the share is the larger the less J varies."""


@shared
def direction(sides, motion, way, distance, slack):
    """Return the unit vector n, near that along the way between the points, best for the proof.

    If the points are so near each other that rounding tilts the way, n is instead normal to those
    derivatives at the points to which the way is about normal. Then n D' vanishes, and tau(p0) is
    below the slack.
    """
    n, long, wide = scaled(way, (1.0 - _SHORTER) / distance), 0.0, 0.0
    first = normal = (0.0, 0.0, 0.0)
    for i in range(4):
        t = _tangent(sides, motion, i)
        length = norm(t)
        if length > long and abs(dot(t, way)) <= slack * length:
            first, long = t, length
    if long == 0.0:
        return n
    for i in range(4):
        t = _tangent(sides, motion, i)
        if abs(dot(t, way)) <= slack * norm(t):
            other = cross(first, t)
            if norm(other) > wide:
                normal, wide = other, norm(other)
    for k in range(2):
        better = normal if k == 0 else along(way, first, -dot(first, way) / (long * long))
        length = norm(better)
        if not length > 0.0:
            continue
        better = scaled(better, (1.0 - _SHORTER) / (length if dot(better, way) > 0.0 else -length))
        if norm(along(way, better, -dot(better, way))) <= slack:
            return better
    return n


@inlined
def _tangent(sides, motion, i):
    """Return a derivative at the points, in a's frame."""
    t = _three(sides[i // 2], SLOPE + 3 * (i % 2))
    return t if i < 2 else rotated(motion, t)


@shared
def surpasses(sides, n, motion, way, distance, slack, limit):
    """Tell if |D| is surely at least `limit` all over two sides; the points err by `slack`."""
    rows, rise = table_on_stack(4, _ROW, 0.0), dot(way, n)
    _put_rows(sides, n, motion, slack, rows)
    high = rise - limit - 16.0 * DOUBLE_EPS * distance
    beside = norm(along(way, n, -rise)) + slack + 16.0 * DOUBLE_EPS * distance
    bends = spread = 0.0
    for i in range(4):
        side, k = sides[i // 2], i % 2
        middle, least = _three(rows[i], _ACROSS), side[SECOND + 2 * k]
        least = (least if i >= 2 else -least) - side[HALVES + 2 * k]
        squared = dot(middle, middle)
        if squared > 0.0 and not _rises(sides, rows, i, 0.0) > 0.0:
            bends = max(bends, -least / squared)
            spread = max(spread, rows[i, _SPREAD] / np.sqrt(squared))
    # The least sufficient m is the best for parameters that stay where they are, and the only one
    # that works if the points are very near each other. But in large cells it may not suffice.
    m, share = min(1.0 / distance, _OUTWEIGHING / _SHARE * bends), _SHARE
    larger = min(max(1.0 - spread, _SHARE), _LARGEST)
    for _ in range(2):
        # What tau(p0) subtracts.
        lost = 0.5 * (1.0 + 1.0 / _LOOSE) * share / (1.0 - share) * m * beside * beside
        if high > lost and _is_least(sides, rows, beside, m, share, high - lost):
            return True
        m, share = 1.0 / distance, larger
    return False


@kernel
def _put_rows(sides, n, motion, slack, rows):
    """Write a row for each of the four parameters: how D changes with it, in the frame of a.

    Across n: the middle of the derivative, and how far it may be from the middle. Along n: middle
    and half length of the derivative's range, its value at the points, and the error of that value.
    """
    for i in range(4):
        side, k = sides[i // 2], i % 2
        middle, first = _three(side, ACROSS + 3 * k), _three(side, SLOPE + 3 * k)
        slope, slant = side[MIDDLE + k], side[HALF + k]
        if i < 2:  # of a: D begins there, so the signs change
            middle, first, slope = scaled(middle, -1.0), scaled(first, -1.0), -slope
        else:
            middle, first = rotated(motion, middle), rotated(motion, first)
        row = rows[i]
        row[_ACROSS], row[_ACROSS + 1], row[_ACROSS + 2] = middle
        row[_SPREAD] = _STRETCH * side[SPREAD + k] + _TILT * (abs(slope) + slant)
        row[_SLOPE], row[_SLANT] = slope, slant
        row[_RISE] = dot(first, n)
        row[_ERROR] = slack * side[ERRORS + k]  # the points' error, times the degree


@kernel
def falls_by(sides, n, motion):
    """Return the least rise of n D over both sides, by the derivatives at the points."""
    u, v = _three(sides[0], SLOPE), _three(sides[0], SLOPE + 3)
    least = _least_rise(sides[0], -dot(u, n), -dot(v, n))
    u, v = rotated(motion, _three(sides[1], SLOPE)), rotated(motion, _three(sides[1], SLOPE + 3))
    return least + _least_rise(sides[1], dot(u, n), dot(v, n))


@inlined
def _least_of(rows, i, begin, end):
    """Return the least rise of F (at most 0) with a parameter, by its derivative at the points."""
    rise, error = rows[i, _RISE], rows[i, _ERROR]
    return min(min((rise + error) * begin, (rise - error) * end), 0.0)


@inlined
def _least_rise(side, u, v):
    """Return the least rise of F from the point over a side, by its derivatives u and v there."""
    low_u, high_u, low_v, high_v = side[ENDS], side[ENDS + 1], side[ENDS + 2], side[ENDS + 3]
    if side[CORNER] == 0.0:
        return min(u * low_u, u * high_u) + min(v * low_v, v * high_v)
    corner = u * low_u + v * low_v
    return min(corner, min(u * high_u + v * low_v, u * low_u + v * high_v))


@inlined
def _rises(sides, rows, i, turn):
    """Return the least slope of F as a parameter leaves its end at the points; 0 if not at an end.

    `turn` is the most that m tau, times the derivative across n, may subtract.
    """
    begin, end = _ends(sides, i)
    if begin == 0.0 and end > 0.0:
        return rows[i, _SLOPE] - rows[i, _SLANT] - turn
    if end == 0.0 and begin < 0.0:
        return -rows[i, _SLOPE] - rows[i, _SLANT] - turn
    return 0.0


@inlined
def _turn(sides, rows, held, reaches, beside, i):
    """Return the most that tau times its derivative subtracts from F's slope at a parameter's end.

    tau is no longer than `beside` at the points. Further on, each parameter adds its derivative
    across n times how far it has gone. What this parameter itself has gone usually adds to the
    slope.
    """
    own = _three(rows[i], _ACROSS)
    if _ends(sides, i)[0] < 0.0:
        own = scaled(own, -1.0)
    least = -beside * reaches[i]
    for j in range(4):
        if held[j] > 0.0:
            continue
        begin, end = _ends(sides, j)
        product = dot(own, _three(rows[j], _ACROSS))
        error = reaches[i] * rows[j, _SPREAD] + reaches[j] * rows[i, _SPREAD]
        error += 8.0 * DOUBLE_EPS * reaches[i] * reaches[j]
        least += min(min(end * (product - error), begin * (product + error)), 0.0)
    return -least


@inlined
def _lift(sides, rows, i):
    """Return what a diagonal element of the form gains if F rises from its parameter's end.

    From 0 to L, g x is at least (2 g / L) x^2 / 2.
    """
    (begin, end), slope, error = _ends(sides, i), rows[i, _RISE], rows[i, _ERROR]
    if begin == 0.0 and end > 0.0:
        return 2.0 * max(slope - error, 0.0) / end
    if end == 0.0 and begin < 0.0:
        return 2.0 * max(-slope - error, 0.0) / -begin
    return 0.0


@inlined
def _lift_of_both(sides, rows, i, j):
    """As `_lift`, for an element off the diagonal: both parameters of a triangle, from a corner.

    As x + y is at most 1, g x + h y is at least (g x + h y) (x + y), and at least any mean of that
    and g x^2 + h y^2. The share makes the mean a multiple of the squared length of the way if g and
    h have the ratio of the squared lengths of both sides. Then a bend that is alike in all
    directions, as a sphere's, is outweighed as well as possible.
    """
    one, other = _lift(sides, rows, i), _lift(sides, rows, j)
    if i // 2 != j // 2 or sides[i // 2, CORNER] == 0.0 or one == 0.0 or other == 0.0:
        return 0.0
    e, f = _three(rows[i], _ACROSS), _three(rows[j], _ACROSS)
    share = 2.0 * dot(e, f) / (dot(e, e) + dot(f, f))
    return 0.5 * min(max(share, 0.0), 1.0) * (one + other)


@kernel
def _is_least(sides, rows, beside, m, share, left):
    """Tell whether F is surely nowhere less than at the points by more than `left`.

    At the points, tau is no longer than `beside`.

    If a parameter is at an end there, and F rises all over the cells as the parameter leaves the
    end, the parameter counts as fixed. Then tau is less, so another parameter may become fixed. At
    a pole, the other parameter of the same surface is fixed as well. For the parameters that are
    left, the form must be positive by Cholesky factorization, after its diagonal grows by what
    `left` allows. The difference from the form of the middles is subtracted there: with |E_ij| at
    most R_ij, x E x is at least minus the sum of x_i^2 R_ij w_j / w_i, for any w > 0.

    Let the columns of J differ by at most e_i from those of the middles, J_0. A `share` t of
    m |tau(p0) + J x|^2 is left: with E the sum of e_i |x_i|, and C = `beside`, it is at least
    t m |J_0 x|^2 - t / (1 - t) m (E + C)^2, by Young's inequality. So the differences e_i count
    with their squares: two of four parameters do not change tau, and there the bends must outweigh
    the differences.

    If the points are not exact to the last digit, the tangent falls from there: by its least value
    over the cells, or by g_i^2 / (2 s h_i) if a share s of the form's diagonal h_i is left to
    outweigh the fall, because g x + s h x^2 / 2 is no less.
    """
    matrix, errors = table_on_stack(4, 4, 0.0), table_on_stack(4, 4, 0.0)
    held, reaches, kept = on_stack(4, 0.0), on_stack(4, 0.0), on_stack(4, 0.0)
    for i in range(4):
        held[i] = 0.0
        reaches[i] = _STRETCH * (norm(_three(rows[i], _ACROSS)) + rows[i, _SPREAD])
    # No derivative of F is longer than this times that of D.
    steepest = 1.0 + m * (beside + reaches[0] + reaches[1] + reaches[2] + reaches[3])
    changed = True
    while changed:
        changed = False
        for i in range(4):
            if held[i] > 0.0:
                continue
            if _rises(sides, rows, i, m * _turn(sides, rows, held, reaches, beside, i)) > 0.0:
                held[i], changed = 1.0, True
                apart = sides[i // 2, APART + i % 2]
                if apart < np.inf and held[i ^ 1] == 0.0:  # a pole: the other moves nothing
                    held[i ^ 1] = 1.0
                    left, beside = left - steepest * apart, beside + apart
    extent = 0.0
    differing = (1.0 + _LOOSE) * share / (1.0 - share) * m
    for i in range(4):
        for j in range(i + 1):
            if held[i] > 0.0 or held[j] > 0.0:
                matrix[i, j] = errors[i, j] = errors[j, i] = 0.0
                continue
            value = share * m * dot(_three(rows[i], _ACROSS), _three(rows[j], _ACROSS))
            error = differing * rows[i, _SPREAD] * rows[j, _SPREAD]
            lift = _lift(sides, rows, i) if i == j else _lift_of_both(sides, rows, i, j)
            terms = m * reaches[i] * reaches[j] + lift
            value += lift
            if i // 2 == j // 2:
                side, k = sides[i // 2], i % 2 + j % 2
                middle, half = side[SECOND + k], side[HALVES + k]
                value += middle if i >= 2 else -middle
                error += half
                terms += abs(middle)
            error += 16.0 * DOUBLE_EPS * terms
            matrix[i, j] = value
            errors[i, j] = errors[j, i] = _STRETCH * error
        if matrix[i, i] == 0.0 and errors[i, i] == 0.0:
            matrix[i, i] = 1.0  # the element does not have this parameter
            continue
        begin, end = _ends(sides, i)
        most = max(-begin, end)
        extent += (abs(matrix[i, i]) + errors[i, i]) * most * most
    room = left
    for i in range(0, 4, 2):
        side = sides[i // 2]
        falls = errors_of_both = 0.0
        for k in range(i, i + 2):
            begin, end = _ends(sides, k)
            least, kept[k] = _least_of(rows, k, begin, end), 1.0 - _ROUNDING
            errors_of_both += rows[k, _ERROR] * (end - begin)
            if held[k] > 0.0:
                continue
            if matrix[k, k] > 0.0 and least < 0.0:
                slope = abs(rows[k, _RISE]) + rows[k, _ERROR]
                fall = 0.5 * slope * slope / matrix[k, k]
                spare = min(max(fall / (_ROOM_SHARE * room), _SPARE), _MOST_SPARE)
                if -fall / spare > least:
                    least, kept[k] = -fall / spare, 1.0 - _ROUNDING - spare
            falls += least
        joint = _least_rise(side, rows[i, _RISE], rows[i + 1, _RISE]) - errors_of_both
        left += max(falls, joint)
    if not left >= 0.0:
        return False
    # F may be less by half the sum of what is added, times the squares of the extents.
    more = left / extent if extent > 0.0 else 0.0
    weights = on_stack(4, 0.0)
    for i in range(4):
        matrix[i, i] += more * (abs(matrix[i, i]) + errors[i, i])
        if not matrix[i, i] > errors[i, i]:
            return False
        weights[i] = 1.0 / np.sqrt(matrix[i, i])
    for i in range(4):
        matrix[i, i] *= kept[i]
        for j in range(4):
            matrix[i, i] -= errors[i, j] * weights[j] / weights[i]
    for i in range(4):
        for j in range(i + 1):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            if i != j:
                matrix[i, j] = value / matrix[j, j]
            elif value > 0.0:
                matrix[i, i] = np.sqrt(value)
            else:
                return False
    return True


@inlined
def _three(numbers, at):
    return (numbers[at], numbers[at + 1], numbers[at + 2])


@inlined
def _ends(sides, i):
    """Return how far a parameter may go back, not above 0, and forth, not below 0."""
    at = ENDS + 2 * (i % 2)
    return sides[i // 2, at], sides[i // 2, at + 1]
