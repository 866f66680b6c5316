"""On which side of a closed surface each of many points lies."""

from __future__ import annotations

import numpy as np

from ..base.jit import entry
from ..base.memory import on_stack
from ..base.tables import tree_at
from ..base.trees import SurfaceTree
from ..elements.errors import joints_err, points_err
from ..inside.closest import image_of
from ..inside.winding import UNKNOWN, ray_steps, winding_number
from ..tree.layout import WIDTH
from . import crossing  # noqa: F401 - it implements what a winding number needs


@entry
def sides_of_surface(model, pose, points, first, last, steps, stack, bounds):
    """Turn bounds (k, 2) of distances of world points (k, 3) into bounds of signed distances.

    It does so for the points from `first` to before `last`. Returns how many are done: `last`, or
    as many as about `steps` steps suffice for, at least one more than before. If a point is so near
    that rounding hides its side, its bounds allow for both signs.
    """
    tree, _ = tree_at(SurfaceTree, model)
    gaps = on_stack(WIDTH, np.float32(0.0))
    for k in range(first, last):
        if k > first and steps <= 0:
            return k
        steps -= ray_steps(tree)
        p, slack = image_of(tree, pose, points, k)
        slack += points_err(tree)
        low, high = bounds[k, 0], bounds[k, 1]
        winding = UNKNOWN
        if low > 2.0 * (slack + joints_err(tree)):
            winding = winding_number(tree, p, slack, stack, gaps)
        if winding != 0:
            bounds[k, 0] = -high
            bounds[k, 1] = high if winding == UNKNOWN else -low
    return last
