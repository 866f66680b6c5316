"""How far a solid of revolution reaches along a direction of its model's frame."""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel
from ..base.rounding import DOUBLE_EPS
from ..base.vectors import dot, norm
from ..tree.layout import row
from .reach import reach_of

_ROUNDING = 64.0 * DOUBLE_EPS
"""Error of a reach along a unit vector, as a share of P, the length that errors of arcs are a share
of, plus the distance of the frame's origin. The frame's axes are perpendicular units up to 4 u
each, so the products with them err by less than 12 u P; the product with the origin errs by 4 u."""


@kernel
def outline_along(tree, n):
    """Return how far a solid of revolution reaches along a unit vector, at most; metres.

    It reaches farthest in the half-plane that the vector points into.
    """
    frame = tree.frame
    x, y, z = dot(row(frame, 0), n), dot(row(frame, 1), n), dot(row(frame, 2), n)
    origin = row(frame, 3)
    across = np.sqrt(x * x + y * y)
    reach = reach_of(tree, tree.arcs[:0], 0, 0.0, across, z, -np.inf)
    return dot(origin, n) + reach + _ROUNDING * (frame[4, 0] + norm(origin))
