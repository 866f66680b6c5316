"""Points in the half-plane through a solid's axis, and how far they are from its fat arcs.

The surface is the same in every half-plane through the axis. So the surface point that is nearest
to a given point lies in that point's half-plane, and is the profile's nearest point there.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import inlined, kernel
from ..base.rounding import DOUBLE_EPS
from ..base.tables import seen_as
from ..base.trees import SurfaceTree
from ..base.vectors import dot, norm, sub
from .profile import put_part
from .reach import bulge

Place = namedtuple("Place", "rho z across along margin")
"""A point seen from a solid's axis: its distance rho from the axis and its height z, metres; the
unit vectors in the model's frame from the axis to the point (`across`) and around the axis
(`along`); and by how much all that is computed from these may err, metres."""

MARGIN = 256.0 * DOUBLE_EPS
"""The margin of a Place, as a share of P, the length that errors of arcs are a share of, and of the
point's distance from the frame's origin. Points of pieces err by 120 u P (see arcs.py), the
coordinates of the point in the frame by less than 16 u of its distance, a distance between both by
a few u of both."""


@inlined
def patches_of(tree):
    """Return the hierarchy of the patches alone, for which kernels are compiled already."""
    return seen_as(SurfaceTree, tree)


@inlined
def _row(frame, i):
    return (frame[i, 0], frame[i, 1], frame[i, 2])


@inlined
def axis_of(tree):
    """Return the unit vector of the axis, model frame."""
    return _row(tree.frame, 2)


@kernel
def place_in(tree, p, way):
    """Return the Place of a point of the model's frame, metres.

    If the point lies on the axis, every half-plane holds it: the one that `way` points into is
    taken.
    """
    frame = tree.frame
    d = sub(p, _row(frame, 3))
    ex, ey = _row(frame, 0), _row(frame, 1)
    x, y, z = dot(d, ex), dot(d, ey), dot(d, _row(frame, 2))
    rho = np.sqrt(x * x + y * y)
    margin = MARGIN * (frame[4, 0] + norm(d))
    c, s = x, y
    if not rho > 0.0:
        c, s = dot(way, ex), dot(way, ey)
    length = np.sqrt(c * c + s * s)
    c, s = (c / length, s / length) if length > 0.0 else (1.0, 0.0)
    across = (c * ex[0] + s * ey[0], c * ex[1] + s * ey[1], c * ex[2] + s * ey[2])
    along = (c * ey[0] - s * ex[0], c * ey[1] - s * ex[1], c * ey[2] - s * ex[2])
    return Place(rho, z, across, along, margin)


@kernel
def angle_of(tree, p):
    """Return the angle about the axis of a point of the model's frame, radians."""
    d = sub(p, _row(tree.frame, 3))
    return np.arctan2(dot(d, _row(tree.frame, 1)), dot(d, _row(tree.frame, 0)))


@inlined
def from_chord(arc, rho, z):
    """Return the distance of a point from an arc's chord, metres.

    The arc is within `thickness` of its chord.
    """
    x, y = rho - arc.middle[0], z - arc.middle[1]
    square = arc.half[0] * arc.half[0] + arc.half[1] * arc.half[1]
    s = (x * arc.half[0] + y * arc.half[1]) / square if square > 0.0 else 0.0
    s = min(max(s, -1.0), 1.0)
    x, y = x - s * arc.half[0], y - s * arc.half[1]
    return np.sqrt(x * x + y * y)


@inlined
def thickness(arc):
    """Return how far a part of the profile may be from its arc's chord, metres."""
    return bulge(arc) + arc.error


@kernel
def from_arc(arc, rho, z):
    """Return the distance of a point from an arc, metres, and about where on it, from -1 to 1.

    Let a be the point's place along the chord, b its height over the chord, q the height of the
    arc's centre, and h half the chord. The squared distance from the centre minus the squared
    radius is then a² + b² - h² - 2 b q: nothing cancels if the arc is nearly straight.
    """
    x, y = rho - arc.middle[0], z - arc.middle[1]
    half = np.sqrt(arc.half[0] * arc.half[0] + arc.half[1] * arc.half[1])
    if not half > 0.0:
        return np.sqrt(x * x + y * y), 0.0
    ux, uz = arc.half[0] / half, arc.half[1] / half
    a, b = x * ux + y * uz, y * ux - x * uz
    if arc.sine != 0.0:
        side, sine = (1.0, arc.sine) if arc.sine > 0.0 else (-1.0, -arc.sine)
        radius = half / sine
        middle = -side * radius * arc.cosine
        up = side * (b - middle)
        if abs(a) * arc.cosine <= up * sine:
            far = np.sqrt(a * a + up * up)
            off = abs(a * a + b * b - half * half - 2.0 * b * middle) / (far + radius)
            return off, min(max(a / (far * sine), -1.0), 1.0)
        s = 1.0 if a > 0.0 else -1.0
    else:
        s = min(max(a / half, -1.0), 1.0)
    a -= s * half
    return np.sqrt(a * a + b * b), s


@kernel
def chord_of(curve, low, high, rows):
    """Return the ends of a part of a piece, and how far it may be from its chord, metres.

    Leaves the part's control points in `rows`; the part lies in their convex hull.
    """
    put_part(curve, low, high, rows)
    n = curve.degree
    x0, z0 = rows[0, 0] / rows[0, 2], rows[0, 1] / rows[0, 2]
    x1, z1 = rows[n, 0] / rows[n, 2], rows[n, 1] / rows[n, 2]
    far = 0.0
    for i in range(1, n):
        x, z = rows[i, 0] / rows[i, 2], rows[i, 1] / rows[i, 2]
        far = max(far, from_segment(x, z, x0, z0, x1, z1))
    return x0, z0, x1, z1, far


@inlined
def from_segment(x, z, x0, z0, x1, z1):
    """Return the distance of a point from a segment, metres."""
    hx, hz, x, z = x1 - x0, z1 - z0, x - x0, z - z0
    square = hx * hx + hz * hz
    s = (x * hx + z * hz) / square if square > 0.0 else 0.0
    s = min(max(s, 0.0), 1.0)
    x, z = x - s * hx, z - s * hz
    return np.sqrt(x * x + z * z)
