"""Local minima of the distance of two turning profiles: found, remembered and kept."""

from __future__ import annotations

import math

import numpy as np

from ..base.jit import inlined, kernel
from ..base.memory import on_stack
from ..base.trees import NONE
from ..base.vectors import moved, norm, sub
from ..elements.primitives import keep
from ..surface.edges import point_on
from .guess import near_samples
from .newton import nearest_at_ends, nearest_rings, to_a
from .places import place_towards, spot_of
from .profile import jet_of

MINIMA = 16
"""Minima that are remembered, at most."""

_SURE = 0.999
"""Cosine between the normal of a piece and the kept direction above which both are taken as one."""

SMALL = 0.6
"""Largest half angle of a sector, radians, whose minimum is looked for however far it is."""


@kernel
def relative(tree_a, tree_b, motion, made):
    """Write the motion (12,) from the frame of b's profile to that of a's."""
    fa, fb = tree_a.frame, tree_b.frame
    origin = moved(motion, (fb[3, 0], fb[3, 1], fb[3, 2]))
    offset = sub(origin, (fa[3, 0], fa[3, 1], fa[3, 2]))
    for j in range(3):
        x = motion[0] * fb[j, 0] + motion[1] * fb[j, 1] + motion[2] * fb[j, 2]
        y = motion[3] * fb[j, 0] + motion[4] * fb[j, 1] + motion[5] * fb[j, 2]
        z = motion[6] * fb[j, 0] + motion[7] * fb[j, 1] + motion[8] * fb[j, 2]
        for i in range(3):
            made[3 * i + j] = fa[i, 0] * x + fa[i, 1] * y + fa[i, 2] * z
    for i in range(3):
        made[9 + i] = fa[i, 0] * offset[0] + fa[i, 1] * offset[1] + fa[i, 2] * offset[2]


@kernel
def measure_rings(tree_a, tree_b, state, motion, a, b, s, t, angle):
    """Find a local minimum near points of two pieces; keep the points if they are the nearest."""
    progress, minima = state.progress[0], state.waiting.minima
    progress.primitive_tests += 1
    curves, errors = (tree_a.curves[a], tree_b.curves[b]), (progress.rel_err, progress.abs_err)
    found = nearest_rings(*curves, motion, s, t, angle, *errors)
    distance, s, t, angle = nearest_at_ends(*curves, motion, found, *errors)
    at = find_minimum(state, a, b)
    if at == NONE:
        at = progress.minima % MINIMA
        progress.minima += 1
        minima[at].curve_a, minima[at].curve_b, minima[at].distance = a, b, np.inf
    if distance < minima[at].distance:
        minima[at].distance, minima[at].s, minima[at].t = distance, s, t
        minima[at].angle = angle
    if distance < progress.distance + progress.slack:
        _keep_points(tree_a, tree_b, state, motion, a, b, s, t, angle)


@kernel
def _take_plane(tree_a, state, p):
    """Keep the direction between the nearest points in a's plane; p is the nearest point of a."""
    progress = state.progress[0]
    f, n = tree_a.frame, progress.normal_a
    p = sub(p, (f[3, 0], f[3, 1], f[3, 2]))
    x = f[0, 0] * p[0] + f[0, 1] * p[1] + f[0, 2] * p[2]
    y = f[1, 0] * p[0] + f[1, 1] * p[1] + f[1, 2] * p[2]
    nx = f[0, 0] * n[0] + f[0, 1] * n[1] + f[0, 2] * n[2]
    ny = f[1, 0] * n[0] + f[1, 1] * n[1] + f[1, 2] * n[2]
    nz = f[2, 0] * n[0] + f[2, 1] * n[1] + f[2, 2] * n[2]
    far = np.sqrt(x * x + y * y)
    if far > 0.0:
        x, y = x / far, y / far
    else:
        x, y = 1.0, 0.0
    across = nx * x + ny * y
    length = np.sqrt(across * across + nz * nz)
    if length > 0.0:
        progress.along[0], progress.along[1] = across / length, nz / length
    else:
        progress.along[0], progress.along[1] = 1.0, 0.0
    progress.along[2], progress.along[3] = x, y


