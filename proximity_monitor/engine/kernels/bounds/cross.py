"""All triangles of one lowest node against all of another.

First all are bounded along one direction, which costs next to nothing. The volumes of one node that
are left are moved into the other's frame together and bounded against its volume as a whole, unless
they are few; each that is left is bounded against its sixteen. None of them goes by way of the
stack, and nothing is moved one by one: it takes half the time of opening one after the other.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np
from numba import uint64

from ..base.jit import inlined, loop16
from ..base.lanes import has_three, lowest, not_above, smallest
from ..base.memory import read_only
from ..base.rounding import ALONG_MARGIN, CROSS_MARGIN, SINGLE_EPS, SINGLE_LIMIT, SINGLE_TINY
from ..base.vectors import add, moved, scaled, sub
from ..tree.layout import (
    CENTRE_X,
    CENTRE_Y,
    CENTRE_Z,
    EMPTY,
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
from .volumes import lower_bounds, lows_along, tighten

Scratch = namedtuple("Scratch", "single found frame placed owns lows other_lows")
"""Room for float32: a single volume (16,), bounds (17 × 16), a motion (16,), a moved node
(STRIDE,); for the numbers of sixteen lanes; and how far the lanes of either node keep from the
other's along a direction (16,)."""


_ALL = (1 << WIDTH) - 1  # lanes


def left_between(waiting, tree, node, progress, limit, reaches):
    """The bits of the lanes of a node that no ball or plane keeps beyond `limit`, metres: a stub.

    `reaches` is room for sixteen float32.
    """


@loop16
def move_lanes(nodes, base, frame, placed):
    """All volumes of the node at `base`, turned, scaled and shifted, into `placed` (STRIDE,).

    `frame` holds the rotation by rows, the shift, and the scale.
    """
    ax, ay, az = frame[0], frame[1], frame[2]
    bx, by, bz = frame[3], frame[4], frame[5]
    cx, cy, cz = frame[6], frame[7], frame[8]
    ox, oy, oz, scale = frame[9], frame[10], frame[11], frame[12]
    for k in range(WIDTH):
        i = base + uint64(k)
        j = uint64(k)
        x, y, z = nodes[i + CENTRE_X], nodes[i + CENTRE_Y], nodes[i + CENTRE_Z]
        placed[j] = (ax * x + ay * y + az * z) * scale + ox
        placed[j + CENTRE_Y] = (bx * x + by * y + bz * z) * scale + oy
        placed[j + CENTRE_Z] = (cx * x + cy * y + cz * z) * scale + oz
        x, y, z = nodes[i + U_X], nodes[i + U_Y], nodes[i + U_Z]
        placed[j + U_X] = ax * x + ay * y + az * z
        placed[j + U_Y] = bx * x + by * y + bz * z
        placed[j + U_Z] = cx * x + cy * y + cz * z
        x, y, z = nodes[i + V_X], nodes[i + V_Y], nodes[i + V_Z]
        placed[j + V_X] = ax * x + ay * y + az * z
        placed[j + V_Y] = bx * x + by * y + bz * z
        placed[j + V_Z] = cx * x + cy * y + cz * z
        placed[j + RADIUS] = nodes[i + RADIUS] * scale
        placed[j + HALF_U] = nodes[i + HALF_U] * scale
        placed[j + HALF_V] = nodes[i + HALF_V] * scale


@inlined
def _pick(lanes, base, margin, single):
    """One lane's volume, which stands in the frame of what it is compared with, as `single`."""
    for field in range(9):
        single[field] = lanes[base + uint64(WIDTH * field)]
    single[9], single[10] = lanes[base + HALF_U], lanes[base + HALF_V]
    single[11] = single[4] * single[8] - single[5] * single[7]
    single[12] = single[5] * single[6] - single[3] * single[8]
    single[13] = single[3] * single[7] - single[4] * single[6]
    single[14] = lanes[base + RADIUS] + margin


@inlined
def along_node(tree, node, normal, sign, lows):
    """How far along the direction from a to b the node of a tree keeps from the other's, in metres.

    That is of its centre; how much less it is of its lanes is written to `lows`, in node units. For
    b, whose sign is 1, it is measured along the direction, for a against it.
    """
    x, y, z = sign * normal[0], sign * normal[1], sign * normal[2]
    lows_along(tree.nodes, uint64(node * STRIDE), np.float32(x), np.float32(y), np.float32(z), lows)
    c = tree.centres
    centre = x * c[node, 0] + y * c[node, 1] + z * c[node, 2]
    return (centre - ALONG_MARGIN * c[node, 3]) * tree.scale[0]


@inlined
def _proven(lows, found, along, own_unit, unit, aligned, whole, count):
    """Lower bound, metres, of all pairs of two nodes of which none is left.

    Every lane of the one was dismissed: along the direction, unless its bit in `aligned` is set;
    against the other's volume as a whole, unless it is in `whole`; or against all its lanes, which
    `count` of them were.
    """
    proven = along + smallest(lows, 0, ~aligned) * own_unit
    proven = min(proven, smallest(found, 0, aligned & ~whole) * unit)
    for i in range(count):
        # Where a lane was dismissed along the direction alone, this is below the limit: no matter.
        proven = min(proven, smallest(found, (i + 1) * WIDTH, _ALL) * unit)
    return proven


