"""Bowls between which both solids lie: a bound of depths where two surfaces are nearly parallel.

A plane above a surface that bends (`ball_caps`) lies too high by the sag of the surface: cells
between two sheets had to be so small that it did not matter. But where both sheets bend alike,
their gap changes slowly. Let c be the centre of a cell, n a unit vector that is about normal to
both surfaces, and c + y + h n a point, with y perpendicular to n. No point of the surface of a
within R of c is higher than a paraboloid, its bowl,

    q(y) = H + g · y + y · K y / 2.

Let |y| <= L all over the cell, and let T be no less than any |h| in it, nor than q where |y| <= L;
and R² >= L² + T². Then what lies above the bowl, with |y| <= L and h <= T, is of one piece: every
point of it leads upwards to a disc. It holds no surface, so all of it is outside where one point
is. Hence a point of the cell that is inside lies below the bowl, and no deeper than q(y) - h. The
same holds of b along -n, with the same K:

    f_a <= H_a + g_a · y + y · K y / 2 - h,     f_b <= H_b - g_b · y - y · K y / 2 + h.

The smaller of both is no more than their mean, (H_a + H_b + (g_a - g_b) · y) / 2. That is linear,
so it is a row as any other (`ball_rows`); and what both surfaces bend alike is not charged for.
Whatever n, g and K are, it holds. It is tightest where they are what the surfaces have in common:
their normals and their second derivatives at the feet of c.

Rounding: heights over c err as those of planes do, by less than PLANE slacks. Slopes g and bends
K R are no more than one half each, so that n - g - K y is shorter than 2.
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
from .ball_newton import foot_bend, frame_between, principal
from .visit import ROOM, at_root, descend
from .winding import ray_steps, winding_number

Bowl = namedtuple(
    "Bowl",
    "place slack normal rise sink radius near top spare fine first second bend_1 bend_2",
)
"""The query for H, as `Cap` is that for a height over a plane.

The height of a point d from the place is rise n · d less half the sum of each bend times the square
of d's part along its axis, `first` or `second`, unit vectors. `sink` is the most that this adds to
rise n · d within the radius, metres."""

_STEEPEST, _MOST_BENT = 0.5, 0.5
"""Of slopes g, and of bends times R."""

_FINE_ROOM = 0.1
"""Share of the room under the limit, as `FINE_TOP` of planes."""

PART = 0.5
"""Share of a row's change over a cell with which it has to be below the limit: then it prunes the
cell or about half of its parts."""


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
    """The height of a point d from the place: what H may not be below."""
    s, t = dot(query.first, d), dot(query.second, d)
    straight = query.rise * dot(query.normal, d)
    return straight - 0.5 * (query.bend_1 * s * s + query.bend_2 * t * t)


@shared
def _bowl_height(tree, motion, point, up, slope, axes, bends, sizes, clear, slack, stack):
    """H of a solid: a bound, and the steps that it took.

    Infinity where nothing tells that the solid is below the bowl. `sizes` are the radius R, the
    height above which H is of no use, the height below which it need not be, and `fine`.
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


def bowls(tree_a, tree_b, region_a, region_b, state, centre, half, limit, spare, row):
    """Find a row for a cell of the search's frame, where both surfaces are nearly parallel: a stub.

    Args:
        tree_a: of a.
        tree_b: of b.
        region_a: its Region.
        region_b: its Region.
        state: Ball; its trial point is the centre.
        centre: (3,) of the cell.
        half: (3,) its half lengths.
        limit: metres: nothing is looked for that would not bring the bound about below it.
        spare: metres that a bowl may lie above what is there.
        row: (4,) of `CELL.rows`; written where there is one.

    Returns:
        Whether there is one, and the steps that it took.
    """


@implements(bowls, (MeshTree, SurfaceTree, RevolutionTree), MeshTree)
@inlined
def _none(tree_a, tree_b, region_a, region_b, state, centre, half, limit, spare, row):
    return False, 0


@implements(bowls, SurfaceTree, SurfaceTree)
@shared
def _bowls(tree_a, tree_b, region_a, region_b, state, centre, half, limit, spare, row):
    at, point, slack = state.at[0], state.trial[0], state.at[0].slack
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
    # The row is v · y over the cell's middle, and changes by so much over all of it.
    v = along(scaled(e, 0.5 * (g1 - g1_b)), f, 0.5 * (g2 - g2_b))
    change = 0.0
    for i in range(3):
        change += abs(along_axis(at.axes, i, v)) * half[i]
    room = 2.0 * (limit - PART * change) - (h - h_b)
    if not room > 0.0 or not steepest < _STEEPEST:
        return False, 1
    # How far the cell reaches, and how high the bowls do.
    yn = (along_axis(at.axes, 0, n), along_axis(at.axes, 1, n), along_axis(at.axes, 2, n))
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
    found, steps = _bowl_height(
        tree_a, state.motions[0], place, n, (g1, g2), (e, f), (k1, k2),
        (radius, h + room, h + spare, fine), clear, slack, state.stack,
    )  # fmt: skip
    if found == np.inf:
        return False, steps
    room -= found - h
    found_b, more = _bowl_height(
        tree_b, state.motions[1], place, scaled(n, -1.0), (-g1_b, -g2_b), (e, f),
        (-k1, -k2), (radius, -h_b + room, -h_b + spare, fine), clear, slack, state.stack,
    )  # fmt: skip
    if found_b == np.inf:
        return False, steps + more
    row[3] = 0.5 * (found + found_b) + 2.0 * PLANE * slack
    for i in range(3):
        row[i] = -along_axis(at.axes, i, v)
        row[3] += row[i] * centre[i]
    return True, steps + more


@kernel
def _at_middle(d, g, k1, k2, c, s):
    """The height over the middle, and the slopes there, of a bowl that touches a surface's foot.

    It is d from the middle, its slopes are g there; those along the axes of the bends are returned.
    """
    y1, y2 = c * d[0] + s * d[1], c * d[1] - s * d[0]
    g1, g2 = c * g[0] + s * g[1] - k1 * y1, c * g[1] - s * g[0] - k2 * y2
    return d[2] - g1 * y1 - g2 * y2 - 0.5 * (k1 * y1 * y1 + k2 * y2 * y2), g1, g2
