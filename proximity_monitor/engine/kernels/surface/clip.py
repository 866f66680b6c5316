"""A half-plane around what trimming loops leave of a cell that they cross.

The parts of the loops within the cell lie between two parallel lines. No loop passes beyond either
line, so the cell is wholly kept or wholly cut off there, and one corner tells which. If it is cut
off, the cell's bounds are those of the rest. In small cells a loop is nearly straight, so the
bounds converge like those of cells that no loop crosses.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.jit import inlined, kernel, shared
from ..base.memory import on_stack, table_on_stack
from ..base.rounding import DOUBLE_EPS
from ..base.vectors import norm
from .facing import vector
from .subdivide import PROJECTED
from .trim import OUTSIDE, is_near, row_of, side_of, to_unit
from .trim_curve import curve_box, restricted

_ROOM = 96
"""Most points of loops that are kept, and most stretches of one curve that wait."""

_SMALL = 0.25
"""A stretch is not halved any more once it is smaller than this share of the cell's extent."""

_PATIENCE = 64
"""Most stretches of a segment that are looked at."""


@shared
def clip_cell(table, piece, cell):
    """Write `clip` of a cell; fit its parallelogram and twist to about what is left of it."""
    cell.clip[0] = cell.clip[1] = cell.clip[2] = 0.0
    size = norm(vector(cell.along_u)) + norm(vector(cell.along_v))
    ragged = _clip(table, piece, cell)
    cell.twist = max(cell.twist, ragged * size)  # dividing the cell gains about that much


@kernel
def _clip(table, piece, cell):
    """Write `clip`; return the width of the strip of loops, as a share of the cell's extent.

    Returns 1 if nothing is clipped, and 0 if the cell is too small to tell.
    """
    trim = table.trims[piece.patch]
    low, high, errors = on_stack(2, 0.0), on_stack(2, 0.0), on_stack(2, 0.0)
    for axis in range(2):
        width = piece.high[axis] - piece.low[axis]
        low[axis] = to_unit(trim, axis, piece.low[axis] + cell.low[axis] * width)
        high[axis] = to_unit(trim, axis, piece.low[axis] + cell.high[axis] * width)
        extent = high[axis] - low[axis]
        if not extent > 64.0 * trim.slack:
            return 0.0
        errors[axis] = 4.0 * trim.slack / extent
        if trim.arcs[axis] > 0:
            # With q = atan T, s in 0..1 maps to the share (1 + atan((2 s - 1) T) / q) / 2 of an
            # arc. Its second derivative is at most 1.3 T² / q, and it leaves its chord by an eighth
            # of that.
            tangent = trim.tangent[axis]
            s = (cell.high[axis] - cell.low[axis]) * width / trim.extent[axis] * trim.arcs[axis]
            turn = 0.17 * tangent * tangent / math.atan(tangent) * s * s / trim.arcs[axis]
            errors[axis] += turn / extent
    points = table_on_stack(96, 2, 0.0)
    count = _gather(table, trim, low, high, points)
    if count <= 0:
        return 1.0
    for k in range(count):
        for axis in range(2):
            points[k, axis] = (points[k, axis] - low[axis]) / (high[axis] - low[axis])
    across = _across(points, count)
    if across[0] == 0.0 and across[1] == 0.0:
        return 1.0
    error = abs(across[0]) * errors[0] + abs(across[1]) * errors[1] + 1e-14
    best = wide = 0.0
    for sign in (1.0, -1.0):
        x, y = sign * across[0], sign * across[1]
        end = -np.inf
        for k in range(count):
            end = max(end, x * points[k, 0] + y * points[k, 1])
        wide += end
        end += error
        s, t = 1.0 if x > 0.0 else 0.0, 1.0 if y > 0.0 else 0.0
        cut = x * s + y * t - end
        if cut > best:
            place_x = high[0] if x > 0.0 else low[0]
            place_y = high[1] if y > 0.0 else low[1]
            if side_of(table, trim, place_x, place_y) == OUTSIDE:
                best = cut
                cell.clip[0], cell.clip[1], cell.clip[2] = x, y, end
    if best == 0.0:
        return 1.0
    _narrow(cell)
    return wide


