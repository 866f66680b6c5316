"""Planes above which a solid surely has nothing: what bounds depths in a cell of space.

Let o be a point, n a direction, and no point y of the surface within R of o higher along n than
H = max n · (y - o). The part of that ball above H holds no surface, hence lies on one side of it.
If that is outside, a point x below the plane, whose foot on it lies in the ball, is no deeper than
it is below the plane:

    f(x) <= H - n · (x - o) + r,

because on the way along n from x inside to what is above the plane the surface is passed. A point x
above the plane, if it is in the ball, lies outside: what the plane says of it is less than its
depth may be, but a search for balls asks for nothing that is not above 0. What a ball of radius r
sweeps needs more where x is above the plane: x may lie outside the core, as far from it as the
plane says, if the surface beyond R is no nearer. Without an inside there is no side to ask for. Of
a solid with holes, sides change without a surface; but far from the holes they do so little that a
point outside stays so on every way there.

Rounding, with s the slack of a depth (32 u S for a share of 21 u S): o is the image of a point of
a's frame, wrong by less than s; n is a unit vector but for 4 u, which is 4 u (H - n (x - o)) <= s;
heights of corners err by 8 u S <= s. Turned into the search's frame n errs by 12 u an entry, the
product with o and with x by 8 u S each: 2 s. PLANE is above that count; what is made of planes has
a slack of its own (`ball_rows`).
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np
from numba import float32, uint64

from ..base.jit import implements, inlined, kernel, loop16, shared
from ..base.memory import on_stack
from ..base.trees import MeshTree, SurfaceTree
from ..base.vectors import along, cross, dot, moved, norm, rotated, scaled, sub
from ..elements.primitives import corners
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
from .angles import is_outside
from .nearest import point_triangle
from .solids import HALF, WHOLE
from .visit import BEYOND, ROOM, at_root, descend
from .winding import ray_steps, winding_number

PLANE = 8.0
"""Slacks by which a plane is raised."""

STEPS = 96
"""Steps of a descent that a plane may take; else there is none."""

CLEAR = 16.0
"""Slacks above a plane at which its side is asked for."""


FINE_SPARE, FINE_TOP = 0.25, 0.02
"""Shares of what a plane may give away, and of the height up to which it is of use: so much higher
than its points an element's control points may count as."""

Cap = namedtuple("Cap", "place slack normal radius near top spare fine")
"""The query how high along a unit vector over its place the surface reaches within a radius, metres
and, float32, node units; the answer is the height, metres. Above `top` it does not matter, nor
whether it is less than `spare`. A bound of a part may be above its points by `fine`."""


def leaf_steps(tree):
    """Steps that what a step meets takes as long as, on average: a stub."""


@implements(leaf_steps, MeshTree)
@inlined
def _one(tree):
    return 1


@loop16
def cap_gaps(nodes, base, x, y, z, nx, ny, nz, radius, margin, gaps):
    """Minus the largest height along a unit vector over (x, y, z) that each lane may have.

    BEYOND where no point of the lane is within `radius`.
    """
    for k in range(WIDTH):
        i = base + uint64(k)
        dx = nodes[i + CENTRE_X] - x
        dy = nodes[i + CENTRE_Y] - y
        dz = nodes[i + CENTRE_Z] - z
        ux, uy, uz = nodes[i + U_X], nodes[i + U_Y], nodes[i + U_Z]
        vx, vy, vz = nodes[i + V_X], nodes[i + V_Y], nodes[i + V_Z]
        a, b = nodes[i + HALF_U], nodes[i + HALF_V]
        wide = nodes[i + RADIUS] + margin
        high = (
            dx * nx + dy * ny + dz * nz
            + a * abs(ux * nx + uy * ny + uz * nz)
            + b * abs(vx * nx + vy * ny + vz * nz)
            + wide
        )  # fmt: skip
        # As in `_point_gaps` (nearest.py).
        s = min(max(dx * ux + dy * uy + dz * uz, -a), a)
        t = min(max(dx * vx + dy * vy + dz * vz, -b), b)
        dx = dx - s * ux - t * vx
        dy = dy - s * uy - t * vy
        dz = dz - s * uz - t * vz
        away = np.sqrt(dx * dx + dy * dy + dz * dz) - wide
        gaps[k] = BEYOND if away >= radius else -high


@implements(visit.lane_gaps, Cap)
@inlined
def _lane_gaps(query, nodes, base, x, y, z, margin, gaps):
    n = query.normal
    nx, ny, nz = float32(n[0]), float32(n[1]), float32(n[2])
    cap_gaps(nodes, base, x, y, z, nx, ny, nz, query.near, margin, gaps)


@implements(visit.limit, Cap)
@inlined
def _limit(query, answer):
    return -np.inf if answer > query.top else -answer


@implements(visit.meet, Cap, MeshTree)
@inlined
def _meet(query, tree, t, answer):
    o, n = query.place, query.normal
    a, b, c = corners(tree.triangles, t)
    high = max(dot(n, sub(a, o)), max(dot(n, sub(b, o)), dot(n, sub(c, o))))
    if high > answer and np.sqrt(point_triangle(o, a, b, c)[0]) < query.radius:
        answer = min(high, query.radius)
    return answer


