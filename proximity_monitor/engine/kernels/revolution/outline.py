"""How far a solid of revolution reaches along a direction of its model's frame."""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel
from ..base.rounding import DOUBLE_EPS
from ..base.vectors import dot, norm
from ..tree.layout import row
from .reach import reach_of

_ROUNDING = 64.0 * DOUBLE_EPS
"""What a reach along a unit vector errs by, as a share of the length P that arcs err by a share of
and of the frame's distance from the origin: the products with the frame's axes err by less than 12
u P, as these are perpendicular, and units, but for 4 u each, and that with its origin by 4 u."""


@kernel
def outline_along(tree, n):
    """How far a solid of revolution reaches along a unit vector, at most; metres.

    The vector's part across the axis is largest in the half-plane that it points into.
    """
    frame = tree.frame
    x, y, z = dot(row(frame, 0), n), dot(row(frame, 1), n), dot(row(frame, 2), n)
    origin = row(frame, 3)
    across = np.sqrt(x * x + y * y)
    reach = reach_of(tree, tree.arcs[:0], 0, 0.0, across, z, -np.inf)
    return dot(origin, n) + reach + _ROUNDING * (frame[4, 0] + norm(origin))
