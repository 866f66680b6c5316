"""Certified lower bounds between boxes, by the algorithm of Gilbert, Johnson and Keerthi (GJK).

A box is {c + s û + t v̂ + r ŵ : |s| <= a, |t| <= b, |r| <= thickness} with the stored axes and
ŵ = û × v̂. Nothing here assumes that the axes are exactly perpendicular. Johnson and Cohen 1997,
section 3.1.1, bound such boxes by Gilbert's algorithm and reject distant boxes with spheres. Here
the swept spheres of volumes.py reject them. The triangles in a box also lie in its rectangle swept
by the thickness (see boxfit.py), so the bounds of `lower_bounds` hold for boxes unchanged.

The differences between the points of two boxes fill a zonotope with six half edges,
{d + sum x_i e_i : |x_i| <= 1}. Its distance from the origin is the distance of the boxes. GJK walks
over simplices of its corners towards the point nearest to the origin. As with the swept spheres,
the walk supplies only directions: for *any* n the gap (n·d - sum |n·e_i|) / |n| is a lower bound.
So rounding or a degenerate box can weaken the bound, but never make it wrong.
"""

from __future__ import annotations

import numpy as np
from numba import uint64

from ..base.jit import kernel
from ..base.rounding import SINGLE_EPS, SINGLE_TINY
from ..base.vectors import add, along, cross, dot, moved, rotated, scaled, sub
from ..tree.layout import EXTENT, HALF_U, HALF_V, RADIUS, STRIDE, U_X, V_X, WIDTH, read_vector, row

_STEPS = 24
"""Maximum number of corners that a walk visits; four is usual. Stopping early weakens the bound."""

_SETTLED = 2.0**-20
"""A walk stops within this share of the distance: sixteen roundings of a float32 bound."""


@kernel
def box_bounds(fixed, lane, motion, tree, node, slack, reach, bounds, first):
    """Raise those bounds of a node's sixteen lanes that are below `reach` to the bounds of boxes.

    The first six arguments are those of `place`, which has accepted the volume. `bounds` holds the
    result of `lower_bounds` from index `first` on. Node units, float32.
    """
    own = lane // WIDTH
    base = uint64(own * STRIDE + lane % WIDTH)
    ratio = fixed.scale[0] * tree.scale[1]
    c = scaled(add(read_vector(fixed.nodes, base), row(fixed.centres, own)), fixed.scale[0])
    c = sub(scaled(moved(motion, c), tree.scale[1]), row(tree.centres, node))
    # Move the third axis as a vector, like the points of the box. The cross product of the two
    # moved axes would differ from it, because the motion is not exactly a rotation.
    u, v, w = _half_edges(fixed.nodes, base)
    u = scaled(rotated(motion, u), ratio)
    v = scaled(rotated(motion, v), ratio)
    w = scaled(rotated(motion, w), ratio)
    # `slack` covers the error of the motion, as in `place`. Only the bound itself is float32. It is
    # at most the sum of all coordinates, so rounding it errs by u32 times that sum. The margin is
    # twice as much; the float64 errors take a millionth of it.
    size = abs(c[0]) + abs(c[1]) + abs(c[2]) + 1.5 * fixed.sizes[lane, EXTENT] * ratio
    margin = 2.0 * SINGLE_EPS * (size + tree.centres[node, 3]) + slack * tree.scale[1]
    for k in range(WIDTH):
        if bounds[first + k] >= reach:
            continue
        at = uint64(node * STRIDE + k)
        f, g, h = _half_edges(tree.nodes, at)
        d = sub(c, read_vector(tree.nodes, at))
        bound = shortest(d, (u, v, w, f, g, h), margin, margin + reach) - margin
        bounds[first + k] = max(bounds[first + k], np.float32(bound))


@kernel
def _half_edges(nodes, base):
    """Return the three half edges of a lane's box."""
    u, v = read_vector(nodes, base + U_X), read_vector(nodes, base + V_X)
    return (
        scaled(u, np.float64(nodes[base + HALF_U])),
        scaled(v, np.float64(nodes[base + HALF_V])),
        scaled(cross(u, v), np.float64(nodes[base + RADIUS])),
    )


@kernel
def shortest(d, edges, short, enough):
    """Return a lower bound of the shortest length in {d + sum x_i edges[i] : |x_i| <= 1}, i < 6.

    If the shortest length lies between `short` and `enough`, the bound is tight up to _SETTLED. The
    walk ends as soon as it proves the length to be outside that range. Returns -1 if it proves
    nothing.
    """
    best = -1.0
    v, squared = d, dot(d, d)  # a walk may begin anywhere in the body
    simplex, n = (d, d, d), np.int64(1)  # a literal would compile the helpers a second time
    for _ in range(_STEPS):
        # The corner farthest in the direction -v, and the gap along v. An edge perpendicular to v
        # does not shift it: the "corner" is then the middle of a side.
        corner, gap = d, dot(v, d)
        for e in edges:
            x = dot(v, e)
            gap -= abs(x)
            if x > 0.0:
                corner = sub(corner, e)
            elif x < 0.0:
                corner = add(corner, e)
        length = np.sqrt(max(squared, SINGLE_TINY))  # see SINGLE_TINY
        best = max(best, gap / length)
        if best > enough or best >= length * (1.0 - _SETTLED) or length <= short:
            break
        simplex, n, v = _nearest_side(simplex, n, corner)
        shorter = dot(v, v)
        # A new corner brings the simplex nearer to the origin, except for rounding. If the origin
        # is inside the simplex, it has no nearest side (n = 0).
        if n == 0 or not shorter < squared:
            break
        squared = shorter
    return best


@kernel
def _nearest_side(old, n, w):
    """Find the side nearest to the origin of the simplex of n <= 3 old corners and the new one w.

    Returns the side's corners, their number (0 if the origin is inside the simplex), and the side's
    nearest point. The side contains w, because w lies beyond the previous nearest side. Every edge
    and face whose nearest point lies within it is compared, so one sign that rounding flips cannot
    lead far away.
    """
    nearest, least = w, dot(w, w)
    corners, used = (w, w, w), 1
    for i in range(n):
        p = old[i]
        e = sub(p, w)
        ee, x = dot(e, e), -dot(w, e)
        if x > 0.0 and x < ee:
            foot = along(w, e, x / ee)
            squared = dot(foot, foot)
            if squared < least:
                nearest, least, corners, used = foot, squared, (w, p, p), 2
    inside = 0
    for i in range(n):
        for j in range(i):
            p, q = old[i], old[j]
            e, f = sub(p, w), sub(q, w)
            normal = cross(e, f)
            nn, height = dot(normal, normal), dot(w, normal)
            # Weights of p and q at the foot of the origin on the face, times nn.
            x, y = dot(cross(f, w), normal), dot(cross(w, e), normal)
            if x > 0.0 and y > 0.0 and x + y < nn and height * height < least * nn:
                nearest, least = scaled(normal, height / nn), height * height / nn
                corners, used = (w, p, q), 3
            if n == 3 and height * dot(sub(old[3 - i - j], w), normal) < 0.0:
                inside += 1
    return corners, 0 if inside == 3 else used, nearest
