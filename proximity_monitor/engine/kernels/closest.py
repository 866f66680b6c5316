"""The nearest point of one hierarchy to each of many points."""

from __future__ import annotations

import numpy as np
from numba import float32, uint64

from ..tolerances import POINT_FLOOR, POINT_MARGIN, POSE_MARGIN, SINGLE_LIMIT, SINGLE_MARGIN
from .jit import entry, kernel, loop16
from .motion import deviation
from .primitives import corners
from .triangles import triangle_distance
from .volumes import STRIDE, WIDTH

_ONE = float32(1.0)


@loop16
def point_bounds(nodes, base, x, y, z, margin, bounds):
    """Lower bounds of a point's distance to each lane of the node at `base`, node units.

    The distance to a rectangle is that to the projection with both parameters clamped; what is
    missing to perpendicular edges, and float32, is in the margin (see SINGLE_MARGIN).
    """
    for k in range(WIDTH):
        i = base + uint64(k)
        dx = x - nodes[i]
        dy = y - nodes[i + uint64(16)]
        dz = z - nodes[i + uint64(32)]
        ux, uy, uz = nodes[i + uint64(48)], nodes[i + uint64(64)], nodes[i + uint64(80)]
        vx, vy, vz = nodes[i + uint64(96)], nodes[i + uint64(112)], nodes[i + uint64(128)]
        s = min(max((dx * ux + dy * uy + dz * uz) * nodes[i + uint64(160)], -_ONE), _ONE)
        t = min(max((dx * vx + dy * vy + dz * vz) * nodes[i + uint64(176)], -_ONE), _ONE)
        dx = dx - s * ux - t * vx
        dy = dy - s * uy - t * vy
        dz = dz - s * uz - t * vz
        bounds[k] = np.sqrt(dx * dx + dy * dy + dz * dz) - nodes[i + uint64(144)] - margin


@kernel
def _push(tree, node, p, best, slack, stack, bounds, top, found):
    """Bound a point against a node's lanes; push those that may be nearer, the nearest on top."""
    unit = tree.scale[0]
    x = p[0] / unit - tree.centres[node, 0]
    y = p[1] / unit - tree.centres[node, 1]
    z = p[2] / unit - tree.centres[node, 2]
    size = abs(x) + abs(y) + abs(z) + tree.centres[node, 3]
    if size < SINGLE_LIMIT:
        margin = np.float32(SINGLE_MARGIN * size + slack / unit)
        base = uint64(node * STRIDE)
        point_bounds(tree.nodes, base, np.float32(x), np.float32(y), np.float32(z), margin, found)
    else:
        # Too far away for float32: then every lane is as good as the next.
        for k in range(WIDTH):
            empty = tree.nodes[uint64(node * STRIDE + 9 * WIDTH + k)] < 0.0
            found[k] = np.float32(1e30) if empty else np.float32(-1.0)
    reach = np.float32(min(best / unit * (1.0 + 1e-6), 1e29))
    first = top
    for k in range(WIDTH):
        if found[k] < reach:
            bound = found[k] * unit
            at = top
            while at > first and bounds[at - 1] < bound:
                bounds[at], stack[at] = bounds[at - 1], stack[at - 1]
                at -= 1
            bounds[at], stack[at] = bound, node * WIDTH + k
            top += 1
    return top


@entry
def closest_points(tree, pose, points, stack, bounds, answers, nearest, triangles):
    """Nearest points on a model at `pose` to points (k, 3) in the world.

    Writes answers (k, 2) the certified bounds, nearest (k, 3) in the world, and triangles (k,) in
    tree order.
    """
    error = deviation(pose)
    found = np.empty(WIDTH, np.float32)
    nearby = 0
    for k in range(points.shape[0]):
        d = (points[k, 0] - pose[0, 3], points[k, 1] - pose[1, 3], points[k, 2] - pose[2, 3])
        p = (
            pose[0, 0] * d[0] + pose[1, 0] * d[1] + pose[2, 0] * d[2],
            pose[0, 1] * d[0] + pose[1, 1] * d[1] + pose[2, 1] * d[2],
            pose[0, 2] * d[0] + pose[1, 2] * d[1] + pose[2, 2] * d[2],
        )
        size = abs(p[0]) + abs(p[1]) + abs(p[2]) + tree.scale[2]
        slack = POINT_MARGIN * size + POINT_FLOOR
        reach_slack = slack + POSE_MARGIN * error * size
        squared, weights, _ = triangle_distance(corners(tree.triangles, nearby), (p, p, p), np.inf)
        best = np.sqrt(squared)
        top = _push(tree, 0, p, best, reach_slack, stack, bounds, 0, found)
        while top > 0:
            top -= 1
            if bounds[top] >= best - slack:
                continue
            child = tree.children[stack[top]]
            if child >= 0:
                top = _push(tree, child, p, best, reach_slack, stack, bounds, top, found)
                continue
            squared, w, _ = triangle_distance(corners(tree.triangles, ~child), (p, p, p), best**2)
            if np.sqrt(squared) < best:
                best, weights, nearby = np.sqrt(squared), w, ~child
        answers[k, 0], answers[k, 1] = max(best - slack, 0.0), best + slack
        triangles[k] = nearby
        for i in range(3):
            nearest[k, i] = pose[i, 3]
            for j in range(3):
                x = 0.0
                for corner in range(3):
                    x += weights[corner] * tree.triangles[nearby, 3 * corner + j]
                nearest[k, i] += pose[i, j] * x
