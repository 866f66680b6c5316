"""How often a ray passes through an element of a surface, as a certified integer.

The ray runs along x, forward or backward, in space sheared by its slope, as for meshes (see
winding.py). Its start p is the origin. If the control points of a part of the surface lie on one
side of a plane through p, the part does not contain p. If the ray lies on the other side of the
plane, or in it, the ray misses the part. Otherwise the opposite half of the ray's line misses the
part, so the ray passes through it as often as the whole line. That count is the degree of the
part's projection along the line: how often its boundary winds around the origin. Each of the four
boundary curves lies in the hull of its control points. If that hull misses the origin, the curve
can be straightened without passing over the origin. So the boundary winds as often as the
quadrilateral of the corners. A part that these tests do not decide is divided.

All hulls keep a margin from the line, for rounding, the slack of p, and the gaps between patches.
So any surface that closes these gaps misses the line as well, and all crossings together are the
winding number of a closed surface (see models/closed.py).

A part of a trimmed patch counts if nothing of it is cut off. A part that loops cross is divided
until the ray misses it. Then the ray also misses the edge in it, by the same margin.
"""

from __future__ import annotations

import numpy as np

from ..base.jit import implements, inlined, kernel, shared
from ..base.memory import on_stack, table_on_stack
from ..base.trees import RevolutionTree, SurfaceTree
from ..base.vectors import cross, dot, norm, scaled, sub
from ..inside import visit
from ..inside.angles import half_side, is_outside
from ..inside.winding import UNKNOWN, Ray, ray_steps, side_of_origin
from .parts import (
    ABOUT,
    EACH,
    MOST,
    NUMBERS,
    SIDE,
    SPLITS,
    begin_parts,
    corner_of,
    halve,
    least_along,
    lines_of,
    margin_of,
    place_of,
    room_of,
    side_of_part,
    take_whole,
)
from .trim import INSIDE, OUTSIDE

_DIVISIONS = 384
"""Most divisions of an element for one ray; then another ray is tried."""

_STEPS = 24
"""A winding number takes as long as this many steps."""

_MISSED, _AHEAD, _OPEN = 0, 1, 2
"""States of a part: the ray misses it; the other half of its line misses it; not known yet."""

_AROUND = 0, 2, 3, 1, 0
"""The corners of a part in the order of its boundary."""

_STRETCH = 1.25
"""As in inside/winding.py: the most by which the shear lengthens."""


@implements(ray_steps, SurfaceTree)
@inlined
def _ray_steps(tree):
    return _STEPS


@implements(half_side, (SurfaceTree, RevolutionTree))
@inlined
def _no_half(tree, region, p, least, slack, stack):
    return 0, 0.0, 1


@implements(is_outside, (SurfaceTree, RevolutionTree))
@inlined
def _not_known(tree, region, p, radius, q, slack, stack):
    return False, 1


@kernel
def _shear(piece, parts, alpha, beta):
    for i in range(np.int64(piece.points)):
        k = EACH * i
        parts[k + 1] -= alpha * parts[k]
        parts[k + 2] -= beta * parts[k]


@kernel
def _is_beside(parts, at, step, count, margin):
    """Tell whether control points lie beside the line by more than a margin, all on one side.

    The side is the bisector of the two outermost points as seen from the origin.
    """
    ly = ry = parts[at + 1]
    lz = rz = parts[at + 2]
    for i in range(1, count):
        a, b = parts[at + i * step + 1], parts[at + i * step + 2]
        if ry * b - rz * a < 0.0:
            ry, rz = a, b
        if ly * b - lz * a > 0.0:
            ly, lz = a, b
    left, right = np.sqrt(ly * ly + lz * lz), np.sqrt(ry * ry + rz * rz)
    if not (left > 0.0 and right > 0.0):
        return False
    ny, nz = ly / left + ry / right, lz / left + rz / right
    size = np.sqrt(ny * ny + nz * nz)
    if not size > 0.0:
        return False
    ny, nz = ny / size, nz / size
    for i in range(count):
        k = at + i * step
        if not ny * parts[k + 1] + nz * parts[k + 2] > margin * parts[k + 3]:
            return False
    return True


@kernel
def _where(piece, parts, at, forth, margin):
    """Tell whether the ray misses a part (_MISSED), the other half of its line does, or neither."""
    n = (forth, 0.0, 0.0)
    if _is_beside(parts, at, EACH, np.int64(piece.points), margin):
        return _MISSED
    # Try planes across the ray, both ways, then one about parallel to the part: near the part's
    # surface, no other plane has all of it on one side.
    for attempt in range(3):
        if attempt == 1:
            n = (-forth, 0.0, 0.0)
        elif attempt == 2:
            a, b = corner_of(piece, parts, at, 0), corner_of(piece, parts, at, 1)
            c, d = corner_of(piece, parts, at, 2), corner_of(piece, parts, at, 3)
            n = cross(sub(d, a), sub(c, b))
            if dot(n, a) + dot(n, d) < 0.0:
                n = scaled(n, -1.0)
        if least_along(piece, parts, at, n) > margin * norm(n):
            return _AHEAD if forth * n[0] > 0.0 else _MISSED
    return _OPEN


@kernel
def _degree(piece, parts, at, margin):
    """Count how often a part's boundary winds around the line, from y to z; or return UNKNOWN."""
    for edge in range(4):
        lines, apart, step, count = lines_of(piece, edge < 2)
        first = at + (apart * (lines - 1) if edge % 2 == 1 else 0)
        if not _is_beside(parts, first, step, count, margin):
            return UNKNOWN
    winding = 0
    for k in range(4):
        a = corner_of(piece, parts, at, _AROUND[k])
        b = corner_of(piece, parts, at, _AROUND[k + 1])
        up, down = a[2] <= 0.0 < b[2], b[2] <= 0.0 < a[2]
        if up or down:
            side = side_of_origin(a[1], a[2], b[1], b[2])
            if side == 0:
                return UNKNOWN
            if up and side > 0:
                winding += 1
            elif down and side < 0:
                winding -= 1
    return winding


@implements(visit.meet, Ray, SurfaceTree)
@shared
def _crossings(query, tree, t, answer):
    """Return the winding number with one more element counted, or UNKNOWN."""
    piece = tree.pieces[t]
    if answer == UNKNOWN or piece.degree_v == 0:
        return answer  # a curve bounds nothing, nor does an edge
    p, slack, forth = query.place, query.slack, query.forth
    parts, about = on_stack(NUMBERS, 0.0), table_on_stack(MOST, ABOUT, 0.0)
    take_whole(piece, tree.nets, p, parts)
    _shear(piece, parts, query.alpha, query.beta)
    left = begin_parts(piece, parts, True, about)
    top, total, divisions, room = 1, 0, 0, room_of(piece)
    while top > 0:
        k = top - 1
        at = place_of(piece, k)
        splits = np.int64(about[k, SPLITS])
        margin = 2.0 * _STRETCH * (margin_of(tree, piece, p, splits) + slack)
        found = _where(piece, parts, at, float(forth), margin)
        if found != _MISSED and side_of_part(tree, piece, about, k) == OUTSIDE:
            found = _MISSED  # loops have cut it off
        if found == _AHEAD and about[k, SIDE] == INSIDE:
            winding = _degree(piece, parts, at, margin)
            if winding != UNKNOWN:
                total += winding
                found = _MISSED  # it has been counted
        if found == _MISSED:
            top -= 1
            continue
        if top >= room or divisions >= _DIVISIONS:
            return UNKNOWN
        halve(piece, parts, about, left, k, top)
        divisions += 1
        top += 1
    return answer + total * forth
