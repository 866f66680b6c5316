"""Parts of a profile's Bezier pieces, and how two of them lie to each other.

A part is an array (18, 5). Its rows up to the degree are control points: rho w, z w and w, then rho
and z. Row 16 (PLACE) holds the two parameters between which the part lies on its piece, the number
of the piece, and how far control points are to the right of the chord, at most 0, and to the left.
Row 17 (BOX) holds the box around the control points, and the chord's length. With positive weights
a part is within the convex hull of its control points (Piegl and Tiller, The NURBS Book, 1997,
section 4.2).
"""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel
from ..base.memory import table_on_stack

ROWS, COLUMNS = 18, 5
PLACE, BOX = 16, 17

LEG = 1e-14
"""A leg of a control polygon that is no longer may be rounding, so it has no direction."""

_MOVED, _FOUND = 2.5, 1e-14
"""The gap between two graphs of slopes up to 2 changes by at most the root of 5 times as much as
one of them is moved: _MOVED is more. A place along a graph is found to within _FOUND."""

_NEAREST = 2.0**-40
"""Share of a part that a cut leaves on either side at least, so that both halves have a length."""


@kernel
def take(net, degree, size, piece, part):
    """Write a whole piece as a part, in units of `size` metres."""
    for i in range(degree + 1):
        part[i, 0], part[i, 1], part[i, 2] = net[i, 0] / size, net[i, 1] / size, net[i, 2]
    part[PLACE, 0], part[PLACE, 1], part[PLACE, 2] = 0.0, 1.0, piece
    _measure(part, degree)


@kernel
def copy(part, degree, to):
    """Copy a part to another place."""
    for c in range(COLUMNS):
        for i in range(degree + 1):
            to[i, c] = part[i, c]
        to[PLACE, c], to[BOX, c] = part[PLACE, c], part[BOX, c]


@kernel
def _measure(part, degree):
    """Write the entries that follow from the homogeneous control points and the parameters."""
    box = part[BOX]
    box[0], box[1], box[2], box[3] = np.inf, -np.inf, np.inf, -np.inf
    for i in range(degree + 1):
        x, y = part[i, 0] / part[i, 2], part[i, 1] / part[i, 2]
        part[i, 3], part[i, 4] = x, y
        box[0], box[1] = min(box[0], x), max(box[1], x)
        box[2], box[3] = min(box[2], y), max(box[3], y)
    box[4] = np.hypot(part[degree, 3] - part[0, 3], part[degree, 4] - part[0, 4])
    right, left = 0.0, 0.0
    for i in range(1, degree):
        side = _side(part, degree, part[i, 3], part[i, 4])
        right, left = min(right, side), max(left, side)
    part[PLACE, 3], part[PLACE, 4] = right, left


@kernel
def extent(part):
    """Return how wide or high the box of the control points is, whichever is more."""
    return max(part[BOX, 1] - part[BOX, 0], part[BOX, 3] - part[BOX, 2])


@kernel
def width(part):
    """Return how wide the strip along the chord is that holds the control points."""
    return part[PLACE, 4] - part[PLACE, 3]


@kernel
def heading(part, degree):
    """Return the unit vector along the chord; any if the chord has no length."""
    length = part[BOX, 4]
    if not length > 0.0:
        return 1.0, 0.0
    return (part[degree, 3] - part[0, 3]) / length, (part[degree, 4] - part[0, 4]) / length


@kernel
def _side(part, degree, x, y):
    """Return how far a point is to the left of a part's chord."""
    u, v = heading(part, degree)
    return u * (y - part[0, 4]) - v * (x - part[0, 3])


@kernel
def halve(part, degree, before, after):
    """Cut a part in two; neither half may be written to the part's own place.

    The cut is not at half the parameter, but where both end weights count equally: else it takes
    dozens of cuts to come near a heavy end.
    """
    t = 0.5
    if part[degree, 2] != part[0, 2]:
        t = 1.0 / (1.0 + (part[degree, 2] / part[0, 2]) ** (1.0 / degree))
        t = min(max(t, _NEAREST), 1.0 - _NEAREST)
    for i in range(degree + 1):
        for c in range(3):
            after[i, c] = part[i, c]
    for level in range(degree + 1):
        for c in range(3):
            before[level, c] = after[0, c]
        for i in range(degree - level):
            for c in range(3):
                after[i, c] = (1.0 - t) * after[i, c] + t * after[i + 1, c]
    low, high = part[PLACE, 0], part[PLACE, 1]
    middle = low + t * (high - low)
    before[PLACE, 0], before[PLACE, 1] = low, middle
    after[PLACE, 0], after[PLACE, 1] = middle, high
    before[PLACE, 2] = after[PLACE, 2] = part[PLACE, 2]
    _measure(before, degree)
    _measure(after, degree)


