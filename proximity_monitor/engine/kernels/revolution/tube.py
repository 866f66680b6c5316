"""Bounds for tubes: a tube is a torus or a sphere, which a ball sweeps along a circle.

All of a tube is within the ball's radius of the circle, which is a point for a sphere. So the
distance from the circle minus the radius is a lower bound of the distance from the tube. For two
tori it comes from the distance of their circles (circles.py), for a sphere beside any solid from
the half-plane through the sphere's centre (closest.py). If the nearest points are a whole circle,
as of a ball in a socket or of coaxial rings, dividing pairs of arcs about two axes would never end
there.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.jit import inlined, kernel
from ..base.memory import on_stack
from ..base.rounding import DOUBLE_EPS, RESOLUTION
from ..base.vectors import moved, moved_back, norm
from .circles import circles_of, distance_of_circles, point_at
from .closest import nearest_on
from .minima import measure_rings
from .places import turning_point

_SPARE = 0.125 * RESOLUTION
"""Share of both models' sizes by which a bound may be less than the best one."""

_MARGIN = 256.0 * DOUBLE_EPS
"""Error of a centre, as a share of its offset plus both lengths that errors of arcs are a share of.
Moving it into the other profile's frame takes 30 u of these, and that frame's axes as much."""

_LOOKS = 4
"""Looks at arcs that count as one step of a search."""


@inlined
def _height(tree):
    """Return the z of the circle."""
    return tree.frame[5, 0]


@inlined
def _radius(tree):
    """Return the radius of the ball; 0 for all other solids."""
    return tree.frame[5, 1]


@inlined
def _around(tree):
    """Return the radius of the circle; 0 for a sphere."""
    return tree.frame[5, 2]


@inlined
def _is_sphere(tree):
    return _radius(tree) > 0.0 and _around(tree) == 0.0


@inlined
def are_tubes(tree_a, tree_b):
    """Return whether the circle of one of two solids tells how far apart the solids are."""
    both = _radius(tree_a) > 0.0 and _radius(tree_b) > 0.0
    return both or _is_sphere(tree_a) or _is_sphere(tree_b)


@inlined
def _foot(tree, p, margin, spare):
    """Find the point of a profile nearest to a point of its frame; see `nearest_on`.

    Returns a lower bound of the distance, metres, the piece, t and the looks.
    """
    rho = np.sqrt(p[0] * p[0] + p[1] * p[1])
    least, _, piece, t, looks = nearest_on(tree, rho, p[2], margin, 0.0, spare)
    return least, piece, t, looks


@inlined
def _margin(tree_a, tree_b, offset):
    return _MARGIN * (tree_a.frame[4, 0] + tree_b.frame[4, 0] + norm(offset))


@kernel
def _beside_sphere(solid, sphere, centre, spare):
    """Return a lower bound of the distance of a solid from a sphere about a point of its frame.

    Returns also about the nearest point of the solid, in its frame, and the looks.
    """
    margin = _margin(solid, sphere, centre)
    least, piece, t, looks = _foot(solid, centre, margin, spare)
    p = turning_point(solid.curves[piece], t, math.atan2(centre[1], centre[0]))
    return least - _radius(sphere), p, looks


@kernel
def _beside_ring(ring, other, motion, spare):
    """Return a lower bound of the distance of two tori, of which the first has the larger circle.

    `motion` is from the second one's frame to the first one's. Returns also about the nearest
    points of their circles, each in its own frame, and the looks.
    """
    circles = circles_of(motion, _around(ring), _height(ring), _around(other), _height(other))
    least, angle, _, looks = distance_of_circles(circles, spare)
    x, y, _ = point_at(circles, angle)
    far = np.sqrt(x * x + y * y)
    share = _around(ring) / far if far > 0.0 else 0.0
    p = (x * share, y * share, _height(ring))
    q = (_around(other) * math.cos(angle), _around(other) * math.sin(angle), _height(other))
    least -= _radius(ring) + _radius(other) + _margin(ring, other, circles.centre)
    return least, p, q, looks


@kernel
def least_beside_tube(tree_a, tree_b, state, motion):
    """Return a lower bound of the distance of two solids, if `are_tubes`, and the steps taken.

    If the bound is below the limit, the points that it comes from are measured.
    """
    progress = state.progress[0]
    spare = _SPARE * (tree_a.scale[2] + tree_b.scale[2])
    if _is_sphere(tree_b):  # before tori: a sphere may be inside a torus's tube or a sphere
        q = moved(motion, (0.0, 0.0, _height(tree_b)))
        least, p, looks = _beside_sphere(tree_a, tree_b, q, spare)
        p = moved_back(motion, p)
    elif _is_sphere(tree_a):
        p = moved_back(motion, (0.0, 0.0, _height(tree_a)))
        least, q, looks = _beside_sphere(tree_b, tree_a, p, spare)
        q = moved(motion, q)
    else:
        if _around(tree_a) >= _around(tree_b):
            least, p, q, looks = _beside_ring(tree_a, tree_b, motion, spare)
        else:
            back = on_stack(12, 0.0)
            _invert(motion, back)
            least, q, p, looks = _beside_ring(tree_b, tree_a, back, spare)
        p, q = moved_back(motion, p), moved(motion, q)
    least -= progress.slack + progress.bound_slack
    if -progress.abs_err < least < progress.limit:  # if they overlap, these points are not near
        _, a, s, more = _foot(tree_a, q, 0.0, spare)
        _, b, t, also = _foot(tree_b, p, 0.0, spare)
        looks += more + also
        measure_rings(tree_a, tree_b, state, motion, a, b, s, t, math.atan2(p[1], p[0]))
    return least, 1 + looks // _LOOKS


@kernel
def _invert(motion, made):
    """Write the inverse of a motion (12,)."""
    for i in range(3):
        for j in range(3):
            made[3 * i + j] = motion[3 * j + i]
    origin = moved_back(motion, (0.0, 0.0, 0.0))
    made[9], made[10], made[11] = origin
