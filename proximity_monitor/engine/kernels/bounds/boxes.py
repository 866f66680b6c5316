"""Certified lower bounds between boxes, by the algorithm of Gilbert, Johnson and Keerthi (GJK).

A box is {c + s û + t v̂ + r ŵ : |s| <= a, |t| <= b, |r| <= thickness} with the stored axes and
ŵ = û × v̂; nothing here supposes that they are exactly perpendicular. Johnson and Cohen 1997,
section 3.1.1, bound such boxes by Gilbert's algorithm, and reject with spheres what is far away.
Here the swept spheres of volumes.py reject: a box holds nothing that its rectangle, swept by the
thickness, does not hold as well (see boxfit.py), so `lower_bounds` is true of boxes as it stands.

The differences between the points of two boxes fill a body with six edges, {d + sum x_i e_i :
|x_i| <= 1}, whose distance from the origin is that of the boxes. GJK walks towards its nearest
point over simplices of its corners. As with the swept spheres only directions are taken from that:
for *any* n the gap (n·d - sum |n·e_i|) / |n| is a lower bound, so whatever rounding or degenerate
boxes do to a walk can make the bound weaker, never wrong.
"""

from __future__ import annotations

import numpy as np
from numba import uint64

from ..base.jit import kernel
from ..base.rounding import SINGLE_EPS, SINGLE_TINY
from ..base.vectors import add, along, cross, dot, moved, rotated, scaled, sub
from ..tree.layout import EXTENT, HALF_U, HALF_V, RADIUS, STRIDE, U_X, V_X, WIDTH, read_vector, row

_STEPS = 24
"""Most corners that a walk visits; four are usual. One that is cut short gives a weaker bound."""

_SETTLED = 2.0**-20
"""Share of a distance that a walk leaves to be gained: sixteen roundings of a float32 bound."""


@kernel
def box_bounds(fixed, lane, motion, tree, node, slack, reach, bounds, first):
    """Raise the bounds of a node's sixteen lanes, where they are below `reach`, to those of boxes.

    The first six arguments are those of `place`, which has accepted the volume; `bounds` is what
    `lower_bounds` wrote, from `first` on. Node units, float32.
    """
    own = lane // WIDTH
    base = uint64(own * STRIDE + lane % WIDTH)
    ratio = fixed.scale[0] * tree.scale[1]
    c = scaled(add(read_vector(fixed.nodes, base), row(fixed.centres, own)), fixed.scale[0])
    c = sub(scaled(moved(motion, c), tree.scale[1]), row(tree.centres, node))
    # The third axis is moved like a point of the box: the product of two axes that were moved would
    # differ by what the motion lacks to a rotation.
    u, v, w = _half_edges(fixed.nodes, base)
    u = scaled(rotated(motion, u), ratio)
    v = scaled(rotated(motion, v), ratio)
    w = scaled(rotated(motion, w), ratio)
    # `slack` pays for the motion, as in `place`. All is float64 but the bound itself, which is no
    # longer than all coordinates together: rounded to float32 it errs by u32 of those. The margin
    # is twice that, of which float64 takes a millionth.
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
    """Half edges of a lane's box."""
    u, v = read_vector(nodes, base + U_X), read_vector(nodes, base + V_X)
    return (
        scaled(u, np.float64(nodes[base + HALF_U])),
        scaled(v, np.float64(nodes[base + HALF_V])),
        scaled(cross(u, v), np.float64(nodes[base + RADIUS])),
    )


@kernel
def shortest(d, edges, short, enough):
    """Lower bound of the shortest vector in {d + sum x_i edges[i] : |x_i| <= 1}, six edges.

    It is reached up to _SETTLED where it lies between `short` and `enough`; the walk ends as soon
    as it is known to be shorter, or longer. -1 where nothing is known.
    """
    best = -1.0
    v, squared = d, dot(d, d)  # a walk may begin anywhere in the body
    simplex, n = (d, d, d), np.int64(1)  # a literal would have helpers compiled twice
    for _ in range(_STEPS):
        # The corner that lies farthest against v, and with it the gap along v. Edges that are
        # perpendicular to v are left out of it: it is the middle of a side then.
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
        # With a new corner the simplex comes nearer, if not for rounding; and it has no nearest
        # side where the origin is inside.
        if n == 0 or not shorter < squared:
            break
        squared = shorter
    return best


@kernel
def _nearest_side(old, n, w):
    """The side of a simplex of n <= 3 old corners and the new one w that is nearest to the origin.

    Returns its corners, how many they are, and the point that is nearest; 0 of them where the
    origin is inside. The side has w, which lies beyond the side that it was found from. Each edge
    and face that has its nearest point within it is compared, so no single sign that rounding
    turned leads far away.
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
            # Weights of p and q at the foot of the origin, times nn.
            x, y = dot(cross(f, w), normal), dot(cross(w, e), normal)
            if x > 0.0 and y > 0.0 and x + y < nn and height * height < least * nn:
                nearest, least = scaled(normal, height / nn), height * height / nn
                corners, used = (w, p, q), 3
            if n == 3 and height * dot(sub(old[3 - i - j], w), normal) < 0.0:
                inside += 1
    return corners, 0 if inside == 3 else used, nearest
