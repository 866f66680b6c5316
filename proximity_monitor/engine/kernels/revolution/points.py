"""The nearest points of a solid of revolution to many points in the world."""

from __future__ import annotations

import numpy as np

from ..base.jit import entry
from ..base.rounding import RESOLUTION
from ..base.tables import tree_at
from ..base.trees import DEVIATION, RevolutionTree
from ..base.vectors import norm, sub
from ..elements.errors import joints_err, points_err
from ..elements.swept import core_of, lower_of, upper_of
from ..inside.closest import NONE, image_of
from ..inside.tolerance import distance_of, share_of_error, spare_of_error
from ..inside.winding import UNKNOWN
from ..surface.edges import point_on
from ..surface.pieces import parameters_of
from .closest import nearest_on
from .inside import turns_around
from .meridian import angle_of, place_in
from .places import place_of

_LOOKS = 8
"""Looks at arcs that count as one step of a descent."""


@entry
def closest_points_of_revolution(
    table, pose, points, max_distance, rel_err, abs_err, signed, first, steps,
    bounds, feet, elements, parameters,
):  # fmt: skip
    """Find the points of a solid nearest to given ones, as `closest_points` of a surface does.

    `table` is the solid's; distances may be signed. Returns how many points are done: all, or as
    many as about `steps` steps suffice for, at least one.
    """
    tree, _ = tree_at(RevolutionTree, table)
    deviation, joints = tree.scale[DEVIATION], joints_err(tree)
    farthest, share = core_of(max_distance, 0.0, deviation), share_of_error(rel_err)
    for k in range(first, points.shape[0]):
        if k > first and steps <= 0:
            return k
        p, moved = image_of(tree, pose, points, k)
        at = place_in(tree, p, (0.0, 0.0, 0.0))
        slack = moved + points_err(tree)
        finest = RESOLUTION * tree.scale[2] + 2.0 * (slack + at.margin)
        spare = spare_of_error(tree, abs_err, finest)
        beyond = distance_of(farthest + 2.0 * slack, share, spare, 0.0)
        least, away, piece, t, looks = nearest_on(tree, at.rho, at.z, at.margin, share, spare)
        steps -= 1 + looks // _LOOKS
        low = max(lower_of(least - slack, 0.0, deviation), 0.0)
        high, elements[k] = np.inf, NONE
        if away < beyond:
            element, (u, v, _) = place_of(tree, piece, t, angle_of(tree, p))
            q = point_on(tree, element, u, v)
            elements[k] = element
            high = upper_of(norm(sub(q, p)) + slack, 0.0, deviation)
            for i in range(3):
                feet[k, i] = pose[i, 3]
                for j in range(3):
                    feet[k, i] += pose[i, j] * q[j]
            if k < parameters.shape[0]:
                u, v, _ = parameters_of(tree, element, (u, v, 0.0))
                parameters[k, 0], parameters[k, 1] = u, v
        bounds[k, 0], bounds[k, 1] = low, high
        if signed:
            turns = UNKNOWN
            if low > 2.0 * (slack + joints):
                turns = turns_around(tree, at.rho, at.z, at.margin + slack + joints, joints)
            if turns != 0:
                bounds[k, 0] = -high
                bounds[k, 1] = high if turns == UNKNOWN else -low
    return points.shape[0]
