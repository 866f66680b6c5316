"""A solid of revolution that a ball sweeps along a circle, a torus: what this circle tells.

All of it is within its radius of the circle, which is a point where the solid is a sphere. So
nothing of another one is nearer to it than to the circle, less the radius. Of two tori that is
found by the distance of their circles (circles.py), of a sphere beside any solid in the half-plane
through its centre (closest.py). Where the nearest points are a whole circle, as of a ball in a
socket or of coaxial rings, pairs of arcs about two axes would be divided there without end.
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
"""Share of both models' sizes by which a bound may be less than it could be."""

_MARGIN = 256.0 * DOUBLE_EPS
"""What a centre errs by, as a share of how far it is off and of the lengths that arcs err by shares
of. Moving it into the other profile's frame takes 30 u of these, and that frame's axes as much."""

_LOOKS = 4
"""Looks at arcs that take as long as a step of a search."""


@inlined
def _height(tree):
    """The z of the circle."""
    return tree.frame[5, 0]


@inlined
def _radius(tree):
    """That of the ball; 0 of all other solids."""
    return tree.frame[5, 1]


@inlined
def _around(tree):
    """The radius of the circle; 0 of a sphere."""
    return tree.frame[5, 2]


@inlined
def _is_sphere(tree):
    return _radius(tree) > 0.0 and _around(tree) == 0.0


@inlined
def are_tubes(tree_a, tree_b):
    """Whether the circle of one of two solids tells how far they are apart."""
    both = _radius(tree_a) > 0.0 and _radius(tree_b) > 0.0
    return both or _is_sphere(tree_a) or _is_sphere(tree_b)


@inlined
def _foot(tree, p, margin, spare):
    """The point of a profile that is nearest to a point of its frame; else as `nearest_on`."""
    rho = np.sqrt(p[0] * p[0] + p[1] * p[1])
    least, _, piece, t, looks = nearest_on(tree, rho, p[2], margin, 0.0, spare)
    return least, piece, t, looks


@inlined
def _margin(tree_a, tree_b, offset):
    return _MARGIN * (tree_a.frame[4, 0] + tree_b.frame[4, 0] + norm(offset))


@kernel
def _beside_sphere(solid, sphere, centre, spare):
    """A lower bound of the distance of a solid from a sphere about a point of its frame.

    Returns also a point that is about the nearest of the solid, its frame, and the looks it took.
    """
    margin = _margin(solid, sphere, centre)
    least, piece, t, looks = _foot(solid, centre, margin, spare)
    p = turning_point(solid.curves[piece], t, math.atan2(centre[1], centre[0]))
    return least - _radius(sphere), p, looks


@kernel
def _beside_ring(ring, other, motion, spare):
    """A lower bound of the distance of two tori, of which the first has the larger circle.

    The motion is that from the second one's frame. Returns also two points of their circles that
    are about the nearest, each in its own frame, and the looks it took.
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
    """A lower bound of the distance of two solids for which that is known; and the steps taken.

    Where the nearest points known are farther apart, those that the bound tells of are measured.
    """
    progress = state.progress[0]
    spare = _SPARE * (tree_a.scale[2] + tree_b.scale[2])
    if _is_sphere(tree_b):  # first, as a sphere may be in the tube of a torus, or in a sphere
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
            _turn_back(motion, back)
            least, q, p, looks = _beside_ring(tree_b, tree_a, back, spare)
        p, q = moved_back(motion, p), moved(motion, q)
    least -= progress.slack + progress.bound_slack
    if -progress.abs_err < least < progress.limit:  # where they cross, these points are not near
        _, a, s, more = _foot(tree_a, q, 0.0, spare)
        _, b, t, also = _foot(tree_b, p, 0.0, spare)
        looks += more + also
        measure_rings(tree_a, tree_b, state, motion, a, b, s, t, math.atan2(p[1], p[0]))
    return least, 1 + looks // _LOOKS


@kernel
def _turn_back(motion, made):
    """Write the motion back, of twelve numbers."""
    for i in range(3):
        for j in range(3):
            made[3 * i + j] = motion[3 * j + i]
    origin = moved_back(motion, (0.0, 0.0, 0.0))
    made[9], made[10], made[11] = origin
