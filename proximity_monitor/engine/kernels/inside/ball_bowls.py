"""Bound depths by bowls (paraboloids) if the surfaces of both solids are nearly parallel in a cell.

A plane above a bent surface (`ball_caps`) lies too high by the sag of the surface. With planes
alone, cells between two sheets would have to be so small that the sag does not matter. But if both
sheets bend alike, their gap changes slowly. Let c be the centre of a cell, n a unit vector that is
about normal to both surfaces, and c + y + h n a point, with y perpendicular to n. The bowl of a is
a paraboloid above all points of the surface of a within R of c:

    q(y) = H + g · y + y · K y / 2.

Let L bound |y| in the cell. Let T bound |h| in the cell, and also q for |y| <= L. Let
R² >= L² + T². Then the region above the bowl with |y| <= L and h <= T is connected, because every
point of it leads upwards to the disc h = T. It holds no surface. So if one point of it is outside,
all of it is. Hence a point of the cell that is inside lies below the bowl and is no deeper than
q(y) - h. The same holds for b along -n, with the same K:

    f_a <= H_a + g_a · y + y · K y / 2 - h,     f_b <= H_b - g_b · y - y · K y / 2 + h.

The smaller depth is at most their mean, (H_a + H_b + (g_a - g_b) · y) / 2. The mean is linear, so
it is a row like any other (`ball_rows`), and the common bend of both surfaces cancels. This holds
for any n, g and K. The bound is tightest if they match the surfaces: the common normal, the slopes,
and the mean second derivatives at the feet of c.

Rounding: heights over c err by less than PLANE slacks, like those of planes. Slopes g and bends
K R are at most one half each, so n - g - K y is shorter than 2.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np
from numba import float32

from ..base.jit import implements, inlined, kernel, shared
from ..base.memory import on_stack
from ..base.trees import MeshTree, RevolutionTree, SurfaceTree
from ..base.vectors import along, dot, moved, norm, rotated, scaled
from ..tree.layout import WIDTH
from . import visit
from .ball_caps import (
    CLEAR,
    FINE_SPARE,
    PLANE,
    STEPS,
    along_axis,
    beside,
    cap_gaps,
    leaf_steps,
)
from .ball_frame import in_search_frame
from .ball_newton import foot_bend, frame_between, principal
from .visit import ROOM, at_root, descend
from .winding import ray_steps, winding_number

Bowl = namedtuple(
    "Bowl",
    "place slack normal rise sink radius near top spare fine first second bend_1 bend_2",
)
"""The query for H, like `Cap` for a height over a plane.

