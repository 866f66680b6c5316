"""Which pieces may be near each other, and which nearest points are contacts, compiled."""

from __future__ import annotations

import math

import numpy as np

from proximity_monitor.engine.compiling import entry, helper

ROUNDING = 1e-14
"""Share of the coordinates by which a bound is weakened: a hundred times what the dozen roundings
of a sum of them can do."""

ON = 1e-6
"""Barycentric weight below which a point lies on the edge opposite of that corner."""

LEANING = 0.02
"""Sine of the angle by which a surface may rise towards the other body beside a contact. Corners
that all but face each other lean by so much and more over a small gap, and have to be held; a
bump of that slope on a surface that is cut into triangles is not felt."""


@helper
def _to_box(pose, x, y, z, box):
    """Distance of a world point from a box that is given in the frame of a pose."""
    x, y, z = x - pose[0, 3], y - pose[1, 3], z - pose[2, 3]
    total = 0.0
    for k in range(3):
        at = pose[0, k] * x + pose[1, k] * y + pose[2, k] * z
        out = max(box[k] - at, at - box[3 + k], 0.0)
        total += out * out
    return math.sqrt(total)


@entry
def spheres_at(poses, owner, spheres):
    """Centres in the world and radii of the pieces, which move with their owners (p,).

    The last column of the result (p, 5) is what rounding may do to a bound of that piece. It counts
    the coordinates in either frame: those of a mesh that is drawn far from its origin are large,
    however near to the world's origin it stands.
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

    A row holds the number of the pair of bodies and the two pieces. Pairs of bodies whose `lower`
    is beyond their reach are passed over; that of the others becomes the least bound of the pairs
    of pieces that are not written. If the rows do not suffice, their number is still right.
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
    """Whether a place is one of the corners that a point of a triangle depends on."""
    found = False
    for k in range(3):
        found |= corners[k] == place and weights[k] > ON
    return found


@helper
def _is_nearest_here(pose, corners, places, first, around, face, weights, point, n):
    """Whether no triangle that meets a surface point comes nearer along n (world, outward).

    Nor does any of a model that was searched whole, which has no face here.
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
    # The point lies on a corner, on an edge or within: only the triangles around that matter, and
    # of an edge those that have both of its ends.
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
    """Whether both points of two pairs are the same but for rounding."""
    for side in range(2):
        for k in range(3):
            if abs(p[side, k] - q[side, k]) > tolerance:
                return False
    return True


@entry
def local_minima(poses, bodies, faces, weights, points, corners, places, first, around, kept):
    """Mark in `kept` (k,) the points (k, 2, 3) where the distance of the surfaces is least.

    Where two pieces of one body meet, both have a nearest point; one of them may lie on the
    piece's border only because the piece ends there, and pushing along that pair's line would be a
    bump on a smooth surface. A local minimum is one for both surfaces (Johnson 2005). Of several
    pairs of pieces that meet in the same two points the first is marked.

    `faces` (k, 2) and `weights` (k, 2, 3) say where the points lie, among the triangles of all
    models one after the other, as `corners`, `places`, `first` and `around` hold them. A face of -1
    is that of a model which was searched whole.
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
