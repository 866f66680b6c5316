"""Convert distances of two models' cores to distances of the parts that the models stand for.

A model is a core (its triangles) swept by a ball of some radius. It may deviate from its part. Let
R be the sum of both radii and D the sum of both deviations. If the cores are at distance d, the
parts are at distance d - R - D at least, and d - R + D at most; D at most if the swept cores meet.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.rounding import OFFSET_MARGIN, OFFSET_RESERVE
from ..base.vectors import along, norm, sub


@inlined
def lower_of(core, radii, deviations):
    """Return a lower bound of the parts' distance, metres, from that of their cores.

    `core` is a lower bound of the cores' distance. The result may be negative.
    """
    offset = radii + deviations
    if offset == 0.0:
        return core
    return core - offset - OFFSET_MARGIN * (abs(core) + offset)


@inlined
def upper_of(core, radii, deviations):
    """Return an upper bound of the parts' distance, metres, from an upper bound of the cores'."""
    if radii + deviations == 0.0:
        return core
    apart = np.maximum(core - radii + OFFSET_MARGIN * (core + radii), 0.0)
    return (apart + deviations) * (1.0 + OFFSET_MARGIN)


@inlined
def reach_of(core, radii, deviations):
    """Return the core distance, metres, up to which other pairs may be as near as one at `core`.

    All pairs whose swept cores meet are equally near, at distance 0.
    """
    if radii + deviations == 0.0:
        return core
    return (max(core, radii) + 2.0 * deviations) * (1.0 + OFFSET_RESERVE)


@inlined
def core_of(limit, radii, deviations):
    """Return a core distance, metres, from which on `lower_of` is at least `limit`."""
    offset = radii + deviations
    if offset == 0.0:
        return limit
    return limit + offset + OFFSET_RESERVE * (limit + offset)


@kernel
def surface_points(p, q, radius_a, radius_b):
    """Return the nearest points of two swept models from the nearest points p and q of their cores.

    All points are in one frame, metres. If the balls around p and q meet, returns one common point
    twice.
    """
    radii = radius_a + radius_b
    if radii == 0.0:
        return p, q
    way = sub(q, p)
    reach = max(norm(way), radii)
    return along(p, way, radius_a / reach), along(q, way, -radius_b / reach)
