"""What of a mesh lies in an empty ball of a surface: a triangle, or the volumes of a node."""

from __future__ import annotations

import numpy as np
from numba import float32, uint64

from ..base.jit import inlined, loop16
from ..base.lanes import not_above
from ..base.rounding import SINGLE_LIMIT, SINGLE_MARGIN
from ..base.vectors import dot, sub
from ..elements.primitives import corners
from ..surface.facing import vector
from ..tree.layout import (
    CENTRE_X,
    CENTRE_Y,
    CENTRE_Z,
    HALF_U,
    HALF_V,
    RADIUS,
    STRIDE,
    U_X,
    U_Y,
    U_Z,
    V_X,
    V_Y,
    V_Z,
    WIDTH,
)

_ALL = (1 << WIDTH) - 1


@inlined
def is_within(mesh, t, place, radius):
    """Whether a triangle lies in a ball around a place."""
    if not radius > 0.0:
        return False
    centre = vector(place)
    a, b, c = corners(mesh.triangles, t)
    a, b, c = sub(a, centre), sub(b, centre), sub(c, centre)
    return max(max(dot(a, a), dot(b, b)), dot(c, c)) <= radius * radius


@loop16
def _reaches(nodes, base, x, y, z, gaps):
    """How far from a point each lane of the node at `base` reaches, at the most; node units.

    The farthest point of a rectangle is a corner. As half axes are perpendicular but for rounding,
    its squared distance from c is c² + a² + b² + 2 a |c u| + 2 b |c v|.
    """
    for k in range(WIDTH):
        i = base + uint64(k)
        dx = x - nodes[i + CENTRE_X]
        dy = y - nodes[i + CENTRE_Y]
        dz = z - nodes[i + CENTRE_Z]
        a, b = nodes[i + HALF_U], nodes[i + HALF_V]
        s = abs(dx * nodes[i + U_X] + dy * nodes[i + U_Y] + dz * nodes[i + U_Z])
        t = abs(dx * nodes[i + V_X] + dy * nodes[i + V_Y] + dz * nodes[i + V_Z])
        square = dx * dx + dy * dy + dz * dz + a * (a + s + s) + b * (b + t + t)
        gaps[k] = np.sqrt(square) + nodes[i + RADIUS]


@inlined
def lanes_beyond(tree, node, progress, limit, reaches):
    """The bits of the lanes of a node that do not lie in the ball, less `limit`, metres.

    `reaches` is room for sixteen float32.
    """
    # With M the sum of the centre's norm and the node's reach: rounding the centre and subtracting
    # a lane's errs by 3 u32 M, and so does the farthest distance. All terms of its square are
    # positive, so that errs by a share: 8 u32 in any order of summation, 6 u32 as axes may be
    # longer than units, and as much as they are perpendicular but for 6 u32, 2 a b being at most
    # a² + b². Its root errs by 10 u32 of itself, the radius and the limit are rounded by 3 u32 M.
    # Together less than 24 u32 M. No number here is NaN, which would count as within.
    room = (min(progress.ball[3], progress.ball[4]) - limit) * tree.scale[1]
    if not room > 0.0:
        return _ALL
    x = progress.ball[0] * tree.scale[1] - tree.centres[node, 0]
    y = progress.ball[1] * tree.scale[1] - tree.centres[node, 1]
    z = progress.ball[2] * tree.scale[1] - tree.centres[node, 2]
    size = abs(x) + abs(y) + abs(z) + tree.centres[node, 3]
    if not size < SINGLE_LIMIT:
        return _ALL
    _reaches(tree.nodes, uint64(node * STRIDE), float32(x), float32(y), float32(z), reaches)
    return _ALL & ~not_above(reaches, 0, float32(room - SINGLE_MARGIN * size))
