"""Where a triangle is nearest to a solid of revolution: Newton's method on the solid's distance.

All is in the frame of the profile, whose z is the axis. The distance f of a point y is that of
(rho, z) from the profile. Let n be the gradient of f, c the curvature of the profile at the nearest
point, positive towards y, and m the unit vector perpendicular to n in the half-plane of y. The
second derivatives of f are those of an offset surface (do Carmo 1976, section 3-3):

    along m  -c / (1 - c f),  or 1 / f if a corner is nearest;  around the axis  n_rho / rho.

Outside a convex solid f is convex, so its quadratic model has a minimum in the triangle, inside it
or on an edge. The method makes upper bounds only, so any result is valid.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import kernel
from ..base.precise import accurate_cross
from ..base.rounding import DOUBLE_EPS
from ..base.vectors import along, dot, norm, scaled, sub
from .closest import nearest_in
from .profile import jet_of

Reach = namedtuple("Reach", "distance normal across around bend turn piece t corner looks")
"""How far a point is from a solid, metres: `normal` is the gradient n, `across` is m, `around` the
unit vector around the axis; `bend` and `turn` are the second derivatives along m and around, 1/m;
`piece` and `t` tell where the profile is nearest, and whether that is a `corner` of it; `looks` how
many arcs were looked at."""

_STEPS, _MORE, _WORTH = 16, 48, 0.01
"""Steps of Newton's method; and most steps, if each further one promises this share of the
distance, as beside a corner of the profile."""

_LEAST, _MOST = 0.1, 0.8
"""The least and the largest share to which a step that does not lead nearer is shortened."""

_GAIN = 1e-13
"""Share of the distance that is no gain: a step that promises less is taken, whatever rounding
says."""

_CORNER = 1e-9
"""Cosine between the tangent and the gradient above which the end of a piece counts as a corner."""

_SURE = 0.5
"""Cosine between the normal of a piece and the way to the point above which the two are taken to be
one: the way to a near point is tilted by rounding, and if the nearest point is not quite exact."""

_ALIKE = 0.99
"""The same for a normal of a triangle or an edge."""

_SLIM = 1e-6
"""Square of the sine of an edge and a tangent below which they count as parallel."""

_ROUNDED = 8.0 * DOUBLE_EPS
"""A first weight below this may be that of a point on the opposite edge: it is 1 - v - w, and v and
w are rounded."""

_FLAT = 1e-12
"""Share of the product of both second derivatives that their determinant has to exceed."""


@kernel
def _nearest(tree, y, spare, most):
    rho = np.sqrt(y[0] * y[0] + y[1] * y[1])
    _, _, piece, t, looks = nearest_in(tree, rho, y[2], 0.0, 0.0, spare, most)
    return rho, piece, t, looks


@kernel
def gradient_at(tree, y, spare, most):
    """Return the Reach of a point of the profile's frame, its distance right to `spare` metres.

    After about `most` looks at arcs, it may be that of a point of the profile that is not nearest.
    """
    rho, piece, t, looks = _nearest(tree, y, spare, most)
    curve = tree.curves[piece]
    (r, z), (r1, z1), (r2, z2) = jet_of(curve, t)
    dr, dz = rho - r, y[2] - z
    length = np.sqrt(dr * dr + dz * dz)
    per = 1.0 / length if length > 0.0 else 0.0
    nr, nz = dr * per, dz * per
    speed = np.sqrt(r1 * r1 + z1 * z1)
    at_end = not 0.0 < t < 1.0
    corner = at_end and abs(r1 * nr + z1 * nz) > _CORNER * speed
    if corner:
        bend = per
    else:
        if abs(r1 * nz - z1 * nr) > _SURE * speed:
            way = speed if r1 * nz > z1 * nr else -speed
            nr, nz = -z1 / way, r1 / way
        c = (r2 * nr + z2 * nz) / (speed * speed) if speed > 0.0 else 0.0
        room = 1.0 - c * length
        bend = max(-c / room, 0.0) if room > 0.0 else per
    ex, ey = (y[0] / rho, y[1] / rho) if rho > 0.0 else (1.0, 0.0)
    turn = max(nr / rho, 0.0) if rho > 0.0 else bend
    normal, across = (nr * ex, nr * ey, nz), (-nz * ex, -nz * ey, nr)
    return Reach(length, normal, across, (-ey, ex, 0.0), bend, turn, piece, t, corner, looks)


@kernel
def foot_of(tree, y, spare, most):
    """Return the point of a solid's boundary nearest to y, in the half-plane of y.

    After about `most` looks at arcs, the point may be another one near y.
    """
    rho, piece, t, _ = _nearest(tree, y, spare, most)
    (r, z), _, _ = jet_of(tree.curves[piece], t)
    share = r / rho if rho > 0.0 else 0.0
    return (share * y[0], share * y[1], z) if rho > 0.0 else (r, 0.0, z)


@kernel
def _along_edge(gv, gw, hvv, hvw, hww, v, w, dv, dw):
    """Return the least value of the model along an edge from (v, w), and the v and w there."""
    slope = gv * dv + gw * dw + hvv * v * dv + hvw * (v * dw + w * dv) + hww * w * dw
    bend = hvv * dv * dv + 2.0 * hvw * dv * dw + hww * dw * dw
    s = min(max(-slope / bend, 0.0), 1.0) if bend > 0.0 else (0.0 if slope >= 0.0 else 1.0)
    v, w = v + s * dv, w + s * dw
    return gv * v + gw * w + 0.5 * (hvv * v * v + 2.0 * hvw * v * w + hww * w * w), v, w


@kernel
def _least(gv, gw, hvv, hvw, hww, v, w):
    """Return a quadratic model's least change in the triangle, and the step to it from (v, w)."""
    det = hvv * hww - hvw * hvw
    if det > _FLAT * hvv * hww:
        dv, dw = (hvw * gw - hww * gv) / det, (hvw * gv - hvv * gw) / det
        if v + dv >= 0.0 and w + dw >= 0.0 and v + dv + w + dw <= 1.0:
            return 0.5 * (gv * dv + gw * dw), dv, dw
    best, dv, dw = _along_edge(gv, gw, hvv, hvw, hww, -v, -w, 1.0, 0.0)
    value, x, y = _along_edge(gv, gw, hvv, hvw, hww, -v, -w, 0.0, 1.0)
    if value < best:
        best, dv, dw = value, x, y
    value, x, y = _along_edge(gv, gw, hvv, hvw, hww, 1.0 - v, -w, -1.0, 1.0)
    if value < best:
        best, dv, dw = value, x, y
    return best, dv, dw


