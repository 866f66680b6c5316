"""Bound all leaves of one lowest node (one whose lanes are leaves) against all leaves of another.

First, all pairs are bounded along one direction, at almost no cost. Then all lanes of the first
node are moved together into the frame of the second node. If more than a few lanes survive, they
are bounded against the volume around the whole second node. Each lane that still survives is
bounded against the sixteen lanes of the second node. No pair goes through the stack and no volume
is moved alone, so this takes half the time of opening the pairs one after the other.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np
from numba import uint64

from ..base.jit import fused, inlined, loop16
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
"""Scratch arrays. float32: single, one volume (16,); found, bounds (17 × 16); frame, a motion
(16,); placed, a moved node (STRIDE,); lows and other_lows (16,), the least coordinates along a
direction of either node's lanes, see `lows_along`. Integers: owns, sixteen lane numbers."""


_ALL = (1 << WIDTH) - 1  # lanes


def left_between(waiting, tree, node, progress, limit, reaches):
    """Return the bits of a node's lanes that no ball or plane proves to be beyond `limit` metres.

    `reaches` is scratch for sixteen float32. A stub.
    """


@loop16
def move_lanes(nodes, base, frame, placed):
    """Rotate, scale and shift all volumes of the node at `base` into `placed` (STRIDE,).

    `frame` holds the rotation row by row, the shift, and the scale.
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


@fused
def _pick(lanes, base, margin, single):
    """Copy one lane's volume to `single`, its radius increased by `margin`.

    The volume is already in the frame of the lanes that it is compared with.
    """
    for field in range(9):
        single[field] = lanes[base + uint64(WIDTH * field)]
    single[9], single[10] = lanes[base + HALF_U], lanes[base + HALF_V]
    single[11] = single[4] * single[8] - single[5] * single[7]
    single[12] = single[5] * single[6] - single[3] * single[8]
    single[13] = single[3] * single[7] - single[4] * single[6]
    single[14] = lanes[base + RADIUS] + margin


@fused
def along_node(tree, node, normal, sign, lows):
    """Return a lower bound of a node centre's coordinate along the search direction, metres.

    Writes to `lows`, in node units, the least coordinate of each lane relative to the centre. For a
    node of b, `sign` is 1; for a node of a it is -1, which reverses the direction. So the sum over
    both nodes, plus `progress.offset`, bounds their gap.
    """
    x, y, z = sign * normal[0], sign * normal[1], sign * normal[2]
    lows_along(tree.nodes, uint64(node * STRIDE), np.float32(x), np.float32(y), np.float32(z), lows)
    c = tree.centres
    centre = x * c[node, 0] + y * c[node, 1] + z * c[node, 2]
    return (centre - ALONG_MARGIN * c[node, 3]) * tree.scale[0]


@inlined
def _proven(lows, found, along, own_unit, unit, aligned, whole, count):
    """Return a lower bound, metres, of all lane pairs of two nodes, once none of them survives.

    Each lane of the first node was pruned in one of three ways. If its bit in `aligned` is not set,
    it was pruned along the direction. If its bit is set in `aligned` but not in `whole`, it was
    pruned against the whole second node. The remaining `count` lanes were bounded against all lanes
    of the second node.
    """
    proven = along + smallest(lows, 0, ~aligned) * own_unit
    proven = min(proven, smallest(found, 0, aligned & ~whole) * unit)
    for i in range(count):
        # A pair that only the direction pruned may make this fall below the limit. It stays valid.
        proven = min(proven, smallest(found, (i + 1) * WIDTH, _ALL) * unit)
    return proven


@inlined
def cross_nodes(tree, fixed, node, lane, motion, flip, state, inherited, limit, scratch, n):
    """Implement `stubs.cross_leaves` for two trees over triangles.

    Returns -1 if the coordinates are too large for single precision.
    """
    single, found, frame, placed, owns, lows, other_lows = scratch
    waiting = state.waiting
    other = fixed.children[lane]
    unit, inverse = fixed.scale[0], fixed.scale[1]
    progress = state.progress[0]
    progress.bound_tests += WIDTH
    before = n
    # Bound all pairs of volumes at once along the search direction.
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
        along = apart + nearest + smallest(lows, 0, _ALL) * tree.scale[0]
        progress.proven = max(along, inherited)
        return n
    ratio = tree.scale[0] * inverse
    centre = row(fixed.centres, other)
    d = scaled(moved(motion, scaled(row(tree.centres, node), tree.scale[0])), inverse)
    d = sub(d, centre)
    # The volume around the whole second node is a lane of that node's parent, with the same axes.
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
    # SINGLE_TINY covers values that float32 would flush to zero.
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
    # Compute all bounds before reading any, so that the processor can overlap two computations.
    count = 0
    while rows:
        own = lowest(rows)
        rows &= rows - 1
        # Once scaled, the radius of an unused lane may no longer exceed every distance.
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
