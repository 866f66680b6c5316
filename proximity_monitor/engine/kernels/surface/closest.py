"""The nearest points of a surface to many points in the world."""

from __future__ import annotations

import numpy as np

from ..base.jit import entry
from ..base.memory import on_stack
from ..base.rounding import RESOLUTION
from ..base.tables import tree_at
from ..base.trees import DEVIATION, SurfaceTree
from ..base.vectors import norm, sub
from ..elements.errors import points_err
from ..elements.swept import core_of, lower_of, upper_of
from ..inside.closest import NONE, TELLING, image_of
from ..inside.tolerance import distance_of, share_of_error, spare_of_error
from ..inside.visit import at_root
from ..tree.layout import WIDTH
from .edges import point_on
from .foot import FAR, Foot, bounded, look_for, unlooked
from .pieces import parameters_of

_ONE_POINT = 4
"""Steps that each point costs besides those of its descent."""

GOING = 7
"""Numbers that store the state of a search that a slice has cut: see `closest_points`."""


@entry
def closest_points(
    model, pose, points, max_distance, rel_err, abs_err, signed, first, steps,
    stack, stacked, going, bounds, feet, elements, parameters,
):  # fmt: skip
    """Find the nearest points of a surface at `pose` to world points (k, 3), from `first` on.

    `model` is the table of the surface's hierarchy. Returns how many points are done: all, or as
    many as about `steps` steps allow. If steps ran out, the search for the next point may have
    begun. Then `going` (GOING,) stores its answer so far (see foot.py) and the number of its
    entries in `stack` and `stacked`. That number is 0 if no search has begun.

    Writes certified bounds (k, 2) and elements (k,) in tree order. For points nearer than
    `max_distance` metres, it also writes feet (k, 3) in the world and their parameters (k, 2), an
    array that may be (0, 2). For the others, the element is NONE and the upper bound is infinite.
    If `signed`, lower bounds are good enough to tell sides. Each search begins with the previous
    foot. Errors are those of the meshes' `closest_points`.
    """
    tree, _ = tree_at(SurfaceTree, model)
    found, last = on_stack(WIDTH, np.float32(0.0)), (0.0, 0.0, 0.0)
    near, near_u, near_v = NONE, 0.0, 0.0
    deviation = tree.scale[DEVIATION]
    farthest = core_of(max_distance, 0.0, deviation)
    share = share_of_error(rel_err)
    telling = TELLING * tree.scale[2] if signed else 0.0
    for k in range(first, points.shape[0]):
        if steps <= 0:
            return k
        # Bounds include the error of the surface's points, but not that of the point itself.
        p, moved = image_of(tree, pose, points, k)
        slack = moved + points_err(tree)
        finest = RESOLUTION * tree.scale[2] + 2.0 * slack
        spare = spare_of_error(tree, abs_err, finest)
        query = Foot(p, slack, share, spare, finest)
        # A distance of `beyond` less both slacks exceeds `farthest`, whatever rounding does.
        beyond = min(distance_of(farthest + 2.0 * slack, share, spare, 0.0), FAR)
        top = np.int64(going[6])
        if top > 0:
            answer = going[0], np.int64(going[1]), going[2], going[3], going[4], np.int64(going[5])
        else:
            steps -= _ONE_POINT
            told = distance_of(telling, share, spare, 0.0)
            top, answer = at_root(stack, stacked), unlooked(max(beyond, told), 0, 0.0, 0.0)
            if near != NONE:
                away = norm(sub(last, p))
                if away < answer[0]:
                    answer = unlooked(away, near, near_u, near_v)
        answer, top, steps = look_for(
            query, tree, answer, top, stack, stacked, found, max(steps, 1)
        )
        distance, nearest, u, v, least, cost = answer
        going[0], going[1], going[2], going[3] = distance, nearest, u, v
        going[4], going[5], going[6] = least, cost, top
        if top > 0:
            return k
        nearest, least = bounded(query, answer)
        bounds[k, 0] = max(lower_of(least - moved, 0.0, deviation), 0.0)
        bounds[k, 1], elements[k] = np.inf, NONE
        if distance < beyond:
            near, near_u, near_v = nearest, u, v
            last = point_on(tree, near, u, v)
            bounds[k, 1], elements[k] = upper_of(distance + slack, 0.0, deviation), near
            for i in range(3):
                feet[k, i] = pose[i, 3]
                for j in range(3):
                    feet[k, i] += pose[i, j] * last[j]
            if k < parameters.shape[0]:
                u, v, _ = parameters_of(tree, near, (u, v, 0.0))
                parameters[k, 0], parameters[k, 1] = u, v
    return points.shape[0]
