"""A lower bound of the distance over two cells, from how it bends around the nearest points.

For a vector n, no longer than a unit, and the way D(p) between two points, with p the parameters of
both, let tau = D - n (n D) be the part of D across n. Where |D| <= U, |D| - n D =
tau^2 / (|D| + n D) is at least tau^2 / 2U, so for any m of 0 to 1/U

    F(p) = n D + m tau^2 / 2

is a lower bound of |D|. From the nearest points p0 on, with n along D there and x = p - p0,

    n D(p) = n D(p0) + n D' x + x B x / 2        tau(p) = tau(p0) + J x

where B is a mean of the second derivatives of n D and J one of the derivatives of tau, between both
points: each lies in the range that it has over the cells. But for rounding, n D' vanishes at a
minimum and tau(p0) does so anyway. So F is at least F(p0) all over two cells where the form
B + m J^2 is positive whatever B and J are in their ranges; and then both are done with. That is so
in cells of a fixed size however near the surfaces are, as m may be less than 1/U; a bound of the
gap alone would have cells divided until they are as small as the square root of what the answer may
err by.

The smaller m is, the sooner a parameter is known to stay where it is. So the first m to be tried
just outweighs the bends away from the other surface; it is 0 between cells that bulge towards each
other.

Where a point lies at an end of a parameter, F rises from there by F' x. Beside a saddle the form
is not positive when both points move along it; but for steps x of 0 to L the linear term is at
least the quadratic F' x^2 / L, and outweighs that. So it counts as 2 F' / L in the form.

Where a tolerance leaves room below |D(p0)|, the form may be as negative as that allows over the
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
"""A Side: numbers about a cell and a point of it, parameters being 0 to 1 over it. By u, and then
by v: of the derivative see `Ranges`, across, 3 numbers each, spread, middle and half. Of the second
derivatives by uu, uv and vv: middle and half. At the point: the derivative, 3 numbers each;
how far back and forth the parameter may go from there; and how many times a point's rounding the
derivative may err by. Whether the sum of both parameters is 1 at the most as well. Last, by u and v
again, how far apart points are where the parameter stays at its end: tiny at a pole, as a cone's
apex is, and infinite where nothing is said of it.

The other line is about the rows of `_put_rows`."""

_STRETCH, _TILT = 1.0 + 1e-5, 1e-5
"""By what lengths of b are increased, and which share of what is along n may be across it besides:
a pose may change them by RIGID_TOLERANCE."""

_OUTWEIGHING = 4.0
"""How many times what outweighs the largest bend away from the other surface m is at first."""

_SPARE, _MOST_SPARE = 1e-3, 0.03125
"""Share of the form's diagonal that outweighs what is left of the gradient at the points: at least,
and at most."""

_ROOM_SHARE = 0.125
"""Share of the room below the distance that this may take for each parameter."""

_LOOSE = 0.125
"""Share by which what J may differ by counts for more, so that tau(p0) counts alone: with E for one
and C for the other, (E + C)^2 is at most (1 + s) E^2 + (1 + 1/s) C^2."""

_SHORTER = 4.0 * DOUBLE_EPS
"""By how much a direction is shorter than a unit vector, for all that rounding does to it."""

_ROUNDING = 1e-9
"""Share of the form's diagonal that is left out, for all that rounding does to it."""

_SHARE, _LARGEST = 0.5, 0.99
"""Share of m |J x|^2 that is left of it where J is not the same all over the cells: where m is as
large as need be; and at most where it is the largest, and more is left the less J differs."""


