"""Certified lower bounds between one swept sphere volume and the sixteen lanes of a node.

A volume is {c + s û + t v̂ : |s| <= a, |t| <= b} swept by a ball of radius r: a rectangle swept
sphere along two perpendicular unit axes; if b = 0, a line swept sphere; if a = 0 as well, a point
swept sphere (Larsen et al. 1999, section 4). One kernel serves all three, in any mixture.

The bound is a support gap, not a distance between closest points: for *any* direction n, the gap
between the two volumes' projections on n is a lower bound of their distance (section 4.3.2 calls
it the separating axis variation). Good directions come from a few alternating projections between
the rectangles, and from the normals of both rectangles. A poor direction makes the bound weaker,
never wrong. A margin (SINGLE_MARGIN) covers single precision.
"""

from __future__ import annotations

import numpy as np
from numba import float32, uint64

from ..base.jit import fused, inlined16, kernel, loop16
from ..base.lanes import turn_axes
from ..base.rounding import (
    SINGLE_EPS,
    SINGLE_LIMIT,
    SINGLE_MARGIN,
    SINGLE_TINY,
)
from ..base.vectors import add, dot, moved, scaled, sub
from ..tree.layout import (
    CENTRE_X,
    CENTRE_Y,
    CENTRE_Z,
    EXTENT,
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
    read_vector,
    row,
)

_TINY = float32(SINGLE_TINY)


@inlined16
def lower_bounds(nodes, base, single, bounds, first):
    """Write lower bounds between `single` and each lane of a node to sixteen entries of `bounds`.

    `nodes` is the flat float32 array of all lanes; the node begins at index `base`, the result at
    index `first`. Both are uint64: a signed index would add a wrap-around test to each load and
    keep the loop scalar. `single` holds the 15 numbers that `place` writes.
    """
    ax, ay, az = single[0], single[1], single[2]
    Ux, Uy, Uz = single[3], single[4], single[5]
    Vx, Vy, Vz = single[6], single[7], single[8]
    A, B = single[9], single[10]
    Wx, Wy, Wz = single[11], single[12], single[13]
    radius = single[14]
    for k in range(WIDTH):
        i = base + uint64(k)
        dx = ax - nodes[i + CENTRE_X]
        dy = ay - nodes[i + CENTRE_Y]
        dz = az - nodes[i + CENTRE_Z]
        ux, uy, uz = nodes[i + U_X], nodes[i + U_Y], nodes[i + U_Z]
        vx, vy, vz = nodes[i + V_X], nodes[i + V_Y], nodes[i + V_Z]
        a, b = nodes[i + HALF_U], nodes[i + HALF_V]
        # Convert to the single volume's axes: this saves some of the products below.
        X = dx * Ux + dy * Uy + dz * Uz
        Y = dx * Vx + dy * Vy + dz * Vz
        Z = dx * Wx + dy * Wy + dz * Wz
        uX = ux * Ux + uy * Uy + uz * Uz
        uY = ux * Vx + uy * Vy + uz * Vz
        uZ = ux * Wx + uy * Wy + uz * Wz
        vX = vx * Ux + vy * Uy + vz * Uz
        vY = vx * Vx + vy * Vy + vz * Vz
        vZ = vx * Wx + vy * Wy + vz * Wz
        # Alternating projections between the rectangles, computed from inner products alone.
        Du = X * uX + Y * uY + Z * uZ
        Dv = X * vX + Y * vY + Z * vZ
        p = min(max(Du, -a), a)
        q = min(max(Dv, -b), b)
        S = min(max(p * uX + q * vX - X, -A), A)
        T = min(max(p * uY + q * vY - Y, -B), B)
        p = min(max(Du + S * uX + T * uY, -a), a)
        q = min(max(Dv + S * vX + T * vY, -b), b)
        S = min(max(p * uX + q * vX - X, -A), A)
        T = min(max(p * uY + q * vY - Y, -B), B)
        nx = X + S - p * uX - q * vX
        ny = Y + T - p * uY - q * vY
        nz = Z - p * uZ - q * vZ
        # The support gap along n. Compute each product anew: the inner products above would cancel
        # when the volumes are close.
        gap = (
            nx * X + ny * Y + nz * Z
            - A * abs(nx)
            - B * abs(ny)
            - a * abs(nx * uX + ny * uY + nz * uZ)
            - b * abs(nx * vX + ny * vY + nz * vZ)
        ) / np.sqrt(max(nx * nx + ny * ny + nz * nz, _TINY))  # fmt: skip
        # The gap along the lane's normal (perpendicular to the lane's axes up to rounding, which
        # the margin covers).
        wx = uY * vZ - uZ * vY
        wy = uZ * vX - uX * vZ
        wz = uX * vY - uY * vX
        gap_lane = abs(wx * X + wy * Y + wz * Z) - A * abs(wx) - B * abs(wy)
        # The gap along the single volume's normal.
        gap_single = abs(Z) - a * abs(uZ) - b * abs(vZ)
        bounds[first + uint64(k)] = max(max(gap, gap_lane), gap_single) - nodes[i + RADIUS] - radius