@inlined
def cross_nodes(tree, fixed, node, lane, motion, flip, state, inherited, limit, scratch, n):
    """What `stubs.cross_leaves` asks for, of two trees over triangles.

    Returns -1 where single precision does not serve.
    """
    single, found, frame, placed, owns, lows, other_lows = scratch
    waiting = state.waiting
    other = fixed.children[lane]
    unit, inverse = fixed.scale[0], fixed.scale[1]
    progress = state.progress[0]
    progress.bound_tests += WIDTH
    before = n
    # Along the direction between the nearest points, all pairs of volumes at once.
    normal = progress.normal_b if flip else progress.normal_a
    other_normal = progress.normal_a if flip else progress.normal_b
    sign = 1.0 if flip else -1.0
    apart = along_node(tree, node, normal, sign, lows)
    apart += along_node(fixed, other, other_normal, -sign, other_lows)
    apart += progress.offset - progress.bound_slack
    room = limit - apart
    nearest = smallest(other_lows, 0, _ALL) * unit
    rows = not_above(lows, 0, np.float32((room - nearest) * tree.scale[1]))
    rows &= left_between(waiting, tree, node, progress, limit, found)
    others = left_between(waiting, fixed, other, progress, limit, found)
    aligned, whole = rows, rows
    if not (rows and others):
        progress.proven = apart + nearest + smallest(lows, 0, _ALL) * tree.scale[0]
        return n
    ratio = tree.scale[0] * inverse
    centre = row(fixed.centres, other)
    d = scaled(moved(motion, scaled(row(tree.centres, node), tree.scale[0])), inverse)
    d = sub(d, centre)
    # The volume of the other node as a whole stands in the node above it, whose axes are the same.
    above = lane // WIDTH
    base = uint64(above * STRIDE + lane % WIDTH)
    o = sub(add(read_vector(fixed.nodes, base), row(fixed.centres, above)), centre)
    reach = (
        abs(d[0]) + abs(d[1]) + abs(d[2]) + tree.centres[node, 3] * ratio
        + abs(o[0]) + abs(o[1]) + abs(o[2]) + 1.5 * fixed.sizes[lane, EXTENT]
        + fixed.centres[other, 3]
    )  # fmt: skip
    slack = progress.bound_slack * inverse
    if not (reach + slack < SINGLE_LIMIT and ratio < SINGLE_LIMIT):
        return -1
    # The floor covers what float32 would flush.
    margin = np.float32((CROSS_MARGIN * reach + slack) * (1.0 + 2.0 * SINGLE_EPS) + SINGLE_TINY)
    threshold = np.float32(min(limit * inverse * (1.0 + 1e-6), 1e29))
    for i in range(9):
        frame[i] = np.float32(motion[i])
    frame[9], frame[10], frame[11] = np.float32(d[0]), np.float32(d[1]), np.float32(d[2])
    frame[12] = np.float32(ratio)
    move_lanes(tree.nodes, uint64(node * STRIDE), frame, placed)
    moved_lanes = read_only(placed)
    if has_three(rows):
        _pick(fixed.nodes, base, margin, single)
        single[0], single[1], single[2] = np.float32(o[0]), np.float32(o[1]), np.float32(o[2])
        lower_bounds(moved_lanes, uint64(0), single, found, uint64(0))
        progress.bound_tests += WIDTH
        whole = not_above(found, 0, threshold)
        rows &= whole
    # All are bounded before any result is looked at, so that the processor works on two at once.
    count = 0
    while rows:
        own = lowest(rows)
        rows &= rows - 1
        # An unused lane's radius, scaled, need not be beyond every distance.
        if tree.children[node * WIDTH + own] == EMPTY:
            continue
        at = (count + 1) * WIDTH
        _pick(moved_lanes, uint64(own), margin, single)
        lower_bounds(fixed.nodes, uint64(other * STRIDE), single, found, uint64(at))
        tighten(
            tree, fixed, node * WIDTH + own, motion, other, progress.bound_slack,
            threshold, found, at,
        )  # fmt: skip
        owns[count] = own
        count += 1
    progress.bound_tests += WIDTH * count
    for i in range(count):
        at = (i + 1) * WIDTH
        own_room = np.float32((room - lows[owns[i]] * tree.scale[0]) * inverse)
        survivors = not_above(found, at, threshold) & not_above(other_lows, 0, own_room) & others
        while survivors:
            k = lowest(survivors)
            survivors &= survivors - 1
            one, two = node * WIDTH + owns[i], other * WIDTH + k
            waiting.lanes[n, 0] = two if flip else one
            waiting.lanes[n, 1] = one if flip else two
            waiting.bounds[n] = max(found[at + k] * unit, inherited)
            n += 1
    if n == before:
        along = apart + nearest
        proven = _proven(lows, found, along, tree.scale[0], unit, aligned, whole, count)
        progress.proven = max(proven, inherited)
    return n