def cap_height(tree, o, n, radius, height, top, slack, stack):
    """How high along n over o the surface reaches within `radius`: a bound, and the steps it took.

    At least `height`; infinity where it is above `top`, or takes too long to tell. A stub.
    """


@implements(cap_height, (MeshTree, SurfaceTree))
@shared
def _by_volumes(tree, o, n, radius, height, top, slack, stack):
    bounds, gaps = on_stack(ROOM, 0.0), on_stack(WIDTH, np.float32(0.0))
    near = float32(min(radius / tree.scale[0] * (1.0 + 1e-6), 1e29))
    fine = max(FINE_SPARE * height, FINE_TOP * top)
    query = Cap(o, slack, n, radius, near, top, height, fine)
    height, left, steps = descend(
        query, tree, height, at_root(stack, bounds), stack, bounds, gaps, STEPS
    )
    steps = (STEPS - steps) * leaf_steps(tree)
    return np.inf if left > 0 or height > top else height, steps


@kernel
def beside(n, half):
    """How far a cell reaches from its centre perpendicular to n, a unit vector.

    Not by Pythagoras: along n half of the digits of a small rest would be lost.
    """
    square = 0.0
    for corner in range(4):  # the other four lie opposite
        v = -half[1] if corner & 1 else half[1]
        w = -half[2] if corner & 2 else half[2]
        across = cross((half[0], v, w), n)
        square = max(square, dot(across, across))
    return np.sqrt(square)


@shared
def plane(tree, region, motion, k, at, point, centre, half, spare, most, row, stack):
    """Find a plane seen from a point for a cell of the search's frame: (whether, steps).

    Args:
        tree: of solid k.
        region: its.
        motion: from a's frame to its.
        k: which solid.
        at: SEARCH.
        point: POINT; the plane is perpendicular to the way to its nearest point of the surface.
        centre: (3,) of the cell.
        half: (3,) its half lengths.
        spare: metres that the plane may lie above what is there.
        most: metres above the nearest point of the surface beyond which the plane is of no use.
        row: (4,) of `CELL.rows`; written where there is a plane.
        stack: scratch.
    """
    way = (point.way[k, 0], point.way[k, 1], point.way[k, 2])
    if not dot(way, way) > 0.5:
        return False, 0
    found, steps = _one_way(
        tree, region, motion, k, at, point, way, centre, half, spare, most, row, stack
    )
    if not found and point.side[k] == 0:  # then it is not known either which way is out
        way = scaled(way, -1.0)
        found, more = _one_way(
            tree, region, motion, k, at, point, way, centre, half, spare, most, row, stack
        )
        steps += more
    return found, steps


@shared
def _one_way(tree, region, motion, k, at, point, way, centre, half, spare, most, row, stack):
    """As `plane`, against the way along which the depth is taken to grow."""
    slack, side, axes = at.slack, point.side[k], at.axes
    low = -point.away[k] if side < 0 else point.away[k]
    # From the nearest point of the surface on, as nearly as it matters.
    x = along((point.place[0], point.place[1], point.place[2]), way, -low)
    o, n = moved(motion, x), rotated(motion, scaled(way, -1.0))
    yn = (-along_axis(axes, 0, way), -along_axis(axes, 1, way), -along_axis(axes, 2, way))
    yo = (along_axis(axes, 0, x), along_axis(axes, 1, x), along_axis(axes, 2, x))
    offset = sub((centre[0], centre[1], centre[2]), yo)
    square = half[0] * half[0] + half[1] * half[1] + half[2] * half[2]
    height, away = dot(yn, offset), norm(offset)
    top = height + abs(yn[0]) * half[0] + abs(yn[1]) * half[1] + abs(yn[2]) * half[2]
    aside = norm(along(offset, yn, -height)) + beside(yn, half)
    far = (away + np.sqrt(square)) * (1.0 + 1e-12)
    clear = CLEAR * slack + 2.0 * at.joints
    high = most + 2.0 * clear
    radius = np.sqrt(aside * aside + high * high)
    if top + clear > 0.0:  # some of the cell may be above the plane
        radius = max(radius, far if at.swept[k] == 0.0 else 2.0 * far)
    radius = radius * (1.0 + 1e-12) + 2.0 * clear
    height, steps = cap_height(tree, o, n, radius, spare, most, slack, stack)
    if height == np.inf:
        return False, steps
    q = along(o, n, height + clear)
    if region.inside == WHOLE and not (side < 0 and height + clear < -low < radius - clear):
        gaps = on_stack(WIDTH, np.float32(0.0))
        steps += ray_steps(tree)
        if winding_number(tree, q, slack, stack, gaps) != 0:
            return False, steps
    elif region.inside == HALF:
        outside, cost = is_outside(tree, region, o, max(radius, far), q, slack, stack)
        steps += cost
        if not outside:
            return False, steps
    row[0], row[1], row[2] = yn
    row[3] = height + PLANE * slack + at.swept[k] + dot(yn, yo)
    return True, steps


@kernel
def along_axis(axes, i, v):
    """The coordinate of a vector of a's frame along one axis of the search's."""
    return axes[i, 0] * v[0] + axes[i, 1] * v[1] + axes[i, 2] * v[2]
