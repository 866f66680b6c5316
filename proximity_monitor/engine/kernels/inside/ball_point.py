"""How deep a point lies in a solid: its signed distance to the surface, positive inside.

The depth of x in a solid is f(x) = g(x) + r: g is the distance of x to the surface of its core, its
elements, positive inside and negative outside, and r the radius that sweeps it. Where the core is
closed, g changes by no more than x moves, as the surface lies between two points of different
sides. Where the core has no inside, g is minus the distance.
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
    """Where a point is."""
    return (point.place[0], point.place[1], point.place[2])


@shared
def sound_some(tree, region, motion, k, at, point, stack, reached, steps):
    """Go on to find the depth of a point in solid k; returns how many steps are left.

    `point` holds its place; the side, if it is known, else 0, and how far around the point it is
    the same; and a triangle that may be near. The rest is written. Where the steps do not suffice,
    `at.height` is not 0, and the descent goes on with what `point` and the stack hold.
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
        way = scaled(normal_at(tree, k, point), -1.0)  # what is left of the difference is rounding
    way = turned_back(motion, unit(way))
    point.way[k, 0], point.way[k, 1], point.way[k, 2] = way
    return steps


@kernel
def sound(tree, region, motion, k, at, point, stack, reached):
    """As `sound_some`, to the end; returns how many steps that took."""
    most = np.int64(TO_THE_END)  # a number of the type of all others: no second form is compiled
    return most - sound_some(tree, region, motion, k, at, point, stack, reached, most)


@kernel
def certain_depth(point, k, swept, slack):
    """How deep a point certainly lies in solid k, metres; at most 0 where it may lie outside."""
    if point.side[k] == 0:  # it counts as outside
        return swept[k] - point.away[k] - slack
    return point.depth[k] - slack


@kernel
def certain_radius(point, swept, slack):
    """Radius, metres, of a ball around a point that both solids certainly hold; or below 0."""
    return min(certain_depth(point, 0, swept, slack), certain_depth(point, 1, swept, slack))


@kernel
def possible_depth(point, k, inside, swept, radius, slack):
    """Bound, metres, of the depth in solid k of all within `radius` of a point."""
    if point.side[k] < 0 and (inside != HALF or point.clear[k] > radius):
        return swept - point.away[k] + point.loose[k] + radius + slack
    return swept + point.away[k] + radius + slack