@kernel
def _gather(table, trim, low, high, points):
    """Collect points of the unit square whose hull holds the loops' parts in a rectangle.

    Returns how many they are, or -1 if there are too many.
    """
    left, right = low[0] - trim.slack, high[0] + trim.slack
    lower, upper = low[1] - trim.slack, high[1] + trim.slack
    size = _SMALL * max(right - left, upper - lower)
    count = 0
    for row in range(row_of(trim, lower), row_of(trim, upper) + 1):
        for entry in range(table.rows[row], table.rows[row + 1]):
            segment = table.segments[table.entries[entry]]
            if segment.band >= 0.0 and is_near(segment, left, lower, right, upper):
                if segment.degree == 1:
                    count = _chord(segment, left, lower, right, upper, points, count)
                else:
                    count = _stretches(
                        table, segment, trim.slack, left, lower, right, upper, size, points, count
                    )
                if count < 0:
                    return count
    return count


@kernel
def _chord(segment, left, lower, right, upper, points, count):
    """Add the ends of a straight segment's part in a rectangle; return the count, or -1 if full."""
    ax, ay = segment.a[0], segment.a[1]
    dx, dy = segment.b[0] - ax, segment.b[1] - ay
    begin, end = 0.0, 1.0
    if dx != 0.0:
        one, other = (left - ax) / dx, (right - ax) / dx
        begin, end = max(begin, min(one, other)), min(end, max(one, other))
    if dy != 0.0:
        one, other = (lower - ay) / dy, (upper - ay) / dy
        begin, end = max(begin, min(one, other)), min(end, max(one, other))
    if begin > end:  # it passes a corner, to within rounding
        begin, end = min(max(end, 0.0), 1.0), min(max(begin, 0.0), 1.0)
    if count + 2 > _ROOM:
        return -1
    points[count, 0], points[count, 1] = ax + begin * dx, ay + begin * dy
    points[count + 1, 0], points[count + 1, 1] = ax + end * dx, ay + end * dy
    return count + 2


@kernel
def _stretches(table, segment, slack, left, lower, right, upper, size, points, count):
    """Add the control points of a curve's stretches that touch a rectangle; return as `_chord`."""
    stack, net = table_on_stack(96, 2, 0.0), table_on_stack(16, 3, 0.0)
    stack[0, 0], stack[0, 1] = segment.begin, segment.end
    waiting = 1
    for _ in range(_PATIENCE):
        waiting -= 1
        begin, end = stack[waiting, 0], stack[waiting, 1]
        x0, y0, x1, y1 = curve_box(table.nets, segment, begin, end, slack)
        if x0 <= right and x1 >= left and y0 <= upper and y1 >= lower:
            inside = x0 >= left and x1 <= right and y0 >= lower and y1 <= upper
            if inside or max(x1 - x0, y1 - y0) <= size:
                if count + segment.degree + 1 > _ROOM:
                    return -1
                restricted(table.nets, segment, begin, end, net)
                for i in range(segment.degree + 1):
                    points[count, 0], points[count, 1] = (
                        net[i, 0] / net[i, 2],
                        net[i, 1] / net[i, 2],
                    )
                    count += 1
            else:
                middle = 0.5 * (begin + end)
                stack[waiting, 1] = middle
                stack[waiting + 1, 0], stack[waiting + 1, 1] = middle, end
                waiting += 2
        if waiting == 0:
            return count
    return -1


@kernel
def _across(points, count):
    """Return a unit vector about normal to the longest way between points; 0 if there is none."""
    far = 0
    for _ in range(2):
        x, y = points[far, 0], points[far, 1]
        square = 0.0
        last = far
        for k in range(count):
            d = (points[k, 0] - x) ** 2 + (points[k, 1] - y) ** 2
            if d > square:
                square, far = d, k
    x, y = points[far, 0] - points[last, 0], points[far, 1] - points[last, 1]
    length = math.sqrt(x * x + y * y)
    if not length > 1e-12:
        return 0.0, 0.0
    return -y / length, x / length


