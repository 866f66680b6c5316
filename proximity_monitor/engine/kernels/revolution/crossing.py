"""Whether a profile crosses itself.

Its Bezier pieces are halved until the tangents of each part stay within a quarter turn, so that no
part crosses itself. Consecutive parts make up a run as long as there is a direction along which all
of them advance: no two parts of a run meet. Parts of different runs are compared with each other.
If no line between their control points proves them separate, they are halved and compared again,
until they are separate, or cross for certain, or are too straight for it to matter.

A profile that crosses itself is accepted in these cases:

- A loop shrinks to nothing if the profile is moved by some 1e-12 of its size, at a corner or a cusp
  as well as elsewhere: _LEAST says why. Such a loop is narrow rather than short. The loop of a
  cubic near a cusp is up to 1e-7 of the size long. If the sides of a corner of angle zero separate
  as a circle as large as the profile does from its tangent, the loop is up to 1e-5 long. Straighter
  sides may be that near each other for any length.
- Pieces cross near an end of one of them, at an angle of less than _ANGLE, and as near to that end
  as some 1e-12 of the size over the angle.
- Some parts are still to be compared after _LOOKS at two parts and their halves, or after
  _ALL_LOOKS in all, and are no wider than _COARSE. That happens if a bent profile runs on itself
  for long, or beside itself at less than some 1e-9 of its size.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import allocating, allocating_entry, kernel
from ..base.memory import table_on_stack
from .part import (
    BOX,
    COLUMNS,
    PLACE,
    ROWS,
    copy,
    cross_wider,
    directions,
    extent,
    halve,
    heading,
    point_on,
    separate,
    separate_at_joint,
    take,
    width,
)

_STRAIGHT = 1e-12
"""Share of the profile's size, as all lengths here. A part counts as straight if it bends no
farther away from its chord, and two points count as one if they are no farther apart."""

_LEAST = 2e-12
"""A crossing counts only if the parts still cross when one is moved by this. It is more than the
1e-12 that coincident ends may be apart, and that rounding may have moved points at a cusp."""

_QUARTER, _HALF = 0.5 * np.pi, 3.0
"""Largest range of the tangents' angles of a part, and of a run, radians. All parts of a run
advance along a common direction by 1/14 of their length or more."""

_ANGLE = 1e-6
"""Sine of the angle below which straight parts run along each other and do not cross."""

_BENT = 16.0
"""A part's tangents are at an angle of up to 4 times its width over its length to its chord, as
those of a circle are, and of twice that to the next chord. Parts that run along each other may be
at such an angle."""

_AROUND = 1e-4
"""Straight parts that meet at a larger angle are refused even if neither passes across the other: a
corner may be on a wall. But between them the profile has to go farther away than this. If the sides
leave a corner or a cusp as the power m <= 15 of the distance from it, their angle is m times their
gap over that distance: less than _ANGLE if the gap is as small as 3e-12."""

_DEEPEST = 60
"""How often a piece is halved, at most: by then a cusp is a point."""

_ROOM, _LOOKS, _ALL_LOOKS = 256, 1 << 14, 1 << 16
"""Pairs that may wait; looks at a pair of parts and its halves, and looks in all, at most."""

_COARSE, _FEW_LOOKS = 1e-5, 1 << 10
"""A pair that uses up its looks is looked at again, with parts of this width taken for straight: so
many looks find large crossings. Each pair may take so many, however many others took."""


@allocating_entry
def first_crossing(nets, degrees, size):
    """Find the first crossing along a profile; the module's docstring says what is overlooked.

    Args:
        nets: (n, 16, 3) control points rho w, z w and w of its pieces, one after the other.
        degrees: (n,) of the pieces.
        size: metres; the largest coordinate.

    Returns:
        (i, j, rho, z): two pieces, which may be the same, and a point, metres; i is -1 if there
        is no crossing.
    """
    if not size > 0.0:
        return -1, -1, 0.0, 0.0
    parts, angles = _parts(nets, degrees, size)
    starts, boxes = _runs(parts, angles)
    count, runs, looks = len(parts), len(boxes), 0
    pairs, joined = np.empty((_ROOM, 2, ROWS, COLUMNS)), np.empty(_ROOM, np.bool_)
    closed = count > 2 and _closes(parts[0], parts[-1], degrees)
    for r in range(runs):
        for s in range(r + 1, runs):
            if not _boxes_meet(boxes[r], boxes[s]):
                continue
            for i in range(starts[r], starts[r + 1]):
                if not _boxes_meet(parts[i, BOX], boxes[s]):
                    continue
                for j in range(starts[s], starts[s + 1]):
                    if not _boxes_meet(parts[i, BOX], parts[j, BOX]):
                        continue
                    last = closed and i == 0 and j == count - 1  # the first part follows it
                    a, b = (j, i) if last else (i, j)
                    p, q = np.int64(parts[a, PLACE, 2]), np.int64(parts[b, PLACE, 2])
                    joint = last or j == i + 1
                    if not _may_cross(parts[a], degrees[p], parts[b], degrees[q], joint):
                        continue
                    left = min(_LOOKS, max(_ALL_LOOKS - looks, _FEW_LOOKS))
                    for enough in (_STRAIGHT, _COARSE):
                        copy(parts[a], degrees[p], pairs[0, 0])
                        copy(parts[b], degrees[q], pairs[0, 1])
                        joined[0] = joint
                        found, made, rho, z = _look(
                            nets, degrees, size, closed, pairs, joined, enough, left
                        )
                        looks += made
                        if found:
                            return min(p, q), max(p, q), rho * size, z * size
                        if made < left:
                            break
                        left = _FEW_LOOKS
    return -1, -1, 0.0, 0.0


@allocating
def _parts(nets, degrees, size):
    """Return parts (n, 18, 5) in units of the size, without points; and their angles (n, 2).

    The angles are the least and the greatest of each part's tangents.
    """
    parts, angles, count = np.empty((4 * len(nets), ROWS, COLUMNS)), np.empty((4 * len(nets), 2)), 0
    waiting, depths = np.empty((_DEEPEST + 4, ROWS, COLUMNS)), np.empty(_DEEPEST + 4, np.int64)
    part, kept = np.empty((ROWS, COLUMNS)), 0
    for k in range(len(nets)):
        take(nets[k], degrees[k], size, k, part)
        kept += extent(part) > _STRAIGHT
    enough = 0 if kept > 2 else 2  # two parts of a loop may not share both ends
    for k in range(len(nets)):
        take(nets[k], degrees[k], size, k, waiting[0])
        left, depths[0] = 1, 0
        while left > 0:
            left -= 1
            copy(waiting[left], degrees[k], part)
            depth = depths[left]
            if extent(part) <= _STRAIGHT:
                continue
            low, high = directions(part, degrees[k])
            if depth < _DEEPEST and (depth < enough or high - low > _QUARTER):
                halve(part, degrees[k], waiting[left + 1], waiting[left])
                depths[left] = depths[left + 1] = depth + 1
                left += 2
                continue
            if count == len(parts):
                more, beside = np.empty((2 * count, ROWS, COLUMNS)), np.empty((2 * count, 2))
                # Row by row: to copy slices, numba would compile an error message, which takes
                # three seconds.
                for i in range(count):
                    copy(parts[i], degrees[np.int64(parts[i, PLACE, 2])], more[i])
                    beside[i, 0], beside[i, 1] = angles[i, 0], angles[i, 1]
                parts, angles = more, beside
            copy(part, degrees[k], parts[count])
            angles[count, 0], angles[count, 1] = low, high
            count += 1
    return parts[:count], angles[:count]


@allocating
def _runs(parts, angles):
    """Return where runs begin (r + 1,), and the boxes (r, 4) around them."""
    starts, boxes, runs = np.empty(len(parts) + 1, np.int64), np.empty((len(parts), 4)), 0
    low, high = 0.0, 0.0
    for i in range(len(parts)):
        own_low, own_high = angles[i, 0], angles[i, 1]
        turns = 2.0 * np.pi * np.rint((low + high - own_low - own_high) / (4.0 * np.pi))
        own_low, own_high = own_low + turns, own_high + turns
        box = parts[i, BOX]
        if i > 0 and max(high, own_high) - min(low, own_low) <= _HALF:
            low, high = min(low, own_low), max(high, own_high)
            for c in (0, 2):
                boxes[runs - 1, c] = min(boxes[runs - 1, c], box[c])
                boxes[runs - 1, c + 1] = max(boxes[runs - 1, c + 1], box[c + 1])
            continue
        low, high, starts[runs] = own_low, own_high, i
        for c in range(4):
            boxes[runs, c] = box[c]
        runs += 1
    starts[runs] = len(parts)
    return starts[: runs + 1], boxes[:runs]


@kernel
def _closes(first, last, degrees):
    """Return whether the profile ends where it begins."""
    end = last[degrees[np.int64(last[PLACE, 2])]]
    return np.hypot(first[0, 3] - end[3], first[0, 4] - end[4]) <= _LEAST


@kernel
def _boxes_meet(a, b):
    return a[0] <= b[1] and b[0] <= a[1] and a[2] <= b[3] and b[2] <= a[3]


@kernel
def _may_cross(a, degree_a, b, degree_b, joined):
    """Return whether no line separates two parts; of joined parts, no line through their joint."""
    if joined:
        return not separate_at_joint(a, degree_a, b, degree_b, _STRAIGHT)
    return not separate(a, degree_a, b, degree_b)


@kernel
def _look(nets, degrees, size, closed, pairs, joined, enough, most):
    """Return whether the two parts in pairs[0] cross, how many looks that took, and where.

    If `joined` says so, the first part of a pair ends where the second begins. If all looks allowed
    are used up, the parts may cross although no crossing was found.
    """
    a0, a1 = table_on_stack(ROWS, COLUMNS, 0.0), table_on_stack(ROWS, COLUMNS, 0.0)
    b0, b1 = table_on_stack(ROWS, COLUMNS, 0.0), table_on_stack(ROWS, COLUMNS, 0.0)
    p, q = np.int64(pairs[0, 0, PLACE, 2]), np.int64(pairs[0, 1, PLACE, 2])
    degree_a, degree_b = degrees[p], degrees[q]
    count, looks = 1, 0
    while count > 0 and looks < most:
        looks += 1
        count -= 1
        a, b, joint = pairs[count, 0], pairs[count, 1], joined[count]
        halve_a, halve_b = width(a) > enough, width(b) > enough
        found, rho, z = cross_wider(nets, degrees, size, a, b, _LEAST)
        if found:
            return True, looks, rho, z
        if not (halve_a or halve_b):
            if enough == _STRAIGHT and not joint and _meet(nets, degrees, size, closed, a, b):
                rho, z = _where(a, degree_a, b, degree_b)
                return True, looks, rho, z
            continue
        if count + 4 > _ROOM:
            continue
        if halve_a:
            halve(a, degree_a, a0, a1)
        else:
            copy(a, degree_a, a1)
        if halve_b:
            halve(b, degree_b, b0, b1)
        else:
            copy(b, degree_b, b0)
        for k in range(4):  # the pair at the joint last: it is taken next
            if (k < 2 and not halve_a) or (k % 2 == 0 and not halve_b):
                continue
            one, other = a0 if k < 2 else a1, b1 if k % 2 == 0 else b0
            joined[count] = joint and k == 3
            if _may_cross(one, degree_a, other, degree_b, joined[count]):
                copy(one, degree_a, pairs[count, 0])
                copy(other, degree_b, pairs[count, 1])
                count += 1
    return False, looks, 0.0, 0.0


@kernel
def _where(a, degree_a, b, degree_b):
    """Return where a part's chord meets the line of another's chord, or is nearest to it."""
    u, v = heading(a, degree_a)
    x, y = heading(b, degree_b)
    across = u * y - v * x
    along = 0.5 * a[BOX, 4]
    if abs(across) > _ANGLE:
        along = ((b[0, 3] - a[0, 3]) * y - (b[0, 4] - a[0, 4]) * x) / across
    along = min(max(along, 0.0), a[BOX, 4])
    return a[0, 3] + along * u, a[0, 4] + along * v


@kernel
def _meet(nets, degrees, size, closed, a, b):
    """Return whether straight parts meet at an angle, and the profile goes far between them."""
    i, j = np.int64(a[PLACE, 2]), np.int64(b[PLACE, 2])
    u, v = heading(a, degrees[i])
    x, y = heading(b, degrees[j])
    bent = width(a) / a[BOX, 4] + width(b) / b[BOX, 4]
    if abs(u * y - v * x) <= _ANGLE + _BENT * bent:
        return False
    x, y = _where(a, degrees[i], b, degrees[j])
    x, y = x * size, y * size
    if i > j or (i == j and a[PLACE, 0] > b[PLACE, 0]):
        a, b, i, j = b, a, j, i
    far = _AROUND * size
    if not _leaves(nets, degrees, i, a[PLACE, 1], j, b[PLACE, 0], x, y, far):
        return False
    if not closed:
        return True
    last = len(nets) - 1
    return _leaves(nets, degrees, j, b[PLACE, 1], last, 1.0, x, y, far) or _leaves(
        nets, degrees, 0, 0.0, i, a[PLACE, 0], x, y, far
    )


@kernel
def _leaves(nets, degrees, i, low, j, high, x, y, far):
    """Return whether the profile leaves a circle about (x, y) between two places; all in metres."""
    rows = table_on_stack(PLACE, 3, 0.0)
    for k in range(i, j + 1):
        first, last = low if k == i else 0.0, high if k == j else 1.0
        for m in range(9):
            rho, z, _ = point_on(nets[k], degrees[k], first + (last - first) * m / 8, rows)
            if np.hypot(rho - x, z - y) > far:
                return True
    return False
