"""Points of a turning profile as points of the patches that it sweeps, and back.

A patch's second parameter runs around the axis, a quarter turn from each whole number to the next.
Each quarter is a rational quadratic with the weights 1, sqrt(1/2) and 1. At the angle phi in it,
its parameter s from 0 to 1 is given by s : 1 - s = sin(phi / 2) : sin(pi / 4 - phi / 2). With
h = tan(phi / 2) that is sqrt(2) h : 1 - h.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.jit import kernel
from .profile import jet_of


@kernel
def turning_point(curve, t, angle):
    """Return the point of a piece at t and an angle, metres, in the profile's frame."""
    (rho, z), _, _ = jet_of(curve, t)
    return (rho * math.cos(angle), rho * math.sin(angle), z)


@kernel
def place_of(tree, k, t, angle):
    """Return the element of the patches at t on the k-th piece and an angle, and its weights."""
    return place_towards(tree, k, t, math.cos(angle), math.sin(angle))


@kernel
def place_towards(tree, k, t, x, y):
    """Return the same, in the half-plane of the unit vector (x, y) across the axis."""
    curve = tree.curves[k]
    part = min(np.int64(t * curve.parts), np.int64(curve.parts - 1))
    u = min(max(t * curve.parts - part, 0.0), 1.0)
    if y >= 0.0:
        quarter, x, y = (0, x, y) if x > 0.0 else (1, y, -x)
    else:
        quarter, x, y = (2, -x, -y) if x < 0.0 else (3, -y, x)
    h = min(max(y / (1.0 + x), 0.0), 1.0)
    h, rest = math.sqrt(2.0) * h, 1.0 - h
    each = curve.around // 4
    v = h / (h + rest) * each
    column = min(np.int64(v), np.int64(each - 1))
    v = min(max(v - column, 0.0), 1.0)
    element = tree.places[curve.first + part * curve.around + quarter * each + column]
    return np.int64(element), (u, v, 0.0)


@kernel
def spot_of(tree, element, weights):
    """Return the piece of the profile that a point of an element lies on, and its t and angle."""
    piece = tree.pieces[element]
    k = 0
    for i in range(len(tree.curves)):
        curve = tree.curves[i]
        if curve.patch == piece.patch and curve.low <= piece.low[0] < curve.high:
            k = i
            break
    curve = tree.curves[k]
    u = piece.low[0] + weights[0] * (piece.high[0] - piece.low[0])
    v = piece.low[1] + weights[1] * (piece.high[1] - piece.low[1])
    t = min(max((u - curve.low) / (curve.high - curve.low), 0.0), 1.0)
    quarter = min(math.floor(v), 3.0)
    s = v - quarter
    both = math.sqrt(2.0) * s * (1.0 - s)
    phi = math.atan2(s * s + both, (1.0 - s) * (1.0 - s) + both)
    return k, t, 0.5 * math.pi * quarter + phi