@kernel
def widen(net, degree, size, part, wider):
    """Write a wider part: it begins sooner and ends later by the length of the parameter range."""
    low, high = part[PLACE, 0], part[PLACE, 1]
    step = high - low
    low, high = max(low - step, 0.0), min(high + step, 1.0)
    for i in range(degree + 1):
        wider[i, 0], wider[i, 1], wider[i, 2] = net[i, 0] / size, net[i, 1] / size, net[i, 2]
    for level in range(1, degree + 1):  # cut off what is beyond `high`
        for i in range(degree, level - 1, -1):
            for c in range(3):
                wider[i, c] = (1.0 - high) * wider[i - 1, c] + high * wider[i, c]
    t = low / high
    for level in range(degree):  # and what is below `low`, now at t
        for i in range(degree - level):
            for c in range(3):
                wider[i, c] = (1.0 - t) * wider[i, c] + t * wider[i + 1, c]
    wider[PLACE, 0], wider[PLACE, 1], wider[PLACE, 2] = low, high, part[PLACE, 2]
    _measure(wider, degree)


@kernel
def directions(part, degree):
    """Return the least and greatest angle of the control polygon's legs, radians.

    Whatever the weights, the curve's tangents are sums of the legs with factors of at least 0: the
    derivative is the sum over i < j of (p_j - p_i) w_i w_j B_i B_j (j - i) / (t (1 - t) w^2). Legs
    no longer than LEG do not count. If there is no leg, the least angle is above the greatest.
    """
    u, v, first, low, high = 0.0, 0.0, 0.0, np.inf, -np.inf
    for i in range(degree):
        x, y = part[i + 1, 3] - part[i, 3], part[i + 1, 4] - part[i, 4]
        if max(abs(x), abs(y)) <= LEG:
            continue
        if low > high:
            u, v, first, low, high = x, y, np.arctan2(y, x), 0.0, 0.0
            continue
        turn = np.arctan2(u * y - v * x, u * x + v * y)
        low, high = min(low, turn), max(high, turn)
    return first + low, first + high


@kernel
def _beside(a, degree_a, b, degree_b):
    """Return whether all of b is on one side of the strip that holds a, or beyond its ends."""
    u, v = heading(a, degree_a)
    least, most, low, high = np.inf, -np.inf, np.inf, -np.inf
    for i in range(degree_b + 1):
        x, y = b[i, 3] - a[0, 3], b[i, 4] - a[0, 4]
        side, along = u * y - v * x, u * x + v * y
        least, most = min(least, side), max(most, side)
        low, high = min(low, along), max(high, along)
    if least > a[PLACE, 4] or most < a[PLACE, 3]:
        return True
    first, last = np.inf, -np.inf
    for i in range(degree_a + 1):
        along = u * (a[i, 3] - a[0, 3]) + v * (a[i, 4] - a[0, 4])
        first, last = min(first, along), max(last, along)
    return low > last or high < first


@kernel
def separate(a, degree_a, b, degree_b):
    """Return whether a line between control points proves that parts have no point in common."""
    for c in (0, 2):
        if a[BOX, c] > b[BOX, c + 1] or b[BOX, c] > a[BOX, c + 1]:
            return True
    return _beside(a, degree_a, b, degree_b) or _beside(b, degree_b, a, degree_a)


@kernel
def separate_at_joint(a, degree_a, b, degree_b, near):
    """Return whether a line through the joint, where a ends and b begins, separates a from b.

    If there is such a line, there is one through a control point as well. Control points beyond the
    line by less than `near` count as on it; so do both ends at the joint, if they are apart.
    """
    for k in range(degree_a + degree_b):
        u, v = _from_joint(a, degree_a, b, k)
        wide = near * np.hypot(u, v)
        if not wide > near * near:
            continue
        a_least, a_most, b_least, b_most = 0.0, 0.0, 0.0, 0.0
        for i in range(degree_a + degree_b):
            x, y = _from_joint(a, degree_a, b, i)
            side = u * y - v * x
            if i < degree_a:
                a_least, a_most = min(a_least, side), max(a_most, side)
            else:
                b_least, b_most = min(b_least, side), max(b_most, side)
        if max(-a_least, b_most) <= wide or max(a_most, -b_least) <= wide:
            return True
    return False


@kernel
def _from_joint(a, degree, b, i):
    """Return the vector to a control point of a from its last, or to one of b from its first."""
    if i < degree:
        return a[i, 3] - a[degree, 3], a[i, 4] - a[degree, 4]
    return b[i - degree + 1, 3] - b[0, 3], b[i - degree + 1, 4] - b[0, 4]


