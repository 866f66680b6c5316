"""Sleeves: bounds of depths for two solids about nearly one axis, as of a press fit.

A sleeve is the cone or cylinder that a line of a solid's half-plane sweeps about the axis. If a
bore is too narrow for a shaft, their overlap is thin and goes around their axis. There, planes are
of use only in small cells, and bowls (`inside/ball_bowls.py`) only if both feet of a cell's centre
are on the faces that count. In the half-plane through each axis, a sleeve is straight.

Let c be the centre of a cell, rho_k and z_k a point's place in the half-plane of solid k, and m_k =
(p_k, q_k) a unit vector there. Suppose that no point of the profile within R of c's place is higher
than H_k over c's place along m_k, and that all above this line is outside. Then, as for planes
(`inside/ball_caps.py`) but with distances in the half-plane, a point x of the cell is no deeper
than

    f_k(x) <= H_k - p_k (rho_k(x) - rho_k(c)) - q_k (z_k(x) - z_k(c)).

Let m_b be opposite to m_a. With d = x - c, a and b the unit vectors of the axes, b turned so that
a . b > 0, and p, q those of solid a, the mean of both bounds is

    F(x) <= (H_a + H_b + p (rho_b(x) - rho_b(c) - rho_a(x) + rho_a(c)) - q (a - b) . d) / 2.

The difference of the distances changes little. To first order the change is (u_b - u_a) . d, with
u_k the unit vector from axis k to c. So F is a row (`inside/ball_rows.py`) raised by |p| / 2 times
the rest of the change. The rest is at most half the largest |(t_b . d)² / rho_b -
(t_a . d)² / rho_a| in the cell, where t_k is perpendicular to axis k and to u_k. Let the cell
extend no more than S across axis a and Z along it, and rho_k be no less than r_k in it. The axes'
vectors to one point of the cell differ by no more than

    D = |rho_b(c) u_b - rho_a(c) u_a| + sin(tilt) |d|,

and so do distances; unit vectors differ by no more than D / min(r_a, r_b), and with g = |a - b|,

    |(t_b - t_a) . d| <= G = (g + D / min(r_a, r_b)) S + g Z.

Hence twice the rest is at most S² D / (r_a r_b) + G (2 S + G) / r_b.

Both bounds may also be of one solid, along m and against it. Then the rest is zero, and the mean is
half the solid's thickness, as of a thin ring.

Rounding: heights err as in `height_in_plane`, by the margins of places; unit vectors by 16 u an
entry, which is less than a slack of what a row says. A rotation that is off by E moves points and
turns unit vectors by 3 E of their length, which is less than a slack as well: see POSE_MARGIN.
SLACKS is above the count.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ..base.jit import kernel, shared
from ..base.vectors import along, cross, dot, moved, norm, scaled, sub, turned_back
from ..elements.errors import joints_err
from ..inside.ball_bowls import PART
from ..inside.ball_caps import CLEAR, PLANE, along_axis, beside
from ..inside.ball_frame import in_search_frame
from ..inside.ball_point import place_of
from .cap import height_in_plane
from .coaxial import ALIKE
from .inside import turns_around
from .meridian import axis_of, place_in

SLACKS = 2.0 * PLANE
"""Slacks by which a row is raised."""

_NARROWEST = 0.5
"""A cell has to stay farther from an axis than this share of its centre's distance from it."""

_MANY = 512
"""If the axes differ, a solid alone is tried only after so many cells: mostly it is not worth
it."""

_FINE = 0.1
"""Share of the limit by which a height may be too high."""

Seen = namedtuple("Seen", "place u axis across along")
"""A cell seen from the axis of a solid: the Place of its centre; `u`, the unit vector from the axis
to it, and `axis`, both in a's frame; and how far the cell extends from its centre across the axis
and along it, metres."""


@kernel
def _seen(tree, motion, centre, half, axes):
    """Return the cell around a point of a's frame as it is Seen from a solid."""
    place = place_in(tree, moved(motion, centre), (1.0, 0.0, 0.0))
    u, axis = turned_back(motion, place.across), turned_back(motion, axis_of(tree))
    z = in_search_frame(axes, axis)
    far = abs(z[0]) * half[0] + abs(z[1]) * half[1] + abs(z[2]) * half[2]
    across = beside(z, half)
    return Seen(place, u, axis, across * (1.0 + 1e-12), far * (1.0 + 1e-12))


@kernel
def _height(tree, seen, m, floor, top, fine, slack, joints):
    """Return a bound of H of a solid along a vector m of the half-plane, and the looks.

    The bound is at least `floor`, and infinity if it is above `top`, or if nothing proves that what
    is above is outside.
    """
    place = seen.place
    p, q = abs(m[0]), abs(m[1])
    clear = CLEAR * slack + 2.0 * joints + place.margin
    aside = q * seen.across + p * seen.along
    high = max(p * seen.across + q * seen.along, max(abs(floor), abs(top))) + 2.0 * clear
    # What is above the line is convex, hence of one piece. If m leads inwards, it must miss the
    # axis.
    if m[0] < 0.0 and not place.rho - p * high - q * aside > clear:
        return np.inf, 1
    radius = np.sqrt(aside * aside + high * high) * (1.0 + 1e-12)
    height, looks = height_in_plane(
        tree, place.rho, place.z, m, radius, 0.0, place.margin, floor, fine, top
    )
    if height == np.inf:
        return np.inf, looks
    own, over = joints_err(tree), height + clear
    rho, z = place.rho + over * m[0], place.z + over * m[1]
    if not rho > 0.0 or turns_around(tree, rho, z, place.margin + slack + own, own) != 0:
        return np.inf, looks
    return height, looks