Let d be a point's offset from the place. Its height is rise n · d - (bend_1 s² + bend_2 t²) / 2,
where s and t are the components of d along the unit vectors `first` and `second`. Within the
radius, the bends add at most `sink` metres to rise n · d."""

_STEEPEST, _MOST_BENT = 0.5, 0.5
"""Largest slope g, and largest product of a bend and R, that are used."""

_FINE_ROOM = 0.1
"""Share of the room under the limit; for bowls what `FINE_TOP` is for planes."""

PART = 0.5
"""The value of a row at the cell's centre, plus this share of its change over the cell, must be
below the limit. Then the row prunes the cell or about half of its parts."""


@implements(visit.lane_gaps, Bowl)
@inlined
def _lane_gaps(query, nodes, base, x, y, z, margin, gaps):
    n = query.normal
    nx, ny, nz = float32(n[0]), float32(n[1]), float32(n[2])
    cap_gaps(nodes, base, x, y, z, nx, ny, nz, query.near, margin, gaps)


@implements(visit.limit, Bowl)
@inlined
def _limit(query, answer):
    return -np.inf if answer > query.top else -(answer - query.sink) / query.rise


@kernel
def height_over(query, d):
    """Return the height of the point at offset d from the place; H must be at least as high."""
    s, t = dot(query.first, d), dot(query.second, d)
    straight = query.rise * dot(query.normal, d)
    return straight - 0.5 * (query.bend_1 * s * s + query.bend_2 * t * t)


@shared
def _bowl_height(tree, motion, point, up, slope, axes, bends, sizes, clear, slack, stack):
    """Return an upper bound of H of a solid, and the steps used.

    The bound is infinite if the solid is not proven to be below the bowl. `sizes` holds the radius
    R; the height above which H is useless; the least height of interest; and `fine` (see `Cap`).
    """
    bounds, gaps = on_stack(ROOM, 0.0), on_stack(WIDTH, np.float32(0.0))
    o, n = moved(motion, point), rotated(motion, up)
    first, second = rotated(motion, axes[0]), rotated(motion, axes[1])
    way = along(along(n, first, -slope[0]), second, -slope[1])
    rise = norm(way)
    radius, top, least, fine = sizes
    sink = 0.5 * max(-min(bends[0], bends[1]), 0.0) * radius * radius
    near = float32(min(radius / tree.scale[0] * (1.0 + 1e-6), 1e29))
    query = Bowl(
        o, slack, scaled(way, 1.0 / rise), rise, sink, radius, near, top, least, fine, first,
        second, bends[0], bends[1],
    )  # fmt: skip
    height, left, steps = descend(
        query, tree, least, at_root(stack, bounds), stack, bounds, gaps, STEPS
    )
    steps = (STEPS - steps) * leaf_steps(tree)
    if left > 0 or height > top:
        return np.inf, steps
    steps += ray_steps(tree)
    if winding_number(tree, along(o, n, height + clear), slack, stack, gaps) != 0:
        return np.inf, steps
    return height, steps


WAYS = 3
"""Number of ways in which `bowls` seeks a row."""


def bowls(tree_a, tree_b, region_a, region_b, way, state, centre, half, limit, spare, row):
    """Find a row for a cell of the search's frame if both surfaces are nearly parallel. A stub.

    Each way does a part of the work, so that no part takes long: 0 seeks sleeves (see
    revolution/sleeves.py); 1 finds the bowl of a, and 2 that of b, which makes the row.

    Args:
        tree_a: the tree of a.
        tree_b: the tree of b.
        region_a: the Region of a.
        region_b: the Region of b.
        way: from 0 on, in this order.
        state: Ball; its trial point is the cell's centre.
        centre: (3,) of the cell.
        half: (3,) half lengths of the cell.
        limit: metres; a row that cannot bring the bound roughly below it is not sought.
        spare: metres by which a bowl may lie above its surface.
        row: (4,) of `CELL.rows`; written if a row is found.

    Returns:
        Whether a row was found, and the steps used.
    """


@implements(bowls, (MeshTree, SurfaceTree, RevolutionTree), MeshTree)
@inlined
def _none(tree_a, tree_b, region_a, region_b, way, state, centre, half, limit, spare, row):
    return False, 0


@implements(bowls, SurfaceTree, SurfaceTree)
@shared
def _bowls(tree_a, tree_b, region_a, region_b, way, state, centre, half, limit, spare, row):
    at, point, slack = state.at[0], state.trial[0], state.at[0].slack
    if way == 0 or (way == 2 and at.bowl == np.inf):
        return False, 0
    found, at.bowl = at.bowl, np.inf
    n, e, f = frame_between(point)
    if not dot(n, n) > 0.5 or at.swept[0] > 0.0 or at.swept[1] > 0.0:
        return False, 0
    sound, d, g, bend = foot_bend(tree_a, state.motions[0], 0, point, n, e, f)
    sound_b, d_b, g_b, bend_b = foot_bend(tree_b, state.motions[1], 1, point, n, e, f)
    if not (sound and sound_b):
        return False, 1
    k1, k2, c, s = principal(
        0.5 * (bend[0] + bend_b[0]), 0.5 * (bend[1] + bend_b[1]), 0.5 * (bend[2] + bend_b[2])
    )
    e, f = along(scaled(e, c), f, s), along(scaled(f, c), e, -s)
    h, g1, g2 = _at_middle(d, g, k1, k2, c, s)
    h_b, g1_b, g2_b = _at_middle(d_b, g_b, k1, k2, c, s)
    steepest = max(np.hypot(g1, g2), np.hypot(g1_b, g2_b))
    # Relative to the cell's middle, the row is v · y. It changes by at most `change` in the cell.
    v = along(scaled(e, 0.5 * (g1 - g1_b)), f, 0.5 * (g2 - g2_b))
    change = 0.0
    for i in range(3):
        change += abs(along_axis(at.axes, i, v)) * half[i]
    room = 2.0 * (limit - PART * change) - (h - h_b)
    if not room > 0.0 or not steepest < _STEEPEST:
        return False, 1
    # How far the cell reaches perpendicular to n (`aside`), and how high cell and bowls reach.
    yn = in_search_frame(at.axes, n)
    aside = beside(yn, half) * (1.0 + 1e-12)
    high = abs(yn[0]) * half[0] + abs(yn[1]) * half[1] + abs(yn[2]) * half[2]
    clear, bent = CLEAR * slack + 2.0 * at.joints, max(abs(k1), abs(k2))
    high = max(high, max(h, -h_b) + room + steepest * aside + 0.5 * bent * aside * aside)
    high = (high + clear) * (1.0 + 1e-12)
    radius = np.sqrt(aside * aside + high * high) * (1.0 + 1e-12) + 2.0 * clear
    if not bent * radius < _MOST_BENT:
        return False, 1
    place = (point.place[0], point.place[1], point.place[2])
    fine = max(FINE_SPARE * spare, _FINE_ROOM * room)
    if way == 1:
        at.bowl, steps = _bowl_height(
            tree_a, state.motions[0], place, n, (g1, g2), (e, f), (k1, k2),
            (radius, h + room, h + spare, fine), clear, slack, state.stack,
        )  # fmt: skip
        return False, steps
    room -= found - h
    found_b, steps = _bowl_height(
        tree_b, state.motions[1], place, scaled(n, -1.0), (-g1_b, -g2_b), (e, f),
        (-k1, -k2), (radius, -h_b + room, -h_b + spare, fine), clear, slack, state.stack,
    )  # fmt: skip
    if found_b == np.inf:
        return False, steps
    row[3] = 0.5 * (found + found_b) + 2.0 * PLANE * slack
    for i in range(3):
        row[i] = -along_axis(at.axes, i, v)
        row[3] += row[i] * centre[i]
    return True, steps


@kernel
def _at_middle(d, g, k1, k2, c, s):
    """Return height and slopes at the cell's middle of the bowl that touches a surface at its foot.

    The foot is at offset d from the middle and has slopes g. The returned slopes are along the axes
    of the bends.
    """
    y1, y2 = c * d[0] + s * d[1], c * d[1] - s * d[0]
    g1, g2 = c * g[0] + s * g[1] - k1 * y1, c * g[1] - s * g[0] - k2 * y2
    return d[2] - g1 * y1 - g2 * y2 - 0.5 * (k1 * y1 * y1 + k2 * y2 * y2), g1, g2
