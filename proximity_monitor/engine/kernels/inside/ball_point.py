"""How deep a point lies in a solid: its signed distance to the surface, positive inside.

The depth of x in a solid is f(x) = g(x) + r. Here r is the solid's swept radius, and g is the
distance of x to the surface of the core (the elements), positive inside and negative outside. If
the core is closed, g changes by no more than x moves, because the surface lies between two points
on different sides. If the core has no inside, g is minus the distance.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel, shared
from ..base.memory import on_stack
from ..base.vectors import moved, scaled, sub, turned_back, unit
from ..tree.layout import WIDTH
from .angles import side_of
from .feet import foot_of, normal_at, seek
from .solids import HALF, NOWHERE, WHOLE
from .visit import TO_THE_END


@kernel
def place_of(point):
    """Return the place of a point."""
    return (point.place[0], point.place[1], point.place[2])


@shared
def continue_depth(tree, region, motion, k, at, point, stack, reached, steps):
    """Continue to find the depth of a point in solid k; return the steps left.

    On entry `point` holds its place; its side, or 0 if unknown; `clear`; and an element that may be
    near. The rest is written. If the steps do not suffice, `at.height` is not 0, and the next call
    continues the descent from `point` and the stack.
    """
    slack, swept, near = at.slack, at.swept[k], 2.0 * (at.slack + at.joints)
    found = on_stack(WIDTH, np.float32(0.0))
    p = moved(motion, place_of(point))
    steps = seek(tree, p, k, at, point, stack, reached, found, steps)
    if at.height > 0:
        return steps
    away = point.away[k]
    least = away - point.loose[k]
    side, clear = point.side[k], point.clear[k]
    if region.inside == NOWHERE:
        side, clear = -1, np.inf
    elif least <= near:
        side, clear = 0, 0.0
    elif side == 0:
        side, clear, cost = side_of(tree, region, p, least - slack, slack, stack, found)
        steps -= cost
        if region.inside == WHOLE:
            clear = least - near if side != 0 else 0.0
    elif region.inside == WHOLE:
        clear = least - near
    else:
        clear = min(clear, least - near)
    point.side[k], point.clear[k] = side, clear
    depth = -away if side < 0 else away
    point.depth[k] = (least if side > 0 else depth) + swept
    foot, _ = foot_of(tree, p, k, point)
    way = scaled(sub(p, foot), 1.0 if side > 0 else -1.0)
    if not away > 4.0 * slack and region.inside == WHOLE:
        way = scaled(normal_at(tree, k, point), -1.0)  # the difference p - foot is mere rounding
    way = turned_back(motion, unit(way))
    point.way[k, 0], point.way[k, 1], point.way[k, 2] = way
    return steps


@kernel
def measure_depth(tree, region, motion, k, at, point, stack, reached):
    """Do the same as `continue_depth` to the end; return the steps used."""
    most = np.int64(TO_THE_END)  # int64, as elsewhere: no second version is compiled
    return most - continue_depth(tree, region, motion, k, at, point, stack, reached, most)


@kernel
def certain_depth(point, k, swept, slack):
    """Return a certified lower bound of a point's depth in solid k, metres."""
    if point.side[k] == 0:  # an unknown side counts as outside
        return swept[k] - point.away[k] - slack
    return point.depth[k] - slack


@kernel
def certain_radius(point, swept, slack):
    """Return the radius, metres, of a ball around a point certainly in both solids; may be < 0."""
    return min(certain_depth(point, 0, swept, slack), certain_depth(point, 1, swept, slack))


@kernel
def possible_depth(point, k, inside, swept, radius, slack):
    """Return an upper bound, metres, of the depth in solid k of all points within `radius`."""
    if point.side[k] < 0 and (inside != HALF or point.clear[k] > radius):
        return swept - point.away[k] + point.loose[k] + radius + slack
    return swept + point.away[k] + radius + slack
