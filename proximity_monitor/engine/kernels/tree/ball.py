"""The smallest ball around points: exact except for rounding, by exchanging boundary points.

At most four points on the boundary define the smallest ball (Welzl 1991). The point that is
farthest outside joins them, the points that it makes superfluous leave, and the ball grows until it
holds all points.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel
from ..base.memory import table_on_stack
from ..base.vectors import add, cross, dot, scaled, sub

_ROUNDS = 32
"""Exchanges after which the best ball so far is taken. About ten suffice for 100,000 points."""


@kernel
def enclosing_ball(points, n):
    """Return the centre of the smallest ball around points[:n].

    If the points lie in a plane, it is the centre of the smallest circle around them.
    """
    basis = table_on_stack(5, 3, 0.0)
    basis[0, 0], basis[0, 1], basis[0, 2] = points[0, 0], points[0, 1], points[0, 2]
    used, squared = np.int64(1), 0.0  # with a literal, helpers would be compiled twice
    centre = _at(points, 0)
    best, least = centre, np.inf
    for _ in range(_ROUNDS):
        farthest, outside = _farthest(points, n, centre)
        if farthest < least:
            best, least = centre, farthest
        # No point lies outside, except by rounding.
        if not farthest > squared * (1.0 + 1e-12):
            break
        for axis in range(3):
            basis[used, axis] = points[outside, axis]
        used, centre, grown = _exchange(basis, used)
        if not grown > squared:
            break
        squared = grown
    return best


@kernel
def _at(points, i):
    return (points[i, 0], points[i, 1], points[i, 2])


@kernel
def _farthest(points, n, centre):
    """Return the largest squared distance of points[:n] from a centre, and which point has it."""
    farthest, which = -1.0, 0
    for i in range(n):
        d = sub(_at(points, i), centre)
        squared = dot(d, d)
        if not squared <= farthest:
            farthest, which = squared, i
    return farthest, which


@kernel
def _exchange(basis, used):
    """Find the smallest ball around basis[:used + 1] that has the last (new) point on its boundary.

    Moves the at most four points that define the ball to the front of `basis`. Returns their
    number, the centre and the squared radius. The ball is chosen among all balls through the new
    point and some of the others. Each is given the radius that holds all points, as measured; so
    rounding cannot choose a ball that is too small.
    """
    new = _at(basis, used)
    least, chosen, centre = np.inf, 0, new
    for mask in range(1, 1 << used):
        trial = _through(basis, used, mask, new)
        squared = _farthest(basis, used + 1, trial)[0]
        # If points coincide or lie on a line, the trial is not finite, and the comparison is false.
        if squared < least:
            least, chosen, centre = squared, mask, trial
    kept = 0
    for i in range(used + 1):
        if i == used or chosen >> i & 1:
            for axis in range(3):
                basis[kept, axis] = basis[i, axis]
            kept += 1
    return kept, centre, least


@kernel
def _through(basis, used, mask, new):
    """Return the centre of the smallest ball through a point and the one to three points of a mask.

    It is not finite if the points do not define a ball, or if the mask has four points.
    """
    a = b = c = new
    count = 0
    for i in range(used):
        if mask >> i & 1:
            if count == 0:
                a = sub(_at(basis, i), new)
            elif count == 1:
                b = sub(_at(basis, i), new)
            elif count == 2:
                c = sub(_at(basis, i), new)
            count += 1
    if count == 1:
        return add(new, scaled(a, 0.5))
    ab = cross(a, b)
    if count == 2:
        towards = cross(sub(scaled(b, dot(a, a)), scaled(a, dot(b, b))), ab)
        return add(new, scaled(towards, 0.5 / dot(ab, ab)))
    if count == 3:
        towards = add(scaled(cross(b, c), dot(a, a)), scaled(cross(c, a), dot(b, b)))
        towards = add(towards, scaled(ab, dot(c, c)))
        return add(new, scaled(towards, 0.5 / dot(c, ab)))
    return (np.nan, np.nan, np.nan)