@kernel
def nearest_of_triangle(tree, triangle, v, w, spare, rel_err, abs_err, limit, most):
    """Find the point a + v (b - a) + w (c - a) of a triangle nearest to a solid, from a given v, w.

    Returns its Reach, the point, v, w, and how many arcs were looked at. The search ends if the
    plane perpendicular to the gradient leaves at most half of the tolerances (Frank and Wolfe
    1956), or proves that nothing is below the limit, or after about `most` looks. The distance of a
    point need not be known better than to `spare` metres.
    """
    a, b, c = triangle
    e, f = sub(b, a), sub(c, a)
    y = along(along(a, e, v), f, w)
    here = gradient_at(tree, y, spare, most)
    looks = here.looks
    fresh, gv, gw, dv, dw, less = True, 0.0, 0.0, 0.0, 0.0, 0.0
    for step in range(_MORE):
        if fresh:
            n, m, o, p, q = here.normal, here.across, here.around, here.bend, here.turn
            gv, gw = dot(n, e), dot(n, f)
            left = gv * v + gw * w - min(min(gv, gw), 0.0)
            enough = left <= 0.5 * max(rel_err * here.distance, abs_err)
            if enough or here.distance - left >= limit:
                break
            me, mf, oe, of = dot(m, e), dot(m, f), dot(o, e), dot(o, f)
            hvv, hww = p * me * me + q * oe * oe, p * mf * mf + q * of * of
            less, dv, dw = _least(gv, gw, hvv, p * me * mf + q * oe * of, hww, v, w)
            if not less < 0.0 or (step >= _STEPS and -less < _WORTH * here.distance):
                break
            if here.distance + less < 0.0:  # only as far as the boundary
                share = min(-here.distance / (gv * dv + gw * dw), 1.0)
                dv, dw = share * dv, share * dw
        if looks >= most:
            break
        x, z = max(v + dv, 0.0), max(w + dw, 0.0)
        at = along(along(a, e, x), f, z)
        there = gradient_at(tree, at, spare, most - looks)
        looks += there.looks
        fresh = there.distance < here.distance or -less <= _GAIN * here.distance
        if fresh:
            here, y, v, w = there, at, x, z
        else:
            # Shorten the step to where the slope is zero, interpolated between both ends.
            before, after = gv * dv + gw * dw, dot(there.normal, e) * dv + dot(there.normal, f) * dw
            share = before / (before - after) if after > 0.0 else _LEAST
            share = min(max(share, _LEAST), _MOST)
            dv, dw = share * dv, share * dw
    return here, y, v, w, looks


@kernel
def normal_between(here, triangle, v, w):
    """Return a unit vector between a triangle's point at v and w and a solid, as exact as possible.

    The way between two near points is tilted by rounding, which costs much along a long edge. The
    normal of a face is not; nor is that of an edge and a tangent of the solid: along the profile,
    or else around the axis. Returns `here.normal` at the triangle's corners.
    """
    a, b, c = triangle
    u = 1.0 - v - w
    u = u if u > _ROUNDED else 0.0
    if v > 0.0 and w > 0.0 and u > 0.0:
        n = accurate_cross(sub(b, a), sub(c, a))
    else:
        if u > 0.0 and v > 0.0:
            edge = sub(b, a)
        elif u > 0.0 and w > 0.0:
            edge = sub(c, a)
        elif v > 0.0 and w > 0.0:
            edge = sub(c, b)
        else:
            return here.normal
        n, least = (0.0, 0.0, 0.0), _SLIM * dot(edge, edge)
        if not here.corner:
            n = accurate_cross(edge, here.across)
        if not dot(n, n) > least:  # it is along the profile, or at a corner
            n = accurate_cross(edge, here.around)
        if not dot(n, n) > least:
            n, per = here.normal, 1.0 / max(dot(edge, edge), 1e-300)
            for _ in range(2):  # the second time removes what rounding has left
                n = along(n, edge, -per * dot(n, edge))
    length = norm(n)
    turned = dot(n, here.normal)
    if not abs(turned) > _ALIKE * length:
        return here.normal
    return scaled(n, (1.0 if turned > 0.0 else -1.0) / length)
