"""Whether parts of a mesh lie in an empty ball of a surface: a triangle, or the volumes of a node.

An empty ball holds no point of the surface (see surface/empty_ball.py).
"""

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
    """Return whether a triangle lies in a ball around a place, both in the mesh's frame."""
    if not radius > 0.0:
        return False
    centre = vector(place)
    a, b, c = corners(mesh.triangles, t)
    a, b, c = sub(a, centre), sub(b, centre), sub(c, centre)
    return max(max(dot(a, a), dot(b, b)), dot(c, c)) <= radius * radius


@loop16
def _reaches(nodes, base, x, y, z, gaps):
    """Write how far from a point each lane of the node at `base` reaches at most, in node units.

    The farthest point of a rectangle is a corner. The half axes are perpendicular up to rounding,
    so its squared distance is c² + a² + b² + 2 a |c u| + 2 b |c v|, with c from the rectangle's
    centre to the point.
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
    """Return the bits of a node's lanes that may reach out of the ball shrunk by `limit` metres.

    `reaches` is room for sixteen float32.
    """
    # Let M be the sum of the centre's norm and the node's reach. Rounding the centre and
    # subtracting a lane's centre errs by 3 u32 M, and so does the farthest distance. All terms of
    # its square are positive, so the square errs by a share of itself: 8 u32 in any order of
    # summation, 6 u32 because axes may be longer than units, and 6 u32 because they are
    # perpendicular only up to 6 u32 (2 a b <= a² + b²). So the root errs by 10 u32 of itself. The
    # radius and the limit are rounded by 3 u32 M. Together less than 24 u32 M. No number is NaN,
    # which would count as inside.
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
