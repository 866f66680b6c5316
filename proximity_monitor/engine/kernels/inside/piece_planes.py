"""Planes beyond which a solid has nothing, for the search for a surface's deepest point.

One is perpendicular to the way from the piece's middle to the nearest point of the solid's surface,
its foot. It is the best bound wherever the piece is not about parallel to it. Another plane is
parallel to the piece. Where a solid rests on a flat piece, the value of this plane is that of the
deepest point, all over the piece. So pieces need not become small along a line or an arc of
contact. It is tried only if it would prune the piece, provided that the solid has nothing above it.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import kernel, shared
from ..base.memory import on_stack, table_on_stack
from ..base.vectors import add, along, dot, moved, norm, scaled, sub, turned_back, unit
from .ball_caps import PLANE, cap_over
from .ball_cells import radius_limit
from .ball_frame import in_search_frame
from .feet import foot_of, normal_at
from .piece_rows import HULL, LINES, ROWS, bound_by, leave_rows

_SPARE = 0.1
"""As in ball.py."""

_LOOSE = 8.0
"""The normal at the foot replaces the way there, if the angle between both is explained by this
many times the error of the distance. An inexact foot may lie far aside."""

_PARALLEL = 0.7
"""Least product of the normals of a piece and of the solid for a plane parallel to the piece."""


@kernel
def _foot_and_normal(tree, state):
    """Return the foot of the trial point, and the solid's normal there, both in a's frame.

    The normal points outward, if the side of the trial point is known. It may be zero.
    """
    at, trial, motion = state.at[0], state.trial[0], state.motions[0]
    place = (trial.place[0], trial.place[1], trial.place[2])
    p = moved(motion, place)
    foot, _ = foot_of(tree, p, 0, trial)
    x = add(place, turned_back(motion, sub(foot, p)))
    n = scaled((trial.way[0, 0], trial.way[0, 1], trial.way[0, 2]), -1.0)
    normal = turned_back(motion, normal_at(tree, 0, trial))
    product = dot(normal, n)
    explained = _LOOSE * (trial.loose[0] + at.slack)
    if abs(product) > 0.5 and (1.0 - abs(product)) * trial.away[0] <= explained:
        n = scaled(normal, 1.0 if product > 0.0 else -1.0)
    return x, n


@shared
def _row_over(tree, region, state, x, n, centre, half, spare, most, row):
    """Write a row for the plane through x with normal n; return (found, steps).

    `centre` and `half` are those of a cuboid around the piece, in the frame `at.axes`.
    """
    at, trial, axes = state.at[0], state.trial[0], state.at[0].axes
    way = sub((trial.place[0], trial.place[1], trial.place[2]), x)
    offset = sub((centre[0], centre[1], centre[2]), in_search_frame(axes, x))
    height, steps = cap_over(
        tree, region, state.motions[0], 0, at, trial.side[0], x, n, dot(n, way), norm(way),
        in_search_frame(axes, n), offset, half, spare, most, state.stack,
    )  # fmt: skip
    if height == np.inf:
        return False, steps
    row[0], row[1], row[2] = n
    row[3] = height + PLANE * at.slack + at.swept[0] + dot(n, x)
    return True, steps


@kernel
def _largest(x, n, hull, points):
    """Return how far the hull reaches beyond x against n."""
    most = -np.inf
    for k in range(points):
        most = max(most, -dot(n, sub((hull[k, 0], hull[k, 1], hull[k, 2]), x)))
    return most


@shared
def bound_by_planes(tree, region, state, rows, count, hull, points, margin, spans, bound):
    """Bound a piece by its rows and by new planes, and leave rows to its parts.

    Args:
        tree: the solid's hierarchy.
        region: its Region.
        state: Ball; the trial point is about in the middle of the piece.
        rows: (ROWS, 4); the first `count` are inherited.
        count: see `rows`.
        hull: (HULL, 3) points, in whose hull the piece lies up to `margin`, metres.
        points: the number of these points.
        margin: see `hull`.
        spans: the number of directions that the piece extends in, 1 or 2: the first axes.
        bound: metres, known before.

    Returns:
        The bound, metres, and the steps used.
    """
    at, trial, axes = state.at[0], state.trial[0], state.at[0].axes
    limit, steps = radius_limit(at), 0
    margin += at.slack
    enough = limit - margin
    tolerated = limit - at.radius
    spare = _SPARE * tolerated
    middle = (trial.place[0], trial.place[1], trial.place[2])
    centre, half = on_stack(3, 0.0), on_stack(3, 0.0)
    values, used = table_on_stack(LINES, HULL, 0.0), on_stack(ROWS, np.int64(0))
    centre[0], centre[1], centre[2] = in_search_frame(axes, middle)
    half[0] = half[1] = half[2] = 0.0
    for k in range(points):
        corner = in_search_frame(axes, sub((hull[k, 0], hull[k, 1], hull[k, 2]), middle))
        for j in range(3):
            half[j] = max(half[j], abs(corner[j]) + margin)
    x, n = _foot_and_normal(tree, state)
    if dot(n, n) > 0.5:
        most = max(limit - trial.depth[0], 2.0 * spare)
        found, steps = _row_over(tree, region, state, x, n, centre, half, spare, most, rows[count])
        if not found and trial.side[0] == 0:  # outward may be the opposite way
            n = scaled(n, -1.0)
            found, more = _row_over(
                tree, region, state, x, n, centre, half, spare, most, rows[count]
            )
            steps += more
        if found:
            count += 1
    if count > 0:
        by_rows = bound_by(rows, count, hull, points, enough, at.slack, values, used)
        bound = min(bound, by_rows + margin)
    if bound > limit and dot(n, n) > 0.5:
        if spans == 2:
            normal = (axes[2, 0], axes[2, 1], axes[2, 2])
        else:
            first = (axes[0, 0], axes[0, 1], axes[0, 2])
            normal = unit(along(n, first, -dot(n, first)))
        product = dot(normal, n)
        normal = scaled(normal, 1.0 if product > 0.0 else -1.0)
        over = _largest(x, normal, hull, points) + at.swept[0] + margin + (PLANE + 2.0) * at.slack
        most = limit - over
        if abs(product) > _PARALLEL and most > spare:
            found, more = _row_over(
                tree, region, state, x, normal, centre, half, spare, most, rows[count]
            )
            steps += more
            if found:
                count += 1
                by_rows = bound_by(
                    rows, count, hull, points, limit - margin, at.slack, values, used
                )
                bound = min(bound, by_rows + margin)
    if bound > limit:
        leave_rows(at, rows, count, points, values, used)
    return bound, steps
