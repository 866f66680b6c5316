"""The search's frame, whose axes the cells follow, and the cuboid around what two models share."""

from __future__ import annotations

import numpy as np
from numba import uint64

from ..base.jit import kernel, shared
from ..base.rounding import SINGLE_MARGIN
from ..base.vectors import along, cross, dot, rotated, sub, unit
from ..tree.layout import (
    CENTRE_X,
    CENTRE_Y,
    CENTRE_Z,
    EMPTY,
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
from .solids import HALF


@kernel
def _axis(axes, i):
    return (axes[i, 0], axes[i, 1], axes[i, 2])


@kernel
def in_a_frame(axes, v):
    """Convert a point of the search's frame to a's frame."""
    return (
        axes[0, 0] * v[0] + axes[1, 0] * v[1] + axes[2, 0] * v[2],
        axes[0, 1] * v[0] + axes[1, 1] * v[1] + axes[2, 1] * v[2],
        axes[0, 2] * v[0] + axes[1, 2] * v[1] + axes[2, 2] * v[2],
    )


@kernel
def in_search_frame(axes, v):
    """Convert a vector of a's frame to the search's frame: undoes `in_a_frame`."""
    return (dot(_axis(axes, 0), v), dot(_axis(axes, 1), v), dot(_axis(axes, 2), v))


@kernel
def _perpendicular(v, first):
    """Return the unit vector along the part of v that is perpendicular to `first`, or zero."""
    second = unit(along(v, first, -dot(v, first)))
    return unit(along(second, first, -dot(second, first)))


@kernel
def _set_axes(axes, first, second):
    third = cross(first, second)
    for j in range(3):
        axes[0, j], axes[1, j], axes[2, j] = first[j], second[j], third[j]


@kernel
def take_plane(axes, u, v):
    """Set the first axis along u, and the second in the plane of u and v; return their number.

    The number is 1 if the two do not span a plane. Then the second axis is any.
    """
    take_axes(axes, u)
    first = _axis(axes, 0)
    second = _perpendicular(v, first)
    if not dot(second, second) > 0.5:
        return 1
    _set_axes(axes, first, second)
    return 2


@kernel
def take_axes(axes, way):
    """Set the first axis to the direction of `way`, and the others perpendicular to it."""
    first = unit(way)
    if not dot(first, first) > 0.5:
        first = (1.0, 0.0, 0.0)
    other = (0.0, 1.0, 0.0)
    if abs(first[1]) > min(abs(first[0]), abs(first[2])):
        other = (1.0, 0.0, 0.0) if abs(first[0]) < abs(first[2]) else (0.0, 0.0, 1.0)
    _set_axes(axes, first, _perpendicular(other, first))


@kernel
def axis_of(point):
    """Return the direction through both nearest points; if both ways nearly agree, that of a."""
    a = (point.way[0, 0], point.way[0, 1], point.way[0, 2])
    b = (point.way[1, 0], point.way[1, 1], point.way[1, 2])
    way = sub(a, b)
    return way if dot(way, way) > 0.1 else a


@kernel
def _extent(tree, region, motion, axis, swept, slack):
    """Bound a solid's least and largest coordinate along a unit vector of a's frame, metres."""
    n = rotated(motion, axis)
    shift = motion[9] * n[0] + motion[10] * n[1] + motion[11] * n[2]
    if region.inside == HALF:  # the inside may reach beyond the volumes, but not beyond the box
        box, middle, reach = region.box, -shift, 4.0 * slack + swept
        for i in range(3):
            middle += 0.5 * (box[0, i] + box[1, i]) * n[i]
            reach += 0.5 * (box[1, i] - box[0, i]) * abs(n[i])
        return middle - reach, middle + reach
    lo, hi = np.inf, -np.inf
    nodes, unit_length = tree.nodes, tree.scale[0]
    size = tree.centres[0, 3]
    for i in range(3):
        size += abs(tree.centres[0, i])
    middle = n[0] * tree.centres[0, 0] + n[1] * tree.centres[0, 1] + n[2] * tree.centres[0, 2]
    for lane in range(WIDTH):
        if tree.children[lane] == EMPTY:
            continue
        i = uint64(lane)
        c = nodes[i + CENTRE_X] * n[0] + nodes[i + CENTRE_Y] * n[1] + nodes[i + CENTRE_Z] * n[2]
        u = nodes[i + U_X] * n[0] + nodes[i + U_Y] * n[1] + nodes[i + U_Z] * n[2]
        v = nodes[i + V_X] * n[0] + nodes[i + V_Y] * n[1] + nodes[i + V_Z] * n[2]
        reach = nodes[i + HALF_U] * abs(u) + nodes[i + HALF_V] * abs(v) + nodes[i + RADIUS]
        lo, hi = min(lo, c - reach), max(hi, c + reach)
    margin = SINGLE_MARGIN * size * unit_length + 4.0 * slack + swept
    lo, hi = (lo + middle) * unit_length - shift, (hi + middle) * unit_length - shift
    return lo - margin, hi + margin


@shared
def common_box(tree_a, tree_b, region_a, region_b, state, centre, half):
    """Write the cuboid, in the search's frame, around what two models share; False if none."""
    at, motions = state.at[0], state.motions
    for i in range(3):
        axis = _axis(at.axes, i)
        lo, hi = _extent(tree_a, region_a, motions[0], axis, at.swept[0], at.slack)
        low, high = _extent(tree_b, region_b, motions[1], axis, at.swept[1], at.slack)
        lo, hi = max(lo, low), min(hi, high)
        if not lo <= hi:
            return False
        centre[i] = 0.5 * (lo + hi)
        half[i] = 0.5 * (hi - lo) * (1.0 + 1e-12) + 4.0 * at.slack
    return True