@kernel
def _take_normal(curve_a, curve_b, progress, motion, s, t, angle):
    """Make the kept direction the normal of a straight piece, if the nearest point is inside one.

    Rounding tilts the way between two near points, which costs much along a straight piece.
    """
    kept = progress.along
    if curve_a.degree == 1 and 0.0 < s < 1.0:
        _, (x, z), _ = jet_of(curve_a, s)
        n, m, ex, ey = -z, x, kept[2], kept[3]
    elif curve_b.degree == 1 and 0.0 < t < 1.0:
        _, (x, z), _ = jet_of(curve_b, t)
        x, y, m = to_a(motion, -z * math.cos(angle), -z * math.sin(angle), x)
        n = np.sqrt(x * x + y * y)
        if not n > 0.0:
            return
        ex, ey = x / n, y / n
        if ex * kept[2] + ey * kept[3] < 0.0:
            n, ex, ey = -n, -ex, -ey
    else:
        return
    length, along = np.sqrt(n * n + m * m), n * kept[0] + m * kept[1]
    if abs(along) > _SURE * length:
        length = length if along > 0.0 else -length
        kept[0], kept[1], kept[2], kept[3] = n / length, m / length, ex, ey


@kernel
def _keep_points(tree_a, tree_b, state, motion, a, b, s, t, angle):
    """Keep two points, as points of their patches, if they are nearer than those before."""
    x, y = math.cos(angle), math.sin(angle)
    element_b, wb = place_towards(tree_b, b, t, x, y)
    (rho, z), _, _ = jet_of(tree_b.curves[b], t)
    x, y, _ = moved(motion, (rho * x, rho * y, z))
    far = np.sqrt(x * x + y * y)
    x, y = (x / far, y / far) if far > 0.0 else (1.0, 0.0)
    element_a, wa = place_towards(tree_a, a, s, x, y)
    p = point_on(tree_a, element_a, wa[0], wa[1])
    q = point_on(tree_b, element_b, wb[0], wb[1])
    way = sub(moved(state.motions[0], q), p)
    if norm(way) < state.progress[0].distance:
        keep(state, norm(way), element_a, element_b, wa, wb, way)
        _take_plane(tree_a, state, p)
        _take_normal(tree_a.curves[a], tree_b.curves[b], state.progress[0], motion, s, t, angle)


@inlined
def find_minimum(state, a, b):
    """Return the index of the minimum of these two pieces; NONE if none is known."""
    minima = state.waiting.minima
    for k in range(min(state.progress[0].minima, MINIMA)):
        if minima[k].curve_a == a and minima[k].curve_b == b:
            return k
    return NONE


@inlined
def nearest_minimum(state):
    """Return the index of the nearest minimum remembered; NONE if none is known."""
    minima, found = state.waiting.minima, NONE
    for k in range(min(state.progress[0].minima, MINIMA)):
        if found == NONE or minima[k].distance < minima[found].distance:
            found = k
    return found


@kernel
def keep_same(tree_a, tree_b, state):
    """Keep the points that progress names, by elements and weights, as the nearest."""
    progress = state.progress[0]
    wa, wb = progress.weights_a, progress.weights_b
    a, b = progress.element_a, progress.element_b
    wa, wb = (wa[0], wa[1], 0.0), (wb[0], wb[1], 0.0)
    p, q = point_on(tree_a, a, wa[0], wa[1]), point_on(tree_b, b, wb[0], wb[1])
    way = sub(moved(state.motions[0], q), p)
    keep(state, norm(way), a, b, wa, wb, way)
    _take_plane(tree_a, state, p)
    motion = on_stack(12, 0.0)
    relative(tree_a, tree_b, state.motions[0], motion)
    a, s, _ = spot_of(tree_a, a, progress.weights_a)
    b, t, angle = spot_of(tree_b, b, progress.weights_b)
    _take_normal(tree_a.curves[a], tree_b.curves[b], progress, motion, s, t, angle)


@kernel
def measure_again(tree_a, tree_b, state):
    """Find the local minimum near the points that were nearest, and keep it."""
    progress = state.progress[0]
    motion = on_stack(12, 0.0)
    relative(tree_a, tree_b, state.motions[0], motion)
    a, s, _ = spot_of(tree_a, progress.element_a, progress.weights_a)
    b, t, angle = spot_of(tree_b, progress.element_b, progress.weights_b)
    measure_rings(tree_a, tree_b, state, motion, a, b, s, t, angle)


@kernel
def look_around(tree_a, tree_b, state):
    """Find a local minimum from nothing: usually the nearest one, but it may be any."""
    motion = on_stack(12, 0.0)
    relative(tree_a, tree_b, state.motions[0], motion)
    i, j, angle = near_samples(tree_a.samples, tree_b.samples, motion)
    at_a, at_b = tree_a.samples[i, 2], tree_b.samples[j, 2]
    a, b = np.int64(at_a), np.int64(at_b)
    measure_rings(tree_a, tree_b, state, motion, a, b, at_a - a, at_b - b, angle)