@kernel
def cross(a, degree_a, b, degree_b, least):
    """Return whether parts cross for certain, even if one is moved by up to `least`; and where.

    Both parts advance along a direction midway between their chords, so they are graphs over it.
    They cross if one is above the other where their common range begins, and below it where the
    range ends.

    Returns:
        (1, rho, z) if they cross; 0 first if this proves no crossing; -1 first if they nearly meet
        where one of them ends.
    """
    u, v = heading(a, degree_a)
    x, y = heading(b, degree_b)
    sign = 1.0 if u * x + v * y >= 0.0 else -1.0
    u, v = u + sign * x, v + sign * y
    length = np.hypot(u, v)
    u, v = u / length, v / length
    if not (_advances(a, degree_a, u, v) and _advances(b, degree_b, u, v)):
        return 0, 0.0, 0.0
    p, q = u * a[0, 3] + v * a[0, 4], u * a[degree_a, 3] + v * a[degree_a, 4]
    r, s = u * b[0, 3] + v * b[0, 4], u * b[degree_b, 3] + v * b[degree_b, 4]
    low, high = max(min(p, q), min(r, s)), min(max(p, q), max(r, s))
    least *= _MOVED
    if not high - low > least:
        return 0, 0.0, 0.0
    before = _across(a, degree_a, u, v, low) - _across(b, degree_b, u, v, low)
    after = _across(a, degree_a, u, v, high) - _across(b, degree_b, u, v, high)
    if not min(abs(before), abs(after)) > least:
        return -1, 0.0, 0.0
    if before * after > 0.0:
        return 0, 0.0, 0.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        here = _across(a, degree_a, u, v, middle) - _across(b, degree_b, u, v, middle)
        low, high = (middle, high) if here * before > 0.0 else (low, middle)
    across = _across(a, degree_a, u, v, low)
    return 1, u * low - v * across, v * low + u * across


@kernel
def _advances(part, degree, u, v):
    """Return whether all legs of the control polygon lead along a direction, or all against it.

    Each leg has to go at least half as far along the direction as away from it.
    """
    sign = (part[degree, 3] - part[0, 3]) * u + (part[degree, 4] - part[0, 4]) * v
    for i in range(degree):
        x, y = part[i + 1, 3] - part[i, 3], part[i + 1, 4] - part[i, 4]
        along = (u * x + v * y) * np.sign(sign)
        if max(abs(x), abs(y)) > LEG and not along >= 0.5 * abs(u * y - v * x):
            return False
    return True


@kernel
def point_on(net, degree, t, rows):
    """Return the point of a piece or a part at t, in the units of `net`, and its weight.

    By de Casteljau's method. Its last two control points, between which the point lies, are left in
    the first rows: x w, y w and w.
    """
    for i in range(degree + 1):
        for c in range(3):
            rows[i, c] = net[i, c]
    for level in range(degree, 1, -1):
        for i in range(level):
            for c in range(3):
                rows[i, c] = (1.0 - t) * rows[i, c] + t * rows[i + 1, c]
    w = (1.0 - t) * rows[0, 2] + t * rows[1, 2]
    x = ((1.0 - t) * rows[0, 0] + t * rows[1, 0]) / w
    y = ((1.0 - t) * rows[0, 1] + t * rows[1, 1]) / w
    return x, y, w


@kernel
def _across(part, degree, u, v, along):
    """Return how far a part is to the left of a direction at `along`; NaN if that is not found."""
    rows = table_on_stack(PLACE, 3, 0.0)
    low, high = 0.0, 1.0
    first, last = u * part[0, 3] + v * part[0, 4], u * part[degree, 3] + v * part[degree, 4]
    t = min(max((along - first) / (last - first), 0.0), 1.0)
    for _ in range(60):
        x, y, w = point_on(part, degree, t, rows)
        over = u * x + v * y - along
        if abs(over) <= _FOUND:
            return u * y - v * x
        low, high = (low, t) if (over > 0.0) == (last > first) else (t, high)
        x = rows[1, 0] / rows[1, 2] - rows[0, 0] / rows[0, 2]
        y = rows[1, 1] / rows[1, 2] - rows[0, 1] / rows[0, 2]
        t -= over * w * w / (degree * rows[0, 2] * rows[1, 2] * (u * x + v * y))  # Newton's step
        if not low < t < high:
            t = 0.5 * (low + high)
    return np.nan


@kernel
def cross_wider(nets, degrees, size, a, b, least):
    """Return whether parts `cross`, and where; if they nearly meet at an end, test wider parts."""
    i, j = np.int64(a[PLACE, 2]), np.int64(b[PLACE, 2])
    found, rho, z = cross(a, degrees[i], b, degrees[j], least)
    if found >= 0:
        return found == 1, rho, z
    one, other = table_on_stack(ROWS, COLUMNS, 0.0), table_on_stack(ROWS, COLUMNS, 0.0)
    widen(nets[i], degrees[i], size, a, one)
    widen(nets[j], degrees[j], size, b, other)
    found, rho, z = cross(one, degrees[i], other, degrees[j], least)
    return found == 1, rho, z
