"""What opening a volume promises: how much more tightly its children enclose the model.

A search opens one volume of a pair. If the two volumes are apart, their bound can grow by at most
the distance by which the opened volume stands off its children. So the volume that stands off
farther is opened, whatever its size. A rectangle around the cap of a sphere stands off by the
height of the cap. The ball around a whole sphere is as tight as possible, and its children are less
tight.

No bound depends on the promises, so single precision and a few points of the volume's surface
suffice.
"""

from __future__ import annotations

import numpy as np
from numba import uint64

from ..base.jit import kernel, loop16
from ..base.lanes import smallest
from ..base.memory import on_stack
from ..base.vectors import along, cross
from .layout import (
    CENTRE_X,
    CENTRE_Y,
    CENTRE_Z,
    EXTENT,
    HALF_U,
    HALF_V,
    PROMISE,
    RADIUS,
    STRIDE,
    U_X,
    U_Y,
    U_Z,
    V_X,
    V_Y,
    V_Z,
    WIDTH,
    read_vector,
    row,
)

_SHARE = 0.04
"""Share of a volume's extent that is added to its promise, so that the larger of two volumes that
stand off equally is opened. Without it, spheres that are far apart take four times as many
openings. With twice this share, concentric spheres take three times as many."""

_ALL = (1 << WIDTH) - 1


@loop16
def _outside(nodes, base, x, y, z, found):
    """Write how far, approximately, a point lies outside each lane of a node, in node units.

    Negative means inside. `x`, `y`, `z` are relative to the node's centre.
    """
    for k in range(WIDTH):
        i = base + uint64(k)
        dx, dy, dz = x - nodes[i + CENTRE_X], y - nodes[i + CENTRE_Y], z - nodes[i + CENTRE_Z]
        ux, uy, uz = nodes[i + U_X], nodes[i + U_Y], nodes[i + U_Z]
        vx, vy, vz = nodes[i + V_X], nodes[i + V_Y], nodes[i + V_Z]
        a, b = nodes[i + HALF_U], nodes[i + HALF_V]
        s = min(max(dx * ux + dy * uy + dz * uz, -a), a)
        t = min(max(dx * vx + dy * vy + dz * vz, -b), b)
        dx, dy, dz = dx - s * ux - t * vx, dy - s * uy - t * vy, dz - s * uz - t * vz
        found[k] = np.sqrt(dx * dx + dy * dy + dz * dz) - nodes[i + RADIUS]


@kernel
def _stand_off(nodes, centres, node, lane, child, found):
    """Return how far a volume's two flat faces stand off its children, in node units.

    This is the mean over nine points of each face.
    """
    base = uint64(node * STRIDE + lane)
    u, v = read_vector(nodes, base + U_X), read_vector(nodes, base + V_X)
    w = cross(u, v)
    c, parent, own = read_vector(nodes, base), row(centres, node), row(centres, child)
    centre = (
        c[0] + parent[0] - own[0],
        c[1] + parent[1] - own[1],
        c[2] + parent[2] - own[2],
    )
    a, b = np.float64(nodes[base + HALF_U]), np.float64(nodes[base + HALF_V])
    radius = np.float64(nodes[base + RADIUS])
    total = 0.0
    for side in range(-1, 2, 2):
        for i in range(-1, 2):
            for j in range(-1, 2):
                p = along(along(along(centre, w, side * radius), u, i * a), v, j * b)
                x, y, z = np.float32(p[0]), np.float32(p[1]), np.float32(p[2])
                _outside(nodes, uint64(child * STRIDE), x, y, z, found)
                total += max(np.float64(smallest(found, 0, _ALL)), 0.0)
    return total / 18.0


@kernel
def find_promises(nodes, centres, children, sizes):
    """Write the promises to `sizes` (k × 16, 2) of a hierarchy whose volumes are fitted."""
    found = on_stack(WIDTH, np.float32(0.0))
    for lane in range(len(children)):
        promise = _SHARE * np.float64(sizes[lane, EXTENT])
        if children[lane] >= 0:
            promise += _stand_off(
                nodes, centres, lane // WIDTH, lane % WIDTH, np.int64(children[lane]), found
            )
        sizes[lane, PROMISE] = np.float32(promise)
