"""How often a closed surface winds around a point, as a certified integer.

The winding number of a closed mesh (Jacobson et al. 2013, section 3) is the sum of its triangles'
solid angles over 4 pi, and, what serves here, the number of triangles that leave along any ray from
the point less the number that enter. Solid angles need a tolerance; crossings need only signs, and
each sign is either proven or the next ray is tried.

A ray runs along x, forth or back, through space sheared by a slope: (x, y - alpha x, z - beta x).
Every vertex is rounded in the same way wherever it is used, so the sheared mesh is as closed as the
given one. Rounding moves a vertex by less than 4 u of its length and the point likewise; a point
that is farther than that from the surface has the same winding number before and after.
"""

from __future__ import annotations

import numpy as np
from numba import float32, uint64

from ..base.jit import kernel, loop16
from ..base.lanes import lowest, not_above
from ..base.precise import orientation
from ..base.rounding import DOUBLE_EPS, SINGLE_LIMIT, SINGLE_MARGIN
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
    first_of,
    last_of,
)

UNKNOWN = -(2**31)
"""Winding number of a point whose every ray grazes an edge. Its vertices widen the bounds."""

RAY_STEPS = 12
"""Steps that a winding number takes as long as."""

_SLOPES = (
    (0.2939453125, 0.1845703125),
    (-0.2119140625, 0.3544921875),
    (0.4072265625, -0.1396484375),
    (-0.3232421875, -0.2607421875),
    (0.0830078125, 0.4521484375),
    (-0.4677734375, 0.0576171875),
    (0.1513671875, -0.3896484375),
    (0.0322265625, 0.0107421875),
)
"""Slopes of the rays: exact in float32, below 1/2, and not those that drawings are made of."""

_STRETCH = float32(1.25)
"""What the shear may lengthen across the ray: less than sqrt(1 + 1/2)."""

_MARGIN = 2.0 * SINGLE_MARGIN
"""As for volumes, SINGLE_MARGIN, stretched; the shear's own three roundings are in the reserve."""

_FLOOR = 1e-200
"""Square metres below which a sheared triangle's area is taken for noise: the volume made of it
and of a height stays far above the subnormals."""

_TINY = float32(1e-36)
_ZERO = float32(0.0)


@loop16
def ray_gaps(nodes, base, x, y, z, alpha, beta, forth, margin, gaps):
    """Positive where a ray certainly misses a lane of the node at `base`; (x, y, z) its start.

    The rectangle's shadow along the ray is a parallelogram, swept by the radius. It lies to one
    side of the start's shadow along some direction, or wholly behind the start. Any direction
    proves a miss: the centre's own and those across the parallelogram's edges are tried. The floor
    under a length makes it too long, which is the safe side.
    """
    for k in range(WIDTH):
        i = base + uint64(k)
        dx = nodes[i + CENTRE_X] - x
        ux, vx = nodes[i + U_X], nodes[i + V_X]
        cy = nodes[i + CENTRE_Y] - y - alpha * dx
        cz = nodes[i + CENTRE_Z] - z - beta * dx
        uy, uz = nodes[i + U_Y] - alpha * ux, nodes[i + U_Z] - beta * ux
        vy, vz = nodes[i + V_Y] - alpha * vx, nodes[i + V_Z] - beta * vx
        a, b = nodes[i + HALF_U], nodes[i + HALF_V]
        wide = _STRETCH * nodes[i + RADIUS] + margin
        centre = (
            cy * cy + cz * cz
            - a * abs(cy * uy + cz * uz)
            - b * abs(cy * vy + cz * vz)
            - wide * np.sqrt(cy * cy + cz * cz + _TINY)
        )  # fmt: skip
        across_u = (
            abs(uy * cz - uz * cy)
            - b * abs(uy * vz - uz * vy)
            - wide * np.sqrt(uy * uy + uz * uz + _TINY)
        )
        across_v = (
            abs(vy * cz - vz * cy)
            - a * abs(vy * uz - vz * uy)
            - wide * np.sqrt(vy * vy + vz * vz + _TINY)
        )
        behind = -forth * dx - a * abs(ux) - b * abs(vx) - nodes[i + RADIUS] - margin
        gaps[k] = max(max(centre, across_u), max(across_v, behind))


