"""A solid of revolution that is a sphere: what its centre tells, however its axis is turned.

All of it is within its radius of the centre, which lies on its axis. So nothing of another solid is
nearer to it than to the centre, less the radius; and that is found in the half-plane through the
centre (closest.py). Where the centre lies on the other's axis, as of a ball in a socket, the
nearest points are a whole circle: pairs of arcs about two axes would be divided there without end.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.jit import inlined, kernel
from ..base.rounding import DOUBLE_EPS, RESOLUTION
from ..base.vectors import moved, moved_back, norm
from .closest import nearest_on
from .minima import measure_rings
from .places import turning_point

_SPARE = 0.125 * RESOLUTION
"""Share of both models' sizes by which a bound may be less than it could be."""

_MARGIN = 256.0 * DOUBLE_EPS
"""What a centre errs by, as a share of its own norm and of the lengths that arcs err by shares of.
Moving it into the other profile's frame takes 30 u of these."""

_LOOKS = 4
"""Looks at arcs that take as long as a step of a search."""


@inlined
def is_sphere(tree):
    """Whether a solid is one."""
    return tree.frame[5, 1] > 0.0


@inlined
def _centre(tree):
    return (0.0, 0.0, tree.frame[5, 0])


@inlined
def _foot(tree, p, margin, spare):
    """The point of a profile that is nearest to a point of its frame; else as `nearest_on`."""
    rho = np.sqrt(p[0] * p[0] + p[1] * p[1])
    least, _, piece, t, looks = nearest_on(tree, rho, p[2], margin, 0.0, spare)
    return least, piece, t, looks


@kernel
def _least(solid, sphere, centre, spare):
    """A lower bound of the distance of a solid from a sphere about a point of its frame.

    Returns also which piece of the profile that is of, where on it, and how many looks it took.
    """
    margin = _MARGIN * (solid.frame[4, 0] + sphere.frame[4, 0] + norm(centre))
    least, piece, t, looks = _foot(solid, centre, margin, spare)
    return least - sphere.frame[5, 1], piece, t, looks


@kernel
def least_beside_sphere(tree_a, tree_b, state, motion):
    """A lower bound of the distance of two solids, one of which is a sphere, and the steps taken.

    Where the nearest points known are farther apart, those that the bound tells of are measured.
    """
    progress = state.progress[0]
    spare = _SPARE * (tree_a.scale[2] + tree_b.scale[2])
    lost = progress.slack + progress.bound_slack
    if is_sphere(tree_b):
        centre = moved(motion, _centre(tree_b))
        least, a, s, looks = _least(tree_a, tree_b, centre, spare)
    else:
        centre = moved_back(motion, _centre(tree_a))
        least, b, t, looks = _least(tree_b, tree_a, centre, spare)
    least -= lost
    if least < progress.limit:
        way = math.atan2(centre[1], centre[0])
        if is_sphere(tree_b):
            p = moved_back(motion, turning_point(tree_a.curves[a], s, way))
            _, b, t, more = _foot(tree_b, p, 0.0, spare)
            angle = math.atan2(p[1], p[0])
        else:
            p = moved(motion, turning_point(tree_b.curves[b], t, way))
            _, a, s, more = _foot(tree_a, p, 0.0, spare)
            angle = way
        looks += more
        measure_rings(tree_a, tree_b, state, motion, a, b, s, t, angle)
    return least, 1 + looks // _LOOKS
