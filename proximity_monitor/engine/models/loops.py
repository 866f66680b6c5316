"""Find out on which side of trimming loops the patch is left, and prove that they do not cross.

What is left of a patch is inside an odd number of loops. The loops are its boundary only if they
neither cross nor touch themselves or each other. Then it lies on one side of each loop. The proof
is a line between the hulls of any two stretches, which are halved until there is such a line. If a
stretch begins at the end of another, the line must pass through this common point. At a cusp there
is no such line; the stretches that stay undecided there need only be small.

A stretch is a rational Bezier curve: homogeneous control points (n, 3) in the unit square.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .trim import Trim

Reals = NDArray[np.float64]

_DEEP = 30
"""The most halvings of a stretch."""
_SMALL = 1e-9
"""As a share of the rectangle: a stretch no larger than this is a point."""
_CUSP = 1e-6
"""As a share of the rectangle: stretches no larger than this beside a cusp may cross, because
rounding hides whether they do."""

_MANY, _MANY_TIMES = 4096, 8
"""A loop whose side is not proven is divided into up to so many stretches, or into so many times
as many as it has, whichever is more."""

_OUTSIDE = 0.5
"""Segments that stand for a side of the rectangle are at least so far outside it (see trim.py)."""


class Loops(NamedTuple):
    """The result of examining the loops of a trim."""

    reason: str
    """Why they are no boundary; empty if they are."""
    turned: list[bool]
    """For each loop, whether what is left of the patch lies on its right."""
    blur: float
    """As a share of the rectangle: what is left may differ from what the loops bound only within
    this distance of the loops."""


def examine(trim: Trim) -> Loops:
    """Find out on which side of its loops a patch is left, and whether the loops cross or touch."""
    slack = 4.0 * float(trim.record["slack"])
    loops, blur = [], slack
    for loop in trim.loops:
        stretches, moved = _fine(list(chain(*(part.outline for part in loop))))
        loops.append(stretches)
        blur = max(blur, slack + moved)
    if not all(loops):
        return Loops("one of its trimming loops is a point", [], 0.0)
    for loop in loops:
        for stretch in loop:
            blur = max(blur, _alone(stretch, slack, _DEEP))
    stretches = list(chain(*loops))
    of = np.repeat(np.arange(len(loops)), [len(loop) for loop in loops])
    first = np.searchsorted(of, of)
    number = np.arange(len(of))
    following = np.where(np.append(of[1:], -1) == of, number + 1, first)
    low = np.array([_hull(each).min(axis=0) for each in stretches]) - slack
    high = np.array([_hull(each).max(axis=0) for each in stretches]) + slack
    meet = ((low[:, None] <= high) & (low <= high[:, None])).all(axis=2)
    for i, j in np.argwhere(np.triu(meet, 1)).tolist():
        a, b = stretches[i], stretches[j]
        if following[i] == j:
            blur = max(blur, _joined(a, b, slack, _DEEP))
        elif following[j] == i:
            blur = max(blur, _joined(b, a, slack, _DEEP))
        elif not _are_apart(a, b, slack, _DEEP):
            blur = np.inf
    if blur > _CUSP:
        return Loops("its trimming loops cross or touch", [], 0.0)
    turned = []
    for i, loop in enumerate(loops):
        place = _hull(loop[0])[0]
        odd = sum(_holds(other, place, slack) for j, other in enumerate(loops) if j != i) % 2
        area = _area(loop, slack)
        if area == 0.0:
            return Loops("one of its trimming loops is too thin to tell its inside", [], 0.0)
        turned.append((area > 0.0) == (odd == 1))
    return Loops("", turned, blur)


def _fine(stretches: list[Reals]) -> tuple[list[Reals], float]:
    """Return the stretches of a loop without those that are points, and how far ends were moved.

    There are at least three, each of which begins exactly where the one before it ends; none if
    the whole loop is a point.
    """
    found, moved = _without_folds(each for each in stretches if _size(each) > _SMALL), 0.0
    for before, each in zip([*found[-1:], *found[:-1]], found, strict=True):
        end = before[-1, :2] / before[-1, 2]
        moved = max(moved, float(np.abs(_hull(each)[0] - end).max()))
        each[0, :2] = end * each[0, 2]
    while 0 < len(found) < 3:
        found = list(chain(*map(split, found)))
    return found, moved


def _without_folds(stretches: Iterable[Reals]) -> list[Reals]:
    """Join successive stretches that lie on one line outside the rectangle; return all stretches.

    Two straight stretches that go somewhere and come back at once are dropped.
    """
    found: list[Reals] = []
    for each in stretches:
        if found and len(found[-1]) == len(each) == 2:
            points = np.concatenate([found[-1], each])[:, :2]
            if np.abs(points[3] - points[0]).max() <= _SMALL:
                found.pop()
                continue
            outside = ((points <= -_OUTSIDE) | (points >= 1.0 + _OUTSIDE)).all(axis=0)
            if (outside & (np.ptp(points, axis=0) == 0.0)).any():
                found[-1][1] = each[1]
                continue
        found.append(each.copy())
    return [each for each in found if _size(each) > _SMALL]


def _hull(net: Reals) -> Reals:
    """Return control points (n, 2), whose hull holds the curve, from homogeneous ones (n, 3)."""
    return net[:, :2] / net[:, 2:]


def split(net: Reals, t: float = 0.5) -> tuple[Reals, Reals]:
    """Split a curve of homogeneous control points at a parameter (de Casteljau's algorithm)."""
    first, last = [net[0]], [net[-1]]
    while len(net) > 1:
        net = (1.0 - t) * net[:-1] + t * net[1:]
        first.append(net[0])
        last.append(net[-1])
    return np.array(first), np.array(last[::-1])


def _size(net: Reals) -> float:
    return float(np.ptp(_hull(net), axis=0).max())


def _alone(net: Reals, slack: float, deep: int) -> float:
    """Return the size of the largest part of a stretch that may cross itself; 0 if none can."""
    if len(net) == 2:
        return 0.0
    points = _hull(net)
    if (np.diff(points, axis=0) @ (points[-1] - points[0]) > 0.0).all():
        return 0.0
    if deep == 0 or _size(net) <= slack:
        return _size(net)
    a, b = split(net)
    joined = _joined(a, b, slack, deep - 1)
    return max(_alone(a, slack, deep - 1), _alone(b, slack, deep - 1), joined)


def _joined(a: Reals, b: Reals, slack: float, deep: int) -> float:
    """Return the size of the parts of a and b that may meet, besides where a ends and b begins."""
    p, q = _hull(a), _hull(b)
    before, behind = _unit(p[-1] - p[:-1][::-1]), _unit(q[1:] - q[0])
    n = before + behind
    if ((p - p[-1])[:-1] @ n < 0.0).all() and ((q - q[0])[1:] @ n > 0.0).all():
        return 0.0
    size = max(_size(a), _size(b))
    if len(a) == len(b) == 2:
        return np.inf  # b folds back onto a
    if deep == 0 or size <= slack:
        return size
    (a, near_a), (near_b, b) = split(a), split(b)
    if not (_are_apart(a, near_b, slack, deep) and _are_apart(near_a, b, slack, deep)):
        return size
    if not _are_apart(a, b, slack, deep):
        return size
    return _joined(near_a, near_b, slack, deep - 1)


def _unit(ways: Reals) -> Reals:
    """Return the unit vector along the first of vectors (k, 2) that is not 0."""
    lengths = np.hypot(*ways.T)
    first = int(np.argmax(lengths > 0.0))
    return ways[first] / max(lengths[first], 1e-300)


def _are_apart(a: Reals, b: Reals, slack: float, deep: int) -> bool:
    """Tell whether two stretches certainly do not meet."""
    p, q = _hull(a), _hull(b)
    along = np.array([p[-1] - p[0], q[-1] - q[0]])
    ways = np.concatenate([along, along[:, ::-1] * (1.0, -1.0), np.eye(2)])
    one, other = p @ ways.T, q @ ways.T
    margin = slack * np.hypot(*ways.T)
    if (one.max(axis=0) + margin < other.min(axis=0)).any():
        return True
    if (other.max(axis=0) + margin < one.min(axis=0)).any():
        return True
    if deep == 0 or len(a) == len(b) == 2:
        return False
    if len(b) == 2 or (len(a) > 2 and _size(a) > _size(b)):
        return all(_are_apart(half, b, slack, deep - 1) for half in split(a))
    return all(_are_apart(a, half, slack, deep - 1) for half in split(b))


def _holds(loop: Sequence[Reals], place: Reals, slack: float) -> bool:
    """Tell whether a loop runs around a point off it, from the crossings of a ray to the right.

    Outside of its hull a stretch counts as its chord, as in kernels/surface/trim.py.
    """
    odd, waiting = False, [(each, _DEEP) for each in loop]
    while waiting:
        net, deep = waiting.pop()
        points = _hull(net)
        low, high = points.min(axis=0) - slack, points.max(axis=0) + slack
        if not (low[1] <= place[1] <= high[1] and place[0] <= high[0]):
            continue
        (ax, ay), (bx, by) = points[0], points[-1]
        if place[0] >= low[0] and len(net) > 2 and deep > 0:
            waiting += [(half, deep - 1) for half in split(net)]
        elif (ay <= place[1]) != (by <= place[1]):
            at = ax + (place[1] - ay) / (by - ay) * (bx - ax)
            odd ^= place[0] < low[0] or bool(place[0] < at)
    return odd


def _area(loop: Sequence[Reals], slack: float) -> float:
    """Return about twice a loop's area, positive if it is on the left; 0 if its sign is not proven.

    Moving every point of the loop by up to `slack`, as rounding may, changes twice its area by at
    most twice `slack` times its length. That is counted twice, which covers the products below:
    they are of differences, so what rounds off is a share of the loop's own size.
    """
    most = max(_MANY, _MANY_TIMES * len(loop))
    while True:
        ends = np.array([_hull(each)[0] for each in loop])
        steps = np.roll(ends, -1, axis=0) - ends
        ends = ends - ends[0]
        area = math.fsum(ends[:, 0] * steps[:, 1] - ends[:, 1] * steps[:, 0])
        # A curve and its chord enclose at most twice their hull's area, and `area` is doubled.
        missing = sum(4.0 * _hull_area(each) for each in loop)
        length = sum(float(np.hypot(*np.diff(_hull(each), axis=0).T).sum()) for each in loop)
        if abs(area) > missing + 4.0 * slack * (length + slack):
            return area
        if len(loop) > most or all(len(each) == 2 for each in loop):
            return 0.0
        loop = list(chain(*(split(each) if len(each) > 2 else (each,) for each in loop)))


def _hull_area(net: Reals) -> float:
    """Return an upper bound of the area of the hull of control points."""
    points = _hull(net) - _hull(net)[0]
    way = points[-1]
    length = float(np.hypot(*way))
    if len(net) == 2 or length == 0.0:
        return 0.0 if len(net) == 2 else _size(net) ** 2
    along = points @ way / length
    across = points @ (way[::-1] * (-1.0, 1.0)) / length
    return float(np.ptp(along) * np.ptp(across))