@kernel
def _side(ay, az, by, bz):
    """Sign of a × b in the plane, both differences of rounded coordinates; 0 where uncertain.

    3 u (1 + 6 u) of the terms suffices (Shewchuk 1997, section 4.3); 4 u is simpler.
    """
    left, right = ay * bz, az * by
    value = left - right
    if abs(value) > 4.0 * DOUBLE_EPS * (abs(left) + abs(right)) + _FLOOR:
        return 1 if value > 0.0 else -1
    return 0


@kernel
def _sheared(triangles, t, corner, alpha, beta):
    x = triangles[t, 3 * corner]
    return (x, triangles[t, 3 * corner + 1] - alpha * x, triangles[t, 3 * corner + 2] - beta * x)


@kernel
def _crossing(triangles, t, p, alpha, beta, forth):
    """What one triangle adds to the winding number; p is the ray's start, sheared.

    1 where the ray leaves through it, -1 where it enters, 0 where it misses; UNKNOWN where a sign
    is uncertain. A triangle without area is missed or uncertain.
    """
    x0, x1, x2 = triangles[t, 0], triangles[t, 3], triangles[t, 6]
    if forth * x0 < forth * p[0] and forth * x1 < forth * p[0] and forth * x2 < forth * p[0]:
        return 0
    a = _sheared(triangles, t, 0, alpha, beta)
    b = _sheared(triangles, t, 1, alpha, beta)
    c = _sheared(triangles, t, 2, alpha, beta)
    ay, az = a[1] - p[1], a[2] - p[2]
    by, bz = b[1] - p[1], b[2] - p[2]
    cy, cz = c[1] - p[1], c[2] - p[2]
    ab, bc, ca = _side(ay, az, by, bz), _side(by, bz, cy, cz), _side(cy, cz, ay, az)
    low, high = min(ab, min(bc, ca)), max(ab, max(bc, ca))
    if low < 0 and high > 0:
        return 0
    if low == 0 or high == 0:
        return UNKNOWN
    if forth * x0 > forth * p[0] and forth * x1 > forth * p[0] and forth * x2 > forth * p[0]:
        return ab * forth
    # The volume over the sheared area is how far along x the crossing lies.
    side = orientation(a, b, c, p) * ab * forth
    if side == 0:
        return UNKNOWN
    return ab * forth if side > 0 else 0


@kernel
def _along_ray(tree, p, slack, alpha, beta, forth, stack, gaps):
    """Crossings of one ray, or UNKNOWN."""
    unit = tree.scale[0]
    start = (p[0], p[1] - alpha * p[0], p[2] - beta * p[0])
    winding = 0
    stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        node = stack[top]
        x = p[0] / unit - tree.centres[node, 0]
        y = p[1] / unit - tree.centres[node, 1]
        z = p[2] / unit - tree.centres[node, 2]
        size = abs(x) + abs(y) + abs(z) + tree.centres[node, 3]
        base = uint64(node * STRIDE)
        ray_gaps(
            tree.nodes, base, float32(x), float32(y), float32(z), float32(alpha), float32(beta),
            float32(forth), float32(_MARGIN * size + 2.0 * slack / unit), gaps,
        )  # fmt: skip
        hit = not_above(gaps, 0, _TINY)
        while hit:
            k = lowest(hit)
            hit &= hit - 1
            child = tree.children[node * WIDTH + k]
            if child >= 0:
                stack[top] = child
                top += 1
            else:
                for t in range(first_of(child), last_of(child) + 1):
                    crossing = _crossing(tree.triangles, t, start, alpha, beta, forth)
                    if crossing == UNKNOWN:
                        return UNKNOWN
                    winding += crossing
    return winding


@kernel
def winding_number(tree, p, slack, stack, gaps):
    """Winding number of a closed mesh around p, both in the model's frame, metres; or UNKNOWN.

    Proven for every point within `slack` of p where the surface is farther than 2 `slack`, slack
    being at least 16 u of the largest coordinates.
    """
    unit = tree.scale[0]
    x = p[0] / unit - tree.centres[0, 0]
    y = p[1] / unit - tree.centres[0, 1]
    z = p[2] / unit - tree.centres[0, 2]
    reach = tree.centres[0, 3] + slack / unit
    size = abs(x) + abs(y) + abs(z) + reach
    if max(abs(x), max(abs(y), abs(z))) > 1.001 * reach or not size < SINGLE_LIMIT:
        return 0
    forth = 1 if x >= 0.0 else -1
    for alpha, beta in _SLOPES:
        winding = _along_ray(tree, p, slack, alpha, beta, forth, stack, gaps)
        if winding != UNKNOWN:
            return winding
    return UNKNOWN
