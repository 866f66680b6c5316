"""The winding number of a closed surface around a point, as a certified integer.

This file traces a ray through any hierarchy and counts its crossings of triangles. Crossings of
surface patches are counted in surface/crossing.py.

The winding number of a closed mesh (Jacobson et al. 2013, section 3) is the sum of its triangles'
solid angles over 4 pi. Equivalently, and used here: take any ray from the point; count the
triangles through which it leaves, minus those through which it enters. Solid angles need a
tolerance. Crossings need only signs: if a sign cannot be proven, the next ray is tried.

A ray runs along x, forth or back, through space sheared by slopes: (x, y - alpha x, z - beta x).
A vertex is rounded in the same way wherever it is used, so the sheared mesh is as closed as the
given one. Rounding moves a vertex by less than 4 u of its length, and the point likewise. If the
point is farther than that from the surface, the rounding does not change its winding number.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np
from numba import float32, uint64

from ..base.jit import implements, inlined, kernel, loop16
from ..base.memory import on_stack
from ..base.precise import orientation
from ..base.rounding import DOUBLE_EPS, SINGLE_LIMIT
from ..base.trees import MeshTree, SurfaceTree
from ..elements.errors import joints_err
from ..tree.layout import (
    CENTRE_X,
    CENTRE_Y,
    CENTRE_Z,
    HALF_U,
    HALF_V,
    RADIUS,
    U_X,
    U_Y,
    U_Z,
    V_X,
    V_Y,
    V_Z,
    WIDTH,
)
from . import visit
from .visit import BEYOND, ROOM, TO_THE_END, at_root, descend

Ray = namedtuple("Ray", "place slack alpha beta forth")
"""The query for the crossings of a ray. The answer is the signed number of crossings, or UNKNOWN.
`forth` is 1 if the ray runs along x, -1 if it runs back."""

UNKNOWN = -(2**31)
"""Winding number of a point whose every ray grazes an edge. Callers then leave its side open."""

_STEPS = 12
"""Cost of the winding number of a mesh, in steps."""

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
"""Slopes of the rays: exact in float32, below 1/2, and unlike the slopes that drawings use."""

_STRETCH = float32(1.25)
"""The shear stretches lengths across the ray by less than this: by at most sqrt(1 + 1/2)."""

_MARGIN = float32(2.0)
"""Factor on the margin of volumes, because the shear stretches it. The factor also covers the three
roundings of the shear itself."""

_FLOOR = 1e-200
"""Areas of sheared triangles below this, square metres, count as noise. So the product of an area
and a height stays far above the subnormals."""

_TINY = float32(1e-36)
_ZERO = float32(0.0)


@loop16
def _ray_gaps(nodes, base, x, y, z, alpha, beta, forth, margin, gaps):
    """Write 0, or BEYOND for each lane of the node at `base` that a ray certainly misses.

    (x, y, z) is the ray's start. Projected along the ray, the rectangle is a parallelogram and the
    start is a point. The ray misses the lane if some direction separates the point from the
    parallelogram swept by the radius, or if the lane is wholly behind the start. The directions
    tried are those to the centre and across the parallelogram's edges. _TINY makes the length of a
    direction too long, which is safe.
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
        missed = max(max(centre, across_u), max(across_v, behind)) > _ZERO
        gaps[k] = BEYOND if missed else _ZERO


def ray_steps(tree):
    """Return the cost of a winding number, in steps. A stub."""


@implements(ray_steps, MeshTree)
@inlined
def _ray_steps(tree):
    return _STEPS


@kernel
def side_of_origin(ay, az, by, bz):
    """Return the sign of a × b in the plane, or 0 if it is uncertain.

    a and b are differences of rounded coordinates. An error of 3 u (1 + 6 u) of the terms would do
    (Shewchuk 1997, section 4.3); 4 u is simpler.
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
    """Return what one triangle adds to the winding number; p is the ray's start, sheared.

    1 if the ray leaves through it, -1 if it enters, 0 if it misses; UNKNOWN if a sign is uncertain.
    A triangle without area is missed or uncertain.
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
    ab, bc, ca = (
        side_of_origin(ay, az, by, bz), side_of_origin(by, bz, cy, cz),
        side_of_origin(cy, cz, ay, az),
    )  # fmt: skip
    low, high = min(ab, min(bc, ca)), max(ab, max(bc, ca))
    if low < 0 and high > 0:
        return 0
    if low == 0 or high == 0:
        return UNKNOWN
    if forth * x0 > forth * p[0] and forth * x1 > forth * p[0] and forth * x2 > forth * p[0]:
        return ab * forth
    # The volume divided by the sheared area is the crossing's distance from the start along x.
    side = orientation(a, b, c, p) * ab * forth
    if side == 0:
        return UNKNOWN
    return ab * forth if side > 0 else 0


@implements(visit.lane_gaps, Ray)
@inlined
def _lane_gaps(query, nodes, base, x, y, z, margin, gaps):
    alpha, beta, forth = float32(query.alpha), float32(query.beta), float32(query.forth)
    _ray_gaps(nodes, base, x, y, z, alpha, beta, forth, _MARGIN * margin, gaps)


@implements(visit.limit, Ray)
@inlined
def _limit(query, answer):
    return -np.inf if answer == UNKNOWN else np.inf


@implements(visit.meet, Ray, MeshTree)
@inlined
def _meet(query, tree, t, answer):
    p, alpha, beta = query.place, query.alpha, query.beta
    start = (p[0], p[1] - alpha * p[0], p[2] - beta * p[0])
    crossing = _crossing(tree.triangles, t, start, alpha, beta, query.forth)
    return UNKNOWN if answer == UNKNOWN or crossing == UNKNOWN else answer + crossing


def winding_number(tree, p, slack, stack, gaps):
    """Return the winding number of a closed surface around p, or UNKNOWN. A stub.

    p is in the model's frame, metres. The result holds for every point within `slack` of p if the
    surface is farther from p than 2 (`slack` + `joints_err`), and `slack` is at least 16 u of the
    largest coordinates.
    """


@implements(winding_number, (MeshTree, SurfaceTree))
@kernel
def _by_rays(tree, p, slack, stack, gaps):
    slack += joints_err(tree)
    unit = tree.scale[0]
    x = p[0] / unit - tree.centres[0, 0]
    y = p[1] / unit - tree.centres[0, 1]
    z = p[2] / unit - tree.centres[0, 2]
    reach = tree.centres[0, 3] + slack / unit
    size = abs(x) + abs(y) + abs(z) + reach
    if max(abs(x), max(abs(y), abs(z))) > 1.001 * reach or not size < SINGLE_LIMIT:
        return 0
    forth = 1 if x >= 0.0 else -1
    bounds = on_stack(ROOM, 0.0)
    for alpha, beta in _SLOPES:
        ray, top = Ray(p, slack, alpha, beta, forth), at_root(stack, bounds)
        winding, _, _ = descend(ray, tree, 0, top, stack, bounds, gaps, TO_THE_END)
        if winding != UNKNOWN:
            return winding
    return UNKNOWN
