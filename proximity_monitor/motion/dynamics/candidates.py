"""Compiled tests: which pieces may be near each other, and which nearest points are contacts."""

from __future__ import annotations

import math

import numpy as np

from proximity_monitor.engine.compiling import entry, helper

ROUNDING = 1e-14
"""Slack of a bound, as a share of the coordinates' sum: a hundred times what a dozen roundings of
such a sum can change."""

ON = 1e-6
"""Barycentric weight of a corner up to which a point lies on the edge opposite that corner."""

LEANING = 0.02
"""Sine of the angle by which a surface may rise towards the other body beside a contact. If the gap
between two corners that almost face each other is small, their surfaces rise by such an angle, and
the corners must stay a contact. On a surface of triangles, a bump of this slope is not felt."""


@helper
def _to_box(pose, x, y, z, box):
    """Return the distance of a world point from a box that is given in the frame of a pose."""
    x, y, z = x - pose[0, 3], y - pose[1, 3], z - pose[2, 3]
    total = 0.0
    for k in range(3):
        at = pose[0, k] * x + pose[1, k] * y + pose[2, k] * z
        out = max(box[k] - at, at - box[3 + k], 0.0)
        total += out * out
    return math.sqrt(total)


@entry
def spheres_at(poses, owner, spheres):
    """Return the world spheres (p, 5) of the pieces, whose bodies are `owner` (p,).

    The columns are the centre, the radius and the slack of a bound of that piece. The slack counts
    the coordinates in both frames: if a mesh is drawn far from its own origin, its coordinates are
    large even if it is near the world's origin.
    """
    found = np.empty((len(owner), 5))
    for i in range(len(owner)):
        pose, s = poses[owner[i]], spheres[i]
        size = s[3]
        for k in range(3):
            found[i, k] = pose[k, 0] * s[0] + pose[k, 1] * s[1] + pose[k, 2] * s[2] + pose[k, 3]
            size += abs(s[k]) + abs(pose[k, 3])
        found[i, 3] = s[3]
        found[i, 4] = ROUNDING * size
    return found


@entry
def near_pieces(poses, pairs, reach, lower, first, spheres, boxes, rows):
    """Write the pairs of pieces that may be within reach into `rows` (size, 3); return how many.

    A row holds the index of the pair of bodies and of the two pieces. Pairs of bodies whose `lower`
    is beyond their reach are skipped. For all others, `lower` becomes the least lower bound of
    their pairs of pieces that are not written. If there are too few rows, the returned number is
    still right.
    """
    count = 0
    for i in range(len(pairs)):
        if lower[i] > reach[i]:
            continue
        a, b = pairs[i, 0], pairs[i, 1]
        least = math.inf
        for p in range(first[a], first[a + 1]):
            for q in range(first[b], first[b + 1]):
                s, t = spheres[p], spheres[q]
                x, y, z = s[0] - t[0], s[1] - t[1], s[2] - t[2]
                weak = s[4] + t[4]
                bound = math.sqrt(x * x + y * y + z * z) - s[3] - t[3] - weak
                if bound <= reach[i]:
                    into_b = _to_box(poses[b], s[0], s[1], s[2], boxes[q]) - s[3]
                    into_a = _to_box(poses[a], t[0], t[1], t[2], boxes[p]) - t[3]
                    bound = max(bound, into_b - weak, into_a - weak)
                if bound > reach[i]:
                    least = min(least, bound)
                else:
                    if count < len(rows):
                        rows[count, 0], rows[count, 1], rows[count, 2] = i, p, q
                    count += 1
        lower[i] = least
    return count


@helper
def _holds(corners, weights, place):
    """Return whether `place` is a corner with a weight above ON in a point of a triangle."""
    found = False
    for k in range(3):
        found |= corners[k] == place and weights[k] > ON
    return found


@helper
def _is_nearest_here(pose, corners, places, first, around, face, weights, point, n):
    """Return whether no triangle at a surface point rises along n (world, outward).

    A model that was searched whole has no face here (-1); the answer is then True.
    """
    if face < 0:
        return True
    x, y, z = point[0] - pose[0, 3], point[1] - pose[1, 3], point[2] - pose[2, 3]
    px = pose[0, 0] * x + pose[1, 0] * y + pose[2, 0] * z
    py = pose[0, 1] * x + pose[1, 1] * y + pose[2, 1] * z
    pz = pose[0, 2] * x + pose[1, 2] * y + pose[2, 2] * z
    nx = pose[0, 0] * n[0] + pose[1, 0] * n[1] + pose[2, 0] * n[2]
    ny = pose[0, 1] * n[0] + pose[1, 1] * n[1] + pose[2, 1] * n[2]
    nz = pose[0, 2] * n[0] + pose[1, 2] * n[1] + pose[2, 2] * n[2]
    # The point lies at a corner, on an edge or inside. Check the triangles around that corner, or
    # those that have both ends of that edge.
    on = 0
    for k in range(3):
        if weights[k] > ON:
            on += 1
    if on == 3:
        return True
    for k in range(3):
        if weights[k] <= ON:
            continue
        place = places[face, k]
        for i in range(first[place], first[place + 1]):
            other, shared = around[i], 0
            for m in range(3):
                shared += _holds(places[face], weights, places[other, m])
            if shared < on:
                continue
            for m in range(3):
                if _holds(places[face], weights, places[other, m]):
                    continue
                dx = corners[other, m, 0] - px
                dy = corners[other, m, 1] - py
                dz = corners[other, m, 2] - pz
                rise = dx * nx + dy * ny + dz * nz
                if rise > LEANING * math.sqrt(dx * dx + dy * dy + dz * dz):
                    return False
    return True


@helper
def _same(p, q, tolerance):
    """Return whether two pairs of points are the same within a tolerance."""
    for side in range(2):
        for k in range(3):
            if abs(p[side, k] - q[side, k]) > tolerance:
                return False
    return True


@entry
def local_minima(poses, bodies, faces, weights, points, corners, places, first, around, kept):
    """Mark in `kept` (k,) the points (k, 2, 3) that are local minima of the surfaces' distance.

    If two pieces of one body meet, both have a nearest point. One of these may lie on its piece's
    border only because the piece ends there. A force along its line would feel like a bump on a
    smooth surface. A local minimum must be one for both surfaces (Johnson 2005). If several pairs
    of pieces have the same two points, the first pair is marked.

    `faces` (k, 2) and `weights` (k, 2, 3) say where the points lie. The faces are among the
    triangles of all models, concatenated, as `corners`, `places`, `first` and `around` hold them
    (see `Pieces`). A face of -1 belongs to a model that was searched whole.
    """
    for i in range(len(bodies)):
        a, b = bodies[i, 0], bodies[i, 1]
        n = points[i, 0] - points[i, 1]
        size = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
        n /= size
        on_b = _is_nearest_here(
            poses[b],
            corners,
            places,
            first,
            around,
            faces[i, 1],
            weights[i, 1],
            points[i, 1],
            n,
        )
        kept[i] = on_b and _is_nearest_here(
            poses[a],
            corners,
            places,
            first,
            around,
            faces[i, 0],
            weights[i, 0],
            points[i, 0],
            -n,
        )
        for j in range(i - 1, -1, -1):
            if not kept[i] or bodies[j, 0] != a or bodies[j, 1] != b:
                break
            if kept[j] and _same(points[i], points[j], ON * size):
                kept[i] = False
