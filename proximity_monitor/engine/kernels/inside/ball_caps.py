"""Bound depths in a cell of space by planes above which a solid certainly has nothing.

Let o be a point, n a direction and R a radius. Let y run over the points of the surface within R of
o, and H = max n · (y - o). The part of the ball above H (the cap) holds no surface, so it lies on
one side of it. If that side is outside, a point x below the plane whose foot on the plane lies in
the ball is no deeper than it is below the plane:

    f(x) <= H - n · (x - o) + r,

because the way along n from x, if x is inside, to the cap crosses the surface. A point x above the
plane and in the ball is outside. There the plane's value may be less than the depth, but both are
below 0, and a search for balls needs no depth that is not above 0.

If the solid is swept by a radius r, a point x above the plane may have a depth above 0. Its
distance from the core is at least what the plane tells only if the surface beyond R is no nearer,
so R must be larger. If the core has no inside, the side needs no test. If the solid has holes, the
side can change without crossing a surface. But far from the holes the winding number changes so
little that a point outside stays outside on every path in the cap.

Rounding, with s the slack of a depth (32 u S for a share of 21 u S): o is the image of a point of
a's frame and errs by less than s. n is a unit vector up to 4 u, which gives 4 u (H - n (x - o)) <=
s. Heights of corners err by 8 u S <= s. In the search's frame n errs by 12 u an entry, and its
products with o and with x by 8 u S each: 2 s. PLANE exceeds this count. Combinations of planes have
a slack of their own (`ball_rows`).
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
from .ball_frame import in_search_frame
from .nearest import point_triangle
from .solids import HALF, WHOLE
from .visit import BEYOND, ROOM, at_root, descend
from .winding import ray_steps, winding_number

PLANE = 8.0
"""A plane is raised by this number of slacks."""

STEPS = 96
"""Maximum number of steps of the descent for a plane. If it needs more, there is no plane."""

CLEAR = 16.0
"""The side of a cap is tested this number of slacks above its plane."""


FINE_SPARE, FINE_TOP = 0.25, 0.02
"""Shares of the height that a plane may give away, and of the height up to which it is of use. The
larger of both heights is `Cap.fine`."""

Cap = namedtuple("Cap", "place slack normal radius near top spare fine")
"""The query for the largest height of the surface along `normal` over `place`, within `radius`. The
answer is the height, metres. `near` is the radius in node units, float32. A height above `top` is
of no use; a height below `spare` need not be known better. The bound of a part may exceed its
points by `fine`: then the control points of an element count instead of its points."""


def leaf_steps(tree):
    """Return the average cost of a step of a descent, in steps. A stub."""


@implements(leaf_steps, MeshTree)
@inlined
def _one(tree):
    return 1


@loop16
def cap_gaps(nodes, base, x, y, z, nx, ny, nz, radius, margin, gaps):
    """Write minus the largest height that each lane may have along (nx, ny, nz) over (x, y, z).

    Writes BEYOND if no point of the lane is within `radius`. Node units.
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
        # As in `point_gaps` (nearest.py).
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
    """Bound how high along n over o the surface reaches within `radius`. A stub.

    Returns the bound, at least `height`, and the steps used. The bound is infinite if it is above
    `top` or takes too many steps.
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
    """Return how far a cell reaches from its centre perpendicular to n, a unit vector.

    Uses cross products. If the cell extends mainly along n, Pythagoras would lose half the digits.
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
    """Find a plane, seen from a point, for a cell of the search's frame; return (found, steps).

    Args:
        tree: the tree of solid k.
        region: the Region of solid k.
        motion: from a's frame to that of solid k.
        k: which solid.
        at: SEARCH.
        point: POINT; the plane is perpendicular to the way from it to its nearest surface point.
        centre: (3,) of the cell.
        half: (3,) half lengths of the cell.
        spare: metres by which the plane may lie above the surface.
        most: metres above the nearest surface point, beyond which the plane is of no use.
        row: (4,) of `CELL.rows`; written if a plane is found.
        stack: scratch.
    """
    way = (point.way[k, 0], point.way[k, 1], point.way[k, 2])
    if not dot(way, way) > 0.5:
        return False, 0
    found, steps = _one_way(
        tree, region, motion, k, at, point, way, centre, half, spare, most, row, stack
    )
    if not found and point.side[k] == 0:  # the side is unknown, so outward may be the opposite way
        way = scaled(way, -1.0)
        found, more = _one_way(
            tree, region, motion, k, at, point, way, centre, half, spare, most, row, stack
        )
        steps += more
    return found, steps


@shared
def _one_way(tree, region, motion, k, at, point, way, centre, half, spare, most, row, stack):
    """Do the same as `plane` with the normal opposite to `way`, the direction of growing depth."""
    low = -point.away[k] if point.side[k] < 0 else point.away[k]
    # x is about the point of the surface nearest to `point`.
    x, n = along((point.place[0], point.place[1], point.place[2]), way, -low), scaled(way, -1.0)
    axes = at.axes
    yn, yo = in_search_frame(axes, n), in_search_frame(axes, x)
    offset = sub((centre[0], centre[1], centre[2]), yo)
    height, steps = cap_over(
        tree, region, motion, k, at, point.side[k], x, n, -low, -low, yn, offset, half, spare, most,
        stack,
    )  # fmt: skip
    if height == np.inf:
        return False, steps
    row[0], row[1], row[2] = yn
    row[3] = height + PLANE * at.slack + at.swept[k] + dot(yn, yo)
    return True, steps


@shared
def cap_over(
    tree, region, motion, k, at, side, x, n, above, apart, yn, offset, half, spare, most, stack
):  # fmt: skip
    """Bound the height of solid k over a plane, beyond which a cell has no depth.

    The plane goes through x, which is about on the surface, and n is its unit normal, outward; both
    are in a's frame. A point with this `side` was tested before; it is `above` metres above the
    plane and `apart` metres from x. In the search's frame, `yn` is n, and `offset` leads from x to
    the cell's centre. The other arguments are as for `plane`.

    Returns the height, metres, or infinity if it is not known; and the steps used.
    """
    slack = at.slack
    o, n = moved(motion, x), rotated(motion, n)
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
        return np.inf, steps
    low, high = height + clear, radius - clear
    if region.inside == WHOLE and not (side < 0 and low < above and apart < high):
        # Any point of the cap tells its side. Near the surface it would take longest.
        gaps = on_stack(WIDTH, np.float32(0.0))
        steps += ray_steps(tree)
        if winding_number(tree, along(o, n, 0.5 * (low + high)), slack, stack, gaps) != 0:
            return np.inf, steps
    elif region.inside == HALF:
        q = along(o, n, low)
        outside, cost = is_outside(tree, region, o, max(radius, far), q, slack, stack)
        steps += cost
        if not outside:
            return np.inf, steps
    return height, steps


@kernel
def along_axis(axes, i, v):
    """Return the coordinate of a vector of a's frame along axis i of the search's frame."""
    return axes[i, 0] * v[0] + axes[i, 1] * v[1] + axes[i, 2] * v[2]