@kernel
def _rest(seen_k, seen_l, axis_l, half):
    """Bound how far the difference of distances from two axes is from linear in a cell, metres."""
    least_k, least_l = seen_k.place.rho - seen_k.across, seen_l.place.rho - seen_l.across
    off = norm(sub(scaled(seen_l.u, seen_l.place.rho), scaled(seen_k.u, seen_k.place.rho)))
    square = half[0] * half[0] + half[1] * half[1] + half[2] * half[2]
    off += norm(cross(seen_k.axis, axis_l)) * np.sqrt(square)
    gap, across = norm(sub(seen_k.axis, axis_l)), seen_k.across
    twist = (gap + off / min(least_k, least_l)) * across + gap * seen_k.along
    rest = across * across * off / (least_k * least_l) + twist * (2.0 * across + twist) / least_l
    return 0.5 * rest * (1.0 + 1e-9)


@kernel
def _normal(point, k, u, axis):
    """Return the outward normal at a point's foot on solid k, in the half-plane; or zero."""
    p = -(point.way[k, 0] * u[0] + point.way[k, 1] * u[1] + point.way[k, 2] * u[2])
    q = -(point.way[k, 0] * axis[0] + point.way[k, 1] * axis[1] + point.way[k, 2] * axis[2])
    length = np.sqrt(p * p + q * q)
    if not length > 0.9:
        return 0.0, 0.0
    return p / length, q / length


@kernel
def _between(tree_k, tree_l, seen_k, seen_l, m, foot, spare, state, centre, half, limit, row):
    """Find a row from solid k along m and l against it; return whether there is one, and the looks.

    k is known to reach `foot` over the cell's centre, or not much less, and may reach by `spare`
    more, metres.
    """
    at, (p, q) = state.at[0], m
    turned = 1.0 if dot(seen_k.axis, seen_l.axis) > 0.0 else -1.0
    axis_l = scaled(seen_l.axis, turned)
    rest = abs(p) * _rest(seen_k, seen_l, axis_l, half)
    # The mean of both bounds changes by v . d.
    v = along(scaled(sub(seen_l.u, seen_k.u), 0.5 * p), sub(seen_k.axis, axis_l), -0.5 * q)
    change = 0.0
    for i in range(3):
        change += abs(along_axis(at.axes, i, v)) * half[i]
    room = 2.0 * (limit - PART * change) - rest
    fine = _FINE * max(limit, at.floor)
    top = foot + spare + max(room, 0.0) + fine
    found, looks = _height(tree_k, seen_k, m, foot, top, fine, at.slack, at.joints)
    if found == np.inf:
        return False, looks
    floor = min(2.0 * room, 0.0) - found
    other, more = _height(
        tree_l, seen_l, (-p, -q * turned), floor, room - found, fine, at.slack, at.joints
    )
    looks += more
    if other == np.inf:
        return False, looks
    row[3] = 0.5 * (found + other + rest) + SLACKS * at.slack
    for i in range(3):
        row[i] = -along_axis(at.axes, i, v)
        row[3] += row[i] * centre[i]
    return True, looks


@shared
def sleeves(tree_a, tree_b, state, centre, half, limit, row):
    """Find a row for a cell of the search's frame, as `bowls` does.

    Returns whether there is one, and the looks.
    """
    at, point, best, motions = state.at[0], state.trial[0], state.best[0], state.motions
    if at.swept[0] > 0.0 or at.swept[1] > 0.0:
        return False, 0
    axis_a, axis_b = (
        turned_back(motions[0], axis_of(tree_a)),
        turned_back(motions[1], axis_of(tree_b)),
    )
    alike = abs(dot(axis_a, axis_b)) > ALIKE
    if not (alike or at.cells > _MANY):
        return False, 0
    middle = place_of(point)
    seen_a = _seen(tree_a, motions[0], middle, half, at.axes)
    seen_b = _seen(tree_b, motions[1], middle, half, at.axes)
    # Try the face farther from the centre first: the nearer one may be an end face.
    first = 0 if point.away[0] >= point.away[1] else 1
    looks = 0
    for turn in range(4):
        k = first if turn == 0 else 1 - first
        other = 1 - k
        if turn == 3:  # one solid alone: the one that the centre is less deep in
            k = other = 0 if point.depth[0] <= point.depth[1] else 1
        elif not alike or (turn == 2 and not at.radius > 0.0):
            continue
        tree_k, seen_k, motion = (
            (tree_a, seen_a, motions[0]) if k == 0 else (tree_b, seen_b, motions[1])
        )
        tree_l, seen_l = (tree_a, seen_a) if other == 0 else (tree_b, seen_b)
        near = min(seen_k.place.rho, seen_l.place.rho)
        if not near - max(seen_k.across, seen_l.across) > _NARROWEST * near:
            continue
        if turn == 2:  # along the normal at the largest ball: here both feet may be on end faces
            u = turned_back(
                motion, place_in(tree_k, moved(motion, place_of(best)), seen_k.u).across
            )
            m = _normal(best, k, u, seen_k.axis)
            foot = -abs(m[0]) * seen_k.across - abs(m[1]) * seen_k.along
            spare = -2.0 * foot
        else:
            m = _normal(point, k, seen_k.u, seen_k.axis)
            foot = -point.away[k] if point.side[k] < 0 else point.away[k]
            spare = 0.0
        if m[0] == 0.0 and m[1] == 0.0:
            continue
        found, more = _between(
            tree_k, tree_l, seen_k, seen_l, m, foot, spare, state, centre, half, limit, row
        )
        looks += more
        if found:
            return True, looks
    return False, looks