@inlined
def _corner(k):
    """Return corner k of the unit square; k counts around the square."""
    return (1.0 if k == 1 or k == 2 else 0.0), (1.0 if k >= 2 else 0.0)


@kernel
def _narrow(cell):
    """Fit the cell's parallelogram to the box, in parameters, around what is left of the cell."""
    x, y, end = cell.clip[0], cell.clip[1], cell.clip[2]
    s_0 = t_0 = 1.0
    s_1 = t_1 = 0.0
    for k in range(4):
        (a, b), (c, d) = _corner(k), _corner((k + 1) % 4)
        one, other = x * a + y * b - end, x * c + y * d - end
        if one <= 0.0:
            s_0, s_1, t_0, t_1 = min(s_0, a), max(s_1, a), min(t_0, b), max(t_1, b)
        if (one <= 0.0) != (other <= 0.0):
            share = one / (one - other)
            s, t = a + share * (c - a), b + share * (d - b)
            s_0, s_1, t_0, t_1 = min(s_0, s), max(s_1, s), min(t_0, t), max(t_1, t)
    if s_0 > s_1 or t_0 > t_1:
        return
    for i in range(3):
        u, v = cell.along_u[i], cell.along_v[i]
        cell.centre[i] += (s_0 + s_1 - 1.0) * u + (t_0 + t_1 - 1.0) * v
        cell.along_u[i], cell.along_v[i] = (s_1 - s_0) * u, (t_1 - t_0) * v


@kernel
def clipped_least(piece, cell, nets, at, n):
    """Return a lower bound of the product of n with any point of what is left of a cell.

    The product f is a Bezier function; its coefficients b_ij are the products of the control
    points. A linear function a differs from f by at most the largest |b_ij - a(i/p, j/q)|, and a is
    least at a corner of what is left. Weights w_ij shift a(i/p, j/q) away from a(u, v): along each
    parameter by at most sum B_i |i/p - u|, which is at most 1/2, times (w_max - w_min) / 2 w_min.
    """
    p, q, room = np.int64(piece.degree_u), np.int64(piece.degree_v), np.int64(piece.room)
    f_00, f_01 = _product(nets, at, room, n), _product(nets, at + q, room, n)
    f_10, f_11 = (
        _product(nets, at + p * (q + 1), room, n),
        _product(nets, at + p * (q + 1) + q, room, n),
    )
    slope_u, slope_v = 0.5 * ((f_10 - f_00) + (f_11 - f_01)), 0.5 * ((f_01 - f_00) + (f_11 - f_10))
    begin = 0.25 * ((f_00 + f_01) + (f_10 + f_11)) - 0.5 * (slope_u + slope_v)
    error, light, heavy, most = 0.0, np.inf, 0.0, 0.0
    for i in range(p + 1):
        for j in range(q + 1):
            k = at + i * (q + 1) + j
            value = _product(nets, k, room, n)
            most = max(most, abs(value))
            error = max(error, begin + slope_u * (i / p) + slope_v * (j / q) - value)
            if piece.rational:
                w = nets[k + (PROJECTED + 3) * room]
                light, heavy = min(light, w), max(heavy, w)
    if piece.rational:
        error += 0.25 * (heavy - light) / light * (abs(slope_u) + abs(slope_v)) * (1.0 + 1e-12)
    least = np.inf
    x, y, end = cell.clip[0], cell.clip[1], cell.clip[2]
    for k in range(4):
        (a, b), (c, d) = _corner(k), _corner((k + 1) % 4)
        one, other = x * a + y * b - end, x * c + y * d - end
        if one <= 0.0:
            least = min(least, begin + slope_u * a + slope_v * b)
        if (one <= 0.0) != (other <= 0.0):
            share = one / (one - other)
            s, t = a + share * (c - a), b + share * (d - b)
            least = min(least, begin + slope_u * s + slope_v * t)
    return least - error - 64.0 * DOUBLE_EPS * most


@inlined
def _product(nets, k, room, n):
    return nets[k] * n[0] + nets[k + room] * n[1] + nets[k + 2 * room] * n[2]