@loop16
def lows_along(nodes, base, x, y, z, lows):
    """Write to `lows` each lane's least coordinate along a direction, from the node's centre.

    Two such arrays bound all lane pairs of two nodes along the direction, with one sum per pair.
    Node units.
    """
    for k in range(WIDTH):
        i = base + uint64(k)
        centre = nodes[i + CENTRE_X] * x + nodes[i + CENTRE_Y] * y + nodes[i + CENTRE_Z] * z
        u = nodes[i + U_X] * x + nodes[i + U_Y] * y + nodes[i + U_Z] * z
        v = nodes[i + V_X] * x + nodes[i + V_Y] * y + nodes[i + V_Z] * z
        reach = nodes[i + HALF_U] * abs(u) + nodes[i + HALF_V] * abs(v) + nodes[i + RADIUS]
        lows[k] = centre - reach


@fused
def place(fixed, lane, motions, tree, node, slack, out):
    """Move one lane of `fixed` into the frame of a node of `tree`, as `single` of `lower_bounds`.

    `motions` are that from fixed's model to tree's and its inverse, twelve numbers each; `slack`
    bounds their errors, metres. Writes 15 float32 to `out` and returns True. Returns False if the
    volume is too far away or too large for single precision (see `far_bound`).
    """
    own = lane // WIDTH
    base = uint64(own * STRIDE + lane % WIDTH)
    nodes = fixed.nodes
    ratio = fixed.scale[0] * tree.scale[1]
    c = scaled(add(read_vector(nodes, base), row(fixed.centres, own)), fixed.scale[0])
    c = scaled(moved(motions[0], c), tree.scale[1])
    x = c[0] - tree.centres[node, 0]
    y = c[1] - tree.centres[node, 1]
    z = c[2] - tree.centres[node, 2]
    size = fixed.sizes[lane, EXTENT] * ratio
    # 1.5 times the diagonal exceeds the sum of both half edges and the radius. The slack counts
    # too: if it were far larger than both models, even an unused lane might seem near.
    reach = abs(x) + abs(y) + abs(z) + 1.5 * size
    if not reach + slack * tree.scale[1] < SINGLE_LIMIT:
        return False
    out[0], out[1], out[2] = np.float32(x), np.float32(y), np.float32(z)
    turn_axes(nodes, np.int64(base), motions[1], out)
    out[9] = np.float32(nodes[base + HALF_U] * ratio)
    out[10] = np.float32(nodes[base + HALF_V] * ratio)
    margin = SINGLE_MARGIN * (reach + tree.centres[node, 3]) + slack * tree.scale[1]
    out[14] = np.float32((nodes[base + RADIUS] * ratio + margin) * (1.0 + 2.0 * SINGLE_EPS))
    return True


@kernel
def far_bound(fixed, lane, motion, tree, node, slack):
    """Return a lower bound in metres between one lane's sphere and a whole node's, in float64.

    Use it when `place` returns False: the volume is some 1e15 node units away or larger, where
    spheres are as good.
    """
    own = lane // WIDTH
    base = uint64(own * STRIDE + lane % WIDTH)
    own_centre = read_vector(fixed.nodes, base)
    own_centre = add(own_centre, row(fixed.centres, own))
    c = moved(motion, scaled(own_centre, fixed.scale[0]))
    unit = tree.scale[0]
    d = sub(c, scaled(row(tree.centres, node), unit))
    reach = 1.5 * fixed.sizes[lane, EXTENT] * fixed.scale[0] + tree.centres[node, 3] * unit
    return (np.sqrt(dot(d, d)) - reach) * (1.0 - 1e-12) - slack


def tighten(fixed, tree, lane, motion, node, slack, reach, bounds, first):
    """Raise those bounds from `lower_bounds` that are below `reach`. A stub.

    The arguments are those of `boxes.box_bounds`; see pairs/swept.py.
    """