@shared
def direction(sides, motion, way, distance, slack):
    """The unit vector n, near that along the way between the points, that is best for the proof.

    Where the points are so near each other that rounding tilts the way, that across the derivatives
    at the points which it is about normal to: then n D' vanishes, and tau(p0) is below the slack.
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
    """A derivative at the points, in a's frame."""
    t = _three(sides[i // 2], SLOPE + 3 * (i % 2))
    return t if i < 2 else rotated(motion, t)


@shared
def surpasses(sides, n, motion, way, distance, slack, limit):
    """Whether |D| is at least `limit` all over two sides; `slack` is what the points err by."""
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
    # The least m that will do is the best for parameters that stay where they are, and all that
    # serves where the points are very near each other. But in large cells it may not suffice.
    m, share = min(1.0 / distance, _OUTWEIGHING / _SHARE * bends), _SHARE
    larger = min(max(1.0 - spread, _SHARE), _LARGEST)
    for _ in range(2):
        # What tau(p0) takes off.
        lost = 0.5 * (1.0 + 1.0 / _LOOSE) * share / (1.0 - share) * m * beside * beside
        if high > lost and _is_least(sides, rows, beside, m, share, high - lost):
            return True
        m, share = 1.0 / distance, larger
    return False


@kernel
def _put_rows(sides, n, motion, slack, rows):
    """Write a row about each of the four parameters: how D changes with it, in the frame of a.

    Across n, the middle of the derivative and how far it may be from there; along n, middle and
    half length of its range, what it is at the points, and what that errs by.
    """
    for i in range(4):
        side, k = sides[i // 2], i % 2
        middle, first = _three(side, ACROSS + 3 * k), _three(side, SLOPE + 3 * k)
        slope, slant = side[MIDDLE + k], side[HALF + k]
        if i < 2:  # of a: the way goes from there
            middle, first, slope = scaled(middle, -1.0), scaled(first, -1.0), -slope
        else:
            middle, first = rotated(motion, middle), rotated(motion, first)
        row = rows[i]
        row[_ACROSS], row[_ACROSS + 1], row[_ACROSS + 2] = middle
        row[_SPREAD] = _STRETCH * side[SPREAD + k] + _TILT * (abs(slope) + slant)
        row[_SLOPE], row[_SLANT] = slope, slant
        row[_RISE] = dot(first, n)
        row[_ERROR] = slack * side[ERRORS + k]  # as the points do, times the degree


@kernel
def falls_by(sides, n, motion):
    """The least that n D rises by, as the derivatives at the points say, over either side."""
    u, v = _three(sides[0], SLOPE), _three(sides[0], SLOPE + 3)
    least = _least_rise(sides[0], -dot(u, n), -dot(v, n))
    u, v = rotated(motion, _three(sides[1], SLOPE)), rotated(motion, _three(sides[1], SLOPE + 3))
    return least + _least_rise(sides[1], dot(u, n), dot(v, n))


@inlined
def _least_of(rows, i, begin, end):
    """The least, not above 0, that F rises by with a parameter, by its derivative at the points."""
    rise, error = rows[i, _RISE], rows[i, _ERROR]
    return min(min((rise + error) * begin, (rise - error) * end), 0.0)


@inlined
def _least_rise(side, u, v):
    """The least that F rises by from the point on over a side, with its derivatives there."""
    low_u, high_u, low_v, high_v = side[ENDS], side[ENDS + 1], side[ENDS + 2], side[ENDS + 3]
    if side[CORNER] == 0.0:
        return min(u * low_u, u * high_u) + min(v * low_v, v * high_v)
    corner = u * low_u + v * low_v
    return min(corner, min(u * high_u + v * low_v, u * low_u + v * high_v))


@inlined
def _rises(sides, rows, i, turn):
    """The least that F rises by a parameter as it leaves its end at the points; 0 if it has none.

    `turn` is the most that m tau, times the derivative across n, may take off that.
    """
    begin, end = _ends(sides, i)
    if begin == 0.0 and end > 0.0:
        return rows[i, _SLOPE] - rows[i, _SLANT] - turn
    if end == 0.0 and begin < 0.0:
        return -rows[i, _SLOPE] - rows[i, _SLANT] - turn
    return 0.0


@inlined
def _turn(sides, rows, held, reaches, beside, i):
    """The most that tau times its derivative takes off what F rises by from a parameter's end.

    tau is no longer than `beside` at the points, and further on the sum of that and of all
    derivatives across n times how far their parameters have gone from there; what this one has gone
    itself adds to the rise, as a rule.
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
    """What an element of the form's diagonal grows by where F rises from its parameter's end.

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
    """The same of an element off the diagonal, for both parameters of a triangle from a corner.

    As x + y is at most 1, g x + h y is at least (g x + h y) (x + y), and any mean of that and of
    g x^2 + h y^2. The share that is taken makes it a multiple of the squared length of the way,
    where g and h are to each other as the squared lengths of both sides: a bend that is alike in
    all directions, as a sphere's, is outweighed as well as can be.
    """
    one, other = _lift(sides, rows, i), _lift(sides, rows, j)
    if i // 2 != j // 2 or sides[i // 2, CORNER] == 0.0 or one == 0.0 or other == 0.0:
        return 0.0
    e, f = _three(rows[i], _ACROSS), _three(rows[j], _ACROSS)
    share = 2.0 * dot(e, f) / (dot(e, e) + dot(f, f))
    return 0.5 * min(max(share, 0.0), 1.0) * (one + other)


@kernel
def _is_least(sides, rows, beside, m, share, left):
    """Whether F is nowhere less by more than `left` than it is at the points.

    There tau is no longer than `beside`.

    A parameter that ends there, where F rises all over the cells as it leaves its end, is as good
    as fixed; and then tau is less, so that another one may be. At a pole the other parameter of the
    same surface is fixed with it. Of those that are left the form
    has to be positive, by Cholesky's factors, when so much is added to its diagonal as makes that
    difference. What it may differ by from that of the middles is subtracted there: with |E_ij| at
    most R_ij, x E x is at least minus the sum of x_i^2 R_ij w_j / w_i, for any w > 0.

    Of m |tau(p0) + J x|^2, where the columns of J differ by e_i at most from those of the middles,
    J_0, a `share` t is left: with E the sum of e_i |x_i|, and C = `beside`, it is at
    least t m |J_0 x|^2 - t / (1 - t) m (E + C)^2, by Young's inequality. So it counts with their
    squares how much they differ: of four parameters two do not change tau, and there the bends have
    to outweigh that.

    Where the points were not found to the last digit, the tangent falls from there: by its least
    value over the cells, or, where a share s of the form's diagonal h_i is left to outweigh
    that, by g_i^2 / (2 s h_i), as g x + s h x^2 / 2 is no less.
    """
    matrix, errors = table_on_stack(4, 4, 0.0), table_on_stack(4, 4, 0.0)
    held, reaches, kept = on_stack(4, 0.0), on_stack(4, 0.0), on_stack(4, 0.0)
    for i in range(4):
        held[i] = 0.0
        reaches[i] = _STRETCH * (norm(_three(rows[i], _ACROSS)) + rows[i, _SPREAD])
    # No derivative of F is longer than this by that of D.
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
                if apart < np.inf and held[i ^ 1] == 0.0:  # a pole: the other one moves nothing
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
            matrix[i, i] = 1.0  # a parameter that there is not
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
    # F may be less by half the sum of what is added times the squares of the extents.
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
    """How far a parameter may go back, not above 0, and forth, not below 0."""
    at = ENDS + 2 * (i % 2)
    return sides[i // 2, at], sides[i // 2, at + 1]
