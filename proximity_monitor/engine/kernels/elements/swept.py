"""From the cores of two models to the models: triangles swept by balls, and how far they deviate.

A model is its triangles, its core, swept by a ball of some radius, and may deviate from what it
stands for. With R both radii and D both deviations together, a distance d of the cores is one of at
least d - R - D of the things, and at most d - R + D, or D where the swept cores meet.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import inlined, kernel
from ..base.rounding import OFFSET_MARGIN, OFFSET_RESERVE
from ..base.vectors import along, norm, sub


@inlined
def lower_of(core, radii, deviations):
    """Lower bound of the things' distance, metres, from one of their cores'; may be negative."""
    offset = radii + deviations
    if offset == 0.0:
        return core
    return core - offset - OFFSET_MARGIN * (abs(core) + offset)


@inlined
def upper_of(core, radii, deviations):
    """Upper bound of the things' distance, metres, from one of their cores'."""
    if radii + deviations == 0.0:
        return core
    apart = np.maximum(core - radii + OFFSET_MARGIN * (core + radii), 0.0)
    return (apart + deviations) * (1.0 + OFFSET_MARGIN)


@inlined
def reach_of(core, radii, deviations):
    """A distance of the cores, metres, up to which others may be as near as one of `core`.

    All that meet are: at distance 0.
    """
    if radii + deviations == 0.0:
        return core
    return (max(core, radii) + 2.0 * deviations) * (1.0 + OFFSET_RESERVE)


@inlined
def core_of(limit, radii, deviations):
    """A distance of the cores, metres, from which on `lower_of` is at least `limit`."""
    offset = radii + deviations
    if offset == 0.0:
        return limit
    return limit + offset + OFFSET_RESERVE * (limit + offset)


@kernel
def surface_points(p, q, radius_a, radius_b):
    """Nearest points of two swept models, from the nearest points p and q of their cores.

    Both in one frame, metres. Where the balls around p and q meet, one point of both.
    """
    radii = radius_a + radius_b
    if radii == 0.0:
        return p, q
    way = sub(q, p)
    reach = max(norm(way), radii)
    return along(p, way, radius_a / reach), along(q, way, -radius_b / reach)
